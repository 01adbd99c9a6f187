#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "palpate/math/eigenvalue.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// A compressible Neo-Hookean solid at a deformation F, which may be inverted (Bonet & Wood; Smith, de Goes & Kim 2018, without the
/// logarithm). Small strains are those of linear elasticity with the same Lame constants.
///   psi = mu/2 (|F|^2 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2
template <class Scalar>
class NeoHookean {
 public:
  /// Shear modulus mu and Lame's lambda, Pa.
  NeoHookean(const Matrix3<Scalar>& deformation, Scalar shear, Scalar lame) noexcept
      : deformation_(deformation), shear_(shear), stiffness_(lame + shear) {
    for (int i = 0; i < 3; ++i) cofactor_.col(i) = deformation.col((i + 1) % 3).cross(deformation.col((i + 2) % 3));
    growth_ = deformation.col(0).dot(cofactor_.col(0)) - Scalar(1.0);
    pressure_ = stiffness_ * growth_ - shear_;
  }

  [[nodiscard]] Scalar energy() const noexcept {  ///< per volume at rest, J/m^3
    return Scalar(0.5) * (shear_ * (deformation_.squaredNorm() - Scalar(3.0)) + (stiffness_ * growth_) * growth_) - shear_ * growth_;
  }

  /// First Piola-Kirchhoff, Pa.
  [[nodiscard]] Matrix3<Scalar> stress() const noexcept { return shear_ * deformation_ + pressure_ * cofactor_; }

  /// The share of the geometric part with which no turn and no shear makes the tangent negative, up to 1.
  [[nodiscard]] Scalar safe_share() const noexcept {
    using std::abs, std::sqrt;
    const Scalar most = abs(pressure_) * sqrt(largest_eigenvalue(Matrix3<Scalar>(deformation_.transpose() * deformation_)));
    return shear_ / max_of(shear_, most);
  }

  /// How the stress along slope `a` of one corner changes as the corner with slope `b` moves, Pa/m^2, with `geometric` of its geometric
  /// part: 1 is exact.
  [[nodiscard]] Matrix3<Scalar> tangent(const Vector3<Scalar>& a, const Vector3<Scalar>& b, Scalar geometric) const noexcept {
    const Vector3<Scalar> ca = cofactor_ * a, cb = stiffness_ * (cofactor_ * b);
    const Vector3<Scalar> turn = (geometric * pressure_) * (deformation_ * b.cross(a));
    Matrix3<Scalar> block = ca * cb.transpose() + cross_matrix(turn);
    const Scalar along = shear_ * a.dot(b);
    for (int i = 0; i < 3; ++i) block(i, i) += along;
    return block;
  }

 private:
  Matrix3<Scalar> deformation_, cofactor_;
  Scalar shear_, stiffness_;
  Scalar growth_;    // J - 1
  Scalar pressure_;  // d psi / d J without the shear part, Pa
};

}  // namespace palpate::deformable
