#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace palpate::guard {

/// Velocity of one joint from counted positions, over the longest window that a straight line fits (Janabi-Sharifi, Hayward & Chen 2000,
/// first-order adaptive window, end fit).
class AdaptiveWindow {
 public:
  static constexpr int most = 16;  ///< periods of the longest window

  AdaptiveWindow() = default;
  /// @param count  encoder count, rad, which deviations from the line stay below; 0: backward difference
  AdaptiveWindow(double count, double period) : tolerance_(count * (1.0 - 1e-9)), period_(period) {}

  /// Return the velocity [rad/s] at the next sample `q` [rad].
  double velocity(double q) noexcept {
    newest_ = (newest_ + 1) % (most + 1);
    samples_[static_cast<std::size_t>(newest_)] = q;
    if (known_ <= most) ++known_;
    double slope = 0.0;  // per sample
    for (int n = 1; n < known_; ++n) {
      const double longer = (q - at(n)) / n;
      if (n > 1 && !fits(q, longer, n)) break;
      slope = longer;
    }
    return slope / period_;
  }

  void reset() noexcept { known_ = 0; }

 private:
  [[nodiscard]] double at(int samples_ago) const noexcept {
    return samples_[static_cast<std::size_t>((newest_ - samples_ago + most + 1) % (most + 1))];
  }
  /// Return whether the samples within a window lie on the line through its ends, to less than a count.
  [[nodiscard]] bool fits(double q, double slope, int window) const noexcept {
    for (int i = 1; i < window; ++i)
      if (!(std::abs(at(i) - (q - i * slope)) <= tolerance_)) return false;
    return true;
  }

  double tolerance_ = 0.0;
  double period_ = 1e-3;
  std::array<double, most + 1> samples_{};
  int newest_ = 0;
  int known_ = 0;
};

}  // namespace palpate::guard
