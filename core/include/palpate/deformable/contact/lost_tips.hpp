#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/deformable/contact/layer_contact.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Finds the tips that are in a body without contact, for SignedDistanceContact: they begin inside, or have been pushed through.
class LostTips {
 public:
  /// `nodes` must outlive the object.
  explicit LostTips(const SurfaceNodes& nodes) : nodes_(&nodes) {}

  /// Begin a tick with the forces of the last one.
  void begin(const NearNodes& near) noexcept { first_work_ = work_of_body(near); }

  /// Find out whether a tip is inside the body without contact; keep that until it is outside and clear of the surface. `first`: it may be
  /// far from the places so far.
  void check_inside(NearNodes& near, LayerContact& layer, int t, bool first) const noexcept {
    NearNodes::Tip& tip = near.tip(t);
    if (!tip.lost && near.engaged(t) > 0) return;
    const int nearest = near.nearest(t, false);
    if (tip.lost) {
      if (nearest < 0 ? !first : !(height_over(near, nearest) > 0.0 && is_clear(near, layer, t))) return;
      tip.lost = false;
      if (near.engaged(t) > 0) return;
    }
    if (nearest >= 0) {
      tip.lost = is_inside(near.place(nearest).node, tip, present_point(near, nearest));
    } else if (first) {
      const std::int32_t node = nodes_->nearest(tip.center, std::numeric_limits<float>::max());
      tip.lost = node >= 0 && is_inside(node, tip, near.present_point(node));
    }
  }

  /// Release the body from tips that have been pushed through. Their centers are below the surface at rest, those of flat ends by a quarter
  /// of the radius. Either such a tip has passed the nodes that it touches. Or its force falls by half or more in this tick, from about its
  /// largest one, and the `energy` [J] has dropped by more than a share `allowed` of what it would be by the work, less that of friction. A
  /// tip that jumps may find another equilibrium. Return whether there is one.
  bool release_pushed_through(NearNodes& near, const LayerFriction& friction, double energy_before, double energy, double allowed,
                              bool jump) const noexcept {
    bool dropped = false, released = false;
    for (int t = 0; t < near.tip_count(); ++t) dropped = dropped || has_fallen(near.tip(t));
    dropped = dropped && !jump && has_dropped(near, friction, energy_before, energy, allowed);
    for (int t = 0; t < near.tip_count(); ++t) {
      NearNodes::Tip& tip = near.tip(t);
      const bool fell = dropped && has_fallen(tip);
      if (!fell && !has_passed(near, t)) continue;
      const int nearest = near.nearest(t, true);
      const double sunk = tip.shape.shape == TipGeometry::Shape::capsule ? 0.0 : 0.25 * tip.shape.radius;
      if (nearest < 0 || height_over_patch(near, nearest) > -sunk) continue;
      if (!fell && !is_under(near.place(nearest).node, tip, present_point(near, nearest))) continue;
      tip.lost = released = true;
      near.release(t);
    }
    return released;
  }

 private:
  static constexpr double max_sunk = 0.3;       // of the radius: depth of the center below the nearest node's tangent plane
  static constexpr double least_pressed = 0.2;  // of the forces of a flat end that has not passed: part along its axis or the normals

  /// Whether the force of a tip falls by half or more in a tick, from one that is not much smaller than those of the last ticks: a contact
  /// that ends, or from which the body swings away, has lost most of its force before.
  [[nodiscard]] static bool has_fallen(const NearNodes::Tip& tip) noexcept {
    const double last = tip.last_force.norm();
    return last >= 0.5 * tip.recent_force && tip.force.norm() <= 0.5 * last;
  }

  /// Work of the present forces on a body with motion by its motion in this tick, J. The contact loses it.
  [[nodiscard]] static double work_of_body(const NearNodes& near) noexcept {
    double work = 0.0;
    for (int k = 0; near.has_motion() && k < near.engaged(); ++k)
      work += (near.place(k).force + near.place(k).traction).dot(near.place(k).free_change);
    return work;
  }

  [[nodiscard]] bool has_dropped(const NearNodes& near, const LayerFriction& friction, double before, double now,
                                 double allowed) const noexcept {
    if (!(before > 0.0)) return false;
    double rubbed = 0.0;  // bound on what friction dissipates
    for (int k = 0; friction && k < near.engaged(); ++k) {
      const NearNodes::Place& p = near.place(k);
      if (p.rubs) rubbed += p.traction.norm() * (p.displacement - near.tip_of(p).center - p.last_relative).norm();
    }
    double work = -0.5 * (first_work_ + work_of_body(near));
    for (int t = 0; t < near.tip_count(); ++t) work += 0.5 * near.tip(t).last_move.dot(near.tip(t).force + near.tip(t).last_force);
    return before + work - rubbed - now > allowed * (before + std::abs(work));
  }

