#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

// <immintrin.h> takes half a second to compile, so only where more than SSE2 is used.
#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "palpate/math/select.hpp"
#include "palpate/math/sincos.hpp"

namespace palpate::math {

namespace detail {

// Each size is spelled out, because g++ ignores a vector size that depends on a template parameter.
template <int lanes>
struct Lanes;
template <>
struct Lanes<2> {
  using Vector [[gnu::vector_size(16)]] = double;
  using Bits [[gnu::vector_size(16)]] = std::int64_t;
  using Float [[gnu::vector_size(8)]] = float;
};
template <>
struct Lanes<4> {
  using Vector [[gnu::vector_size(32)]] = double;
  using Bits [[gnu::vector_size(32)]] = std::int64_t;
  using Float [[gnu::vector_size(16)]] = float;
};
template <>
struct Lanes<8> {
  using Vector [[gnu::vector_size(64)]] = double;
  using Bits [[gnu::vector_size(64)]] = std::int64_t;
  using Float [[gnu::vector_size(32)]] = float;
};
template <>
struct Lanes<16> {
  using Vector [[gnu::vector_size(128)]] = double;
  using Bits [[gnu::vector_size(128)]] = std::int64_t;
  using Float [[gnu::vector_size(64)]] = float;
};

}  // namespace detail

/// Boolean per lane: all bits of the lane are set, or none.
template <int lanes>
struct Mask {
  using Bits = typename detail::Lanes<lanes>::Bits;
  Bits bits{};

  Mask() = default;
  Mask(Bits b) : bits(b) {}                                          // NOLINT(google-explicit-constructor): result of a vector comparison
  Mask(bool all) : bits(Bits{} - static_cast<std::int64_t>(all)) {}  // NOLINT(google-explicit-constructor): constants mix with masks

  [[nodiscard]] bool operator[](int lane) const { return bits[lane] != 0; }
  void set(int lane, bool value) { bits[lane] = value ? -1 : 0; }

  [[gnu::always_inline]] friend Mask operator&(Mask a, Mask b) { return Mask(Bits(a.bits & b.bits)); }
  [[gnu::always_inline]] friend Mask operator|(Mask a, Mask b) { return Mask(Bits(a.bits | b.bits)); }
  [[gnu::always_inline]] friend Mask operator!(Mask a) { return Mask(Bits(~a.bits)); }
};

/// SIMD scalar: one double per lane, one lane per loop of a batch.
///
/// Each lane performs the operations of a plain double in the same order. The result of a loop is
/// therefore independent of its neighboring lanes and of the number of lanes.
template <int lanes>
struct Pack {
  static constexpr int width = lanes;
  using Vector = typename detail::Lanes<lanes>::Vector;
  Vector v{};

  Pack() = default;
  [[gnu::always_inline]] Pack(double all) : v(Vector{} + all) {}  // NOLINT(google-explicit-constructor): constants mix with packs
  [[gnu::always_inline]] explicit Pack(Vector x) : v(x) {}

  [[nodiscard]] double operator[](int lane) const { return v[lane]; }
  void set(int lane, double value) { v[lane] = value; }

