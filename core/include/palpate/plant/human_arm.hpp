#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::plant {

/// The operator at the tip: a mass, damper and spring to the shoulder (Gil et al. 2004), held rigidly
/// or through fingertip tissue, and a voluntary force. All zero: nobody holds the device, the force still acts on the tip.
template <class Scalar>
struct BasicHumanArm {
  Scalar mass = 0.0;                                      ///< kg
  Scalar damping = 0.0;                                   ///< N*s/m, to the ground
  Scalar stiffness = 0.0;                                 ///< N/m, to `rest`
  bool tissue = false;                                    ///< false: hand and tip move as one; true: through the next two
  Scalar tissue_stiffness = 0.0;                          ///< N/m
  Scalar tissue_damping = 0.0;                            ///< N*s/m
  Vector3<Scalar> rest = Vector3<Scalar>::Constant(0.0);  ///< where the arm's spring is unstretched, m

  /// Nothing but a force: the tip carries no extra mass, damper or spring.
  [[nodiscard]] bool empty() const {
    return all(mass == Scalar(0.0)) && all(damping == Scalar(0.0)) && all(stiffness == Scalar(0.0)) && !tissue;
  }

  /// Puts one loop's hand into a lane, which holds the device as the others do: with tissue or without.
  void set_lane(int lane, const BasicHumanArm<double>& one) {
    using math::set_lane;
    set_lane(mass, lane, one.mass);
    set_lane(damping, lane, one.damping);
    set_lane(stiffness, lane, one.stiffness);
    tissue = one.tissue;
    set_lane(tissue_stiffness, lane, one.tissue_stiffness);
    set_lane(tissue_damping, lane, one.tissue_damping);
    set_lane(rest, lane, one.rest);
  }
};
using HumanArm = BasicHumanArm<double>;

/// The voluntary force [N] over one servo period: linear in time from `begin` to `end`.
template <class Scalar = double>
struct ForceSegment {
  Vector3<Scalar> begin = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> end = Vector3<Scalar>::Constant(0.0);

  [[nodiscard]] Vector3<Scalar> at(double fraction) const { return begin + fraction * (end - begin); }
};

}  // namespace palpate::plant
