#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// The facets that a sphere can meet as long as its centre stays within `clearance` of where it was when they were gathered, each behind
/// a plane: as long as the sphere stays in front of that one, it need not look at the facet.
class BroadPhaseCache {
 public:
  /// Shows `visit(facet, end)` every facet that a sphere of `radius` [m] on its way from `from` to from + end way could touch; `visit`
  /// may lower `end` (from 1 on). Long ways are looked up in the tree. Facets are gathered ahead: it will go on.
  template <class Visit>
  void along(const TriangleMesh& mesh, const AabbTree& tree, const Vector3<>& from, const Vector3<>& way, double radius,
             Visit visit) noexcept {
    const Vector3<> to = from + way;
    const auto covered = [&] { return (from - centre_).norm() <= clearance_ && (to - centre_).norm() <= clearance_; };
    if (!covered()) {
      if (!gather(mesh, tree, from, way, radius) || !covered()) return tree.along(from, way, radius, visit);
    }
    double end = 1.0;
    const double enough = radius * (1.0 + rounding);
    for (int i = 0; i < count_; ++i) {
      const Plane& p = plane_[static_cast<std::size_t>(i)];
      if (std::fmin(p.normal.dot(from), p.normal.dot(to)) - p.offset <= enough) visit(p.facet, end);
    }
  }

  /// After the mesh has moved.
  void forget() noexcept { clearance_ = -1.0; }

 private:
  static constexpr int most = 64;

  /// Through the facet's point nearest to where they were gathered, across the way from there. A facet is convex: all of it lies behind.
  struct Plane {
    Vector3<> normal = Vector3<>::Zero();  // unit
    double offset = 0.0;                   // m
    std::int32_t facet = TriangleMesh::none;
  };

  /// False if there are too many facets, or the way is so long that the tree does better.
  bool gather(const TriangleMesh& mesh, const AabbTree& tree, const Vector3<>& from, const Vector3<>& way, double radius) noexcept {
    if (!(wish_ > 0.0)) wish_ = 0.5 * radius;
    clearance_ = -1.0;
    const double length = way.norm();
    if (length > 4.0 * radius) return false;
    const double wide = std::fmax(wish_, 0.6 * length), reach = radius + wide;
    const Vector3<> centre = length > 0.0 ? Vector3<>(from + 0.9 * wide / length * way) : from;
    count_ = 0;
    bool room = true;
    tree.within(centre, reach, [&](std::int32_t f) {
      const Vector3<> point = nearest_point(mesh.facet(f), centre).point, away = centre - point;
      const double distance = away.norm();
      if (!(distance <= reach) || !room) return;
      if (count_ == most) {
        room = false;
        return;
      }
      const Vector3<> normal = distance > 0.0 ? Vector3<>(away / distance) : Vector3<>(Vector3<>::Zero());
      plane_[static_cast<std::size_t>(count_++)] = {normal, normal.dot(point), f};
    });
    if (!room || 3 * count_ > most) wish_ *= 0.7;
    if (room && 6 * count_ < most && wish_ < 2.0 * radius) wish_ *= 1.4;
    if (!room) return false;
    centre_ = centre;
    clearance_ = wide * (1.0 - rounding);
    return true;
  }

  static constexpr double rounding = 1e-12;

  Vector3<> centre_ = Vector3<>::Zero();  // m
  double clearance_ = -1.0;               // m; negative: nothing gathered
  double wish_ = 0.0;                     // for the next clearance, m
  int count_ = 0;
  std::array<Plane, most> plane_{};
};

}  // namespace palpate::mesh
