#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "palpate/deformable/contact/coupled_newton.hpp"
#include "palpate/deformable/contact/layer_creep.hpp"
#include "palpate/deformable/contact/layer_friction.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/press_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Contact of tips with the elastic layer of a surface, with friction and creep: force, stiffness and energy of each place where it is.
/// SignedDistanceContact and EquilibriumPath find the displacements.
class LayerContact {
 public:
  using Place = NearNodes::Place;

  /// `nodes` and `patches` must outlive the contact.
  LayerContact(const SurfaceNodes& nodes, const ContactPatches& patches, DryFriction friction)
      : friction_(friction, patches), nodes_(&nodes), patches_(&patches) {
    if (patches.creep.delayed_ratio > 0.0) creeps_ = {LayerCreep(patches.round, patches.creep), LayerCreep(patches.flat, patches.creep)};
  }

  void reset() noexcept {
    friction_.reset();
    for (LayerCreep& creep : creeps_) creep.reset();
  }

  /// Continue the contact `before` as SignedDistanceContact::take_over() does.
  template <class NodeAfter>
  void take_over(const LayerContact& before, NodeAfter node_after) noexcept {
    friction_.take_over(before.friction_);
    for (std::size_t k = 0; k < creeps_.size(); ++k) {
      const auto points = k == 0 ? &ContactPatches::round : &ContactPatches::flat;
      creeps_[k].take_over(before.creeps_[k], patches_->*points, before.patches_->*points, node_after);
    }
  }

  [[nodiscard]] LayerFriction& friction() noexcept { return friction_; }
  [[nodiscard]] const LayerFriction& friction() const noexcept { return friction_; }
  /// Points that a tip of a shape presses.
  [[nodiscard]] const PatchPoints& points(const TipGeometry& shape) const noexcept {
    return shape.shape == TipGeometry::Shape::cylinder ? patches_->flat : patches_->round;
  }

  void begin_period() noexcept {
    for (LayerCreep& creep : creeps_) creep.begin_period();
  }

  /// Point of a place's node at rest, m.
  [[nodiscard]] const Vector3<>& point(const Place& p) const noexcept { return nodes_->point(p.node); }
  /// Position of a place relative to its tip, m.
  [[nodiscard]] Vector3<> position(const NearNodes& near, const Place& p) const noexcept {
    return nodes_->point(p.node) + p.displacement - near.tip_of(p).center;
  }
  /// Distance of a place's patch from its tip, m, with the place at the position `at`.
  [[nodiscard]] static double gap(const NearNodes& near, const Place& p, const Vector3<>& at) noexcept {
    const NearNodes::Tip& tip = near.tip_of(p);
    return tip.shape.distance(at) - tip.points->reach(p.node);
  }

  /// Evaluate the points of a place. Return the energy of its force and its points.
  double press(NearNodes& near, int k) noexcept {
    Place& p = near.place(k);
    const Vector3<> at = position(near, p);
    double clear = 0.0;
    if (k >= near.engaged()) {
      if (near.still_clear(k, at)) return 0.0;
      clear = gap(near, p, at);
    }
    const PressedPoints pressed = clear > 0.0 ? PressedPoints{.clearance = clear} : points_at<false>(near.tip_of(p), p, at);
    p.target = pressed.force;
    p.stiffness = pressed.stiffness;
    p.grip = pressed.grip;
    p.layer_energy = pressed.energy;
    near.set_clearance(k, std::max(pressed.clearance, 0.0), at);
    return p.layer_energy + 0.5 * p.force.dot(p.displacement - p.free);
  }

  /// Set the energy of a place's points, and the traction that they carry, at the position `at` relative to its tip [m].
  void press_at(const NearNodes& near, Place& p, const Vector3<>& at) noexcept {
    const PressedPoints pressed = points_at<false, detail::DoublePack>(near.tip_of(p), p, at);
    p.layer_energy = pressed.energy;
    p.grip = {pressed.grip.stiffness, p.traction, pressed.grip.energy};
  }

  /// Force at a place with the displacement `u` [m]. PointTractions records the stiffness of its points there.
  [[nodiscard]] CoupledNewton::Force law(const NearNodes& near, const Place& p, const Vector3<>& u) noexcept {
    const NearNodes::Tip& tip = near.tip_of(p);
    const PressedPoints pressed = points_at<false, detail::DoublePack>(tip, p, nodes_->point(p.node) + u - tip.center);
    CoupledNewton::Force f{.normal = pressed.force, .stiffness = pressed.stiffness, .energy = pressed.energy, .grip = pressed.grip};
    if (friction_) f.traction = friction_.traction_at(p, u - tip.center, f.normal, f.grip);
    return f;
  }

  /// Energy that the forces have stored in the body and in the layer, in shear as well, J. `are_moved`: the places are where these forces
  /// displace them.
  [[nodiscard]] double energy(const NearNodes& near, bool are_moved = false) const noexcept {
    double energy = 0.0;
    for (int k = 0; k < near.engaged(); ++k) {
      const Place& p = near.place(k);
      const Vector3<> moved = are_moved ? Vector3<>(p.displacement - p.free) : near.displacement(k);
      energy += p.layer_energy + 0.5 * (p.force + p.traction).dot(moved);
      if (friction_) energy += friction_.energy(p);
    }
    return energy;
  }

  /// Record the creep of a place's layer at the end of the period. Return the energy of its points, J.
  double settle(const NearNodes& near, Place& p) noexcept {
    const NearNodes::Tip& tip = near.tip_of(p);
    if (LayerCreep* const creep = creep_under(tip); creep != nullptr) {
      const PressedPoints settled = points_at<true>(tip, p, position(near, p));
      p.layer_energy = settled.energy;
      p.crept = p.stiffness > 0.0 ? settled.crept / p.stiffness : 0.0;
      creep->mark(p.node);
    }
    return p.layer_energy + friction_.stored_energy(p);
  }
  /// Energy of the creep of all places, J.
  [[nodiscard]] double delayed_energy() const noexcept {
    double energy = 0.0;
    for (const LayerCreep& creep : creeps_) energy += creep.delayed_energy();
    return energy;
  }
  /// Whether the layer under a tip creeps.
  [[nodiscard]] bool creeps() const noexcept { return creeps_.front().active(); }

 private:
  /// Creep of the layer under a tip, or null.
  [[nodiscard]] LayerCreep* creep_under(const NearNodes::Tip& tip) noexcept {
    LayerCreep& creep = creeps_[tip.points == &patches_->flat ? 1 : 0];
    return creep.active() ? &creep : nullptr;
  }

  /// press_points() of a place at `y` relative to its tip [m].
  template <bool settle, class Scalar = detail::FloatPack>
  PressedPoints points_at(const NearNodes::Tip& tip, const Place& p, const Vector3<>& y) noexcept {
    return press_points<settle, Scalar>(p.node, tip, y, creep_under(tip), friction_.points(p, *tip.points));
  }

  LayerFriction friction_;
  const SurfaceNodes* nodes_;
  const ContactPatches* patches_;
  std::array<LayerCreep, 2> creeps_;  // of the round and the flat points, or empty
};

}  // namespace palpate::deformable
