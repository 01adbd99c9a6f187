#pragma once

#include <Eigen/Core>

namespace palpate::math {

/// A point, displacement [m] or force [N] in the device's base frame: x to the right, y up, z towards the operator.
template <class Scalar = double>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

template <class Scalar = double>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

/// The matrix whose product with a vector w is v x w.
template <class Scalar>
Matrix3<Scalar> cross_matrix(const Vector3<Scalar>& v) {
  const Scalar o(0.0);
  Matrix3<Scalar> m;
  m << o, -v.z(), v.y(), v.z(), o, -v.x(), -v.y(), v.x(), o;
  return m;
}

/// One number for each joint: angles [rad], speeds [rad/s], torques [N*m] (metres and newtons for a sliding joint).
template <int dof, class Scalar = double>
using Joints = Eigen::Matrix<Scalar, dof, 1>;

/// The derivative of the tip's position by the joints, 3 x dof [m/rad]; its transpose turns tip forces into torques.
template <int dof, class Scalar = double>
using TipJacobian = Eigen::Matrix<Scalar, 3, dof>;

}  // namespace palpate::math

namespace palpate {
using namespace math;  // vocabulary of every folder
}
