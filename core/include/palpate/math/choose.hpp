#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

namespace palpate {

// Decisions written once for one loop (double, bool) and for several side by side (Pack, Mask).

inline bool any(bool condition) {
  return condition;
}
inline bool all(bool condition) {
  return condition;
}

/// `yes` where the condition holds, else `no`.
inline double choose(bool condition, double yes, double no) {
  return condition ? yes : no;
}
inline bool choose(bool condition, bool yes, bool no) {
  return condition ? yes : no;
}

inline double nearest(double x) {
  return std::nearbyint(x);
}
inline bool finite(double x) {
  return std::isfinite(x);
}

/// What a comparison of two scalars gives.
template <class Scalar>
using Condition = decltype(Scalar() < Scalar());

/// A whole number of each loop.
template <class Scalar>
struct WholeOf {
  using Type = int;
};
template <class Scalar>
using Whole = typename WholeOf<Scalar>::Type;

/// What names a sequence of random numbers, for each loop its own: the same seed, the same numbers.
template <class Scalar>
struct SeedOf {
  using Type = std::uint64_t;
};
template <class Scalar>
using Seed = typename SeedOf<Scalar>::Type;

/// As std::min and std::max: the first, unless the second is smaller or larger.
template <class Scalar>
[[gnu::always_inline]] inline Scalar lesser(const Scalar& a, const Scalar& b) {
  return choose(b < a, b, a);
}
template <class Scalar>
[[gnu::always_inline]] inline Scalar greater(const Scalar& a, const Scalar& b) {
  return choose(a < b, b, a);
}

/// Each entry of a matrix chosen by one condition.
template <class Condition_, class Matrix>
[[gnu::always_inline]] inline Matrix choose_each(const Condition_& condition, const Matrix& yes, const Matrix& no) {
  Matrix out;
  for (Eigen::Index i = 0; i < out.size(); ++i) out.data()[i] = choose(condition, yes.data()[i], no.data()[i]);
  return out;
}

}  // namespace palpate
