#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/deformable/contact/dry_friction.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/point_tractions.hpp"
#include "palpate/deformable/contact/traction_turn.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Coulomb friction of the tips on the engaged places, for SignedDistanceContact. The layer of a node yields in shear as well: its shear
/// stiffness is k = h 2 (1 - nu) / (2 - nu) (Mindlin 1949), with the stiffness h of the node's points in contact, which fades to zero with
/// their depth. The traction T of a node is perpendicular to its force F:
///   |T| <= mu |F|,   T = (traction that the layer still carries) - k (slip of the node relative to the tip) inside the cone.
/// Normal forces held, the tractions are found by sweeps of projected Gauss-Seidel over blocks of one node. The next tick makes up the
/// residual that is left.
///
/// TractionTurn turns the traction with its plane. PointTractions has the tractions of the single points: those that come into contact
/// carry none yet, and those that leave take theirs with them.
class LayerFriction {
 public:
  LayerFriction(DryFriction friction, const ContactPatches& patches)
      : friction_(friction), shear_ratio_(patches.shear_ratio), period_ratio_(patches.creep.period_ratio) {
    if (friction_) points_ = PointTractions(patches, NearNodes::capacity);
  }

  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(friction_); }
  [[nodiscard]] const DryFriction& coefficients() const noexcept { return friction_; }
  [[nodiscard]] bool sliding(int tip) const noexcept { return sliding_[at(tip)]; }
  void reset() noexcept { sliding_.fill(false); }
  /// Continue the friction `before` of the same tips, once NearNodes has taken over the places and their slots.
  void take_over(const LayerFriction& before) noexcept {
    sliding_ = before.sliding_;
    points_.take_over(before.points_);
  }
  /// Friction of the points of a place. Points less deep than a hundredth of their patch carry less: if the stiffness that carries friction
  /// jumped as a point comes into contact, so would the traction. The force on a sliding tip would be rough, and Newton's method could not
  /// solve for it. On a body that creeps the whole depth counts, unless the point is about to lose its force.
  [[nodiscard]] RubbedPoints points(const NearNodes::Place& p, const PatchPoints& patch) noexcept {
    if (!friction_) return {};
    const double fading = 0.01 * patch.reach(p.node);
    return {fading, period_ratio_ * fading, p.rubs ? points_.first(p.slot) : nullptr, points_.stride()};
  }

  /// Reduce the traction of a place to what its normal force allows.
  void limit(NearNodes::Place& p) const noexcept {
    const double mu = coefficient(p.tip), most = mu * mu * p.force.squaredNorm(), square = p.traction.squaredNorm();
    if (square > most) p.traction *= std::sqrt(most / square);
  }

  /// Update the tractions under the present normal forces, and the displacements of the places. Return the change of the tractions' sum, N.
  double sweep(NearNodes& near) noexcept {
    const int count = near.engaged();
    const double force = prepare(near);
    Vector3<> total = Vector3<>::Zero();
    for (int s = 0; s < max_sweeps; ++s) {
      Vector3<> sum = Vector3<>::Zero();
      for (int k = 0; k < count; ++k) sum += take_step(near, k, next_step(near, k));
      total += sum;
      if (sum.norm() <= tolerance * force) break;
    }
    for (int k = 0; k < count; ++k) {
      near.set_force(k);
      near.place(k).displacement = displacement_.get(k);
    }
    return total.norm();
  }

  /// Traction of a place displaced by `relative` from its tip's center [m] under the normal force `force` [N] of the points `grip`, N.
  [[nodiscard]] Vector3<> traction_at(const NearNodes::Place& p, const Vector3<>& relative, const Vector3<>& force,
                                      const Grip& grip) const noexcept {
    const double size = force.norm();
    if (!p.rubs || !(grip.stiffness > 0.0) || !(size > 0.0)) return Vector3<>::Zero();
    const TractionTurn turn(p.last_direction, force / size);
    const Vector3<> slip = turn.slip(relative - p.last_relative);
    return in_cone(turn.carried(grip.carried) - shear_ratio_ * grip.stiffness * slip, coefficient(p.tip) * size);
  }

  /// Record the state at the end of a tick, when the forces are found.
  void finish(NearNodes& near) noexcept {
    std::array<bool, max_tips> all{}, any{};
    all.fill(true);
    for (int k = 0; k < near.engaged(); ++k) {
      NearNodes::Place& p = near.place(k);
      const Vector3<> relative = p.displacement - near.tip_of(p).center;
      if (p.rubs && p.grip.stiffness > 0.0) {
        const PatchPoints& patch = *near.tip_of(p).points;
        const bool slips = rub(p, patch.end(p.node) - patch.begin(p.node), relative - p.last_relative);
        all[at(p.tip)] = all[at(p.tip)] && slips;
        any[at(p.tip)] = any[at(p.tip)] || slips;
      } else {
        points_.clear(p.slot);
        p.grip = {.stiffness = p.grip.stiffness};
      }
      p.rubs = p.grip.stiffness > 0.0;
      p.last_relative = relative;
      p.last_direction = p.direction;
    }
    for (std::size_t t = 0; t < max_tips; ++t) sliding_[t] = any[t] && (all[t] || sliding_[t]);
  }

  /// Energy of the layer in shear, J.
  [[nodiscard]] double energy(const NearNodes::Place& p) const noexcept {
    if (!(p.grip.stiffness > 0.0)) return 0.0;
    return 0.5 / shear_ratio_ * (p.grip.energy + (p.traction.squaredNorm() - p.grip.carried.squaredNorm()) / p.grip.stiffness);
  }
  /// The same after finish(), of the tractions without the residual of the sweeps.
  [[nodiscard]] double stored_energy(const NearNodes::Place& p) const noexcept { return 0.5 / shear_ratio_ * p.grip.energy; }

  static constexpr std::size_t max_tips = 8;

 private:
  static constexpr int max_sweeps = 6;            // one alone lets predicted tractions oscillate from tick to tick
  static constexpr double tolerance = 3e-4;       // of the change of the traction's sum, relative to the normal forces
  static constexpr double cone_tolerance = 1e-6;  // relative; keeps the slip state independent of the last bits

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] double coefficient(int tip) const noexcept { return sliding_[at(tip)] ? friction_.mu_dynamic : friction_.mu_static; }

  /// What all sweeps of a tick's iteration know of a place.
  struct Rub {
    double limit;       // of the traction, N
    double yielding;    // of the layer, m/N
    double mobility;    // over that of the layer and the body, N/m
    Vector3<> carried;  // by the layer without further slip, N
    Vector3<> origin;   // displacement without slip, m
  };

  /// Record the tractions of the `points` of a place that has moved by `way` relative to its tip [m], with what the sweeps lack. Return
  /// whether it slips.
  bool rub(NearNodes::Place& p, std::size_t points, const Vector3<>& way) noexcept {
    const double limit = coefficient(p.tip) * p.force.norm(), stiffness = shear_ratio_ * p.grip.stiffness;
    const TractionTurn turn(p.last_direction, p.direction);
    const Vector3<> missing = (turn.carried(p.grip.carried) - p.traction) / stiffness - turn.slip(way);
    const bool slips = p.traction.squaredNorm() >= limit * limit * (1.0 - cone_tolerance) &&
                       p.traction.dot(missing) > cone_tolerance * limit * limit / stiffness;
    p.grip = points_.share(p.slot, points, p.grip, in_cone(p.traction + stiffness * missing, limit), slips);
    return slips;
  }
  /// A traction reduced to at most `limit` [N].
  [[nodiscard]] static Vector3<> in_cone(const Vector3<>& traction, double limit) noexcept {
    const double square = traction.squaredNorm();
    return square > limit * limit ? Vector3<>(traction * (limit / std::sqrt(square))) : traction;
  }

  /// Evaluate the displacements, and what the sweeps know of the places. Return the sum of the sizes of the normal forces, N.
  double prepare(const NearNodes& near) noexcept {
    double sum = 0.0;
    for (int k = 0; k < near.engaged(); ++k) {
      const NearNodes::Place& p = near.place(k);
      Rub& rub = rub_[at(k)];
      displacement_.set(k, p.free + near.displacement(k));
      const double force = p.force.norm();
      sum += force;
      rub.mobility = 0.0;
      if (!p.rubs || !(p.grip.stiffness > 0.0)) continue;
      const Matrix3<> own = near.compliance(k, k);
      const double across = 0.5 * (own.trace() - p.direction.dot(own * p.direction));
      rub.limit = coefficient(p.tip) * force;
      rub.yielding = 1.0 / (shear_ratio_ * p.grip.stiffness);
      rub.mobility = 1.0 / (across + rub.yielding);
      const TractionTurn turn(p.last_direction, p.direction);
      rub.carried = turn.carried(p.grip.carried);
      rub.origin = near.tip_of(p).center + p.last_relative;
      rub.origin += turn.along(displacement_.get(k) - rub.origin);
    }
    return sum;
  }

  /// Change the traction of a place, and the displacements. Return the change.
  Vector3<> take_step(NearNodes& near, int k, const Vector3<>& step) noexcept {
    near.place(k).traction += step;
    if (step.squaredNorm() > 0.0) near.add_displacements(k, step, displacement_);
    return step;
  }

  /// Change of the traction of a place that its displacement asks for, N.
  [[nodiscard]] Vector3<> next_step(const NearNodes& near, int k) const noexcept {
    const NearNodes::Place& p = near.place(k);
    const Rub& rub = rub_[at(k)];
    if (rub.mobility == 0.0) return -p.traction;
    const Vector3<>& d = p.direction;
    const Vector3<> traction = p.traction - p.traction.dot(d) * d;
    const Vector3<> without_slip = traction + (rub.mobility * rub.yielding) * (rub.carried - traction);
    Vector3<> slip = displacement_.get(k) - rub.origin;
    slip -= slip.dot(d) * d;
    return in_cone(without_slip - rub.mobility * slip, rub.limit) - p.traction;
  }

  DryFriction friction_;
  double shear_ratio_, period_ratio_;
  PointTractions points_;
  std::array<bool, max_tips> sliding_{};
  PlaceForces displacement_;
  std::array<Rub, NearNodes::capacity> rub_{};
};

}  // namespace palpate::deformable
