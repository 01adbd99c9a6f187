#pragma once

#include <cmath>

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::mechanism {

/// Products of the singular values of a tip Jacobian, cheaper than the values themselves.
template <class Scalar>
struct JacobianSize {
  Scalar volume;  ///< square of the product of all singular values
  Scalar norm;    ///< sum of their squares, |J|_F^2
};

/// Return the size of the tip Jacobian `j`.
template <int dof, class Scalar>
[[nodiscard, gnu::always_inline]] inline JacobianSize<Scalar> jacobian_size(const math::TipJacobian<dof, Scalar>& j) {
  const Scalar norm = j.squaredNorm();
  if constexpr (dof == 1) {
    return {norm, norm};
  } else {
    const auto minor = [&j](int row, int other) -> Scalar { return j(row, 0) * j(other, 1) - j(other, 0) * j(row, 1); };
    const Scalar x = minor(1, 2), y = minor(2, 0), z = minor(0, 1);  // of the first two columns
    if constexpr (dof == 2) return {x * x + y * y + z * z, norm};
    const Scalar volume = x * j(0, dof - 1) + y * j(1, dof - 1) + z * j(2, dof - 1);
    return {volume * volume, norm};
  }
}

/// Return false only where s_min / s_max of the singular values of a tip Jacobian of `dof` joints is above 0.01.
///
/// It compares the product of the singular values with 0.01 |J|_F^dof, which is at least 0.01 s_max^dof.
template <int dof, class Scalar>
[[nodiscard, gnu::always_inline]] inline math::Condition<Scalar> may_be_singular(const JacobianSize<Scalar>& size) {
  Scalar least = 1e-4 * size.norm;
  for (int i = 1; i < dof; ++i) least = least * size.norm;
  return size.volume <= least;
}

/// Return (s_min / s_max)^2 of the singular values of a tip Jacobian.
///
/// It follows from the characteristic polynomial x^3 - a x^2 + b x - c of J^T J. For one and two joints it is exact. For three joints the
/// smallest root is taken as c/b, and the largest as that of x^2 - a x + b. The relative error then has the order of s_min / s_mid, so the
/// value is accurate near singular poses. Elsewhere it is a measure of the conditioning that is zero at singular poses only.
template <int dof, class Scalar>
[[nodiscard, gnu::always_inline]] inline Scalar squared_conditioning(const math::TipJacobian<dof, Scalar>& j) {
  using std::sqrt;
  const Scalar tiny = 1e-300;
  const auto dot = [&j](int a, int b) -> Scalar { return j(0, a) * j(0, b) + j(1, a) * j(1, b) + j(2, a) * j(2, b); };
  const auto largest = [](const Scalar& a, const Scalar& b) -> Scalar {
    return 0.5 * (a + sqrt(math::max_of(Scalar(a * a - 4.0 * b), Scalar(0.0))));
  };
  if constexpr (dof == 1) {
    return Scalar(1.0);
  } else if constexpr (dof == 2) {
    const Scalar xx = dot(0, 0), yy = dot(1, 1), xy = dot(0, 1);
    const Scalar b = xx * yy - xy * xy, most = largest(xx + yy, b);
    return b / (most * most + tiny);
  } else {
    static_assert(dof == 3);
    const Scalar xx = dot(0, 0), yy = dot(1, 1), zz = dot(2, 2), xy = dot(0, 1), xz = dot(0, 2), yz = dot(1, 2);
    const Scalar in_yz = yy * zz - yz * yz;
    const Scalar b = in_yz + (xx * zz - xz * xz) + (xx * yy - xy * xy);
    const Scalar c = xx * in_yz - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    return c / (b * largest(xx + yy + zz, b) + tiny);
  }
}

}  // namespace palpate::mechanism
