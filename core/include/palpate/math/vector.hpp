#pragma once

#include <Eigen/Core>

#include "palpate/math/check_compiler.hpp"

namespace palpate::math {

/// Point [m], displacement [m] or force [N] in the base frame of the device: x right, y up, z
/// towards the operator.
template <class Scalar = double>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

template <class Scalar = double>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

/// Return the skew-symmetric matrix of `v`: cross_matrix(v) * w = v x w.
template <class Scalar>
Matrix3<Scalar> cross_matrix(const Vector3<Scalar>& v) {
  const Scalar o(0.0);
  Matrix3<Scalar> m;
  m << o, -v.z(), v.y(), v.z(), o, -v.x(), -v.y(), v.x(), o;
  return m;
}

/// One value per joint: angles [rad], velocities [rad/s] or torques [N*m]; m, m/s and N for a
/// prismatic joint.
template <int dof, class Scalar = double>
using Joints = Eigen::Matrix<Scalar, dof, 1>;

/// Jacobian of the tip position, 3 x dof [m/rad]. Its transpose maps tip forces to joint torques.
template <int dof, class Scalar = double>
using TipJacobian = Eigen::Matrix<Scalar, 3, dof>;

namespace detail {
/// Return term(first) + ... + term(first + count - 1), added pairwise.
template <int first, int count, class Term>
[[gnu::always_inline]] inline auto pairwise_sum(const Term& term) {
  if constexpr (count == 1)
    return term(first);
  else
    return pairwise_sum<first, count / 2>(term) + pairwise_sum<first + count / 2, count - count / 2>(term);
}
}  // namespace detail

/// Return the product of a small matrix and a vector. The order of its sums does not depend on Eigen's vectorization, and it compiles
/// faster than Eigen's product.
template <class Scalar, int rows, int columns>
[[nodiscard]] Eigen::Matrix<Scalar, rows, 1> product(const Eigen::Matrix<Scalar, rows, columns>& a,
                                                     const Eigen::Matrix<Scalar, columns, 1>& x) {
  Eigen::Matrix<Scalar, rows, 1> out;
  for (int i = 0; i < rows; ++i) out[i] = detail::pairwise_sum<0, columns>([&](int j) { return a(i, j) * x[j]; });
  return out;
}

/// Return the product of the transpose of a small matrix and a vector; see product().
template <class Scalar, int rows, int columns>
[[nodiscard]] Eigen::Matrix<Scalar, columns, 1> transposed_product(const Eigen::Matrix<Scalar, rows, columns>& a,
                                                                   const Eigen::Matrix<Scalar, rows, 1>& x) {
  Eigen::Matrix<Scalar, columns, 1> out;
  for (int i = 0; i < columns; ++i) out[i] = detail::pairwise_sum<0, rows>([&](int j) { return a(j, i) * x[j]; });
  return out;
}

}  // namespace palpate::math

namespace palpate {
using namespace math;  // shared vocabulary of all folders
}
