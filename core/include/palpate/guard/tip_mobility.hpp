#pragma once

#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Return the acceleration of the tip along a unit direction per force along it [1/kg], at the pose `q` [rad].
template <class Mechanism>
[[nodiscard]] double tip_mobility(const Mechanism& mechanism, const math::Joints<Mechanism::dof>& q,
                                  const math::Vector3<>& along) noexcept {
  const auto cache = mechanism.kinematics(q);
  const math::Joints<Mechanism::dof> torque = mechanism.apply_jacobian_transpose(cache, along);
  return torque.dot(math::Joints<Mechanism::dof>(mechanism.dynamics(cache).inverse() * torque));
}

}  // namespace palpate::guard
