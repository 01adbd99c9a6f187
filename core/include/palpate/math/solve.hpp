#pragma once

#include <Eigen/Core>

namespace palpate {

/// x of A x = b for a small symmetric positive definite A (n x n), by A = L D L^T: one division for each row, no root, no branch.
template <class Scalar, int n>
[[nodiscard, gnu::always_inline]] inline Eigen::Matrix<Scalar, n, 1> solve_positive_definite(const Eigen::Matrix<Scalar, n, n>& a,
                                                                                             const Eigen::Matrix<Scalar, n, 1>& b) {
  Eigen::Matrix<Scalar, n, n> l = a;  // below the diagonal: L; on it: 1 / D
  Eigen::Matrix<Scalar, n, 1> x = b;
  for (int k = 0; k < n; ++k) {
    l(k, k) = 1.0 / l(k, k);
    for (int i = k + 1; i < n; ++i) {
      const Scalar part = l(i, k) * l(k, k);
      for (int j = k + 1; j <= i; ++j) l(i, j) -= part * l(j, k);
      x[i] -= part * x[k];
    }
    for (int i = k + 1; i < n; ++i) l(i, k) *= l(k, k);
  }
  for (int k = n - 1; k >= 0; --k) {
    x[k] *= l(k, k);
    for (int i = k + 1; i < n; ++i) x[k] -= l(i, k) * x[i];
  }
  return x;
}

}  // namespace palpate
