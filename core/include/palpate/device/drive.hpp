#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/math/vector.hpp"

namespace palpate {

/// Encoders: angles come in whole counts.
template <int dof>
struct Encoder {
  Joints<dof> step = Joints<dof>::Zero();  ///< rad per count; 0 reads exactly

  [[nodiscard]] Joints<dof> read(const Joints<dof>& q) const noexcept {
    Joints<dof> counted = q;
    for (int i = 0; i < dof; ++i) {
      if (step[i] > 0.0) counted[i] = std::nearbyint(q[i] / step[i]) * step[i];
    }
    return counted;
  }
};

/// Limits of a drive; infinite where there is none.
template <int dof>
struct DriveLimits {
  double peak_force = std::numeric_limits<double>::infinity();        ///< at the tip, N
  double continuous_force = std::numeric_limits<double>::infinity();  ///< at the tip, N: what the motors stand for ever
  double thermal_time = 1.0;                                          ///< s: time constant of the windings' heating
  Joints<dof> peak_torque = Joints<dof>::Constant(std::numeric_limits<double>::infinity());  ///< N*m
};

/// Motors: a peak, a continuous rating behind a first-order winding temperature, and torque limits, in this order.
///
/// Above the peak the tip force is scaled, so that its direction is kept. Heat follows (force / continuous)^2; over the last
/// tenth of the heat the windings may hold, the limit fades from the peak to the continuous force, so that the limit itself
/// makes no step that a hand would feel.
template <int dof>
class Drive {
 public:
  Drive() = default;
  Drive(const DriveLimits<dof>& limits, double period)
      : limits_(limits),
        limits_force_(std::isfinite(limits.peak_force) || std::isfinite(limits.continuous_force)),
        warming_(1.0 - std::exp(-period / limits.thermal_time)) {}

  /// The tip force [N] that the motors will give when `wanted` is asked for.
  Vector3<> limit_force(const Vector3<>& wanted) noexcept {
    if (!limits_force_) return wanted;
    const double size = wanted.norm();
    double limit = limits_.peak_force;
    if (std::isfinite(limits_.continuous_force)) {
      const double left = std::clamp((1.0 - heat_) / 0.1, 0.0, 1.0);
      limit = std::min(limit, limits_.continuous_force + left * std::max(0.0, std::min(limit, 1e300) - limits_.continuous_force));
      const double load = std::min(size, limit) / limits_.continuous_force;
      heat_ += warming_ * (load * load - heat_);
    }
    return size > limit ? Vector3<>(wanted * (limit / size)) : wanted;
  }

  /// The largest part, 0 to 1, of joint torques [N*m] that the motors can give; all joints are scaled alike, so that the tip
  /// force keeps its direction.
  [[nodiscard]] double possible_part(const Joints<dof>& wanted) const noexcept {
    double part = 1.0;
    for (int i = 0; i < dof; ++i) {
      const double size = std::abs(wanted[i]);
      if (size > limits_.peak_torque[i]) part = std::fmin(part, limits_.peak_torque[i] / size);
    }
    return part;
  }

  /// Heat of the windings: 1 is what the continuous force keeps up.
  [[nodiscard]] double heat() const { return heat_; }

 private:
  DriveLimits<dof> limits_;
  bool limits_force_ = false;
  double warming_ = 0.0;
  double heat_ = 0.0;
};

/// A transport delay of whole servo periods.
template <class Value, int longest = 65>
class Delay {
 public:
  Delay() = default;
  /// `periods` in [0, longest - 1]; `initial` is what comes out before the first value arrives.
  Delay(int periods, const Value& initial) : periods_(std::clamp(periods, 0, longest - 1)) { line_.fill(initial); }

  /// Puts `value` in, takes out what went in `periods` calls ago.
  Value pass(const Value& value) noexcept {
    line_[static_cast<std::size_t>(position_)] = value;
    const int oldest = position_ >= periods_ ? position_ - periods_ : position_ - periods_ + longest;
    position_ = position_ + 1 < longest ? position_ + 1 : 0;
    return line_[static_cast<std::size_t>(oldest)];
  }

 private:
  int periods_ = 0;
  int position_ = 0;
  std::array<Value, longest> line_{};
};

}  // namespace palpate
