#pragma once

#include <cmath>

namespace palpate::mesh {

/// Dry and viscous friction of a proxy. The tip drags the proxy by a spring across the surface; the proxy holds while the spring is
/// inside the cone, and once it slides it stops where the spring equals the sliding friction:
///
///   k_t lag = mu_d k_n depth + b (way slid) / T.
struct FrictionCone {
  double hold = 0.0;   ///< lag over depth up to which a resting proxy holds: mu_s k_n / k_t
  double slide = 0.0;  ///< lag over depth at which a sliding proxy stops: mu_d k_n / k_t
  double drag = 0.0;   ///< b / (T k_t)

  /// Lag [m] that is left after sliding from `lag`, when the proxy is `depth` [m] from the tip and has slid `slid` [m] in this tick.
  [[nodiscard]] double rest(double lag, double depth, double slid, bool sliding) const noexcept {
    const double coefficient = sliding ? slide : hold;
    const double dry = coefficient > 0.0 ? coefficient * depth : 0.0;  // infinity * 0 is no friction
    if (!(lag > dry)) return lag;
    const double after = slide > 0.0 ? slide * depth : 0.0;
    const double left = (after + drag * (slid + lag)) / (1.0 + drag);
    return left < lag ? left : lag;
  }
};

/// How far a proxy has slid in one tick. It counts as sliding only from a length on that rounding cannot make: which friction holds
/// must not be chosen by the last bits.
struct SlidingState {
  bool before = false;  // it slid in the last tick
  double slid = 0.0;    // in this tick, m
  double least = 0.0;   // m

  [[nodiscard]] bool sliding() const noexcept { return before || slid > least; }
};

}  // namespace palpate::mesh
