#pragma once

#include <cmath>
#include <cstdint>

#include "palpate/math/select.hpp"

namespace palpate::deformable {

/// Force of a spring by its strain e = (l - l0) / l0: k l0 p(e), odd in e, with p'(0) = 1.
///   linear       p = e
///   cubic        p = e + e^3 / e0^2       (Duffing): twice the linear force at the strain e0
///   exponential  p = (exp(b e) - 1) / b   (Fung 1967), for e > 0: hardening for b > 0, softening for b < 0
/// p' is the ratio of the tangent stiffness to k. Where it reaches its limit r (softening: 1 / r), the law continues with that slope, so
/// the stiffness of a spring never exceeds max(1, r) k, at any deformation.
struct SpringLaw {
  enum class Kind : std::uint8_t { linear, cubic, exponential };

  Kind kind = Kind::linear;
  double parameter = 1.0;  ///< cubic: the strain e0; exponential: the exponent b
  double limit = 1.0;      ///< r, from 1 to 100

  /// Largest ratio of the tangent stiffness to k.
  [[nodiscard]] double stiffness_bound() const noexcept {
    return kind == Kind::linear || (kind == Kind::exponential && parameter < 0.0) ? 1.0 : limit;
  }
};

namespace detail {

/// A SpringLaw with the numbers of its evaluation, of one kind.
template <SpringLaw::Kind kind>
struct SpringLawKernel {
  double factor = 0.0;  // cubic: 1 / e0^2; exponential: b
  double knee = 0.0;    // strain from which on the law is a line
  double slope = 1.0;   // of that line

  explicit SpringLawKernel(const SpringLaw& law) noexcept {
    if constexpr (kind == SpringLaw::Kind::cubic) {
      factor = 1.0 / (law.parameter * law.parameter);
      knee = law.parameter * std::sqrt((law.limit - 1.0) / 3.0);
      slope = law.limit;
    } else if constexpr (kind == SpringLaw::Kind::exponential) {
      factor = law.parameter;
      knee = std::log(law.limit) / std::abs(law.parameter);
      slope = law.parameter > 0.0 ? law.limit : 1.0 / law.limit;
    }
  }

  /// Compute p and its integral over the strain, from zero.
  template <class Scalar>
  [[gnu::always_inline]] void evaluate(const Scalar& strain, Scalar& force, Scalar& energy) const noexcept {
    const Scalar zero = 0.0, end = knee;
    const auto negative = strain < zero;
    const Scalar magnitude = select(negative, Scalar(-strain), strain);
    const Scalar m = select(magnitude < end, magnitude, end), beyond = magnitude - m, squared = m * m;
    if constexpr (kind == SpringLaw::Kind::cubic) {
      const Scalar stiffening = factor * squared;
      force = m * (1.0 + stiffening);
      energy = squared * (0.5 + 0.25 * stiffening);
    } else {
      const auto [first, second] = exponential_integrals(Scalar(factor * m));
      force = m * first;
      energy = squared * second;
    }
    energy += beyond * (force + (0.5 * slope) * beyond);
    force += slope * beyond;
    force = select(negative, Scalar(-force), force);
  }

 private:
  template <class Scalar>
  struct Integrals {
    Scalar first, second;
  };

  /// Return (e^x - 1) / x and (e^x - 1 - x) / x^2 for |x| <= ln(100), to rounding: the series at x / 8, and three doublings.
  template <class Scalar>
  [[gnu::always_inline]] static Integrals<Scalar> exponential_integrals(const Scalar& x) noexcept {
    const Scalar y = 0.125 * x;
    Scalar second = 1.0 / 1307674368000.0;  // 1 / 15!
    double denominator = 15.0;
    double coefficient = 1.0 / 1307674368000.0;
    for (int n = 12; n >= 0; --n) {
      coefficient *= denominator;
      denominator -= 1.0;
      second = second * y + coefficient;
    }
    Scalar first = 1.0 + y * second;
    Scalar at = y;
    for (int doubling = 0; doubling < 3; ++doubling) {
      second = 0.5 * second + 0.25 * (first * first);
      first = first * (1.0 + 0.5 * (at * first));
      at = at + at;
    }
    return {first, second};
  }
};

}  // namespace detail

}  // namespace palpate::deformable
