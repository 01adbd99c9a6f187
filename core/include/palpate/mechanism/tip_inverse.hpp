#pragma once

#include <Eigen/Core>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/mechanism.hpp"

namespace palpate::mechanism {

/// Inverse of a tip Jacobian J on the directions in which the tip can move: J^+ = (J^T J)^-1 J^T, with J^+ = J^-1 for three joints.
template <int dof, class Scalar = double>
class TipInverse {
  static_assert(dof <= 3, "palpate: a tip Jacobian with more than three joints has no such inverse");

 public:
  using Vector = Vector3<Scalar>;
  using Angles = Joints<dof, Scalar>;

  /// Compute J^+. Return whether J is regular: det(J^T J) > 1e-18 |J|^(2 dof). Otherwise J^+ must not be used.
  [[nodiscard]] Condition<Scalar> update(const TipJacobian<dof, Scalar>& j) {
    Scalar size = 0.0;
    for (Eigen::Index i = 0; i < j.size(); ++i) size += j.data()[i] * j.data()[i];
    Scalar limit = 1e-18;
    for (int i = 0; i < dof; ++i) limit = limit * size;
    if constexpr (dof == 3) {
      const auto minor = [&j](int a, int b, int row, int next) { return j(row, a) * j(next, b) - j(next, a) * j(row, b); };
      for (int i = 0; i < 3; ++i)  // cofactors of column i
        for (int k = 0; k < 3; ++k) inverse_(i, k) = minor((i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3);
      const Scalar determinant = j(0, 0) * inverse_(0, 0) + j(1, 0) * inverse_(0, 1) + j(2, 0) * inverse_(0, 2);
      const Scalar scale = 1.0 / determinant;
      for (Eigen::Index i = 0; i < inverse_.size(); ++i) inverse_.data()[i] *= scale;
      return limit < determinant * determinant;
    } else {
      JointMatrix<dof, Scalar> gram;
      for (int a = 0; a < dof; ++a)
        for (int b = 0; b < dof; ++b) gram(a, b) = j(0, a) * j(0, b) + j(1, a) * j(1, b) + j(2, a) * j(2, b);
      Scalar determinant = gram(0, 0);
      if constexpr (dof == 2) determinant = gram(0, 0) * gram(1, 1) - gram(0, 1) * gram(1, 0);
      const JointMatrix<dof, Scalar> inverse = inverse_of_spd<dof, Scalar>(gram);
      for (int a = 0; a < dof; ++a)
        for (int k = 0; k < 3; ++k) {
          inverse_(a, k) = inverse(a, 0) * j(k, 0);
          for (int b = 1; b < dof; ++b) inverse_(a, k) += inverse(a, b) * j(k, b);
        }
      return limit < determinant;
    }
  }

  /// Return |J|^2 |J^+|^2 of the Frobenius norms, at least dof^2; it grows as the pose nears a singular one.
  [[nodiscard]] Scalar squared_condition(const TipJacobian<dof, Scalar>& j) const {
    Scalar size = 0.0, back = 0.0;
    for (Eigen::Index i = 0; i < j.size(); ++i) size += j.data()[i] * j.data()[i];
    for (Eigen::Index i = 0; i < inverse_.size(); ++i) back += inverse_.data()[i] * inverse_.data()[i];
    return size * back;
  }

  /// Joint motion of a tip motion, J^+ v: the nearest one that the tip can make.
  [[nodiscard]] Angles to_joints(const Vector& v) const { return math::product(inverse_, v); }
  /// Smallest tip force with these joint torques, J^+T torque [N].
  [[nodiscard]] Vector to_tip(const Angles& torque) const { return math::transposed_product(inverse_, torque); }
  /// Part of a vector in the directions in which the tip can move, J J^+ v.
  [[nodiscard]] Vector reachable(const TipJacobian<dof, Scalar>& j, const Vector& v) const {
    if constexpr (dof == 3)
      return v;
    else
      return math::product(j, to_joints(v));
  }

 private:
  Eigen::Matrix<Scalar, dof, 3> inverse_ = Eigen::Matrix<Scalar, dof, 3>::Constant(0.0);
};

}  // namespace palpate::mechanism
