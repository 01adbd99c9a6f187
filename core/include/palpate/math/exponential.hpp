#pragma once

#include <bit>
#include <cstdint>

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"

namespace palpate::math {

namespace detail {

/// Adding this constant to an integer places the integer plus the exponent bias in the lowest bits
/// of the double.
constexpr double exponent_to_bits = 6755399441055744.0 + 1023.0;  // 1.5 * 2^52 plus the bias

[[gnu::always_inline]] inline double power_of_two(double exponent) noexcept {
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(exponent + exponent_to_bits) << 52);
}
template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> power_of_two(const Pack<lanes>& exponent) noexcept {
  using Bits = typename Mask<lanes>::Bits;
  return Pack<lanes>(typename Pack<lanes>::Vector(Bits((exponent + Pack<lanes>(exponent_to_bits)).v) << 52));
}

}  // namespace detail

/// Return e^x for x <= 0 with an error of at most 2 ulp; return 0 for x < -700 (e^-700 is about
/// 1e-304).
///
/// Inlines and vectorizes, unlike std::exp (see `sincos`).
template <class Scalar>
[[gnu::always_inline]] inline Scalar decaying_exponential(const Scalar& x) noexcept {
  const Scalar lowest = -700.0;
  const auto underflows = x < lowest;
  const Scalar y = select(underflows, lowest, x);
  const Scalar exponent = round_to_even(Scalar(y * 1.4426950408889634074));
  const Scalar r = (y - exponent * 0x1.62e42feep-1) - exponent * 0x1.a39ef35793c76p-33;  // |r| <= ln(2)/2
  // Taylor series, truncated where the next term is below 5e-18. Estrin's scheme.
  const Scalar r2 = r * r;
  const Scalar r4 = r2 * r2;
  const Scalar low = (1.0 + r) + r2 * ((1.0 / 2.0) + r * (1.0 / 6.0));
  const Scalar middle = ((1.0 / 24.0) + r * (1.0 / 120.0)) + r2 * ((1.0 / 720.0) + r * (1.0 / 5040.0));
  const Scalar high = ((1.0 / 40320.0) + r * (1.0 / 362880.0)) + r2 * ((1.0 / 3628800.0) + r * (1.0 / 39916800.0));
  const Scalar highest = (1.0 / 479001600.0) + r * (1.0 / 6227020800.0);
  const Scalar exp_r = low + r4 * (middle + r4 * (high + r4 * highest));
  return select(underflows, Scalar(0.0), exp_r * detail::power_of_two(exponent));
}

}  // namespace palpate::math
