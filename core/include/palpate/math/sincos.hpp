#pragma once

#include <cmath>
#include <cstdint>

#include "palpate/math/check_compiler.hpp"

namespace palpate::math {

/// Sine and cosine of one angle.
template <class Scalar>
struct SineCosine {
  Scalar sine;
  Scalar cosine;
};

namespace detail {

/// Subtract `quadrants` * pi/2 from the angle (Cody-Waite reduction). pi/2 is split into 33 + 33 +
/// 53 bits, which makes the products exact up to 2^20 quadrants.
template <class Scalar>
[[gnu::always_inline]] inline Scalar reduce_quadrants(const Scalar& angle, const Scalar& quadrants) noexcept {
  return ((angle - quadrants * 0x1.921fb544p+0) - quadrants * 0x1.0b4611a6p-34) - quadrants * 0x1.3198a2e037073p-69;
}

/// Chebyshev approximation in r^2 on [-pi/4, pi/4]. Approximation error: 2e-17 (sine), 1e-18
/// (cosine).
template <class Scalar>
[[gnu::always_inline]] inline SineCosine<Scalar> sincos_near_zero(const Scalar& r) noexcept {
  // Estrin's scheme instead of Horner's: latency depends on the longest dependency chain.
  const Scalar u = r * r;
  const Scalar u2 = u * u;
  const Scalar u4 = u2 * u2;
  const Scalar sine_tail = (-0.16666666666666664611 + u * 0.0083333333333309365507) +
                           u2 * (-0.00019841269836740527586 + u * 2.7557316093196064354e-6) +
                           u4 * (-2.5051129895962806497e-8 + u * 1.5917988944318715217e-10);
  const Scalar cosine_tail = (0.041666666666666665381 + u * -0.0013888888888887389771) +
                             u2 * (0.000024801587298754398347 + u * -2.7557317265876615658e-7) +
                             u4 * (2.0876145049108280391e-9 + u * -1.1382544623404290303e-11);
  // Compensate the rounding error of 1 - u/2.
  const Scalar half = 0.5 * u;
  const Scalar leading = 1.0 - half;
  return {r + r * u * sine_tail, leading + (((1.0 - leading) - half) + u * u * cosine_tail)};
}

}  // namespace detail

/// Return sine and cosine of an angle [rad].
///
/// Error: at most 1 ulp for |angle| <= 1e3 rad and 2 ulp up to 1e5 rad. The C library computes
/// larger and non-finite angles.
///
/// std::sin is not used because it cannot be inlined, g++ does not vectorize it, and the dynamics
/// of the arm spend most of their time in it.
[[gnu::always_inline]] inline SineCosine<double> sincos(double angle) noexcept {
  if (!(std::abs(angle) <= 1e5)) return {std::sin(angle), std::cos(angle)};
  constexpr double two_over_pi = 0.63661977236758134308;
  // Adding and subtracting 1.5 * 2^52 rounds to the nearest integer (ties to even).
  constexpr double round_to_integer = 6755399441055744.0;
  const double quadrants = (angle * two_over_pi + round_to_integer) - round_to_integer;
  const auto quadrant = static_cast<std::int64_t>(quadrants);
  const auto [sine, cosine] = detail::sincos_near_zero(detail::reduce_quadrants(angle, quadrants));
  const bool swap = (quadrant & 1) != 0;
  const double s = swap ? cosine : sine;
  const double c = swap ? sine : cosine;
  return {(quadrant & 2) != 0 ? -s : s, ((quadrant + 1) & 2) != 0 ? -c : c};
}

/// Largest rotation that `rotate_small` accepts [rad].
constexpr double max_small_rotation = 1.0 / 32.0;

/// Return sine and cosine of the angle of `from` plus `rotation` [rad].
///
/// Requires |rotation| <= max_small_rotation. Addition theorem with Taylor series truncated where
/// the next term is below 3e-18; absolute error at most 2 ulp of 1. Costs a third of `sincos`. Do
/// not chain calls: the errors accumulate.
template <class Scalar>
[[gnu::always_inline]] inline SineCosine<Scalar> rotate_small(const SineCosine<Scalar>& from, const Scalar& rotation) noexcept {
  const Scalar u = rotation * rotation;
  const Scalar u2 = u * u;
  const Scalar sine = rotation * ((1.0 - u * (1.0 / 6.0)) + u2 * ((1.0 / 120.0) - u * (1.0 / 5040.0)));
  const Scalar cosine_less_one = u * ((u * (1.0 / 24.0) - 0.5) + u2 * (u * (1.0 / 40320.0) - (1.0 / 720.0)));
  return {from.sine + (from.sine * cosine_less_one + from.cosine * sine), from.cosine + (from.cosine * cosine_less_one - from.sine * sine)};
}

/// Largest rotation that `rotate_medium` accepts [rad].
constexpr double max_medium_rotation = 1.0 / 8.0;

/// Like `rotate_small`, for |rotation| <= max_medium_rotation. Costs half of `sincos`.
template <class Scalar>
[[gnu::always_inline]] inline SineCosine<Scalar> rotate_medium(const SineCosine<Scalar>& from, const Scalar& rotation) noexcept {
  const Scalar u = rotation * rotation;
  const Scalar u2 = u * u;
  const Scalar sine = rotation * ((1.0 - u * (1.0 / 6.0)) + u2 * (((1.0 / 120.0) - u * (1.0 / 5040.0)) + u2 * (1.0 / 362880.0)));
  const Scalar cosine_less_one = u * ((u * (1.0 / 24.0) - 0.5) + u2 * ((u * (1.0 / 40320.0) - (1.0 / 720.0)) - u2 * (1.0 / 3628800.0)));
  return {from.sine + (from.sine * cosine_less_one + from.cosine * sine), from.cosine + (from.cosine * cosine_less_one - from.sine * sine)};
}

}  // namespace palpate::math

namespace palpate {
using namespace math;  // shared vocabulary of all folders
}
