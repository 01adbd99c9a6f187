#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/friction_cone.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// A point on a mesh, or free of it.
struct PointProxyState {
  std::int32_t facet = TriangleMesh::none;  ///< none: free
  Feature feature = Feature::inside;
  Vector3<> point = Vector3<>::Zero();   ///< m
  Vector3<> normal = Vector3<>::Zero();  ///< unit, towards the free side, of what holds the point there; zero if free
  double side = 1.0;                     ///< -1: on the back of an open mesh

  [[nodiscard]] bool touching() const noexcept { return facet != TriangleMesh::none; }
};

/// The point proxy's move: from where it is, over the surface, to the nearest point to the tip that it can slide to. Each step goes
/// along one facet, edge or free segment and ends nearer to the tip, so there is no cycle; what is under the proxy is known from
/// adjacency, so the time does not grow with the mesh.
///
/// Around a point of the surface the mesh is a cone of facets. The nearest point to the tip on that cone says which way to slide, and
/// the pseudonormal there (Baerentzen & Aanaes 2005) whether the tip is outside, that is, whether the proxy may leave.
class PointProxy {
 public:
  static constexpr int most_steps = 512;

  PointProxy(const TriangleMesh& mesh, const AabbTree& tree) noexcept
      : mesh_(&mesh), tree_(&tree), one_sided_(mesh.closed()), rounding_(1e-14 * mesh.reach()) {}

  /// Where a proxy starts: at the tip, or at the nearest point of the surface if the tip is inside a closed mesh.
  [[nodiscard]] PointProxyState start(const Vector3<>& tip) const noexcept {
    PointProxyState place;
    place.point = tip;
    if (!one_sided_) return place;
    const AabbTree::Nearest near = tree_->nearest(*mesh_, tip);
    const Face& facet = mesh_->facet(near.facet);
    if (pseudonormal(facet, near.at.feature).dot(tip - near.at.point) >= 0.0) return place;
    place.facet = near.facet;
    place.feature = near.at.feature;
    place.point = near.at.point;
    place.normal = facet.normal;
    return place;
  }

  /// The place where the mesh has moved under it: at `weights` of its facet's corners; a free one that is inside now, on the surface.
  void carry(PointProxyState& place, const Vector3<>& weights) const noexcept {
    if (!place.touching()) {
      const double side = place.side;
      place = start(place.point);
      if (!place.touching()) place.side = side;
      return;
    }
    const Face& facet = mesh_->facet(place.facet);
    place.point = weights[0] * facet.corner[0] + weights[1] * facet.corner[1] + weights[2] * facet.corner[2];
    place.normal = place.side * facet.normal;
  }

  /// Moves `place` towards `tip`. `cone(facet, point)` gives the friction there; `slip` what has slid so far. False if most_steps were
  /// not enough (the next call goes on).
  template <class Cone>
  bool follow(PointProxyState& place, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    slip.least = still * (tip - place.point).norm();
    bool done = false;
    for (int step = 0; step < most_steps && !done; ++step) {
      if (!place.touching()) {
        done = fly(place, tip, TriangleMesh::none, Feature::inside);
      } else if (place.feature == Feature::inside) {
        done = from_facet(place, tip, cone, slip);
      } else if (is_edge(place.feature)) {
        done = from_edge(place, tip, cone, slip);
      } else {
        done = from_corner(place, tip, cone, slip);
      }
    }
    return done;
  }

  /// Normal that tells inside from outside near a feature; not scaled.
  [[nodiscard]] Vector3<> pseudonormal(const Face& facet, Feature feature) const noexcept {
    if (is_corner(feature)) return mesh_->vertex_normal(facet.vertex[static_cast<std::size_t>(index_of(feature))]);
    if (is_edge(feature)) {
      const std::int32_t h = facet.neighbour[static_cast<std::size_t>(index_of(feature))];
      return h < 0 ? facet.normal : Vector3<>(facet.normal + mesh_->facet(h / 3).normal);
    }
    return facet.normal;
  }

 private:
  static constexpr double still = 1e-9;  // of the tip's distance: a shorter way is no sliding
  static constexpr double snap = 1e-12;  // of an edge's length: nearer to its end is at its end

