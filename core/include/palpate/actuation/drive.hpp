#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::actuation {

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

  /// Puts one loop's encoders into a lane.
  void set_lane(int lane, const Encoder<dof>& one) { math::set_lane(step, lane, one.step); }

  [[nodiscard]] Joints<dof, Scalar> read(const Joints<dof, Scalar>& q) const noexcept {
    Joints<dof, Scalar> counted = q;
    for (int i = 0; i < dof; ++i) {
      const auto counts = step[i] > Scalar(0.0);
      if (any(counts)) counted[i] = select(counts, round_to_even(q[i] / step[i]) * step[i], q[i]);
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

  /// Puts one loop's limits into a lane.
  void set_lane(int lane, const DriveLimits<dof>& one) {
    using math::set_lane;
    set_lane(peak_force, lane, one.peak_force);
    set_lane(continuous_force, lane, one.continuous_force);
    set_lane(thermal_time, lane, one.thermal_time);
    set_lane(peak_torque, lane, one.peak_torque);
  }
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
        heats_(is_finite(limits.continuous_force)),
        any_heats_(any(heats_)),
        limits_force_(any_heats_ || any(is_finite(limits.peak_force))),
        warming_(1.0 - exponential(-period / limits.thermal_time)) {
    for (int i = 0; i < dof; ++i) limits_torque_ = limits_torque_ || any(is_finite(limits.peak_torque[i]));
  }

  /// Whether it has any.
  [[nodiscard]] bool limits() const noexcept { return limits_force_ || limits_torque_; }

  /// The tip force [N] that the motors will give when `wanted` is asked for.
  Vector3<Scalar> limit_force(const Vector3<Scalar>& wanted) noexcept {
    if (!limits_force_) return wanted;
    const Scalar size = wanted.norm();
    Scalar limit = limits_.peak_force;
    if (any_heats_) {
      const Scalar& rating = limits_.continuous_force;
      const Scalar left = min_of(max_of((1.0 - heat_) / 0.1, Scalar(0.0)), Scalar(1.0));
      const Scalar faded = rating + left * max_of(Scalar(0.0), min_of(limit, Scalar(1e300)) - rating);
      limit = select(heats_, min_of(limit, faded), limit);
      const Scalar load = min_of(size, limit) / rating;
      heat_ = select(heats_, heat_ + warming_ * (load * load - heat_), heat_);
    }
    const auto too_much = size > limit;
    if (!any(too_much)) return wanted;
    return select_each(too_much, Vector3<Scalar>(wanted * (limit / size)), wanted);
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
      part = select((size > limits_.peak_torque[i]) & (possible < part), possible, part);
    }
    return part;
  }

  /// Heat of the windings: 1 is what the continuous force keeps up.
  [[nodiscard]] const Scalar& heat() const { return heat_; }

  /// Return to cold windings.
  void reset() noexcept { heat_ = 0.0; }

  /// Puts one loop's drive into a lane.
  void set_lane(int lane, const Drive<dof>& one) {
    using math::set_lane;
    limits_.set_lane(lane, one.limits_);
    set_lane(heats_, lane, one.heats_);
    any_heats_ = any_heats_ || one.any_heats_;
    limits_force_ = limits_force_ || one.limits_force_;
    limits_torque_ = limits_torque_ || one.limits_torque_;
    set_lane(warming_, lane, one.warming_);
    set_lane(heat_, lane, one.heat_);
  }

 private:
  template <int, class>
  friend class Drive;

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

/// A transport delay of whole servo periods.
template <class Value, int longest = 65>
class Delay {
 public:
  Delay() = default;
  /// `periods` in [0, longest - 1]; `initial` is what comes out before the first value arrives.
  Delay(int periods, const Value& initial) : periods_(std::clamp(periods, 0, longest - 1)), initial_(initial) { line_.fill(initial); }

  /// Puts `value` in, takes out what went in `periods` calls ago.
  Value pass(const Value& value) noexcept {
    line_[static_cast<std::size_t>(position_)] = value;
    position_ = position_ < periods_ ? position_ + 1 : 0;  // the oldest is the next to be overwritten
    return line_[static_cast<std::size_t>(position_)];
  }

  /// Return to `initial` in every place.
  void reset(const Value& initial) noexcept {
    initial_ = initial;
    line_.fill(initial);
    position_ = 0;
  }

  [[nodiscard]] int periods() const { return periods_; }
  [[nodiscard]] const Value& initial() const { return initial_; }

 private:
  int periods_ = 0;
  int position_ = 0;
  Value initial_{};
  std::array<Value, longest> line_{};
};

/// Delays side by side, each lane its own: a ring of everything that went in, read at each lane's age.
template <class Value, int lanes, int longest = 65>
class Delays {
 public:
  /// Puts one loop's delay, at its beginning, into a lane.
  template <class One>
  void set_lane(int lane, const Delay<One, longest>& one) {
    periods_[static_cast<std::size_t>(lane)] = one.periods();
    for (Value& value : line_) math::set_lane(value, lane, one.initial());
    alike_ = std::all_of(periods_.begin(), periods_.end(), [this](int p) { return p == periods_[0]; });
  }

  Value pass(const Value& value) noexcept {
    if (alike_ && periods_[0] == 0) return value;
    const int newest = position_;
    line_[static_cast<std::size_t>(newest)] = value;
    position_ = position_ < longest - 1 ? position_ + 1 : 0;
    if (alike_) return line_[static_cast<std::size_t>(place(newest - periods_[0]))];
    Value out = value;
    for (int lane = 0; lane < lanes; ++lane) {
      const Value& then = line_[static_cast<std::size_t>(place(newest - periods_[static_cast<std::size_t>(lane)]))];
      for (Eigen::Index i = 0; i < out.size(); ++i) out[i].set(lane, then[i][lane]);
    }
    return out;
  }

 private:
  static int place(int at) { return at < 0 ? at + longest : at; }

  std::array<int, lanes> periods_{};
  bool alike_ = true;
  int position_ = 0;
  std::array<Value, longest> line_{};
};

/// The delay of one loop, or of several side by side.
template <class Value, class Scalar>
struct DelayOf {
  using Type = Delay<Value>;
};
template <class Value, int lanes>
struct DelayOf<Value, Pack<lanes>> {
  using Type = Delays<Value, lanes>;
};

}  // namespace palpate::actuation