  /// Whether a tip has passed the nodes that it touches: it pulls them along their outward normals at rest. A flat end, which goes on
  /// behind its end without limit, then touches them with its side: it hardly presses them along its axis, nor along those normals.
  [[nodiscard]] bool has_passed(const NearNodes& near, int t) const noexcept {
    const TipGeometry& shape = near.tip(t).shape;
    const bool flat = shape.shape == TipGeometry::Shape::cylinder;
    double outward = 0.0, along = 0.0, all = 0.0;
    for (int k = 0; k < near.engaged(); ++k) {
      const NearNodes::Place& p = near.place(k);
      if (p.tip != t) continue;
      outward += p.force.dot(nodes_->normal(p.node));
      if (!flat) continue;
      along -= p.force.dot(shape.axis);
      all += p.force.norm();
    }
    return outward > 0.0 || std::max(-outward, along) < least_pressed * all;
  }

  /// Whether a tip is under the node at `point` [m] nearest to it.
  [[nodiscard]] bool is_inside(std::int32_t node, const NearNodes::Tip& tip, const Vector3<>& point) const noexcept {
    return (tip.center - point).dot(nodes_->normal(node)) < -max_sunk * tip.shape.radius && is_under(node, tip, point);
  }

  /// Whether a tip's center lies under the patch of a node at `point` [m]. Beside a body that is touched on its top alone a tip may be
  /// lower than that, too.
  [[nodiscard]] bool is_under(std::int32_t node, const NearNodes::Tip& tip, const Vector3<>& point) const noexcept {
    const double aside = (tip.center - point).cross(nodes_->normal(node)).norm();
    return aside < std::max(tip.shape.radius, 1.5 * tip.points->reach(node));  // the corners of a patch are farther than its points
  }

  /// Position of a place's node under the forces, m. NearNodes::present_point() is as last looked at, too old on a body that swings.
  [[nodiscard]] Vector3<> present_point(const NearNodes& near, int k) const noexcept {
    return nodes_->point(near.place(k).node) + near.place(k).free + near.displacement(k);
  }

  /// Height of the tip's center over the node of a place.
  [[nodiscard]] double height_over(const NearNodes& near, int k) const noexcept {
    const NearNodes::Place& p = near.place(k);
    return (near.tip_of(p).center - present_point(near, k)).dot(nodes_->normal(p.node));
  }

  /// Height of the tip's center over the nearest point of a place's patch at rest. Unlike the node's mean normal at a corner, the point's
  /// normal is that of its face.
  [[nodiscard]] double height_over_patch(const NearNodes& near, int k) const noexcept {
    const std::int32_t node = near.place(k).node;
    const NearNodes::Tip& tip = near.tip_of(near.place(k));
    const Vector3<> center = tip.center - near.free_point(node);
    const PatchPoints& points = *tip.points;
    double least = std::numeric_limits<double>::infinity(), height = center.dot(nodes_->normal(node));
    for (std::size_t q = points.begin(node); q < points.end(node); ++q) {
      if (points.coordinate(6)[q] == 0.0F) continue;
      const Vector3<> away = center - Vector3<>(points.coordinate(0)[q], points.coordinate(1)[q], points.coordinate(2)[q]);
      if (away.squaredNorm() >= least) continue;
      least = away.squaredNorm();
      height = away.dot(Vector3<>(points.coordinate(3)[q], points.coordinate(4)[q], points.coordinate(5)[q]));
    }
    return height;
  }

  /// Whether no point of the body is in a tip that does not touch it.
  [[nodiscard]] static bool is_clear(NearNodes& near, LayerContact& layer, int t) noexcept {
    for (int k = 0; k < near.count(); ++k) {
      if (near.place(k).tip != t) continue;
      near.move(k);
      layer.press(near, k);
      if (near.place(k).stiffness > 0.0) return false;
    }
    return true;
  }

  const SurfaceNodes* nodes_;
  double first_work_ = 0.0;  // of the last tick's forces by the motion of the body in this one, J
};

}  // namespace palpate::deformable
