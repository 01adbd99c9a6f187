#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace palpate::math {

/// Four doubles, in one register with AVX and in two without: three components and a pad, or four numbers side by side. Products and sums
/// are rounded separately: the same numbers give the same bits on every target. A scalar type for formulas written once for any scalar.
struct alignas(32) Quad {
#if defined(__AVX__)
  using Register [[gnu::vector_size(32)]] = double;
#else
  using Register [[gnu::vector_size(16)]] = double;
#endif
  static constexpr std::size_t width = sizeof(Register) / sizeof(double), registers = 4 / width;

  Register part[registers];

  struct Mask {
    using Bits = decltype(Register() < Register());
    Bits part[registers];
  };

  Quad() = default;
  [[gnu::always_inline]] Quad(double all) {  // NOLINT(google-explicit-constructor): constants mix with quads
    for (Register& r : part) r = all - Register{};
  }
  [[gnu::always_inline]] Quad(double a, double b, double c, double d) {
#if defined(__AVX__)
    part[0] = Register{a, b, c, d};
#else
    part[0] = Register{a, b};
    part[1] = Register{c, d};
#endif
  }

  [[nodiscard, gnu::always_inline]] double operator[](std::size_t lane) const { return part[lane / width][lane % width]; }
  [[gnu::always_inline]] void set(std::size_t lane, double x) { part[lane / width][lane % width] = x; }

  [[gnu::always_inline]] Quad operator-() const {
    Quad x = *this;
    for (Register& r : x.part) r = -r;
    return x;
  }
  [[gnu::always_inline]] Quad& operator+=(const Quad& o) {
    for (std::size_t i = 0; i < registers; ++i) part[i] += o.part[i];
    return *this;
  }
  [[gnu::always_inline]] Quad& operator-=(const Quad& o) {
    for (std::size_t i = 0; i < registers; ++i) part[i] -= o.part[i];
    return *this;
  }
  [[gnu::always_inline]] Quad& operator*=(const Quad& o) {
    for (std::size_t i = 0; i < registers; ++i) part[i] *= o.part[i];
    return *this;
  }
  [[gnu::always_inline]] Quad& operator/=(const Quad& o) {
    for (std::size_t i = 0; i < registers; ++i) part[i] /= o.part[i];
    return *this;
  }
  [[gnu::always_inline]] friend Quad operator+(const Quad& a, const Quad& b) {
    Quad x = a;
    return x += b;
  }
  [[gnu::always_inline]] friend Quad operator-(const Quad& a, const Quad& b) {
    Quad x = a;
    return x -= b;
  }
  [[gnu::always_inline]] friend Quad operator*(const Quad& a, const Quad& b) {
    Quad x = a;
    return x *= b;
  }
  [[gnu::always_inline]] friend Quad operator/(const Quad& a, const Quad& b) {
    Quad x = a;
    return x /= b;
  }
  [[gnu::always_inline]] friend Quad operator*(double a, const Quad& b) {
    Quad x = b;
    for (Register& r : x.part) r = a * r;
    return x;
  }
  [[gnu::always_inline]] friend Mask operator<(const Quad& a, const Quad& b) {
    Mask m;
    for (std::size_t i = 0; i < registers; ++i) m.part[i] = a.part[i] < b.part[i];
    return m;
  }
  [[gnu::always_inline]] friend Quad select(const Mask& m, const Quad& a, const Quad& b) {
    Quad x;
    for (std::size_t i = 0; i < registers; ++i) x.part[i] = m.part[i] ? a.part[i] : b.part[i];
    return x;
  }

  /// Components y, z, x, and the pad.
  [[nodiscard, gnu::always_inline]] Quad rotated() const {
    Quad x;
#if defined(__AVX__)
    x.part[0] = __builtin_shufflevector(part[0], part[0], 1, 2, 0, 3);
#else
    x.part[0] = __builtin_shufflevector(part[0], part[1], 1, 2);
    x.part[1] = __builtin_shufflevector(part[0], part[1], 0, 3);
#endif
    return x;
  }

  /// Sums of the lanes of four quads.
  [[nodiscard, gnu::always_inline]] static Quad sums_of(const Quad& a, const Quad& b, const Quad& c, const Quad& d) {
    Quad sum;
#if defined(__AVX__)
    const Register ab =
        __builtin_shufflevector(a.part[0], b.part[0], 0, 4, 2, 6) + __builtin_shufflevector(a.part[0], b.part[0], 1, 5, 3, 7);
    const Register cd =
        __builtin_shufflevector(c.part[0], d.part[0], 0, 4, 2, 6) + __builtin_shufflevector(c.part[0], d.part[0], 1, 5, 3, 7);
    sum.part[0] = __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
#else
    const auto pair = [](const Register& x, const Register& y) {
      return Register(__builtin_shufflevector(x, y, 0, 2) + __builtin_shufflevector(x, y, 1, 3));
    };
    sum.part[0] = pair(a.part[0], b.part[0]) + pair(a.part[1], b.part[1]);
    sum.part[1] = pair(c.part[0], d.part[0]) + pair(c.part[1], d.part[1]);
#endif
    return sum;
  }

  /// 1 / sqrt of the lanes of two quads in single precision, relative error 2e-7.
  [[gnu::always_inline]] static void single_inverse_roots(const Quad* x, Quad* roots) {
#if defined(__AVX__)
    const __m256 single = _mm256_set_m128(_mm256_cvtpd_ps(__m256d(x[1].part[0])), _mm256_cvtpd_ps(__m256d(x[0].part[0])));
    const __m256 root = _mm256_div_ps(_mm256_set1_ps(1.0F), _mm256_sqrt_ps(single));
    roots[0].part[0] = Register(_mm256_cvtps_pd(_mm256_castps256_ps128(root)));
    roots[1].part[0] = Register(_mm256_cvtps_pd(_mm256_extractf128_ps(root, 1)));
#elif defined(__SSE2__)
    for (int i = 0; i < 2; ++i) {
      const __m128 single = _mm_movelh_ps(_mm_cvtpd_ps(__m128d(x[i].part[0])), _mm_cvtpd_ps(__m128d(x[i].part[1])));
      const __m128 root = _mm_div_ps(_mm_set1_ps(1.0F), _mm_sqrt_ps(single));
      roots[i].part[0] = Register(_mm_cvtps_pd(root));
      roots[i].part[1] = Register(_mm_cvtps_pd(_mm_movehl_ps(root, root)));
    }
#else
    for (int i = 0; i < 2; ++i)
      for (std::size_t lane = 0; lane < 4; ++lane)
        roots[i].set(lane, static_cast<double>(1.0F / std::sqrt(static_cast<float>(x[i][lane]))));
#endif
  }
};

}  // namespace palpate::math