  /// Goes straight from the place to the tip, past the facets around it; stops at the first facet in the way. True if it arrives.
  bool fly(PointProxyState& place, const Vector3<>& tip, std::int32_t left, Feature left_at) const noexcept {
    const Vector3<> from = place.point, way = tip - from;
    std::int32_t beside = TriangleMesh::none, around = TriangleMesh::none;
    if (left != TriangleMesh::none) {
      const Face& facet = mesh_->facet(left);
      if (is_edge(left_at)) {
        const std::int32_t h = facet.neighbour[static_cast<std::size_t>(index_of(left_at))];
        beside = h < 0 ? TriangleMesh::none : h / 3;
      } else if (is_corner(left_at)) {
        around = facet.vertex[static_cast<std::size_t>(index_of(left_at))];
      }
    }
    const double old_side = place.side;
    std::int32_t hit = TriangleMesh::none;
    double hit_side = 1.0;
    tree_->along(from, way, rounding_, [&](std::int32_t f, double& end) {
      if (f == left || f == beside) return;
      const Face& facet = mesh_->facet(f);
      if (around != TriangleMesh::none && (facet.vertex[0] == around || facet.vertex[1] == around || facet.vertex[2] == around)) return;
      double before = facet.height(from), after = facet.height(tip);
      double side = 1.0;
      if (!one_sided_) {
        side = before > rounding_ ? 1.0 : (before < -rounding_ ? -1.0 : old_side);
        before *= side;
        after *= side;
      }
      if (!(after < 0.0) || before < -rounding_ || before <= after) return;
      const double t = before > 0.0 ? before / (before - after) : 0.0;
      if (t > end || (t == end && hit != TriangleMesh::none) || !line_meets(facet, from, way)) return;
      end = t;
      hit = f;
      hit_side = side;
    });
    if (hit == TriangleMesh::none) {
      place = PointProxyState{};
      place.point = tip;
      place.side = old_side;
      return true;
    }
    const Face& facet = mesh_->facet(hit);
    const double before = facet.height(from), after = facet.height(tip);
    const double t = std::fmin(std::fmax(before / (before - after), 0.0), 1.0);
    place.point = from + t * way;
    place.point -= facet.height(place.point) * facet.normal;
    place.facet = hit;
    place.feature = Feature::inside;
    place.side = hit_side;
    place.normal = hit_side * facet.normal;
    return false;
  }

  bool leave(PointProxyState& place, const Vector3<>& tip) const noexcept { return fly(place, tip, place.facet, place.feature); }

  template <class Cone>
  bool from_facet(PointProxyState& place, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    const Face& facet = mesh_->facet(place.facet);
    const double height = facet.height(tip);
    if (place.side * height >= 0.0) return leave(place, tip);
    return slide_on_facet(place, facet, tip, height, cone, slip);
  }

  /// Slides over one facet, from wherever on it the place is. True if it comes to rest there.
  template <class Cone>
  bool slide_on_facet(PointProxyState& place, const Face& facet, const Vector3<>& tip, double height, const Cone& cone,
                      SlidingState& slip) const noexcept {
    place.normal = place.side * facet.normal;
    const Vector3<> pull = tip - height * facet.normal - place.point;
    const double lag = pull.norm();
    const FrictionCone friction = cone(place.facet, place.point);
    const double left = friction.rest(lag, std::fabs(height), slip.slid, slip.sliding());
    if (!(lag - left > 1e-15 * (lag + std::fabs(height)))) return true;
    const Vector3<> way = (1.0 - left / lag) * pull;
    const auto [out, part] = first_exit(facet, place.point, way, [&place](int i) {
      return place.feature == edge(i) || place.feature == corner(i) || place.feature == corner((i + 1) % 3);
    });
    if (out < 0) {
      place.point += way;
      place.point -= facet.height(place.point) * facet.normal;
      place.feature = Feature::inside;
      slip.slid += lag - left;
      return true;
    }
    slip.slid += part * (lag - left);
    put_on_edge(place, facet, out, place.point + part * way);
    return false;
  }

