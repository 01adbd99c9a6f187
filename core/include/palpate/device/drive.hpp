#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

#include "palpate/math/choose.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// Encoders: angles come in whole counts.
template <int dof, class Scalar = double>
struct Encoder {
  Joints<dof, Scalar> step = Joints<dof, Scalar>::Constant(0.0);  ///< rad per count; 0 reads exactly

  /// Whether every joint is read as it is.
  [[nodiscard]] bool exact() const noexcept {
    bool out = true;
    for (int i = 0; i < dof; ++i) out = out && !any(step[i] > Scalar(0.0));
    return out;
  }

  [[nodiscard]] Joints<dof, Scalar> read(const Joints<dof, Scalar>& q) const noexcept {
    Joints<dof, Scalar> counted = q;
    for (int i = 0; i < dof; ++i) {
      const auto counts = step[i] > Scalar(0.0);
      if (any(counts)) counted[i] = choose(counts, nearest(q[i] / step[i]) * step[i], q[i]);
    }
    return counted;
  }
};

/// Limits of a drive; infinite where there is none.
template <int dof, class Scalar = double>
struct DriveLimits {
  static constexpr double none = std::numeric_limits<double>::infinity();
  Scalar peak_force = none;                                               ///< at the tip, N
  Scalar continuous_force = none;                                         ///< at the tip, N: what the motors stand for ever
  Scalar thermal_time = 1.0;                                              ///< s: time constant of the windings' heating
  Joints<dof, Scalar> peak_torque = Joints<dof, Scalar>::Constant(none);  ///< N*m
};

/// Motors: a peak, a continuous rating behind a first-order winding temperature, and torque limits, in this order.
///
/// Above the peak the tip force is scaled, so that its direction is kept. Heat follows (force / continuous)^2; over the last
/// tenth of the heat the windings may hold, the limit fades from the peak to the continuous force, so that the limit itself
/// makes no step that a hand would feel.
template <int dof, class Scalar = double>
class Drive {
 public:
  Drive() = default;
  Drive(const DriveLimits<dof, Scalar>& limits, const Scalar& period)
      : limits_(limits),
        heats_(finite(limits.continuous_force)),
        any_heats_(any(heats_)),
        limits_force_(any_heats_ || any(finite(limits.peak_force))),
        warming_(1.0 - exponential(-period / limits.thermal_time)) {
    for (int i = 0; i < dof; ++i) limits_torque_ = limits_torque_ || any(finite(limits.peak_torque[i]));
  }

  /// The tip force [N] that the motors will give when `wanted` is asked for.
  Vector3<Scalar> limit_force(const Vector3<Scalar>& wanted) noexcept {
    if (!limits_force_) return wanted;
    const Scalar size = wanted.norm();
    Scalar limit = limits_.peak_force;
    if (any_heats_) {
      const Scalar& rating = limits_.continuous_force;
      const Scalar left = lesser(greater((1.0 - heat_) / 0.1, Scalar(0.0)), Scalar(1.0));
      const Scalar faded = rating + left * greater(Scalar(0.0), lesser(limit, Scalar(1e300)) - rating);
      limit = choose(heats_, lesser(limit, faded), limit);
      const Scalar load = lesser(size, limit) / rating;
      heat_ = choose(heats_, heat_ + warming_ * (load * load - heat_), heat_);
    }
    const auto too_much = size > limit;
    if (!any(too_much)) return wanted;
    return choose_each(too_much, Vector3<Scalar>(wanted * (limit / size)), wanted);
  }

  /// The largest part, 0 to 1, of joint torques [N*m] that the motors can give; all joints are scaled alike, so that the tip
  /// force keeps its direction.
  [[nodiscard]] Scalar possible_part(const Joints<dof, Scalar>& wanted) const noexcept {
    using std::abs;
    Scalar part = 1.0;
    if (!limits_torque_) return part;
    for (int i = 0; i < dof; ++i) {
      const Scalar size = abs(wanted[i]);
      const Scalar possible = limits_.peak_torque[i] / size;
      part = choose((size > limits_.peak_torque[i]) & (possible < part), possible, part);
    }
    return part;
  }

  /// Heat of the windings: 1 is what the continuous force keeps up.
  [[nodiscard]] const Scalar& heat() const { return heat_; }

 private:
  static Scalar exponential(const Scalar& x) {
    using std::exp;
    return exp(x);
  }

  DriveLimits<dof, Scalar> limits_;
  Condition<Scalar> heats_ = false;
  bool any_heats_ = false;
  bool limits_force_ = false;
  bool limits_torque_ = false;
  Scalar warming_ = 0.0;
  Scalar heat_ = 0.0;
};

/// A transport delay of whole servo periods: the same for a value, or (Periods a list of them) each lane's own.
template <class Value, class Periods = int, int longest = 65>
class Delay {
 public:
  Delay() = default;
  /// `periods` in [0, longest - 1]; `initial` is what comes out before the first value arrives.
  Delay(const Periods& periods, const Value& initial) : periods_(periods) {
    line_.fill(initial);
    if constexpr (!std::is_same_v<Periods, int>) {
      for (int& p : periods_) longest_ = std::max(longest_, p = std::clamp(p, 0, longest - 1));
      for (const int p : periods_) alike_ = alike_ && p == longest_;
    } else {
      longest_ = std::clamp(periods, 0, longest - 1);
    }
  }

  /// Puts `value` in, takes out what went in `periods` calls ago.
  Value pass(const Value& value) noexcept {
    const int newest = position_;
    line_[static_cast<std::size_t>(newest)] = value;
    position_ = position_ < longest_ ? position_ + 1 : 0;  // the oldest is the next to be overwritten
    if constexpr (!std::is_same_v<Periods, int>) {
      if (!alike_) {
        Value out = value;
        for (std::size_t lane = 0; lane < periods_.size(); ++lane) {
          const int age = newest - periods_[lane];
          const Value& then = line_[static_cast<std::size_t>(age >= 0 ? age : age + longest_ + 1)];
          for (Eigen::Index i = 0; i < out.size(); ++i) out[i].set(static_cast<int>(lane), then[i][static_cast<int>(lane)]);
        }
        return out;
      }
    }
    return line_[static_cast<std::size_t>(position_)];
  }

 private:
  Periods periods_{};
  int longest_ = 0;
  bool alike_ = true;
  int position_ = 0;
  std::array<Value, longest> line_{};
};

}  // namespace palpate
