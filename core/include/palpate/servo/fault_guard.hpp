#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/math/vector.hpp"

namespace palpate::servo {

/// What a servo does with a reading that cannot be true. A reading that is not finite is never used, whatever these values are.
struct FaultLimits {
  double speed = std::numeric_limits<double>::infinity();  ///< largest joint speed that the device can have, rad/s
  double fade = 10e-3;                                     ///< time in which the torque fades to zero while readings are invalid, s
};

/// Decides which samples of a servo are valid, and which share of the torque is applied.
///
/// A sample is invalid if an angle or the reference is not finite or above largest_value, or if a joint has moved farther than the largest
/// speed allows since the last valid sample. The share falls from 1 to 0 within the fade time and rises again within eight valid samples.
template <int dof>
class FaultGuard {
 public:
  static constexpr double largest_value = 1e6;   ///< rad and N of a sample; its squares are far from overflow
  static constexpr double largest_force = 1e12;  ///< N of a command; a stable or diverging simulation stays below it

  Joints<dof> torque = Joints<dof>::Zero();  ///< of the last valid tick, N*m
  Vector3<> command = Vector3<>::Zero();     ///< of the last valid tick, N

  FaultGuard() = default;
  FaultGuard(const FaultLimits& limits, double period) noexcept
      : limits_(limits), period_(period), fall_(limits.fade > period ? period / limits.fade : 1.0), rise_(std::max(fall_, 1.0 / 8.0)) {}

  /// Return whether the angles [rad] and the reference [N] of a sample, `elapsed` [s] after the one before, are valid.
  [[nodiscard]] bool accept(const Joints<dof>& angles, const Vector3<>& reference, double elapsed) noexcept {
    since_valid_ += elapsed > 0.01 * period_ && elapsed < 1e9 ? elapsed : period_;  // a repeated sample has no elapsed time
    if (!within(angles, largest_value) || !within(reference, largest_value)) return false;
    if (has_last_ && !within(angles - last_, limits_.speed * since_valid_)) return false;
    last_ = angles;
    has_last_ = true;
    elapsed_ = since_valid_;
    since_valid_ = 0.0;
    return true;
  }

  /// Return whether a computed tip force [N] can be used.
  [[nodiscard]] static bool usable(const Vector3<>& force) noexcept { return within(force, largest_force); }

  /// Count an invalid sample. Return the share of the last valid torque to apply.
  double fall() noexcept {
    ++faults_;
    return share_ = std::max(0.0, share_ - fall_);
  }
  /// Return the share of the torque to apply at a valid sample.
  double rise() noexcept { return share_ = std::min(1.0, share_ + rise_); }

  [[nodiscard]] double elapsed() const noexcept { return elapsed_; }  ///< between the last two valid samples, s
  [[nodiscard]] std::int64_t faults() const noexcept { return faults_; }
  [[nodiscard]] bool full() const noexcept { return share_ == 1.0; }

  /// Forget the last sample and the faults.
  void reset() noexcept { *this = FaultGuard(limits_, period_); }

 private:
  template <class Vector>
  static bool within(const Vector& values, double limit) noexcept {
    for (Eigen::Index i = 0; i < values.size(); ++i)
      if (!(std::abs(values[i]) <= limit)) return false;  // a value that is not a number fails every comparison
    return true;
  }

  FaultLimits limits_;
  double period_ = 1e-3;
  double fall_ = 1.0;
  double rise_ = 1.0;
  double share_ = 1.0;
  double since_valid_ = 0.0;
  double elapsed_ = 1e-3;
  std::int64_t faults_ = 0;
  bool has_last_ = false;
  Joints<dof> last_ = Joints<dof>::Zero();
};

}  // namespace palpate::servo
