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

/// Cache of the faces near a slowly moving sphere.
///
/// The cached faces are all that the sphere can touch while its center stays within a clearance of
/// the center of the query. Each face lies behind a plane; a sphere in front of that plane skips
/// the face.
class BroadPhaseCache {
 public:
  /// Call visit(face, end) for every face that a sphere of `radius` [m] can touch on its motion
  /// from `from` [m] to from + end * motion [m].
  ///
  /// `end` starts at 1, and `visit` may lower it. Long motions query the tree directly. The cache
  /// is centered ahead of the sphere.
  template <class Visit>
  void sweep_sphere(const TriangleMesh& mesh, const AabbTree& tree, const Vector3<>& from, const Vector3<>& motion, double radius,
                    Visit visit) noexcept {
    const Vector3<> to = from + motion;
    const auto covered = [&] { return (from - center_).norm() <= clearance_ && (to - center_).norm() <= clearance_; };
    if (!covered() && (!gather(mesh, tree, from, motion, radius) || !covered())) {
      tree.sweep_sphere(from, motion, radius, visit);
      return;
    }
    double end = 1.0;
    const double max_distance = radius * (1.0 + rounding);
    for (int i = 0; i < count_; ++i) {
      const Plane& p = planes_[static_cast<std::size_t>(i)];
      if (std::fmin(p.normal.dot(from), p.normal.dot(to)) - p.offset <= max_distance) visit(p.face, end);
    }
  }

  /// Discard the cache. Required after the mesh has moved.
  void invalidate() noexcept { clearance_ = -1.0; }

 private:
  static constexpr int capacity = 64;

  /// Plane through the point of the face nearest to the query center, perpendicular to the line to
  /// that center. The face is convex and lies behind the plane.
  struct Plane {
    Vector3<> normal = Vector3<>::Zero();  // unit
    double offset = 0.0;                   // m
    std::int32_t face = TriangleMesh::none;
  };

  /// Fill the cache. Return false if there are too many faces or the motion is so long that a tree
  /// query is cheaper.
  bool gather(const TriangleMesh& mesh, const AabbTree& tree, const Vector3<>& from, const Vector3<>& motion, double radius) noexcept {
    if (!(target_clearance_ > 0.0)) target_clearance_ = 0.5 * radius;
    clearance_ = -1.0;
    const double length = motion.norm();
    if (length > 4.0 * radius) return false;
    const double clearance = std::fmax(target_clearance_, 0.6 * length), reach = radius + clearance;
    const Vector3<> center = length > 0.0 ? Vector3<>(from + 0.9 * clearance / length * motion) : from;
    count_ = 0;
    bool has_room = true;
    tree.overlap_sphere(center, reach, [&](std::int32_t f) {
      const Vector3<> point = nearest_point(mesh.face(f), center).point, away = center - point;
      const double distance = away.norm();
      if (!(distance <= reach) || !has_room) return;
      if (count_ == capacity) {
        has_room = false;
        return;
      }
      const Vector3<> normal = distance > 0.0 ? Vector3<>(away / distance) : Vector3<>(Vector3<>::Zero());
      planes_[static_cast<std::size_t>(count_++)] = {normal, normal.dot(point), f};
    });
    if (!has_room || 3 * count_ > capacity) target_clearance_ *= 0.7;
    if (has_room && 6 * count_ < capacity && target_clearance_ < 2.0 * radius) target_clearance_ *= 1.4;
    if (!has_room) return false;
    center_ = center;
    clearance_ = clearance * (1.0 - rounding);
    return true;
  }

  static constexpr double rounding = 1e-12;

  Vector3<> center_ = Vector3<>::Zero();  // m
  double clearance_ = -1.0;               // m; negative: empty
  double target_clearance_ = 0.0;         // for the next query, m
  int count_ = 0;
  std::array<Plane, capacity> planes_{};
};

}  // namespace palpate::mesh
