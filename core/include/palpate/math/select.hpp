#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

namespace palpate::math {

// Decisions written once for one loop (double, bool) and for several side by side (Pack, Mask).

inline bool any(bool condition) {
  return condition;
}
inline bool all(bool condition) {
  return condition;
}

/// `yes` where the condition holds, else `no`.
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

/// What a comparison of two scalars gives.
template <class Scalar>
using Condition = decltype(Scalar() < Scalar());

/// A whole number of each loop.
template <class Scalar>
struct LaneIndexOf {
  using Type = int;
};
template <class Scalar>
using LaneIndex = typename LaneIndexOf<Scalar>::Type;

/// What names a sequence of random numbers, for each loop its own: the same seed, the same numbers.
template <class Scalar>
struct SeedOf {
  using Type = std::uint64_t;
};
template <class Scalar>
using Seed = typename SeedOf<Scalar>::Type;

/// As std::min and std::max: the first, unless the second is smaller or larger.
template <class Scalar>
[[gnu::always_inline]] inline Scalar min_of(const Scalar& a, const Scalar& b) {
  return select(b < a, b, a);
}
template <class Scalar>
[[gnu::always_inline]] inline Scalar max_of(const Scalar& a, const Scalar& b) {
  return select(a < b, b, a);
}

/// Each entry of a matrix chosen by one condition.
template <class Mask, class Matrix>
[[gnu::always_inline]] inline Matrix select_each(const Mask& condition, const Matrix& yes, const Matrix& no) {
  Matrix out;
  for (Eigen::Index i = 0; i < out.size(); ++i) out.data()[i] = select(condition, yes.data()[i], no.data()[i]);
  return out;
}

}  // namespace palpate::math

namespace palpate {
using namespace math;  // vocabulary of every folder
}
