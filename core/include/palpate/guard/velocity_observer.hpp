#pragma once

#include <cmath>

#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Observer of one joint: position, velocity and the acceleration of unknown forces, such as the operator's.
///
/// It is driven by the acceleration that the known torque gives. Without the third state (gains with a third entry of zero), a hand that
/// presses gives a false velocity, and a damper of this velocity a false stiffness.
class VelocityObserver {
 public:
  VelocityObserver() = default;
  /// @param gains  corrections of position, 1, velocity, 1/s, and acceleration, 1/s^2, per error of the position
  VelocityObserver(const math::Vector3<>& gains, double period) : gains_(gains), period_(period) {}

  /// Return the gains with three poles exp(-rate period); rate in rad/s.
  [[nodiscard]] static math::Vector3<> gains(double rate, double period) noexcept {
    const double p = std::exp(-rate * period), slow = 1.0 - p;
    return {1.0 - p * p * p, 1.5 * slow * slow * (1.0 + p) / period, slow * slow * slow / (period * period)};
  }

  /// Return the velocity [rad/s] at the next sample `q` [rad].
  /// @param acceleration  of the known torque since the last sample, rad/s^2
  double velocity(double q, double acceleration) noexcept {
    if (!started_) {
      started_ = true;
      state_ = {q, 0.0, 0.0};
      return 0.0;
    }
    const double total = acceleration + state_[2];
    state_[0] += period_ * (state_[1] + 0.5 * period_ * total);
    state_[1] += period_ * total;
    state_ += (q - state_[0]) * gains_;
    return state_[1];
  }

  void reset() noexcept { started_ = false; }

 private:
  math::Vector3<> gains_ = math::Vector3<>::Zero();
  double period_ = 1e-3;
  math::Vector3<> state_ = math::Vector3<>::Zero();  // position, velocity, acceleration of unknown forces
  bool started_ = false;
};

}  // namespace palpate::guard
