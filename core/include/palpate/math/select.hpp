#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

#include "palpate/math/check_compiler.hpp"

namespace palpate::math {

// Branch-free decisions, with one spelling for a single loop (double, bool) and a batch (Pack,
// Mask).

inline bool any(bool condition) {
  return condition;
}
inline bool all(bool condition) {
  return condition;
}

/// Return `yes` where the condition holds, otherwise `no`.
inline double select(bool condition, double yes, double no) {
  return condition ? yes : no;
}
inline bool select(bool condition, bool yes, bool no) {
  return condition ? yes : no;
}

inline double round_to_even(double x) {
  return std::nearbyint(x);
}
inline bool is_finite(double x) {
  return std::isfinite(x);
}

/// Result type of a comparison of two scalars: bool or Mask.
template <class Scalar>
using Condition = decltype(Scalar() < Scalar());

/// Integer index per loop.
template <class Scalar>
struct LaneIndexOf {
  using Type = int;
};
template <class Scalar>
using LaneIndex = typename LaneIndexOf<Scalar>::Type;

/// Seed of a pseudo-random sequence per loop.
template <class Scalar>
struct SeedOf {
  using Type = std::uint64_t;
};
template <class Scalar>
using Seed = typename SeedOf<Scalar>::Type;

/// Return the minimum or maximum with the tie rule of std::min and std::max: the first argument
/// wins.
template <class Scalar>
[[gnu::always_inline]] inline Scalar min_of(const Scalar& a, const Scalar& b) {
  return select(b < a, b, a);
}
template <class Scalar>
[[gnu::always_inline]] inline Scalar max_of(const Scalar& a, const Scalar& b) {
  return select(a < b, b, a);
}

/// Select every entry of a matrix by one condition.
template <class Mask, class Matrix>
[[gnu::always_inline]] inline Matrix select_each(const Mask& condition, const Matrix& yes, const Matrix& no) {
  Matrix out;
  for (Eigen::Index i = 0; i < out.size(); ++i) out.data()[i] = select(condition, yes.data()[i], no.data()[i]);
  return out;
}

}  // namespace palpate::math

namespace palpate {
using namespace math;  // shared vocabulary of all folders
}
