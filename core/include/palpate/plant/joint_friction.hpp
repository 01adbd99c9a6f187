#pragma once

#include <cmath>

#include "palpate/math/exponential.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::plant {

/// Viscous and dry friction of the joints.
///
/// Dry friction is a set-valued law. At rest, it takes any value up to `breakaway` that holds the joint. In sliding, it opposes the motion
/// with coulomb + (breakaway - coulomb) exp(-(v / stribeck_speed)^2), the Stribeck curve.
template <int dof, class Scalar = double>
struct JointFriction {
  Joints<dof, Scalar> viscous = Joints<dof, Scalar>::Constant(0.0);          ///< N*m*s/rad
  Joints<dof, Scalar> coulomb = Joints<dof, Scalar>::Constant(0.0);          ///< N*m
  Joints<dof, Scalar> breakaway = Joints<dof, Scalar>::Constant(0.0);        ///< N*m, at least coulomb
  Joints<dof, Scalar> stribeck_speed = Joints<dof, Scalar>::Constant(1e-2);  ///< rad/s

  /// Whether any joint has dry friction.
  [[nodiscard]] bool dry() const {
    for (int i = 0; i < dof; ++i) {
      if (any(breakaway[i] > Scalar(0.0))) return true;
    }
    return false;
  }

  /// Copy the friction of one loop into a lane.
  void set_lane(int lane, const JointFriction<dof>& one) {
    using math::set_lane;
    set_lane(viscous, lane, one.viscous);
    set_lane(coulomb, lane, one.coulomb);
    set_lane(breakaway, lane, one.breakaway);
    set_lane(stribeck_speed, lane, one.stribeck_speed);
  }

  /// Magnitude of the sliding dry friction of one joint [N*m].
  [[nodiscard]] Scalar sliding(int joint, const Scalar& speed) const {
    const Scalar extra = breakaway[joint] - coulomb[joint];
    if (all(extra == Scalar(0.0))) return coulomb[joint];
    const Scalar ratio = speed / stribeck_speed[joint];
    return coulomb[joint] + extra * decaying_exponential(Scalar(-ratio * ratio));
  }
};

}  // namespace palpate::plant
