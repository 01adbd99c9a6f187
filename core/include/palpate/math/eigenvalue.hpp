#pragma once

#include <cmath>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::math {

/// Return the largest eigenvalue of the symmetric matrix `a`.
///
/// Newton's method on the characteristic polynomial, started at an upper bound. The polynomial is
/// convex above its largest root, so the iterates decrease towards it.
template <class Scalar>
Scalar largest_eigenvalue(const Matrix3<Scalar>& a) noexcept {
  using std::sqrt;
  const Scalar mean = (a(0, 0) + a(1, 1) + a(2, 2)) * Scalar(1.0 / 3.0);
  Matrix3<Scalar> b = a;
  for (int i = 0; i < 3; ++i) b(i, i) -= mean;
  // Polynomial x^3 - 3 q x - d, with x the eigenvalue minus the mean of the eigenvalues.
  const Scalar q = b.squaredNorm() * Scalar(1.0 / 6.0), d = b.col(0).dot(b.col(1).cross(b.col(2)));
  Scalar x = Scalar(2.0) * sqrt(q) + Scalar(1e-300);
  for (int i = 0; i < 40; ++i) {
    const Scalar slope = Scalar(3.0) * (x * x - q);
    const Scalar step = ((x * x - Scalar(3.0) * q) * x - d) / select(slope > Scalar(0.0), slope, Scalar(1.0));
    if (!any(step > Scalar(1e-10) * x)) break;
    x = select(step > Scalar(0.0), x - step, x);
  }
  return mean + x;
}

}  // namespace palpate::math
