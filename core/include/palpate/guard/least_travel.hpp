#pragma once

#include <algorithm>

namespace palpate::guard {

/// Least length of the path of a joint that is measured in counts.
///
/// Every position lies within half a count of its measurement. The shortest path through these intervals follows the last position as long
/// as it stays inside, and otherwise moves to the nearest end (the play operator of hysteresis). With exact measurements it is the sum of
/// |q_k - q_{k-1}|.
class LeastTravel {
 public:
  LeastTravel() = default;
  /// @param half_count  largest error of a measurement, rad
  explicit LeastTravel(double half_count) : half_count_(half_count) {}

  /// Return by how much the least length grows with the measurement `q` [rad].
  double move(double q) noexcept {
    const double low = q - half_count_, high = q + half_count_;
    if (!started_) {
      started_ = true;
      low_ = low;
      high_ = high;
      return 0.0;
    }
    if (low > high_) {
      const double way = low - high_;
      low_ = high_ = low;
      return way;
    }
    if (high < low_) {
      const double way = low_ - high;
      low_ = high_ = high;
      return way;
    }
    low_ = std::max(low_, low);  // the path may still begin anywhere in the interval
    high_ = std::min(high_, high);
    return 0.0;
  }

  void reset() noexcept { started_ = false; }

 private:
  double half_count_ = 0.0;
  double low_ = 0.0, high_ = 0.0;  // ends of the shortest paths so far
  bool started_ = false;
};

}  // namespace palpate::guard
