#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Moves vertices of a mesh and updates the dependent data locally: faces, vertex normals and boxes
/// of the tree.
///
/// All memory is allocated at construction. Proxies on the mesh call Proxy::attach() before and
/// Proxy::reattach() after a move.
class MeshUpdater {
 public:
  MeshUpdater() = default;

  explicit MeshUpdater(const TriangleMesh& mesh)
      : begin_(mesh.vertices().size() + 1, 0),
        faces_(3 * static_cast<std::size_t>(mesh.size())),
        face_mark_(static_cast<std::size_t>(mesh.size()), 0),
        vertex_mark_(mesh.vertices().size(), 0) {
    for (std::int32_t f = 0; f < mesh.size(); ++f)
      for (const std::int32_t v : mesh.face(f).vertex) ++begin_[static_cast<std::size_t>(v) + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::int32_t f = 0; f < mesh.size(); ++f)
      for (const std::int32_t v : mesh.face(f).vertex) faces_[static_cast<std::size_t>(next[static_cast<std::size_t>(v)]++)] = f;
    moved_faces_.reserve(face_mark_.size());
    affected_faces_.reserve(face_mark_.size());
    affected_vertices_.reserve(vertex_mark_.size());
  }

  /// Deleted: the updater is used with the mesh that it was built for.
  explicit MeshUpdater(const TriangleMesh&& mesh) = delete;

  /// Move vertex vertices[i] to positions[i] [m] for i < count.
  ///
  /// Return TriangleMesh::none. If a face would lose its area, return the first such face and leave
  /// everything unchanged. Indices must be in range.
  std::int32_t move(TriangleMesh& mesh, AabbTree& tree, const std::int32_t* vertices, const Vector3<>* positions,
                    std::size_t count) noexcept {
    moved_faces_.clear();
    affected_faces_.clear();
    affected_vertices_.clear();
    ++mark_;
    for (std::size_t i = 0; i < count; ++i) collect_faces(vertices[i], moved_faces_);
    for (std::size_t i = 0; i < count; ++i) mesh.set_vertex(vertices[i], positions[i]);
    for (const std::int32_t f : moved_faces_) {
      if (mesh.can_update_face(f)) continue;
      // The corners of a face still hold the previous positions.
      for (const std::int32_t g : moved_faces_)
        for (std::size_t i = 0; i < 3; ++i) mesh.set_vertex(mesh.face(g).vertex[i], mesh.face(g).corner[i]);
      return f;
    }
    for (const std::int32_t f : moved_faces_) mesh.update_face(f);
    tree.refit(mesh, moved_faces_.begin(), moved_faces_.end());
    // Recompute normals at all vertices of the moved faces, and collect the faces shaded by them.
    for (const std::int32_t f : moved_faces_)
      for (const std::int32_t v : mesh.face(f).vertex) {
        std::uint32_t& mark = vertex_mark_[static_cast<std::size_t>(v)];
        if (mark == mark_) continue;
        mark = mark_;
        affected_vertices_.push_back(v);
      }
    ++mark_;
    for (const std::int32_t v : affected_vertices_) {
      mesh.update_vertex_normal(v, faces_.data() + begin_[static_cast<std::size_t>(v)],
                                faces_.data() + begin_[static_cast<std::size_t>(v) + 1]);
      collect_faces(v, affected_faces_);
    }
    return TriangleMesh::none;
  }

  /// Return the faces that the last move changed.
  [[nodiscard]] const std::vector<std::int32_t>& moved_faces() const noexcept { return moved_faces_; }

  /// Return the faces with a vertex on a moved face. Their shading depends on the last move.
  [[nodiscard]] const std::vector<std::int32_t>& affected_faces() const noexcept { return affected_faces_; }

 private:
  void collect_faces(std::int32_t v, std::vector<std::int32_t>& list) noexcept {
    for (std::int32_t k = begin_[static_cast<std::size_t>(v)]; k < begin_[static_cast<std::size_t>(v) + 1]; ++k) {
      const std::int32_t f = faces_[static_cast<std::size_t>(k)];
      std::uint32_t& mark = face_mark_[static_cast<std::size_t>(f)];
      if (mark == mark_) continue;
      mark = mark_;
      list.push_back(f);
    }
  }

  std::vector<std::int32_t> begin_, faces_;  // faces at each vertex, compressed rows
  std::vector<std::uint32_t> face_mark_, vertex_mark_;
  std::uint32_t mark_ = 0;
  std::vector<std::int32_t> moved_faces_, affected_faces_, affected_vertices_;
};

}  // namespace palpate::mesh
