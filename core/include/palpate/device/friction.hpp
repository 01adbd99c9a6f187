#pragma once

#include <cmath>

#include "palpate/math/vector.hpp"

namespace palpate {

/// Friction in the joints. Dry friction is a set-valued law: at rest it takes whatever value up to `breakaway` holds
/// the joint; sliding, it falls from `breakaway` to `coulomb` with speed (Stribeck): coulomb + (breakaway - coulomb)
/// exp(-(v/stribeck_speed)^2), against the motion.
template <int dof>
struct Friction {
  Joints<dof> viscous = Joints<dof>::Zero();                 ///< N*m*s/rad
  Joints<dof> coulomb = Joints<dof>::Zero();                 ///< N*m
  Joints<dof> breakaway = Joints<dof>::Zero();               ///< N*m, not less than coulomb
  Joints<dof> stribeck_speed = Joints<dof>::Constant(1e-2);  ///< rad/s

  [[nodiscard]] bool dry() const { return (breakaway.array() > 0.0).any(); }

  /// Size of the sliding dry friction of one joint [N*m].
  [[nodiscard]] double sliding(int joint, double speed) const {
    const double extra = breakaway[joint] - coulomb[joint];
    if (extra == 0.0) return coulomb[joint];
    const double ratio = speed / stribeck_speed[joint];
    return coulomb[joint] + extra * std::exp(-ratio * ratio);
  }
};

}  // namespace palpate
