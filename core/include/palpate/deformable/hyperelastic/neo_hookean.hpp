#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "palpate/math/eigenvalue.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Compressible neo-Hookean material at a deformation gradient F, which may be inverted (Bonet & Wood; Smith, de Goes & Kim 2018, without
/// the logarithm). Linearizes to linear elasticity with the same Lame constants.
///   psi = mu/2 (|F|^2 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2
template <class Scalar>
class NeoHookean {
 public:
  NeoHookean() = default;
  /// `deformation` is F; shear modulus mu and Lame's lambda, Pa.
  NeoHookean(const Matrix3<Scalar>& deformation, Scalar shear, Scalar lame) noexcept
      : deformation_(deformation), shear_(shear), stiffness_(lame + shear) {
    for (int i = 0; i < 3; ++i) cofactor_.col(i) = deformation.col((i + 1) % 3).cross(deformation.col((i + 2) % 3));
    volume_change_ = deformation.col(0).dot(cofactor_.col(0)) - Scalar(1.0);
    pressure_ = stiffness_ * volume_change_ - shear_;
  }

  [[nodiscard]] Scalar volume_strain() const noexcept { return volume_change_; }                      ///< J - 1
  [[nodiscard]] const Matrix3<Scalar>& volume_strain_gradient() const noexcept { return cofactor_; }  ///< derivative by F
  /// Add a pressure [Pa] times the volume strain to the energy whose derivatives stress() and tangent() return, not to energy().
  void add_pressure(Scalar pressure) noexcept { pressure_ += pressure; }

  [[nodiscard]] Scalar energy() const noexcept {  ///< per rest volume, J/m^3
    return Scalar(0.5) * (shear_ * (deformation_.squaredNorm() - Scalar(3.0)) + (stiffness_ * volume_change_) * volume_change_) -
           shear_ * volume_change_;
  }

  /// Modulus m of the energy m/2 |F|^2 under large stretches of constant volume, Pa.
  [[nodiscard]] static Scalar stretch_modulus(Scalar shear) noexcept { return shear; }

  /// First Piola-Kirchhoff stress, Pa.
  [[nodiscard]] Matrix3<Scalar> stress() const noexcept { return shear_ * deformation_ + pressure_ * cofactor_; }

  /// Fraction of the geometric stiffness, up to 1, for which no rotation and no shear makes the tangent negative.
  [[nodiscard]] Scalar psd_geometric_fraction() const noexcept {
    using std::abs, std::sqrt;
    const Scalar max_geometric = abs(pressure_) * sqrt(largest_eigenvalue(Matrix3<Scalar>(deformation_.transpose() * deformation_)));
    return shear_ / max_of(shear_, max_geometric);
  }

  /// Part of the tangent that depends on one shape gradient.
  struct TangentFactor {
    Vector3<Scalar> gradient, image;
  };
  [[nodiscard]] TangentFactor tangent_factor(const Vector3<Scalar>& gradient) const noexcept { return {gradient, cofactor_ * gradient}; }

  /// Tangent block: derivative of the stress along the shape gradient of `a` by the position of the node with that of `b`, Pa/m^2.
  /// `geometric_fraction` scales the geometric stiffness; 1 is exact.
  [[nodiscard]] Matrix3<Scalar> tangent(const TangentFactor& a, const TangentFactor& b, Scalar geometric_fraction) const noexcept {
    const Vector3<Scalar> axial = (geometric_fraction * pressure_) * (deformation_ * b.gradient.cross(a.gradient));
    Matrix3<Scalar> block = (a.image * stiffness_) * b.image.transpose() + cross_matrix(axial);
    const Scalar diagonal = shear_ * a.gradient.dot(b.gradient);
    for (int i = 0; i < 3; ++i) block(i, i) += diagonal;
    return block;
  }

 private:
  Matrix3<Scalar> deformation_, cofactor_;
  Scalar shear_, stiffness_;
  Scalar volume_change_;  // J - 1
  Scalar pressure_;       // d psi / d J without the deviatoric part, Pa
};

}  // namespace palpate::deformable
