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

/// The faces that a sphere can meet as long as its center stays within `clearance` of where it was when they were gathered, each behind
/// a plane: as long as the sphere stays in front of that one, it need not look at the face.
class BroadPhaseCache {
 public:
  /// Shows `visit(face, end)` every face that a sphere of `radius` [m] on its motion from `from` to from + end motion could touch; `visit`
  /// may lower `end` (from 1 on). Long ways are looked up in the tree. Facets are gathered ahead: it will go on.
  template <class Visit>
  void sweep_sphere(const TriangleMesh& mesh, const AabbTree& tree, const Vector3<>& from, const Vector3<>& motion, double radius,
                    Visit visit) noexcept {
    const Vector3<> to = from + motion;
    const auto covered = [&] { return (from - center_).norm() <= clearance_ && (to - center_).norm() <= clearance_; };
    if (!covered()) {
      if (!gather(mesh, tree, from, motion, radius) || !covered()) return tree.sweep_sphere(from, motion, radius, visit);
    }
    double end = 1.0;
    const double max_distance = radius * (1.0 + rounding);
    for (int i = 0; i < count_; ++i) {
      const Plane& p = planes_[static_cast<std::size_t>(i)];
      if (std::fmin(p.normal.dot(from), p.normal.dot(to)) - p.offset <= max_distance) visit(p.face, end);
    }
  }

  /// After the mesh has moved.
  void invalidate() noexcept { clearance_ = -1.0; }

 private:
  static constexpr int capacity = 64;

  /// Through the face's point nearest to where they were gathered, across the motion from there. A face is convex: all of it lies behind.
  struct Plane {
    Vector3<> normal = Vector3<>::Zero();  // unit
    double offset = 0.0;                   // m
    std::int32_t face = TriangleMesh::none;
  };

  /// False if there are too many faces, or the motion is so long that the tree does better.
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
  double clearance_ = -1.0;               // m; negative: nothing gathered
  double target_clearance_ = 0.0;         // for the next clearance, m
  int count_ = 0;
  std::array<Plane, capacity> planes_{};
};

}  // namespace palpate::mesh
