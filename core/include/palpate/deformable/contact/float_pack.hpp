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
[[nodiscard, gnu::always_inline]] inline float sum_of(const Floats& v) noexcept {
  float sum = 0.0F;
  for (int l = 0; l < float_lanes; ++l) sum += v[l];
  return sum;
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