  /// Puts the place on an edge of its facet, or on the edge's end if it is there.
  static void put_on_edge(PointProxyState& place, const Face& facet, int i, const Vector3<>& x) noexcept {
    const int j = (i + 1) % 3;
    const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = facet.corner[static_cast<std::size_t>(j)] - a;
    const double u = (x - a).dot(e) / e.squaredNorm();
    if (u <= snap) {
      place.point = a;
      place.feature = corner(i);
    } else if (u >= 1.0 - snap) {
      place.point = facet.corner[static_cast<std::size_t>(j)];
      place.feature = corner(j);
    } else {
      place.point = a + u * e;
      place.feature = edge(i);
    }
  }

  template <class Cone>
  bool from_edge(PointProxyState& place, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    const int i = index_of(place.feature);
    const Face& one = mesh_->facet(place.facet);
    const Vector3<> along = one.corner[static_cast<std::size_t>((i + 1) % 3)] - one.corner[static_cast<std::size_t>(i)];
    const Vector3<> d = tip - place.point;
    const double height = one.height(tip);
    const bool into_one = one.normal.cross(along).dot(d) > 0.0;
    const std::int32_t across = one.neighbour[static_cast<std::size_t>(i)];
    if (across < 0) {  // a border: free beyond it
      if (!into_one || place.side * height >= 0.0) return leave(place, tip);
      return slide_on_facet(place, one, tip, height, cone, slip);
    }
    const Face& two = mesh_->facet(across / 3);
    const double other = two.height(tip);
    const bool into_two = two.normal.cross(along).dot(d) < 0.0;
    if (into_one && !(into_two && std::fabs(other) < std::fabs(height))) {
      if (place.side * height >= 0.0) return leave(place, tip);
      return slide_on_facet(place, one, tip, height, cone, slip);
    }
    if (into_two) {
      if (place.side * other >= 0.0) return leave(place, tip);
      place.facet = across / 3;
      place.feature = edge(across % 3);
      return slide_on_facet(place, two, tip, other, cone, slip);
    }
    // Both facets push towards the edge: a valley, or the tip is out beyond a ridge.
    const double length2 = along.squaredNorm();
    const Vector3<> down = d - d.dot(along) / length2 * along;
    if (place.side * (one.normal + two.normal).dot(down) >= 0.0) return leave(place, tip);
    return slide_on_edge(place, one, i, d, down, cone, slip);
  }

  /// Slides along edge `i` of its facet, from wherever on it the place is. True if it comes to rest on it.
  template <class Cone>
  bool slide_on_edge(PointProxyState& place, const Face& facet, int i, const Vector3<>& d, const Vector3<>& down, const Cone& cone,
                     SlidingState& slip) const noexcept {
    const int j = (i + 1) % 3;
    const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = facet.corner[static_cast<std::size_t>(j)] - a;
    const double length = e.norm(), depth = down.norm();
    const double pull = d.dot(e) / length, lag = std::fabs(pull);
    if (depth > 0.0) place.normal = down / -depth;
    const double left = cone(place.facet, place.point).rest(lag, depth, slip.slid, slip.sliding());
    if (!(lag - left > 1e-15 * (lag + depth))) return true;
    const double way = std::copysign(lag - left, pull);
    const double from = (place.point - a).dot(e) / length, to = from + way;
    if (to > snap * length && to < (1.0 - snap) * length) {
      place.point = a + to / length * e;
      place.feature = edge(i);
      slip.slid += lag - left;
      return true;
    }
    const int end = way > 0.0 ? j : i;
    slip.slid += std::fabs(way > 0.0 ? length - from : from);
    place.point = facet.corner[static_cast<std::size_t>(end)];
    place.feature = corner(end);
    return to >= 0.0 && to <= length;
  }

