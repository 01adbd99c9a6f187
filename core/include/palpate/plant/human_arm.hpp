#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::plant {

/// Mass-spring-damper model of the operator's arm at the tip (Gil, Avello, Rubio & Florez 2004), coupled rigidly or through fingertip
/// tissue, with a voluntary force. If all values are zero, only the voluntary force acts on the tip.
template <class Scalar>
struct BasicHumanArm {
  Scalar mass = 0.0;                                      ///< kg
  Scalar damping = 0.0;                                   ///< N*s/m, to the ground
  Scalar stiffness = 0.0;                                 ///< N/m, to `rest`
  bool tissue = false;                                    ///< false: rigid coupling; true: coupling through the next two
  Scalar tissue_stiffness = 0.0;                          ///< N/m
  Scalar tissue_damping = 0.0;                            ///< N*s/m
  Vector3<Scalar> rest = Vector3<Scalar>::Constant(0.0);  ///< position of the unstretched spring, m

  /// Whether only the voluntary force acts on the tip.
  [[nodiscard]] bool empty() const {
    return all(mass == Scalar(0.0)) && all(damping == Scalar(0.0)) && all(stiffness == Scalar(0.0)) && !tissue;
  }

  /// Copy the arm of one loop into a lane. All or none of the lanes have tissue.
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

/// Voluntary force [N] over one servo period, linear in time from `begin` to `end`.
template <class Scalar = double>
struct ForceSegment {
  Vector3<Scalar> begin = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> end = Vector3<Scalar>::Constant(0.0);

  // Loops in place of Eigen's expressions, which the compiler does not always inline into the step.

  /// Force at a fraction of the period, 0 to 1.
  [[nodiscard]] Vector3<Scalar> at(double fraction) const {
    Vector3<Scalar> out;
    for (int i = 0; i < 3; ++i) out[i] = begin[i] + fraction * (end[i] - begin[i]);
    return out;
  }

  /// Rate of the force over the `period` [s], N/s.
  template <class Time>
  [[nodiscard]] Vector3<Scalar> rate(const Time& period) const {
    Vector3<Scalar> out;
    for (int i = 0; i < 3; ++i) out[i] = (end[i] - begin[i]) / period;
    return out;
  }
};

}  // namespace palpate::plant
