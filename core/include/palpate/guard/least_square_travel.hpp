#pragma once

#include <algorithm>
#include <cmath>

namespace palpate::guard {

/// Least sum of squared motions per tick of a joint that is measured in counts, to which viscous dissipation is proportional.
///
/// Over n ticks with the measured way D, the true motions have a sum of squares of at least (|D| - 2r)^2/n, where r is half a count. A
/// window ends when this bound falls, as after a turning point, or after the most ticks; its largest bound counts. With exact measurements
/// a window is one tick, and the sum is exact.
class LeastSquareTravel {
 public:
  static constexpr int most = 32;  ///< ticks of the longest window

  LeastSquareTravel() = default;
  /// @param half_count  largest error of a measurement, rad
  explicit LeastSquareTravel(double half_count) : error_(2.0 * half_count), longest_(half_count > 0.0 ? most : 1) {}

  /// Return by how much the least sum grows with the measurement `q` of the next tick [rad^2].
  double move(double q) noexcept {
    if (!started_) {
      started_ = true;
      begin(q);
      return 0.0;
    }
    const double way = std::max(0.0, std::abs(q - begin_) - error_), bound = way * way / ++ticks_;
    const double growth = std::max(0.0, bound - best_);
    best_ += growth;
    if (bound < best_ || ticks_ == longest_) begin(q);
    return growth;
  }

  void reset() noexcept { started_ = false; }

 private:
  void begin(double q) noexcept {
    begin_ = q;
    best_ = 0.0;
    ticks_ = 0;
  }

  double error_ = 0.0;
  int longest_ = 1;
  double begin_ = 0.0, best_ = 0.0;  // of the window
  int ticks_ = 0;
  bool started_ = false;
};

}  // namespace palpate::guard
