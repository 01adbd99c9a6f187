#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Moves vertices of a mesh and mends what hangs on them, there only: facets, vertex normals, boxes of the tree. What it needs is taken at
/// construction; moving takes no memory. Proxies on the mesh: Proxy::grip() before, Proxy::carry() after.
class MeshUpdater {
 public:
  MeshUpdater() = default;

  explicit MeshUpdater(const TriangleMesh& mesh)
      : begin_(mesh.vertices().size() + 1, 0),
        facets_(3 * static_cast<std::size_t>(mesh.size())),
        marked_(static_cast<std::size_t>(mesh.size()), 0),
        vertex_marked_(mesh.vertices().size(), 0) {
    for (std::int32_t f = 0; f < mesh.size(); ++f)
      for (const std::int32_t v : mesh.facet(f).vertex) ++begin_[static_cast<std::size_t>(v) + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::int32_t f = 0; f < mesh.size(); ++f)
      for (const std::int32_t v : mesh.facet(f).vertex) facets_[static_cast<std::size_t>(next[static_cast<std::size_t>(v)]++)] = f;
    moved_.reserve(marked_.size());
    around_.reserve(marked_.size());
    vertices_.reserve(vertex_marked_.size());
  }

  /// Puts vertex `vertices[i]` to `to[i]` [m], i < count. Returns Mesh::none; or, with all as it was, the first facet that would lose
  /// its area.
  std::int32_t move(TriangleMesh& mesh, AabbTree& tree, const std::int32_t* vertices, const Vector3<>* to, std::size_t count) noexcept {
    moved_.clear();
    around_.clear();
    vertices_.clear();
    ++mark_;
    for (std::size_t i = 0; i < count; ++i) each_facet(vertices[i], moved_);
    for (std::size_t i = 0; i < count; ++i) mesh.move(vertices[i], to[i]);
    for (const std::int32_t f : moved_) {
      if (mesh.can_move(f)) continue;
      // A facet's corners still are where its vertices were.
      for (const std::int32_t g : moved_)
        for (std::size_t i = 0; i < 3; ++i) mesh.move(mesh.facet(g).vertex[i], mesh.facet(g).corner[i]);
      return f;
    }
    for (const std::int32_t f : moved_) mesh.moved(f);
    tree.refit(mesh, moved_.begin(), moved_.end());
    // Normals at all vertices of those facets, and what is shaded by them.
    for (const std::int32_t f : moved_)
      for (const std::int32_t v : mesh.facet(f).vertex) {
        std::uint32_t& seen = vertex_marked_[static_cast<std::size_t>(v)];
        if (seen == mark_) continue;
        seen = mark_;
        vertices_.push_back(v);
      }
    ++mark_;
    for (const std::int32_t v : vertices_) {
      mesh.measure_vertex(v, facets_.data() + begin_[static_cast<std::size_t>(v)],
                          facets_.data() + begin_[static_cast<std::size_t>(v) + 1]);
      each_facet(v, around_);
    }
    return TriangleMesh::none;
  }

  [[nodiscard]] const std::vector<std::int32_t>& moved() const noexcept { return moved_; }    ///< facets, by the last move
  [[nodiscard]] const std::vector<std::int32_t>& around() const noexcept { return around_; }  ///< facets with a vertex on one of those

 private:
  void each_facet(std::int32_t v, std::vector<std::int32_t>& list) noexcept {
    for (std::int32_t k = begin_[static_cast<std::size_t>(v)]; k < begin_[static_cast<std::size_t>(v) + 1]; ++k) {
      const std::int32_t f = facets_[static_cast<std::size_t>(k)];
      std::uint32_t& seen = marked_[static_cast<std::size_t>(f)];
      if (seen == mark_) continue;
      seen = mark_;
      list.push_back(f);
    }
  }

  std::vector<std::int32_t> begin_, facets_;  // facets at each vertex
  std::vector<std::uint32_t> marked_, vertex_marked_;
  std::uint32_t mark_ = 0;
  std::vector<std::int32_t> moved_, around_, vertices_;
};

}  // namespace palpate::mesh
