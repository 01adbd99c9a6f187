#pragma once

#include <cmath>

#include "palpate/math/exponential.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::plant {

/// Friction in the joints. Dry friction is a set-valued law: at rest it takes whatever value up to `breakaway` holds
/// the joint; sliding, it falls from `breakaway` to `coulomb` with speed (Stribeck): coulomb + (breakaway - coulomb)
/// exp(-(v/stribeck_speed)^2), against the motion.
template <int dof, class Scalar = double>
struct JointFriction {
  Joints<dof, Scalar> viscous = Joints<dof, Scalar>::Constant(0.0);          ///< N*m*s/rad
  Joints<dof, Scalar> coulomb = Joints<dof, Scalar>::Constant(0.0);          ///< N*m
  Joints<dof, Scalar> breakaway = Joints<dof, Scalar>::Constant(0.0);        ///< N*m, not less than coulomb
  Joints<dof, Scalar> stribeck_speed = Joints<dof, Scalar>::Constant(1e-2);  ///< rad/s

  [[nodiscard]] bool dry() const {
    for (int i = 0; i < dof; ++i) {
      if (any(breakaway[i] > Scalar(0.0))) return true;
    }
    return false;
  }

  /// Puts one loop's friction into a lane.
  void set_lane(int lane, const JointFriction<dof>& one) {
    using math::set_lane;
    set_lane(viscous, lane, one.viscous);
    set_lane(coulomb, lane, one.coulomb);
    set_lane(breakaway, lane, one.breakaway);
    set_lane(stribeck_speed, lane, one.stribeck_speed);
  }

  /// Size of the sliding dry friction of one joint [N*m].
  [[nodiscard]] Scalar sliding(int joint, const Scalar& speed) const {
    const Scalar extra = breakaway[joint] - coulomb[joint];
    if (all(extra == Scalar(0.0))) return coulomb[joint];
    const Scalar ratio = speed / stribeck_speed[joint];
    return coulomb[joint] + extra * decaying_exponential(Scalar(-ratio * ratio));
  }
};

}  // namespace palpate::plant
