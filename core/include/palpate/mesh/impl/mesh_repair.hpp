#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/math/inline.hpp"
#include "palpate/mesh/mesh_repair.hpp"

namespace palpate::mesh {

namespace detail {

/// Edge with exactly two triangles, and whether their orientations are consistent.
struct ManifoldEdge {
  std::int32_t one, two;
  bool consistent;
};

inline std::vector<ManifoldEdge> manifold_edges(const std::vector<Triangle>& triangles) {
  struct Half {
    std::int32_t low, high, face;
    bool upward;
    bool operator<(const Half& o) const { return low != o.low ? low < o.low : (high != o.high ? high < o.high : face < o.face); }
  };
  std::vector<Half> halves;
  halves.reserve(3 * triangles.size());
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int32_t a = triangles[f][i], b = triangles[f][(i + 1) % 3];
      halves.push_back({std::min(a, b), std::max(a, b), static_cast<std::int32_t>(f), a < b});
    }
  std::sort(halves.begin(), halves.end());
  std::vector<ManifoldEdge> result;
  for (std::size_t i = 0; i < halves.size();) {
    std::size_t j = i + 1;
    while (j < halves.size() && halves[j].low == halves[i].low && halves[j].high == halves[i].high) ++j;
    if (j - i == 2) result.push_back({halves[i].face, halves[i + 1].face, halves[i].upward != halves[i + 1].upward});
    i = j;
  }
  return result;
}

}  // namespace detail

PALPATE_INLINE RepairReport repair_mesh(const std::vector<Vector3<>>& vertices, std::vector<Triangle>& triangles) {
  RepairReport report;
  {
    const TriangleMesh probe(vertices, triangles, true);  // applies the mesh's own criterion for degenerate triangles
    std::vector<Triangle> kept;
    for (std::int32_t f = 0; f < probe.size(); ++f) {
      if (probe.face(f).normal.squaredNorm() > 0.0) {
        kept.push_back(triangles[static_cast<std::size_t>(f)]);
      } else {
        ++report.dropped_degenerate;
      }
    }
    triangles = std::move(kept);
  }
  std::vector<std::pair<Triangle, std::int32_t>> keys;
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    Triangle t = triangles[f];
    std::sort(t.begin(), t.end());
    keys.emplace_back(t, static_cast<std::int32_t>(f));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<bool> repeated(triangles.size(), false);
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (keys[i].first == keys[i - 1].first) repeated[static_cast<std::size_t>(keys[i].second)] = true;
  std::vector<Triangle> kept;
  for (std::size_t f = 0; f < triangles.size(); ++f)
    if (!repeated[f]) kept.push_back(triangles[f]);
  report.dropped_duplicate = static_cast<std::int64_t>(triangles.size() - kept.size());
  triangles = std::move(kept);

  // Orient each component like its first triangle. Flip a closed component that encloses a negative
  // volume.
  const std::size_t count = triangles.size();
  const std::vector<detail::ManifoldEdge> manifold_edges = detail::manifold_edges(triangles);
  std::vector<std::int32_t> begin(count + 1, 0), edge_of(2 * manifold_edges.size());
  for (const detail::ManifoldEdge& s : manifold_edges) {
    ++begin[static_cast<std::size_t>(s.one) + 1];
    ++begin[static_cast<std::size_t>(s.two) + 1];
  }
  for (std::size_t f = 0; f < count; ++f) begin[f + 1] += begin[f];
  std::vector<std::int32_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t i = 0; i < manifold_edges.size(); ++i) {
    edge_of[static_cast<std::size_t>(next[static_cast<std::size_t>(manifold_edges[i].one)]++)] = static_cast<std::int32_t>(i);
    edge_of[static_cast<std::size_t>(next[static_cast<std::size_t>(manifold_edges[i].two)]++)] = static_cast<std::int32_t>(i);
  }
  std::vector<std::int8_t> orientation(count, 0);
  std::vector<std::int32_t> component;
  for (std::size_t start = 0; start < count; ++start) {
    if (orientation[start] != 0) continue;
    component.assign(1, static_cast<std::int32_t>(start));
    orientation[start] = 1;
    bool closed = true;
    double volume = 0.0;
    const Vector3<> origin = vertices[static_cast<std::size_t>(triangles[start][0])];
    std::int64_t reversed = 0;
    for (std::size_t i = 0; i < component.size(); ++i) {
      const auto f = static_cast<std::size_t>(component[i]);
      closed = closed && begin[f + 1] - begin[f] == 3;
      const auto at = [&](std::size_t k) { return Vector3<>(vertices[static_cast<std::size_t>(triangles[f][k])] - origin); };
      volume += orientation[f] * at(0).dot(at(1).cross(at(2)));
      if (orientation[f] < 0) ++reversed;
      for (std::int32_t k = begin[f]; k < begin[f + 1]; ++k) {
        const detail::ManifoldEdge& s = manifold_edges[static_cast<std::size_t>(edge_of[static_cast<std::size_t>(k)])];
        const std::int32_t other = s.one == component[i] ? s.two : s.one;
        std::int8_t& neighbor_orientation = orientation[static_cast<std::size_t>(other)];
        if (neighbor_orientation != 0) continue;
        neighbor_orientation = static_cast<std::int8_t>(s.consistent ? orientation[f] : -orientation[f]);
        component.push_back(other);
      }
    }
    // An open component keeps the orientation of the majority of its triangles.
    const bool flip = closed ? volume < 0.0 : 2 * reversed > static_cast<std::int64_t>(component.size());
    for (const std::int32_t f : component) {
      if ((orientation[static_cast<std::size_t>(f)] < 0) == flip) continue;
      std::swap(triangles[static_cast<std::size_t>(f)][1], triangles[static_cast<std::size_t>(f)][2]);
      ++report.flipped;
    }
  }
  return report;
}

