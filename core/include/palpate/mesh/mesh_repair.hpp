#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// What mend() did.
struct RepairReport {
  std::int64_t dropped_degenerate = 0;
  std::int64_t dropped_duplicate = 0;
  std::int64_t turned = 0;  ///< triangles whose corners now go the other way round
};

namespace detail {

/// Pairs of triangles that share an edge with no third one, and whether they turn the same way.
struct ManifoldEdge {
  std::int32_t one, two;
  bool agree;
};

inline std::vector<ManifoldEdge> manifold_edges(const std::vector<Triangle>& triangles) {
  struct Half {
    std::int32_t low, high, facet;
    bool upward;
    bool operator<(const Half& o) const { return low != o.low ? low < o.low : (high != o.high ? high < o.high : facet < o.facet); }
  };
  std::vector<Half> halves;
  halves.reserve(3 * triangles.size());
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int32_t a = triangles[f][i], b = triangles[f][(i + 1) % 3];
      halves.push_back({std::min(a, b), std::max(a, b), static_cast<std::int32_t>(f), a < b});
    }
  std::sort(halves.begin(), halves.end());
  std::vector<ManifoldEdge> found;
  for (std::size_t i = 0; i < halves.size();) {
    std::size_t j = i + 1;
    while (j < halves.size() && halves[j].low == halves[i].low && halves[j].high == halves[i].high) ++j;
    if (j - i == 2) found.push_back({halves[i].facet, halves[i + 1].facet, halves[i].upward != halves[i + 1].upward});
    i = j;
  }
  return found;
}

}  // namespace detail

/// Mends what can be mended without guessing: drops triangles without area and repeated ones, turns neighbours the same way round, and
/// closed pieces outward. Indices must be in range and vertices finite.
inline RepairReport repair_mesh(const std::vector<Vector3<>>& vertices, std::vector<Triangle>& triangles) {
  RepairReport done;
  {
    const TriangleMesh probe(vertices, triangles, true);  // its own criterion of what has no area
    std::vector<Triangle> kept;
    for (std::int32_t f = 0; f < probe.size(); ++f) {
      if (probe.facet(f).normal.squaredNorm() > 0.0) {
        kept.push_back(triangles[static_cast<std::size_t>(f)]);
      } else {
        ++done.dropped_degenerate;
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
  done.dropped_duplicate = static_cast<std::int64_t>(triangles.size() - kept.size());
  triangles = std::move(kept);

  // Turn each piece the way its first triangle goes; then, if it is closed and encloses a negative volume, turn it whole.
  const std::size_t count = triangles.size();
  const std::vector<detail::ManifoldEdge> manifold_edges = detail::manifold_edges(triangles);
  std::vector<std::int32_t> begin(count + 1, 0), seam_of(2 * manifold_edges.size());
  for (const detail::ManifoldEdge& s : manifold_edges) {
    ++begin[static_cast<std::size_t>(s.one) + 1];
    ++begin[static_cast<std::size_t>(s.two) + 1];
  }
  for (std::size_t f = 0; f < count; ++f) begin[f + 1] += begin[f];
  std::vector<std::int32_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t i = 0; i < manifold_edges.size(); ++i) {
    seam_of[static_cast<std::size_t>(next[static_cast<std::size_t>(manifold_edges[i].one)]++)] = static_cast<std::int32_t>(i);
    seam_of[static_cast<std::size_t>(next[static_cast<std::size_t>(manifold_edges[i].two)]++)] = static_cast<std::int32_t>(i);
  }
  std::vector<std::int8_t> way(count, 0);
  std::vector<std::int32_t> piece;
  for (std::size_t start = 0; start < count; ++start) {
    if (way[start] != 0) continue;
    piece.assign(1, static_cast<std::int32_t>(start));
    way[start] = 1;
    bool closed = true;
    double volume = 0.0;
    const Vector3<> origin = vertices[static_cast<std::size_t>(triangles[start][0])];
    std::int64_t backwards = 0;
    for (std::size_t i = 0; i < piece.size(); ++i) {
      const auto f = static_cast<std::size_t>(piece[i]);
      closed = closed && begin[f + 1] - begin[f] == 3;
      const auto at = [&](std::size_t k) { return Vector3<>(vertices[static_cast<std::size_t>(triangles[f][k])] - origin); };
      volume += way[f] * at(0).dot(at(1).cross(at(2)));
      if (way[f] < 0) ++backwards;
      for (std::int32_t k = begin[f]; k < begin[f + 1]; ++k) {
        const detail::ManifoldEdge& s = manifold_edges[static_cast<std::size_t>(seam_of[static_cast<std::size_t>(k)])];
        const std::int32_t other = s.one == piece[i] ? s.two : s.one;
        std::int8_t& its = way[static_cast<std::size_t>(other)];
        if (its != 0) continue;
        its = static_cast<std::int8_t>(s.agree ? way[f] : -way[f]);
        piece.push_back(other);
      }
    }
    // An open piece keeps the way most of its triangles had.
    const bool turn = closed ? volume < 0.0 : 2 * backwards > static_cast<std::int64_t>(piece.size());
    for (const std::int32_t f : piece) {
      if ((way[static_cast<std::size_t>(f)] < 0) == turn) continue;
      std::swap(triangles[static_cast<std::size_t>(f)][1], triangles[static_cast<std::size_t>(f)][2]);
      ++done.turned;
    }
  }
  return done;
}

/// Vertices at which parts of a surface meet in that one point only: a proxy on one part does not know of the other there.
inline MeshDiagnosis::Count pinched_vertices(const TriangleMesh& mesh) {
  std::vector<std::int32_t> facets(mesh.vertices().size(), 0);
  std::vector<std::int64_t> corner(mesh.vertices().size(), -1);
  for (std::int32_t f = 0; f < mesh.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto v = static_cast<std::size_t>(mesh.facet(f).vertex[i]);
      ++facets[v];
      if (corner[v] < 0) corner[v] = 3 * static_cast<std::int64_t>(f) + static_cast<std::int64_t>(i);
    }
  MeshDiagnosis::Count found;
  for (std::size_t v = 0; v < facets.size(); ++v) {
    if (corner[v] < 0) continue;
    std::int32_t around = 0;
    mesh.around(static_cast<std::int32_t>(corner[v] / 3), static_cast<int>(corner[v] % 3), [&](std::int32_t, int) { ++around; });
    if (around != facets[v]) found.add(static_cast<std::int64_t>(v));
  }
  return found;
}

/// Edges that pierce a triangle they share no vertex with.
inline MeshDiagnosis::Count self_intersections(const TriangleMesh& mesh, const AabbTree& tree) {
  MeshDiagnosis::Count found;
  for (std::int32_t f = 0; f < mesh.size(); ++f) {
    const Face& facet = mesh.facet(f);
    for (std::size_t i = 0; i < 3; ++i) {
      if (facet.neighbour[i] >= 0 && facet.neighbour[i] / 3 < f) continue;
      const Vector3<>&a = facet.corner[i], &b = facet.corner[(i + 1) % 3];
      const std::int32_t va = facet.vertex[i], vb = facet.vertex[(i + 1) % 3];
      const Vector3<> way = b - a;
      tree.along(a, way, 0.0, [&](std::int32_t g, double&) {
        const Face& other = mesh.facet(g);
        for (const std::int32_t v : other.vertex)
          if (v == va || v == vb) return;
        if (other.height(a) * other.height(b) < 0.0 && line_meets(other, a, way)) found.add(f);
      });
    }
  }
  return found;
}

}  // namespace palpate::mesh
