#pragma once

#include <cmath>
#include <limits>

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::actuation {

/// Limits of a drive. Infinity means no limit.
template <int dof, class Scalar = double>
struct DriveLimits {
  static constexpr double none = std::numeric_limits<double>::infinity();
  Scalar peak_force = none;                                               ///< at the tip, N
  Scalar continuous_force = none;                                         ///< at the tip, N, for an unlimited time
  Scalar thermal_time = 1.0;                                              ///< s, time constant of the winding temperature
  Joints<dof, Scalar> peak_torque = Joints<dof, Scalar>::Constant(none);  ///< N*m

  /// Copies the limits of one loop into a lane.
  void set_lane(int lane, const DriveLimits<dof>& one) {
    using math::set_lane;
    set_lane(peak_force, lane, one.peak_force);
    set_lane(continuous_force, lane, one.continuous_force);
    set_lane(thermal_time, lane, one.thermal_time);
    set_lane(peak_torque, lane, one.peak_torque);
  }
};

/// Motors with a peak force, a continuous force with a thermal model, and torque limits, applied in this order.
///
/// A tip force above the limit is scaled, which keeps its direction. The winding temperature follows (force / continuous force)^2 with a
/// first-order lag. Over the last tenth of the admissible temperature, the limit falls linearly from the peak to the continuous force,
/// so that it has no steps.
template <int dof, class Scalar = double>
class Drive {
 public:
  Drive() = default;
  Drive(const DriveLimits<dof, Scalar>& limits, const Scalar& period)
      : limits_(limits),
        thermal_(is_finite(limits.continuous_force)),
        any_thermal_(any(thermal_)),
        has_force_limit_(any_thermal_ || any(is_finite(limits.peak_force))),
        temperature_gain_(1.0 - exponential(-period / limits.thermal_time)) {
    for (int i = 0; i < dof; ++i) has_torque_limit_ = has_torque_limit_ || any(is_finite(limits.peak_torque[i]));
  }

  /// Whether any limit is finite.
  [[nodiscard]] bool limits() const noexcept { return has_force_limit_ || has_torque_limit_; }

  /// Returns the largest tip force [N] of the next command: the peak force, reduced when the windings are hot.
  [[nodiscard]] Scalar force_limit() const noexcept {
    const Scalar limit = limits_.peak_force;
    if (!any_thermal_) return limit;
    const Scalar& rating = limits_.continuous_force;
    const Scalar margin = min_of(max_of((1.0 - temperature_) / 0.1, Scalar(0.0)), Scalar(1.0));
    const Scalar faded = rating + margin * max_of(Scalar(0.0), min_of(limit, Scalar(1e300)) - rating);
    return select(thermal_, min_of(limit, faded), limit);
  }

  /// Returns the tip force [N] that the motors apply for the force `commanded` [N]. Updates the winding temperature.
  Vector3<Scalar> limit_force(const Vector3<Scalar>& commanded) noexcept {
    if (!has_force_limit_) return commanded;
    const Scalar magnitude = commanded.norm();
    Scalar limit = limits_.peak_force;
    if (any_thermal_) {
      const Scalar& rating = limits_.continuous_force;
      limit = force_limit();
      const Scalar load = min_of(magnitude, limit) / rating;
      temperature_ = select(thermal_, temperature_ + temperature_gain_ * (load * load - temperature_), temperature_);
    }
    const auto exceeds = magnitude > limit;
    if (!any(exceeds)) return commanded;
    return select_each(exceeds, Vector3<Scalar>(commanded * (limit / magnitude)), commanded);
  }

  /// Returns the largest factor, 0 to 1, by which the motors can apply the joint torques `commanded` [N*m]. It is common to all joints,
  /// which keeps the direction of the tip force.
  [[nodiscard]] Scalar torque_scale(const Joints<dof, Scalar>& commanded) const noexcept {
    using std::abs;
    Scalar scale = 1.0;
    if (!has_torque_limit_) return scale;
    for (int i = 0; i < dof; ++i) {
      const Scalar magnitude = abs(commanded[i]);
      const Scalar candidate = limits_.peak_torque[i] / magnitude;
      scale = select((magnitude > limits_.peak_torque[i]) & (candidate < scale), candidate, scale);
    }
    return scale;
  }

  /// Winding temperature above ambient. 1 is the steady state under the continuous force.
  [[nodiscard]] const Scalar& temperature() const { return temperature_; }

  /// Return to cold windings.
  void reset() noexcept { temperature_ = 0.0; }

  /// Copies the drive of one loop into a lane.
  void set_lane(int lane, const Drive<dof>& one) {
    using math::set_lane;
    limits_.set_lane(lane, one.limits_);
    set_lane(thermal_, lane, one.thermal_);
    any_thermal_ = any_thermal_ || one.any_thermal_;
    has_force_limit_ = has_force_limit_ || one.has_force_limit_;
    has_torque_limit_ = has_torque_limit_ || one.has_torque_limit_;
    set_lane(temperature_gain_, lane, one.temperature_gain_);
    set_lane(temperature_, lane, one.temperature_);
  }

 private:
  template <int, class>
  friend class Drive;

  static Scalar exponential(const Scalar& x) {
    using std::exp;
    return exp(x);
  }

  DriveLimits<dof, Scalar> limits_;
  Condition<Scalar> thermal_ = false;
  bool any_thermal_ = false;
  bool has_force_limit_ = false;
  bool has_torque_limit_ = false;
  Scalar temperature_gain_ = 0.0;
  Scalar temperature_ = 0.0;
};

}  // namespace palpate::actuation
