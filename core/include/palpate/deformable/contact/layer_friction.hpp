#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/deformable/contact/dry_friction.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Coulomb friction of the tips on the engaged places, for SignedDistanceContact. The layer of a node yields in shear as well: its shear
/// stiffness is k = h 2 (1 - nu) / (2 - nu) (Mindlin 1949), with the stiffness h of the node's points in contact. The traction T of a node
/// is perpendicular to its force F:
///   |T| <= mu |F|,   T = (traction that the layer still carries) - k (slip of the node relative to the tip) inside the cone.
/// Normal forces held, the tractions are found by sweeps of projected Gauss-Seidel over blocks of one node. What they lack at the end of a
/// tick is made up in the next.
///
/// The layer carries less than before where its stiffness has fallen, and no more where it has risen, so its energy T.T / (2 k) never
/// grows without slip: friction only dissipates.
class LayerFriction {
 public:
  /// @param shear_ratio  shear stiffness of the layer over its normal stiffness
  LayerFriction(DryFriction friction, double shear_ratio) : friction_(friction), shear_ratio_(shear_ratio) {}

  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(friction_); }
  [[nodiscard]] const DryFriction& coefficients() const noexcept { return friction_; }
  [[nodiscard]] bool sliding(int tip) const noexcept { return sliding_[at(tip)]; }
  void reset() noexcept { sliding_.fill(false); }
  /// Continue the friction `before` of the same tips; NearNodes has the tractions.
  void take_over(const LayerFriction& before) noexcept { sliding_ = before.sliding_; }

  /// Reduce the traction of a place to what its normal force allows.
  void limit(NearNodes::Place& p) const noexcept {
    const double most = coefficient(p.tip) * p.force.norm(), size = p.traction.norm();
    if (size > most) p.traction *= most / size;
  }

  static constexpr int max_sweeps = 6;

  /// Update the tractions under the present normal forces by up to `most` sweeps. Return the change of their sum, N.
  double sweep(NearNodes& near, int most = max_sweeps) noexcept {
    const int count = near.engaged();
    prepare(near);
    double change = 0.0, first = 0.0;
    Vector3<> total = Vector3<>::Zero();
    for (int s = 0; s < most; ++s) {
      Vector3<> sum = Vector3<>::Zero();
      double force = 0.0;
      for (int k = 0; k < count; ++k) {
        NearNodes::Place& p = near.place(k);
        const Vector3<> old = p.traction;
        p.traction = next_traction(near, k);
        const Vector3<> step = p.traction - old;
        force += p.force.norm();
        if (step.squaredNorm() == 0.0) continue;
        sum += step;
        near.add_displacements(k, step, displacement_);
      }
      total += sum;
      change = sum.norm();
      first = std::max(first, change);
      if (change <= tolerance * force) break;
    }
    for (int k = 0; k < count; ++k) near.set_force(k);
    return total.norm();
  }

  /// Record the state at the end of a tick, right after sweep(). `displacement` of a place is up to date.
  void finish(NearNodes& near) noexcept {
    std::array<bool, max_tips> all{}, any{};
    all.fill(true);
    for (int k = 0; k < near.engaged(); ++k) {
      NearNodes::Place& p = near.place(k);
      const Vector3<> relative = p.displacement - near.tip_of(p).center;
      p.last_traction = p.traction;
      if (p.rubs && p.stiffness > 0.0) {
        const double limit = coefficient(p.tip) * p.force.norm(), stiffness = shear_ratio_ * p.stiffness;
        Vector3<> missing = (carried_[at(k)] - p.traction) / stiffness - (relative - p.last_relative);
        missing -= missing.dot(p.direction) * p.direction;
        const bool slips = p.traction.squaredNorm() >= limit * limit * (1.0 - cone_tolerance) &&
                           p.traction.dot(missing) > cone_tolerance * limit * limit / stiffness;
        const Vector3<> carried = p.traction + stiffness * missing;
        const double size = carried.norm();
        p.last_traction = size > limit ? Vector3<>(carried * (limit / size)) : carried;
        all[at(p.tip)] = all[at(p.tip)] && slips;
        any[at(p.tip)] = any[at(p.tip)] || slips;
      }
      p.rubs = p.stiffness > 0.0;
      p.last_relative = relative;
      p.last_stiffness = p.stiffness;
    }
    for (std::size_t t = 0; t < max_tips; ++t) sliding_[t] = any[t] && (all[t] || sliding_[t]);
  }

  /// Energy of the layer in shear, J.
  [[nodiscard]] double energy(const NearNodes::Place& p) const noexcept {
    return p.stiffness > 0.0 ? 0.5 * p.traction.squaredNorm() / (shear_ratio_ * p.stiffness) : 0.0;
  }

  static constexpr std::size_t max_tips = 8;

 private:
  static constexpr double tolerance = 3e-4;       // of the change of the traction's sum, relative to the normal forces
  static constexpr double cone_tolerance = 1e-6;  // relative; keeps the slip state independent of the last bits

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] double coefficient(int tip) const noexcept { return sliding_[at(tip)] ? friction_.mu_dynamic : friction_.mu_static; }

  /// Evaluate the displacements, the carried tractions and the compliances of the engaged places.
  void prepare(NearNodes& near) noexcept {
    for (int k = 0; k < near.engaged(); ++k) {
      NearNodes::Place& p = near.place(k);
      displacement_.set(k, p.free + near.displacement(k));
      const Matrix3<> own = near.self_compliance(k);
      compliance_[at(k)] = 0.5 * (own.trace() - p.direction.dot(own * p.direction));
      if (!p.rubs || !(p.stiffness > 0.0)) continue;
      const double kept = std::min(1.0, p.stiffness / p.last_stiffness);
      carried_[at(k)] = kept * (p.last_traction - p.last_traction.dot(p.direction) * p.direction);
    }
  }

  [[nodiscard]] Vector3<> next_traction(const NearNodes& near, int k) const noexcept {
    const NearNodes::Place& p = near.place(k);
    if (!p.rubs || !(p.stiffness > 0.0)) return Vector3<>::Zero();
    const Vector3<>& d = p.direction;
    const double limit = coefficient(p.tip) * p.force.norm(), yielding = 1.0 / (shear_ratio_ * p.stiffness);
    Vector3<> slip = displacement_.get(k) - near.tip_of(p).center - p.last_relative;
    slip -= slip.dot(d) * d;
    const Vector3<> traction = p.traction - p.traction.dot(d) * d;
    const Vector3<> missing = (carried_[at(k)] - traction) * yielding - slip;
    const Vector3<> next = traction + missing / (compliance_[at(k)] + yielding);
    const double size = next.norm();
    return size > limit ? Vector3<>(next * (limit / size)) : next;
  }

  DryFriction friction_;
  double shear_ratio_;
  std::array<bool, max_tips> sliding_{};
  PlaceForces displacement_;
  std::array<double, NearNodes::capacity> compliance_{};
  std::array<Vector3<>, NearNodes::capacity> carried_{};
};

}  // namespace palpate::deformable
