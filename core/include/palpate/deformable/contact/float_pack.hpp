#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "palpate/math/select.hpp"

namespace palpate::deformable {

namespace detail {

constexpr int float_lanes = 8;  ///< of a FloatPack, on every target

/// Storage of single-precision numbers, aligned to a cache line.
struct alignas(64) FloatLine {
  std::array<float, 16> value{};
};

/// Number of packs that hold `count` numbers.
[[nodiscard]] constexpr int in_packs(int count) noexcept {
  return (count + float_lanes - 1) / float_lanes;
}

/// Eight single-precision numbers, in one register with AVX and in two without. Products and sums are rounded separately, and the lanes
/// are added in one order: the same numbers give the same bits on every target. A scalar type for formulas written once for any scalar.
struct [[gnu::may_alias]] FloatPack {
  using Four [[gnu::vector_size(16), gnu::may_alias]] = float;
#if defined(__AVX__)
  using Register [[gnu::vector_size(32), gnu::may_alias]] = float;
#else
  using Register = Four;
#endif
  static constexpr std::size_t width = sizeof(Register) / sizeof(float), registers = 8 / width;

  Register part[registers];

  struct Mask {
    using Bits = decltype(Register() < Register());
    Bits part[registers];

    [[gnu::always_inline]] friend Mask operator&(Mask a, const Mask& b) {
      for (std::size_t i = 0; i < registers; ++i) a.part[i] &= b.part[i];
      return a;
    }
    [[nodiscard, gnu::always_inline]] friend bool any(const Mask& m) {
#if defined(__AVX__)
      return _mm256_movemask_ps(__m256(m.part[0])) != 0;
#elif defined(__SSE2__)
      return _mm_movemask_ps(__m128(m.part[0] | m.part[1])) != 0;
#else
      bool set = false;
      for (const Bits& bits : m.part)
        for (std::size_t l = 0; l < width; ++l) set = set || bits[l] != 0;
      return set;
#endif
    }
  };

  [[gnu::always_inline]] FloatPack() : FloatPack(0.0) {}
  [[gnu::always_inline]] FloatPack(double all) {  // NOLINT(google-explicit-constructor)
    for (Register& r : part) r = Register{} + static_cast<float>(all);
  }

  [[nodiscard, gnu::always_inline]] float operator[](std::size_t lane) const { return part[lane / width][lane % width]; }
  [[gnu::always_inline]] void set(std::size_t lane, float x) { part[lane / width][lane % width] = x; }

  /// Lanes 4 i to 4 i + 3.
  [[nodiscard, gnu::always_inline]] Four half(int i) const {
#if defined(__AVX__)
    return Four(i == 0 ? _mm256_castps256_ps128(__m256(part[0])) : _mm256_extractf128_ps(__m256(part[0]), 1));
#else
    return part[i];
#endif
  }

  [[gnu::always_inline]] FloatPack& operator+=(const FloatPack& o) {
    return each(o, [](Register& a, const Register& b) { a += b; });
  }
  [[gnu::always_inline]] FloatPack& operator-=(const FloatPack& o) {
    return each(o, [](Register& a, const Register& b) { a -= b; });
  }
  [[gnu::always_inline]] FloatPack& operator*=(const FloatPack& o) {
    return each(o, [](Register& a, const Register& b) { a *= b; });
  }
  [[gnu::always_inline]] FloatPack& operator/=(const FloatPack& o) {
    return each(o, [](Register& a, const Register& b) { a /= b; });
  }
  [[gnu::always_inline]] friend FloatPack operator+(FloatPack a, const FloatPack& b) { return a += b; }
  [[gnu::always_inline]] friend FloatPack operator-(FloatPack a, const FloatPack& b) { return a -= b; }
  [[gnu::always_inline]] friend FloatPack operator*(FloatPack a, const FloatPack& b) { return a *= b; }
  [[gnu::always_inline]] friend FloatPack operator/(FloatPack a, const FloatPack& b) { return a /= b; }
  [[gnu::always_inline]] friend Mask operator<(const FloatPack& a, const FloatPack& b) {
    Mask m;
    for (std::size_t i = 0; i < registers; ++i) m.part[i] = a.part[i] < b.part[i];
    return m;
  }
  [[gnu::always_inline]] friend Mask operator>(const FloatPack& a, const FloatPack& b) { return b < a; }
  [[gnu::always_inline]] friend FloatPack select(const Mask& m, FloatPack a, const FloatPack& b) {
    for (std::size_t i = 0; i < registers; ++i) a.part[i] = m.part[i] ? a.part[i] : b.part[i];
    return a;
  }
  [[gnu::always_inline]] friend FloatPack sqrt(FloatPack x) {
    for (Register& r : x.part) {
#if defined(__AVX__)
      r = Register(_mm256_sqrt_ps(__m256(r)));
#elif defined(__SSE2__)
      r = Register(_mm_sqrt_ps(__m128(r)));
#else
      for (std::size_t l = 0; l < width; ++l) r[l] = std::sqrt(r[l]);
#endif
    }
    return x;
  }