PALPATE_INLINE MeshDiagnosis::Count pinched_vertices(const TriangleMesh& mesh) {
  std::vector<std::int32_t> faces(mesh.vertices().size(), 0);
  std::vector<std::int64_t> corner(mesh.vertices().size(), -1);
  for (std::int32_t f = 0; f < mesh.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto v = static_cast<std::size_t>(mesh.face(f).vertex[i]);
      ++faces[v];
      if (corner[v] < 0) corner[v] = 3 * static_cast<std::int64_t>(f) + static_cast<std::int64_t>(i);
    }
  MeshDiagnosis::Count result;
  for (std::size_t v = 0; v < faces.size(); ++v) {
    if (corner[v] < 0) continue;
    std::int32_t around = 0;
    mesh.for_each_face_around(static_cast<std::int32_t>(corner[v] / 3), static_cast<int>(corner[v] % 3),
                              [&](std::int32_t, int) { ++around; });
    if (around != faces[v]) result.add(static_cast<std::int64_t>(v));
  }
  return result;
}

PALPATE_INLINE MeshDiagnosis::Count self_intersections(const TriangleMesh& mesh, const AabbTree& tree) {
  MeshDiagnosis::Count result;
  for (std::int32_t f = 0; f < mesh.size(); ++f) {
    const Face& face = mesh.face(f);
    for (std::size_t i = 0; i < 3; ++i) {
      if (face.neighbor[i] >= 0 && face.neighbor[i] / 3 < f) continue;
      const Vector3<>&a = face.corner[i], &b = face.corner[(i + 1) % 3];
      const std::int32_t va = face.vertex[i], vb = face.vertex[(i + 1) % 3];
      const Vector3<> segment = b - a;
      tree.sweep_sphere(a, segment, 0.0, [&](std::int32_t g, double&) {
        const Face& other = mesh.face(g);
        for (const std::int32_t v : other.vertex)
          if (v == va || v == vb) return;
        if (other.height(a) * other.height(b) < 0.0 && line_intersects(other, a, segment)) result.add(f);
      });
    }
  }
  return result;
}

}  // namespace palpate::mesh