  template <class Cone>
  bool from_corner(PointProxyState& place, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    const int k = index_of(place.feature);
    const std::int32_t vertex = mesh_->facet(place.facet).vertex[static_cast<std::size_t>(k)];
    const Vector3<> d = tip - place.point;
    Best best{d.norm()};
    bool open = false;
    mesh_->around(place.facet, k, [&](std::int32_t f, int c) {
      const Face& facet = mesh_->facet(f);
      look(best, facet, f, c, tip, d);
      const int last = (c + 2) % 3;
      if (facet.neighbour[static_cast<std::size_t>(last)] >= 0) return;
      open = true;
      look_along(best, facet, f, last, d, -1.0);
    });
    if (best.facet == TriangleMesh::none) {  // the corner itself is nearest
      if (open || place.side * mesh_->vertex_normal(vertex).dot(d) >= 0.0) return leave(place, tip);
      const double depth = d.norm();
      if (depth > 0.0) place.normal = d / -depth;
      return true;
    }
    const Face& facet = mesh_->facet(best.facet);
    if (best.feature == Feature::inside) {
      const double height = facet.height(tip);
      if (place.side * height >= 0.0) return leave(place, tip);
      place.facet = best.facet;
      place.feature = corner(best.corner);
      return slide_from_corner(place, facet, best.corner, tip, height, cone, slip);
    }
    const int i = index_of(best.feature);
    const std::int32_t across = facet.neighbour[static_cast<std::size_t>(i)];
    const Vector3<> e = facet.corner[static_cast<std::size_t>((i + 1) % 3)] - facet.corner[static_cast<std::size_t>(i)];
    const Vector3<> down = d - d.dot(e) / e.squaredNorm() * e;
    if (across < 0 || place.side * (facet.normal + mesh_->facet(across / 3).normal).dot(down) >= 0.0) return leave(place, tip);
    place.facet = best.facet;
    place.feature = best.feature;
    return slide_on_edge(place, facet, i, d, down, cone, slip);
  }

  /// From a corner into the facet: only the edge opposite to it can be met.
  template <class Cone>
  bool slide_from_corner(PointProxyState& place, const Face& facet, int c, const Vector3<>& tip, double height, const Cone& cone,
                         SlidingState& slip) const noexcept {
    place.normal = place.side * facet.normal;
    const Vector3<> pull = tip - height * facet.normal - place.point;
    const double lag = pull.norm();
    const double left = cone(place.facet, place.point).rest(lag, std::fabs(height), slip.slid, slip.sliding());
    if (!(lag - left > 1e-15 * (lag + std::fabs(height)))) return true;
    const Vector3<> way = (1.0 - left / lag) * pull;
    const int i = (c + 1) % 3;
    const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
    const Vector3<> inward = facet.normal.cross(facet.corner[static_cast<std::size_t>((i + 1) % 3)] - a);
    const double distance = inward.dot(place.point - a), rate = inward.dot(way);
    if (distance + rate >= 0.0) {
      place.point += way;
      place.feature = Feature::inside;
      slip.slid += lag - left;
      return true;
    }
    const double part = distance / -rate;
    slip.slid += part * (lag - left);
    put_on_edge(place, facet, i, place.point + part * way);
    return false;
  }

  /// The nearest point to the tip on the cone of facets around a corner.
  struct Best {
    double distance;  // m
    std::int32_t facet = TriangleMesh::none;
    Feature feature = Feature::inside;
    int corner = 0;
  };

  static void look(Best& best, const Face& facet, std::int32_t f, int c, const Vector3<>& tip, const Vector3<>& d) noexcept {
    const Vector3<>& v = facet.corner[static_cast<std::size_t>(c)];
    const Vector3<> first = facet.corner[static_cast<std::size_t>((c + 1) % 3)] - v;
    const Vector3<> second = facet.corner[static_cast<std::size_t>((c + 2) % 3)] - v;
    if (facet.normal.cross(first).dot(d) > 0.0 && second.cross(facet.normal).dot(d) > 0.0) {
      const double distance = std::fabs(facet.height(tip));
      if (distance < best.distance) best = {distance, f, Feature::inside, c};
    }
    look_along(best, facet, f, c, d, 1.0);
  }

  static void look_along(Best& best, const Face& facet, std::int32_t f, int i, const Vector3<>& d, double sense) noexcept {
    const Vector3<> e = facet.corner[static_cast<std::size_t>((i + 1) % 3)] - facet.corner[static_cast<std::size_t>(i)];
    const double along = d.dot(e);
    if (sense * along <= 0.0) return;
    const double distance = (d - along / e.squaredNorm() * e).norm();
    if (distance < best.distance) best = {distance, f, edge(i), 0};
  }

  const TriangleMesh* mesh_;
  const AabbTree* tree_;
  bool one_sided_;
  double rounding_;  // m
};

}  // namespace palpate::mesh