 private:
  template <class Change>
  [[gnu::always_inline]] FloatPack& each(const FloatPack& o, Change change) {
    for (std::size_t i = 0; i < registers; ++i) change(part[i], o.part[i]);
    return *this;
  }
};

[[nodiscard, gnu::always_inline]] inline const FloatPack* as_packs(const float* p) noexcept {
  return reinterpret_cast<const FloatPack*>(p);
}
[[nodiscard, gnu::always_inline]] inline FloatPack* as_packs(float* p) noexcept {
  return reinterpret_cast<FloatPack*>(p);
}

/// Sums of neighboring lanes: a0 + a1, a2 + a3, b0 + b1, b2 + b3.
[[nodiscard, gnu::always_inline]] inline FloatPack::Four sums_of_pairs(FloatPack::Four a, FloatPack::Four b) noexcept {
#if defined(__SSE2__)
  return FloatPack::Four(_mm_shuffle_ps(__m128(a), __m128(b), 0x88)) + FloatPack::Four(_mm_shuffle_ps(__m128(a), __m128(b), 0xdd));
#else
  return FloatPack::Four{a[0] + a[1], a[2] + a[3], b[0] + b[1], b[2] + b[3]};
#endif
}

/// Sums of the lanes of four packs.
[[nodiscard, gnu::always_inline]] inline std::array<float, 4> sums_of(const FloatPack& a, const FloatPack& b, const FloatPack& c,
                                                                      const FloatPack& d) noexcept {
#if defined(__AVX__)
  const __m256 pairs =
      _mm256_hadd_ps(_mm256_hadd_ps(__m256(a.part[0]), __m256(b.part[0])), _mm256_hadd_ps(__m256(c.part[0]), __m256(d.part[0])));
  const auto sums = FloatPack::Four(_mm256_castps256_ps128(pairs)) + FloatPack::Four(_mm256_extractf128_ps(pairs, 1));
#else
  FloatPack::Four sums{};
  for (int i = 0; i < 2; ++i) {
    const FloatPack::Four half = sums_of_pairs(sums_of_pairs(a.half(i), b.half(i)), sums_of_pairs(c.half(i), d.half(i)));
    sums = i == 0 ? half : sums + half;
  }
#endif
  return {sums[0], sums[1], sums[2], sums[3]};
}

/// Sum of the lanes of a pack.
[[nodiscard, gnu::always_inline]] inline float sum_of(const FloatPack& v) noexcept {
  const FloatPack::Four four = v.half(0) + v.half(1);
  return (four[0] + four[2]) + (four[1] + four[3]);
}

/// Largest lane of a pack.
[[nodiscard, gnu::always_inline]] inline float largest_of(const FloatPack& v) noexcept {
  const FloatPack::Four four = v.half(0) > v.half(1) ? v.half(0) : v.half(1);
  return std::max(std::max(four[0], four[2]), std::max(four[1], four[3]));
}

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
