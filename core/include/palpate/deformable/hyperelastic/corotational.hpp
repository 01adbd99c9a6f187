#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "palpate/math/eigenvalue.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// A co-rotational solid at a deformation F = R S: linear elasticity in the frame that turns along.
///   psi = mu |F - R|^2 + lambda/2 (tr S - 3)^2
/// R is the rotation with the largest tr(R^T F), proper even if F is inverted. s = tr S is the largest root of
///   s^4 - 2 |F|^2 s^2 - 8 det(F) s + 2 |F^T F|^2 - |F|^4 = 0,
/// and R = ds/dF, so no decomposition is needed (Lin, Chen & Wang 2022).
template <class Scalar>
class Corotational {
 public:
  /// Shear modulus mu and Lame's lambda, Pa.
  Corotational(const Matrix3<Scalar>& deformation, Scalar shear, Scalar lame) noexcept : shear_(shear), lame_(lame) {
    const Matrix3<Scalar>& f = deformation;
    Matrix3<Scalar> cofactor;
    for (int i = 0; i < 3; ++i) cofactor.col(i) = f.col((i + 1) % 3).cross(f.col((i + 2) % 3));
    const Matrix3<Scalar> square = f.transpose() * f;
    const Scalar size = f.squaredNorm(), volume = f.col(0).dot(cofactor.col(0));
    const Scalar last = Scalar(2.0) * square.squaredNorm() - size * size;
    using std::sqrt;
    Scalar s = sqrt(Scalar(3.0) * size) +
               Scalar(1e-30);  // no less than the root, above which the quartic is convex: Newton goes straight down to it
    for (int i = 0; i < 60; ++i) {
      const Scalar slope = slope_of(s, size, volume);
      const Scalar step = (((s * s - Scalar(2.0) * size) * s - Scalar(8.0) * volume) * s + last) / slope;
      const Scalar next = select(step > Scalar(0.0), s - step, s);
      const bool done = !any(s - next > Scalar(1e-15) * s);
      s = next;
      if (done) break;
    }
    const Scalar slope = slope_of(s, size, volume);
    rotation_ = ((Scalar(4.0) * (s * s + size)) * f + (Scalar(8.0) * s) * cofactor - Scalar(8.0) * (f * square)) * (Scalar(1.0) / slope);
    strain_ = f - rotation_;
    dilation_ = s - Scalar(3.0);
    // dR = R [w]x with (s I - S) w the axial vector of R^T dF - dF^T R: the inverse in the turned frame.
    Matrix3<Scalar> stretch = -(f * rotation_.transpose());
    stretch = Matrix3<Scalar>(Scalar(0.5) * (stretch + stretch.transpose()));
    for (int i = 0; i < 3; ++i) stretch(i, i) += s;
    for (int i = 0; i < 3; ++i) turn_.col(i) = stretch.col((i + 1) % 3).cross(stretch.col((i + 2) % 3));
    const Scalar determinant = stretch.col(0).dot(turn_.col(0));
    turn_ = Matrix3<Scalar>(turn_ * ((lame_ * dilation_ - Scalar(2.0) * shear_) / max_of(determinant, least * (s * s) * s)));
  }

  [[nodiscard]] Scalar energy() const noexcept {  ///< per volume at rest, J/m^3
    return shear_ * strain_.squaredNorm() + (Scalar(0.5) * lame_) * (dilation_ * dilation_);
  }

  /// First Piola-Kirchhoff, Pa.
  [[nodiscard]] Matrix3<Scalar> stress() const noexcept { return (Scalar(2.0) * shear_) * strain_ + (lame_ * dilation_) * rotation_; }

  /// The share of the geometric part with which the tangent is nowhere negative, up to 1.
  [[nodiscard]] Scalar safe_share() const noexcept { return shear_ / max_of(shear_, largest_eigenvalue(Matrix3<Scalar>(-turn_))); }

  /// How the stress along slope `a` of one corner changes as the corner with slope `b` moves, Pa/m^2, with `geometric` of its geometric
  /// part: 1 is exact.
  [[nodiscard]] Matrix3<Scalar> tangent(const Vector3<Scalar>& a, const Vector3<Scalar>& b, Scalar geometric) const noexcept {
    const Vector3<Scalar> ra = rotation_ * a, rb = rotation_ * b;
    Matrix3<Scalar> block = ra * (lame_ * rb).transpose() + (geometric * cross_matrix(ra)) * (turn_ * cross_matrix(rb).transpose());
    const Scalar along = Scalar(2.0) * shear_ * a.dot(b);
    for (int i = 0; i < 3; ++i) block(i, i) += along;
    return block;
  }

 private:
  static constexpr double least = 1e-9;  // where two stretches cancel each other no rotation is the nearest

  static Scalar slope_of(Scalar s, Scalar size, Scalar volume) noexcept {
    const Scalar cube = (s * s) * s;
    return max_of(Scalar(4.0) * (cube - size * s) - Scalar(8.0) * volume, least * cube);
  }

  Scalar shear_, lame_;
  Matrix3<Scalar> rotation_;
  Matrix3<Scalar> strain_;  // F - R
  Scalar dilation_;         // tr S - 3
  Matrix3<Scalar> turn_;    // (lambda (tr S - 3) - 2 mu) (s I - S)^-1, turned along, Pa
};

}  // namespace palpate::deformable
