#pragma once

#include <cmath>
#include <limits>

#include "palpate/deformable/hyperelastic/solver_options.hpp"
#include "palpate/math/eigenvalue.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Duration after which only the long-term stress is left, s.
inline constexpr double fully_relaxed = std::numeric_limits<double>::infinity();

/// Coefficients of a step of Overstress.
struct RelaxationStep {
  double decay = 0.0;  ///< part of the overstress that is left after the step
  double gain = 0.0;   ///< overstress at its end over the change of the elastic stress

  RelaxationStep() = default;
  /// Exact for an elastic stress that changes linearly during the step; `duration` in s, from 0 to infinity.
  RelaxationStep(const Relaxation& relaxation, double duration) {
    const double ratio = relaxation.instantaneous_ratio, x = duration * ratio / relaxation.retardation_time;
    decay = std::exp(-x);
    gain = (ratio - 1.0) * (x > 0.0 ? -std::expm1(-x) / x : 1.0);
  }
  /// Factor of the elastic energy in the potential of the step.
  [[nodiscard]] double stiffness() const noexcept { return 1.0 + gain; }
};

/// Overstress Q of a standard linear solid at large strain (Simo 1987; Holzapfel 1996). With the elastic second Piola-Kirchhoff stress S(C)
/// of the long term, C = F^T F, the stress is
///   S + Q,   Q' + Q / tau = (r - 1) S',   tau = retardation_time / r,   r = instantaneous_ratio.
/// It refers to the material, so a rotation of the body turns the forces and changes nothing else. Over a step it is
///   stiffness S(C) + H,   H = decay Q - gain S,   with Q and S before the step,
/// the derivative by C / 2 of the potential stiffness psi(C) + H : (C - I) / 2. Both are per rest volume.
template <class Scalar>
class Overstress {
 public:
  /// Begin a step: set the constant stress of its potential.
  void begin_step(const RelaxationStep& step) noexcept {
    constant_ = overstress_ * Scalar(step.decay) - stress_ * Scalar(step.gain);
    shift_ = max_of(largest_eigenvalue(Matrix3<Scalar>(-constant_)), Scalar(0.0));
  }

  /// Complete the step at a deformation gradient with the first Piola-Kirchhoff stress of the long term [Pa].
  void end_step(const RelaxationStep& step, const Matrix3<Scalar>& deformation, const Matrix3<Scalar>& first) noexcept {
    stress_ = second(deformation, first);
    overstress_ = constant_ + stress_ * Scalar(step.gain);
  }

  /// Energy of the constant stress, per rest volume, J/m^3.
  [[nodiscard]] Scalar potential(const Matrix3<Scalar>& deformation) const noexcept {
    Scalar sum = Scalar(0.0);
    const Matrix3<Scalar> image = deformation * constant_;
    for (int i = 0; i < 3; ++i) sum += deformation.row(i).dot(image.row(i)) - constant_(i, i);
    return Scalar(0.5) * sum;
  }
  /// First Piola-Kirchhoff stress of the constant stress, Pa.
  [[nodiscard]] Matrix3<Scalar> stress(const Matrix3<Scalar>& deformation) const noexcept { return deformation * constant_; }
  /// Constant stress times a shape gradient; the tangent has its product with another gradient on the diagonal. Not `exact`: made positive
  /// semidefinite.
  [[nodiscard]] Vector3<Scalar> image(const Vector3<Scalar>& gradient, bool exact) const noexcept {
    Vector3<Scalar> out = constant_ * gradient;
    if (!exact) out += shift_ * gradient;
    return out;
  }

  /// Energy of the overstress in a spring of small strains with `ratio` times the moduli [Pa], per rest volume, J/m^3.
  [[nodiscard]] Scalar stored(Scalar ratio, Scalar shear, Scalar lame) const noexcept {
    const Scalar trace = overstress_(0, 0) + overstress_(1, 1) + overstress_(2, 2);
    const Scalar part = lame / (Scalar(3.0) * lame + Scalar(2.0) * shear);
    return (overstress_.squaredNorm() - part * trace * trace) / (Scalar(4.0) * ratio * shear);
  }

 private:
  static constexpr double min_volume = 0.05;  // volume ratio below which a domain counts as this large

  /// F^-1 P.
  [[nodiscard]] static Matrix3<Scalar> second(const Matrix3<Scalar>& deformation, const Matrix3<Scalar>& first) noexcept {
    Matrix3<Scalar> cofactor;
    for (int i = 0; i < 3; ++i) cofactor.col(i) = deformation.col((i + 1) % 3).cross(deformation.col((i + 2) % 3));
    const Scalar inverse = Scalar(1.0) / max_of(deformation.col(0).dot(cofactor.col(0)), Scalar(min_volume));
    const Matrix3<Scalar> out = (cofactor.transpose() * first) * inverse;
    return Scalar(0.5) * (out + out.transpose());
  }

  Matrix3<Scalar> stress_ = Matrix3<Scalar>::Zero(), overstress_ = Matrix3<Scalar>::Zero();  // S and Q after the last step, Pa
  Matrix3<Scalar> constant_ = Matrix3<Scalar>::Zero();                                       // H of this step, Pa
  Scalar shift_;                                                                             // that makes H positive semidefinite, Pa
};

}  // namespace palpate::deformable
