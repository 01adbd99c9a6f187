#pragma once

#include "palpate/guard/guard.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Parameters of a SampleEstimateHold. Plain data.
struct SampleEstimateHoldParameters {
  double correction = 1.0;  ///< share of the last estimate's error that the next force makes good, 0 to 1

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    return correction >= 0.0 && correction <= 1.0 ? nullptr : "correction must be 0 to 1";
  }
};

/// Sample-estimate-hold (Ellis, Sarkar & Jenkins 1997): hold the estimated mean of the force over the next period.
///
/// A zero-order hold applies the sampled force of a period too late by half of it, and so generates energy. The force F_k + (F_k -
/// F_{k-1})/2 has the impulse of the linear extrapolation. With a correction c, the force adds c times the error of the last estimate, the
/// difference of the trapezoid of the sampled forces and that estimate. On a spring K without correction this is a damper of K T/2 by
/// backward difference. A force never reverses the sampled one, and is zero where it is zero: outside an object nothing pulls.
template <class Mechanism>
class SampleEstimateHold {
 public:
  using Angles = math::Joints<Mechanism::dof>;

  SampleEstimateHold() = default;
  /// The parameters must have no fault().
  explicit SampleEstimateHold(const SampleEstimateHoldParameters& p) : correction_(p.correction) {}

  void prepare(const Surroundings<Mechanism>& /*s*/) noexcept { reset(); }

  /// Return the tip force [N] in place of `wanted`.
  math::Vector3<> command(const Angles& /*q*/, const math::Vector3<>& wanted, const math::Vector3<>& /*moved*/) noexcept {
    const math::Vector3<> error = 0.5 * (wanted + last_) - estimate_;
    estimate_ = 1.5 * wanted - 0.5 * last_;
    last_ = wanted;
    math::Vector3<> held = estimate_ + correction_ * error;
    if (held.dot(wanted) > 0.0) return held;
    return math::Vector3<>::Zero();
  }

  void reset() noexcept { last_ = estimate_ = math::Vector3<>::Zero(); }

 private:
  double correction_ = 1.0;
  math::Vector3<> last_ = math::Vector3<>::Zero();      // sampled force of the last tick, N
  math::Vector3<> estimate_ = math::Vector3<>::Zero();  // of the mean force since the last tick, N
};

}  // namespace palpate::guard
