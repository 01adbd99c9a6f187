#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "palpate/math/select.hpp"

namespace palpate::deformable {

namespace detail {

/// Single-precision vector as wide as one register of the target.
#if defined(__AVX__)
constexpr int float_lanes = 8;
using Floats [[gnu::vector_size(32), gnu::may_alias]] = float;
#else
constexpr int float_lanes = 4;
using Floats [[gnu::vector_size(16), gnu::may_alias]] = float;
#endif

/// Storage of single-precision numbers, aligned to a cache line.
struct alignas(64) FloatLine {
  std::array<float, 16> value{};
};

[[nodiscard, gnu::always_inline]] inline const Floats* as_floats(const float* p) noexcept {
  return reinterpret_cast<const Floats*>(p);
}
[[nodiscard, gnu::always_inline]] inline Floats* as_floats(float* p) noexcept {
  return reinterpret_cast<Floats*>(p);
}
[[nodiscard]] constexpr int in_registers(int count) noexcept {
  return (count + float_lanes - 1) / float_lanes;
}
/// a b + c, rounded once where the target can.
[[nodiscard, gnu::always_inline]] inline Floats multiply_add(const Floats& a, const Floats& b, const Floats& c) noexcept {
#if defined(__AVX__) && defined(__FMA__)
  return Floats(_mm256_fmadd_ps(__m256(a), __m256(b), __m256(c)));
#else
  return a * b + c;
#endif
}

/// Sums of the lanes of four vectors.
[[nodiscard, gnu::always_inline]] inline std::array<float, 4> sums_of(const Floats& a, const Floats& b, const Floats& c,
                                                                      const Floats& d) noexcept {
  std::array<float, 4> sums{};
#if defined(__AVX__)
  const __m256 pairs = _mm256_hadd_ps(_mm256_hadd_ps(__m256(a), __m256(b)), _mm256_hadd_ps(__m256(c), __m256(d)));
  _mm_storeu_ps(sums.data(), _mm_add_ps(_mm256_castps256_ps128(pairs), _mm256_extractf128_ps(pairs, 1)));
#else
  for (int l = 0; l < float_lanes; ++l) {
    sums[0] += a[l];
    sums[1] += b[l];
    sums[2] += c[l];
    sums[3] += d[l];
  }
#endif
  return sums;
}

/// Sum of the lanes of a vector.
[[nodiscard, gnu::always_inline]] inline float sum_of(const Floats& v) noexcept {
#if defined(__AVX__)
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(__m256(v)), _mm256_extractf128_ps(__m256(v), 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)));
#else
  float sum = 0.0F;
  for (int l = 0; l < float_lanes; ++l) sum += v[l];
  return sum;
#endif
}

/// Largest lane of a vector.
[[nodiscard, gnu::always_inline]] inline float largest_of(const Floats& v) noexcept {
#if defined(__AVX__)
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(__m256(v)), _mm256_extractf128_ps(__m256(v), 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)));
#else
  float most = v[0];
  for (int l = 1; l < float_lanes; ++l) most = v[l] > most ? v[l] : most;
  return most;
#endif
}

/// One register of single-precision numbers as a scalar type, for formulas written once for any scalar (TipGeometry).
struct FloatPack {
  Floats v{};

  struct Mask {
    using Bits = decltype(Floats() < Floats());
    Bits bits;
    [[gnu::always_inline]] friend Mask operator&(Mask a, Mask b) { return {a.bits & b.bits}; }
  };

  FloatPack() = default;
  [[gnu::always_inline]] FloatPack(double all) : v(Floats{} + static_cast<float>(all)) {}  // NOLINT(google-explicit-constructor)
  [[gnu::always_inline]] explicit FloatPack(Floats x) : v(x) {}

  [[gnu::always_inline]] FloatPack& operator+=(FloatPack o) { return v += o.v, *this; }
  [[gnu::always_inline]] FloatPack& operator-=(FloatPack o) { return v -= o.v, *this; }
  [[gnu::always_inline]] friend FloatPack operator+(FloatPack a, FloatPack b) { return FloatPack(Floats(a.v + b.v)); }
  [[gnu::always_inline]] friend FloatPack operator-(FloatPack a, FloatPack b) { return FloatPack(Floats(a.v - b.v)); }
  [[gnu::always_inline]] friend FloatPack operator*(FloatPack a, FloatPack b) { return FloatPack(Floats(a.v * b.v)); }
  [[gnu::always_inline]] friend FloatPack operator/(FloatPack a, FloatPack b) { return FloatPack(Floats(a.v / b.v)); }
  [[gnu::always_inline]] friend bool any(Mask m) {
#if defined(__AVX__)
    return _mm256_movemask_ps(__m256(m.bits)) != 0;
#elif defined(__SSE2__)
    return _mm_movemask_ps(__m128(m.bits)) != 0;
#else
    bool set = false;
    for (int l = 0; l < float_lanes; ++l) set = set || m.bits[l] != 0;
    return set;
#endif
  }
  [[gnu::always_inline]] friend Mask operator<(FloatPack a, FloatPack b) { return {a.v < b.v}; }
  [[gnu::always_inline]] friend Mask operator>(FloatPack a, FloatPack b) { return {a.v > b.v}; }
  [[gnu::always_inline]] friend FloatPack select(Mask m, FloatPack a, FloatPack b) { return FloatPack(Floats(m.bits ? a.v : b.v)); }
  [[gnu::always_inline]] friend FloatPack sqrt(FloatPack x) {
#if defined(__AVX__)
    return FloatPack(Floats(_mm256_sqrt_ps(__m256(x.v))));
#elif defined(__SSE2__)
    return FloatPack(Floats(_mm_sqrt_ps(__m128(x.v))));
#else
    for (int l = 0; l < float_lanes; ++l) x.v[l] = std::sqrt(x.v[l]);
    return x;
#endif
  }
};

}  // namespace detail

}  // namespace palpate::deformable

namespace Eigen {
template <>
struct NumTraits<palpate::deformable::detail::FloatPack> : NumTraits<float> {
  using Real = palpate::deformable::detail::FloatPack;
  using NonInteger = palpate::deformable::detail::FloatPack;
  using Nested = palpate::deformable::detail::FloatPack;
  enum { RequireInitialization = 1 };
};
}  // namespace Eigen
