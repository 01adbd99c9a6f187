#pragma once

#include <cmath>

namespace palpate::mesh {

/// Dry and viscous friction of a proxy. The tip drags the proxy by a spring across the surface; the proxy holds while the spring is
/// inside the cone, and once it slides it stops where the spring equals the sliding friction:
///
///   k_t lag = mu_d k_n depth + b (way distance) / T.
struct FrictionCone {
  double mu_static = 0.0;   ///< lag over depth up to which a resting proxy holds: mu_s k_n / k_t
  double mu_dynamic = 0.0;  ///< lag over depth at which a sliding proxy stops: mu_d k_n / k_t
  double drag = 0.0;        ///< b / (T k_t)

  /// Lag [m] that is remaining after sliding from `lag`, when the proxy is `depth` [m] from the tip and has distance `distance` [m] in this
  /// tick.
  [[nodiscard]] double remaining_lag(double lag, double depth, double distance, bool sliding) const noexcept {
    const double coefficient = sliding ? mu_dynamic : mu_static;
    const double dry = coefficient > 0.0 ? coefficient * depth : 0.0;  // infinity * 0 is no friction
    if (!(lag > dry)) return lag;
    const double after = mu_dynamic > 0.0 ? mu_dynamic * depth : 0.0;
    const double remaining = (after + drag * (distance + lag)) / (1.0 + drag);
    return remaining < lag ? remaining : lag;
  }
};

/// How far a proxy has distance in one tick. It counts as sliding only from a length on that rounding cannot make: which friction holds
/// must not be chosen by the last bits.
struct SlidingState {
  bool was_sliding = false;  // it distance in the last tick
  double distance = 0.0;     // in this tick, m
  double threshold = 0.0;    // m

  [[nodiscard]] bool sliding() const noexcept { return was_sliding || distance > threshold; }
};

}  // namespace palpate::mesh
