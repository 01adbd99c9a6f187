#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::actuation {

/// Encoders, which quantize the joint angles to whole counts.
template <int dof, class Scalar = double>
struct Encoder {
  Joints<dof, Scalar> step = Joints<dof, Scalar>::Constant(0.0);  ///< rad per count; 0: not quantized

  /// Whether no joint is quantized.
  [[nodiscard]] bool exact() const noexcept {
    bool out = true;
    for (int i = 0; i < dof; ++i) out = out && !any(step[i] > Scalar(0.0));
    return out;
  }

  /// Copy the encoders of one loop into a lane.
  void set_lane(int lane, const Encoder<dof>& one) { math::set_lane(step, lane, one.step); }

  /// Return the measured angles [rad] of the true angles `q` [rad].
  [[nodiscard]] Joints<dof, Scalar> read(const Joints<dof, Scalar>& q) const noexcept {
    Joints<dof, Scalar> measured = q;
    for (int i = 0; i < dof; ++i) {
      const auto quantized = step[i] > Scalar(0.0);
      if (any(quantized)) measured[i] = select(quantized, round_to_even(q[i] / step[i]) * step[i], q[i]);
    }
    return measured;
  }
};

}  // namespace palpate::actuation
