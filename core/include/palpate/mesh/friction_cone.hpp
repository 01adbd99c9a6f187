#pragma once

#include <cmath>

namespace palpate::mesh {

/// Dry and viscous friction of a proxy.
///
/// A spring between tip and proxy drags the proxy over the surface. The proxy sticks while the
/// spring force is inside the friction cone. A sliding proxy stops where the spring force equals
/// the sliding friction:
///
///   k_t lag = mu_d k_n depth + b (sliding distance) / T.
struct FrictionCone {
  double mu_static = 0.0;   ///< maximum lag/depth of a sticking proxy: mu_s k_n / k_t
  double mu_dynamic = 0.0;  ///< lag/depth at which a sliding proxy stops: mu_d k_n / k_t
  double drag = 0.0;        ///< viscous term: b / (T k_t)

  /// Return the lag [m] that remains after sliding from `lag` [m] at penetration `depth` [m].
  /// `distance` [m] is the distance slid so far in this tick.
  [[nodiscard]] double remaining_lag(double lag, double depth, double distance, bool sliding) const noexcept {
    const double coefficient = sliding ? mu_dynamic : mu_static;
    const double dry = coefficient > 0.0 ? coefficient * depth : 0.0;  // infinity * 0 means no friction
    if (!(lag > dry)) return lag;
    const double after = mu_dynamic > 0.0 ? mu_dynamic * depth : 0.0;
    const double remaining = (after + drag * (distance + lag)) / (1.0 + drag);
    return remaining < lag ? remaining : lag;
  }
};

/// Sliding of a proxy in one tick.
///
/// The proxy counts as sliding above a threshold larger than rounding errors, so that rounding does
/// not choose between static and dynamic friction.
struct SlidingState {
  bool was_sliding = false;  // in the last tick
  double distance = 0.0;     // in this tick, m
  double threshold = 0.0;    // m

  [[nodiscard]] bool sliding() const noexcept { return was_sliding || distance > threshold; }
};

}  // namespace palpate::mesh
