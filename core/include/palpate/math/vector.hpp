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

}  // namespace palpate::math

namespace palpate {
using namespace math;  // shared vocabulary of all folders
}
