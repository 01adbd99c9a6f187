#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::actuation {

/// Transport delay of a whole number of servo periods.
template <class Value, int max_length = 65>
class Delay {
 public:
  Delay() = default;
  /// @param periods  0 to max_length - 1
  /// @param initial  output before the first input arrives
  Delay(int periods, const Value& initial) : periods_(std::clamp(periods, 0, max_length - 1)), initial_(initial) { line_.fill(initial); }

  /// Store `value` and returns the value stored `periods` calls ago.
  Value pass(const Value& value) noexcept {
    line_[static_cast<std::size_t>(position_)] = value;
    position_ = position_ < periods_ ? position_ + 1 : 0;  // the oldest value, overwritten next
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
  std::array<Value, max_length> line_{};
};

/// Delays of several loops side by side: a ring buffer of past values, read at the delay of each lane.
template <class Value, int lanes, int max_length = 65>
class Delays {
 public:
  /// Copy the delay of one loop, before its first tick, into a lane.
  template <class One>
  void set_lane(int lane, const Delay<One, max_length>& one) {
    periods_[static_cast<std::size_t>(lane)] = one.periods();
    for (Value& value : line_) math::set_lane(value, lane, one.initial());
    all_equal_ = std::all_of(periods_.begin(), periods_.end(), [this](int p) { return p == periods_[0]; });
  }

  Value pass(const Value& value) noexcept {
    if (all_equal_ && periods_[0] == 0) return value;
    const int newest = position_;
    line_[static_cast<std::size_t>(newest)] = value;
    position_ = position_ < max_length - 1 ? position_ + 1 : 0;
    if (all_equal_) return line_[static_cast<std::size_t>(wrap(newest - periods_[0]))];
    Value out = value;
    for (int lane = 0; lane < lanes; ++lane) {
      const Value& delayed = line_[static_cast<std::size_t>(wrap(newest - periods_[static_cast<std::size_t>(lane)]))];
      for (Eigen::Index i = 0; i < out.size(); ++i) out[i].set(lane, delayed[i][lane]);
    }
    return out;
  }

 private:
  static int wrap(int index) { return index < 0 ? index + max_length : index; }

  std::array<int, lanes> periods_{};
  bool all_equal_ = true;
  int position_ = 0;
  std::array<Value, max_length> line_{};
};

/// Delay of one loop, or of several side by side.
template <class Value, class Scalar>
struct DelayOf {
  using Type = Delay<Value>;
};
template <class Value, int lanes>
struct DelayOf<Value, Pack<lanes>> {
  using Type = Delays<Value, lanes>;
};

}  // namespace palpate::actuation
