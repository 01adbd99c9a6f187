#pragma once

#include "palpate/math/vector.hpp"

namespace palpate {

/// The operator at the tip: a mass, damper and spring to the shoulder (Gil et al. 2004), held rigidly
/// or through fingertip tissue, and a voluntary force. All zero: nobody holds the device, the force still acts on the tip.
struct Hand {
  double mass = 0.0;                   ///< kg
  double damping = 0.0;                ///< N*s/m, to the ground
  double stiffness = 0.0;              ///< N/m, to `rest`
  bool tissue = false;                 ///< false: hand and tip move as one; true: through the next two
  double tissue_stiffness = 0.0;       ///< N/m
  double tissue_damping = 0.0;         ///< N*s/m
  Vector3<> rest = Vector3<>::Zero();  ///< where the arm's spring is unstretched, m

  /// Nothing but a force: the tip carries no extra mass, damper or spring.
  [[nodiscard]] bool empty() const { return mass == 0.0 && damping == 0.0 && stiffness == 0.0 && !tissue; }
};

/// The voluntary force [N] over one servo period: linear in time from `begin` to `end`.
struct ForceSegment {
  Vector3<> begin = Vector3<>::Zero();
  Vector3<> end = Vector3<>::Zero();

  [[nodiscard]] Vector3<> at(double fraction) const { return begin + fraction * (end - begin); }
};

}  // namespace palpate
