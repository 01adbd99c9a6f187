#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "palpate/math/eigenvalue.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Corotational elasticity at a deformation gradient F = R S: linear elasticity in the rotated frame.
///   psi = mu |F - R|^2 + lambda/2 (tr S - 3)^2
/// R is the rotation with the largest tr(R^T F), proper even if F is inverted. s = tr S is the largest root of
///   s^4 - 2 |F|^2 s^2 - 8 det(F) s + 2 |F^T F|^2 - |F|^4 = 0,
/// and R = ds/dF, so no matrix decomposition is needed (Lin, Chen & Wang 2022).
template <class Scalar>
class Corotational {
 public:
  Corotational() = default;
  /// `deformation` is F; shear modulus mu and Lame's lambda, Pa.
  Corotational(const Matrix3<Scalar>& deformation, Scalar shear, Scalar lame) noexcept : shear_(shear), lame_(lame) {
    const Matrix3<Scalar>& f = deformation;
    Matrix3<Scalar> cofactor;
    for (int i = 0; i < 3; ++i) cofactor.col(i) = f.col((i + 1) % 3).cross(f.col((i + 2) % 3));
    const Matrix3<Scalar> square = f.transpose() * f;
    const Scalar norm2 = f.squaredNorm(), determinant_f = f.col(0).dot(cofactor.col(0));
    const Scalar constant_term = Scalar(2.0) * square.squaredNorm() - norm2 * norm2;
    using std::sqrt;
    Scalar s = sqrt(Scalar(3.0) * norm2) +
               Scalar(1e-30);  // start at or above the root, where the quartic is convex: Newton's method descends monotonically
    for (int i = 0; i < 60; ++i) {
      const Scalar slope = quartic_slope(s, norm2, determinant_f);
      const Scalar step = (((s * s - Scalar(2.0) * norm2) * s - Scalar(8.0) * determinant_f) * s + constant_term) / slope;
      const Scalar next = select(step > Scalar(0.0), s - step, s);
      const bool done = !any(s - next > Scalar(1e-15) * s);
      s = next;
      if (done) break;
    }
    const Scalar slope = quartic_slope(s, norm2, determinant_f);
    rotation_ = ((Scalar(4.0) * (s * s + norm2)) * f + (Scalar(8.0) * s) * cofactor - Scalar(8.0) * (f * square)) * (Scalar(1.0) / slope);
    strain_ = f - rotation_;
    volume_strain_ = s - Scalar(3.0);
    // dR = R [w]x, where (s I - S) w is the axial vector of R^T dF - dF^T R; the inverse is taken in the rotated frame.
    Matrix3<Scalar> stretch = -(f * rotation_.transpose());
    stretch = Matrix3<Scalar>(Scalar(0.5) * (stretch + stretch.transpose()));
    for (int i = 0; i < 3; ++i) stretch(i, i) += s;
    for (int i = 0; i < 3; ++i) rotation_tangent_.col(i) = stretch.col((i + 1) % 3).cross(stretch.col((i + 2) % 3));
    const Scalar determinant = stretch.col(0).dot(rotation_tangent_.col(0));
    rotation_tangent_ = Matrix3<Scalar>(rotation_tangent_ * (Scalar(1.0) / max_of(determinant, min_relative * (s * s) * s)));
    pressure_ = lame_ * volume_strain_;
  }

  [[nodiscard]] Scalar volume_strain() const noexcept { return volume_strain_; }                      ///< tr S - 3
  [[nodiscard]] const Matrix3<Scalar>& volume_strain_gradient() const noexcept { return rotation_; }  ///< derivative by F
  /// Add a pressure [Pa] times the volume strain to the energy whose derivatives stress() and tangent() return, not to energy().
  void add_pressure(Scalar pressure) noexcept { pressure_ += pressure; }

  [[nodiscard]] Scalar energy() const noexcept {  ///< per rest volume, J/m^3
    return shear_ * strain_.squaredNorm() + (Scalar(0.5) * lame_) * (volume_strain_ * volume_strain_);
  }

  /// Modulus m of the energy m/2 |F|^2 under large stretches, Pa; lambda only adds to it.
  [[nodiscard]] static Scalar stretch_modulus(Scalar shear) noexcept { return Scalar(2.0) * shear; }

  /// First Piola-Kirchhoff stress, Pa.
  [[nodiscard]] Matrix3<Scalar> stress() const noexcept { return (Scalar(2.0) * shear_) * strain_ + pressure_ * rotation_; }

  /// Largest fraction of the geometric stiffness, up to 1, that keeps the tangent positive semidefinite.
  [[nodiscard]] Scalar psd_geometric_fraction() const noexcept {
    return shear_ / max_of(shear_, largest_eigenvalue(Matrix3<Scalar>(-geometric() * rotation_tangent_)));
  }

  /// Part of the tangent that depends on one shape gradient.
  struct TangentFactor {
    Vector3<Scalar> gradient, image;
    Matrix3<Scalar> turned;
  };
  [[nodiscard]] TangentFactor tangent_factor(const Vector3<Scalar>& gradient) const noexcept {
    const Vector3<Scalar> image = rotation_ * gradient;
    return {gradient, image, rotation_tangent_ * cross_matrix(image).transpose()};
  }

  /// Tangent block: derivative of the stress along the shape gradient of `a` by the position of the node with that of `b`, Pa/m^2.
  /// `geometric_fraction` scales the geometric stiffness; 1 is exact.
  [[nodiscard]] Matrix3<Scalar> tangent(const TangentFactor& a, const TangentFactor& b, Scalar geometric_fraction) const noexcept {
    const Vector3<Scalar> axial = a.image * (geometric_fraction * geometric());
    Matrix3<Scalar> block = (a.image * lame_) * b.image.transpose();
    for (int i = 0; i < 3; ++i) block.col(i) += axial.cross(b.turned.col(i));
    const Scalar diagonal = (Scalar(2.0) * shear_) * a.gradient.dot(b.gradient);
    for (int i = 0; i < 3; ++i) block(i, i) += diagonal;
    return block;
  }

 private:
  static constexpr double min_relative = 1e-9;  // regularization where two stretches cancel and the nearest rotation is not unique

  [[nodiscard]] Scalar geometric() const noexcept { return pressure_ - Scalar(2.0) * shear_; }

  static Scalar quartic_slope(Scalar s, Scalar norm2, Scalar determinant_f) noexcept {
    const Scalar cube = (s * s) * s;
    return max_of(Scalar(4.0) * (cube - norm2 * s) - Scalar(8.0) * determinant_f, min_relative * cube);
  }

  Scalar shear_, lame_;
  Matrix3<Scalar> rotation_;
  Matrix3<Scalar> strain_;            // F - R
  Scalar volume_strain_;              // tr S - 3
  Scalar pressure_;                   // lambda (tr S - 3), and the added pressure, Pa
  Matrix3<Scalar> rotation_tangent_;  // (s I - S)^-1 in the rotated frame
};

}  // namespace palpate::deformable