  [[gnu::always_inline]] Pack operator-() const { return Pack(Vector(-v)); }
  [[gnu::always_inline]] Pack& operator+=(Pack o) { return v += o.v, *this; }
  [[gnu::always_inline]] Pack& operator-=(Pack o) { return v -= o.v, *this; }
  [[gnu::always_inline]] Pack& operator*=(Pack o) { return v *= o.v, *this; }
  [[gnu::always_inline]] Pack& operator/=(Pack o) { return v /= o.v, *this; }
  [[gnu::always_inline]] friend Pack operator+(Pack a, Pack b) { return Pack(Vector(a.v + b.v)); }
  [[gnu::always_inline]] friend Pack operator-(Pack a, Pack b) { return Pack(Vector(a.v - b.v)); }
  [[gnu::always_inline]] friend Pack operator*(Pack a, Pack b) { return Pack(Vector(a.v * b.v)); }
  [[gnu::always_inline]] friend Pack operator/(Pack a, Pack b) { return Pack(Vector(a.v / b.v)); }
  [[gnu::always_inline]] friend Mask<lanes> operator<(Pack a, Pack b) { return {a.v < b.v}; }
  [[gnu::always_inline]] friend Mask<lanes> operator>(Pack a, Pack b) { return {a.v > b.v}; }
  [[gnu::always_inline]] friend Mask<lanes> operator<=(Pack a, Pack b) { return {a.v <= b.v}; }
  [[gnu::always_inline]] friend Mask<lanes> operator>=(Pack a, Pack b) { return {a.v >= b.v}; }
  [[gnu::always_inline]] friend Mask<lanes> operator==(Pack a, Pack b) { return {a.v == b.v}; }
  [[gnu::always_inline]] friend Mask<lanes> operator!=(Pack a, Pack b) { return {a.v != b.v}; }
};

template <int lanes>
struct LaneIndexOf<Pack<lanes>> {
  using Type = std::array<int, static_cast<std::size_t>(lanes)>;
};

template <int lanes>
struct SeedOf<Pack<lanes>> {
  using Type = std::array<std::uint64_t, static_cast<std::size_t>(lanes)>;
};

template <int lanes>
[[gnu::always_inline]] inline bool any(const Mask<lanes>& mask) {
#if defined(__AVX512F__)
  if constexpr (lanes == 8) return _mm512_test_epi64_mask(__m512i(mask.bits), __m512i(mask.bits)) != 0;
#endif
#if defined(__AVX__)
  if constexpr (lanes == 4) return _mm256_movemask_pd(__m256d(mask.bits)) != 0;
#endif
#if defined(__SSE2__)
  if constexpr (lanes == 2) return _mm_movemask_pd(__m128d(mask.bits)) != 0;
#endif
  std::int64_t combined = 0;
  for (int i = 0; i < lanes; ++i) combined |= mask.bits[i];
  return combined != 0;
}

template <int lanes>
[[gnu::always_inline]] inline bool all(const Mask<lanes>& mask) {
  return !any(!mask);
}

template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> select(const Mask<lanes>& mask, const Pack<lanes>& yes, const Pack<lanes>& no) {
  return Pack<lanes>(mask.bits ? yes.v : no.v);
}

/// Store the number, condition or vector of one loop in a lane.
template <int lanes>
[[gnu::always_inline]] inline void set_lane(Pack<lanes>& pack, int lane, double one) {
  pack.set(lane, one);
}
template <int lanes>
[[gnu::always_inline]] inline void set_lane(Mask<lanes>& mask, int lane, bool one) {
  mask.set(lane, one);
}
template <class Value, std::size_t lanes>
[[gnu::always_inline]] inline void set_lane(std::array<Value, lanes>& values, int lane, const Value& one) {
  values[static_cast<std::size_t>(lane)] = one;
}
template <int lanes, int rows, int columns>
[[gnu::always_inline]] inline void set_lane(Eigen::Matrix<Pack<lanes>, rows, columns>& packs, int lane,
                                            const Eigen::Matrix<double, rows, columns>& one) {
  for (int i = 0; i < rows * columns; ++i) packs.data()[i].set(lane, one.data()[i]);
}

template <int lanes>
[[gnu::always_inline]] inline void set_lane(SineCosine<Pack<lanes>>& packs, int lane, const SineCosine<double>& one) {
  set_lane(packs.sine, lane, one.sine);
  set_lane(packs.cosine, lane, one.cosine);
}

/// Apply a scalar function to each lane separately. Slow; for rare operations.
template <int lanes, class Function>
Pack<lanes> map_lanes(const Pack<lanes>& x, const Function& function) {
  Pack<lanes> y;
  for (int i = 0; i < lanes; ++i) y.set(i, function(x[i]));
  return y;
}

template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> abs(const Pack<lanes>& x) {
  using Bits = typename Mask<lanes>::Bits;
  return Pack<lanes>(typename Pack<lanes>::Vector(Bits(x.v) & (Bits{} + INT64_MAX)));
}

template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> sqrt(const Pack<lanes>& x) {
#if defined(__AVX512F__)
  if constexpr (lanes == 8) return Pack<lanes>(_mm512_maskz_sqrt_pd(0xff, x.v));  // the unmasked intrinsic causes a false warning in g++ 12
#endif
#if defined(__AVX__)
  if constexpr (lanes == 4) return Pack<lanes>(_mm256_sqrt_pd(x.v));
#endif
#if defined(__SSE2__)
  if constexpr (lanes == 2) return Pack<lanes>(_mm_sqrt_pd(x.v));
#endif
  return map_lanes(x, [](double one) { return std::sqrt(one); });
}

template <int lanes>
Pack<lanes> exp(const Pack<lanes>& x) {
  return map_lanes(x, [](double one) { return std::exp(one); });
}

/// Round to the nearest integer, ties to even, like std::nearbyint in the default rounding mode.
template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> round_to_even(const Pack<lanes>& x) {
  const Pack<lanes> round_to_integer(6755399441055744.0);  // 1.5 * 2^52
  const Pack<lanes> rounded = (x + round_to_integer) - round_to_integer;
  return select(abs(x) < Pack<lanes>(2251799813685248.0), rounded, x);
}

template <int lanes>
[[gnu::always_inline]] inline Mask<lanes> is_finite(const Pack<lanes>& x) {
  return abs(x) <= Pack<lanes>(1.7976931348623157e308);
}

/// Store all lanes in single precision.
template <int lanes>
[[gnu::always_inline]] inline void store_float(const Pack<lanes>& x, float* to) {
  const auto narrow = __builtin_convertvector(x.v, typename detail::Lanes<lanes>::Float);
  std::memcpy(to, &narrow, sizeof narrow);
}

/// Return table[index] for each lane. `index` holds integers >= 0.
template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> gather(const double* table, const Pack<lanes>& index) {
  using Bits = typename Mask<lanes>::Bits;
  // The lowest bits of 2^52 + index contain the integer.
  const Bits at = Bits((index + Pack<lanes>(4503599627370496.0)).v) & 0xfffffffffffffLL;
#if defined(__AVX512F__)
  if constexpr (lanes == 8) return Pack<lanes>(_mm512_mask_i64gather_pd(_mm512_setzero_pd(), 0xff, __m512i(at), table, 8));
#endif
#if defined(__AVX2__)
  if constexpr (lanes == 4) return Pack<lanes>(_mm256_i64gather_pd(table, __m256i(at), 8));
#endif
  Pack<lanes> out;
  for (int i = 0; i < lanes; ++i) out.set(i, table[at[i]]);
  return out;
}

/// Return whether the bit `weight` of integer + shift is set.
template <int lanes>
[[gnu::always_inline]] inline Mask<lanes> test_bit(const Pack<lanes>& integer, double shift, std::int64_t weight) {
  // The lowest bits of 1.5 * 2^52 + integer contain the integer in two's complement.
  using Bits = typename Mask<lanes>::Bits;
  const Bits low = Bits((integer + Pack<lanes>(6755399441055744.0 + shift)).v);
  return Mask<lanes>(Bits((low & weight) != 0));
}

namespace detail {

/// Replace the lanes outside the accurate range by the result of the C library.
template <int lanes>
[[gnu::noinline, gnu::cold]] void sincos_library(const Pack<lanes>& angle, const Mask<lanes>& outside,
                                                 SineCosine<Pack<lanes>>& out) noexcept {
  for (int i = 0; i < lanes; ++i) {
    if (!outside[i]) continue;
    out.sine.set(i, std::sin(angle[i]));
    out.cosine.set(i, std::cos(angle[i]));
  }
}

}  // namespace detail

/// Return sine and cosine of each lane [rad]; the C library computes lanes beyond 1e5 rad and
/// non-finite lanes.
template <int lanes>
[[gnu::always_inline]] inline SineCosine<Pack<lanes>> sincos(const Pack<lanes>& angle) noexcept {
  const Pack<lanes> two_over_pi(0.63661977236758134308);
  const Pack<lanes> round_to_integer(6755399441055744.0);
  const Pack<lanes> quadrants = (angle * two_over_pi + round_to_integer) - round_to_integer;
  const SineCosine<Pack<lanes>> near_zero = detail::sincos_near_zero(detail::reduce_quadrants(angle, quadrants));
  const Mask<lanes> swap = test_bit(quadrants, 0.0, 1);
  const Pack<lanes> s = select(swap, near_zero.cosine, near_zero.sine);
  const Pack<lanes> c = select(swap, near_zero.sine, near_zero.cosine);
  SineCosine<Pack<lanes>> out{select(test_bit(quadrants, 0.0, 2), -s, s), select(test_bit(quadrants, 1.0, 2), -c, c)};
  const Mask<lanes> outside = !(abs(angle) <= Pack<lanes>(1e5));
  if (any(outside)) [[unlikely]]
    detail::sincos_library(angle, outside, out);
  return out;
}

template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> sin(const Pack<lanes>& angle) noexcept {
  return sincos(angle).sine;
}

template <int lanes>
[[gnu::always_inline]] inline Pack<lanes> cos(const Pack<lanes>& angle) noexcept {
  return sincos(angle).cosine;
}

template <int lanes>
Pack<lanes> atan2(const Pack<lanes>& y, const Pack<lanes>& x) {
  Pack<lanes> angle;
  for (int i = 0; i < lanes; ++i) angle.set(i, std::atan2(y[i], x[i]));
  return angle;
}

}  // namespace palpate::math

namespace Eigen {
template <int lanes>
struct NumTraits<palpate::math::Pack<lanes>> : NumTraits<double> {
  using Real = palpate::math::Pack<lanes>;
  using NonInteger = palpate::math::Pack<lanes>;
  using Nested = palpate::math::Pack<lanes>;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 0, ReadCost = 1, AddCost = 1, MulCost = 1 };
};
template <int lanes, class Operation>
struct ScalarBinaryOpTraits<double, palpate::math::Pack<lanes>, Operation> {
  using ReturnType = palpate::math::Pack<lanes>;
};
template <int lanes, class Operation>
struct ScalarBinaryOpTraits<palpate::math::Pack<lanes>, double, Operation> {
  using ReturnType = palpate::math::Pack<lanes>;
};
}  // namespace Eigen
