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

/// Coefficients of a step of Overstress, or of a stage of BodyDynamics.
struct RelaxationStep {
  double decay = 0.0;  ///< part of the overstress that is left after the step
  double gain = 0.0;   ///< overstress at its end over the change of the elastic stress
  double carry = 0.0;  ///< of the second stage: part of the first stage's overstress that is subtracted

  RelaxationStep() = default;
  /// Exact for an elastic stress that changes linearly during the step; `duration` in s, from 0 to infinity.
  RelaxationStep(const Relaxation& relaxation, double duration) {
    const double ratio = relaxation.instantaneous_ratio, x = duration * ratio / relaxation.retardation_time;
    decay = std::exp(-x);
    gain = (ratio - 1.0) * (x > 0.0 ? -std::expm1(-x) / x : 1.0);
  }
  /// Stage 0 or 1 of a step of length h [s] of the Runge-Kutta method with `gamma` (BodyDynamics): z' = -Q / tau, z = Q - (r - 1) S.
  static RelaxationStep stage(const Relaxation& relaxation, int stage, double gamma, double h) {
    const double ratio = relaxation.instantaneous_ratio, x = gamma * h * ratio / relaxation.retardation_time;
    RelaxationStep out;
    out.decay = 1.0 / (1.0 + x);
    out.gain = (ratio - 1.0) * out.decay;
    if (stage == 1) out.carry = (1.0 / gamma - 1.0) * x * out.decay;
    return out;
  }
};

/// Memory of a stress S of the long term, tensor or pressure [Pa]: its overstress Q. Over a step
///   Q = gain S + constant,   constant = decay Q - gain S - carry Q_1,   with Q and S before the step, and Q_1 of a first stage.
template <class Value, class Scalar>
struct StressMemory {
  Value stress, overstress, constant;  ///< S and Q after the last step, and the constant of this one, Pa

  explicit StressMemory(const Value& zero) : stress(zero), overstress(zero), constant(zero) {}

  void begin_step(const RelaxationStep& step) noexcept { constant = overstress * Scalar(step.decay) - stress * Scalar(step.gain); }
  /// `now`: S at the end of the first stage.
  void begin_second_stage(const RelaxationStep& step, const Value& now) noexcept {
    const Value first = constant + now * Scalar(step.gain);
    begin_step(step);
    constant -= first * Scalar(step.carry);
  }
  void end_step(const RelaxationStep& step, const Value& now) noexcept {
    stress = now;
    overstress = constant + now * Scalar(step.gain);
  }
};

/// Overstress Q of a standard linear solid at large strain (Simo 1987; Holzapfel 1996). With the elastic second Piola-Kirchhoff stress S(C)
/// of the long term, C = F^T F, the stress is
///   S + Q,   Q' + Q / tau = (r - 1) S',   tau = retardation_time / r,   r = instantaneous_ratio.
/// It refers to the material, so a rotation of the body turns the forces and changes nothing else. Over a step it is
///   (1 + gain) S(C) + H,   H: the constant of StressMemory,
/// the derivative by C / 2 of the potential (1 + gain) psi(C) + H : (C - I) / 2. Both are per rest volume.
template <class Scalar>
class Overstress {
 public:
  /// Begin a step: set the constant stress of its potential.
  void begin_step(const RelaxationStep& step) noexcept {
    memory_.begin_step(step);
    update_shift();
  }

  /// Begin the second stage of a step from the end of the first one, with the arguments of end_step() there.
  void begin_second_stage(const RelaxationStep& step, const Matrix3<Scalar>& deformation, const Matrix3<Scalar>& first) noexcept {
    memory_.begin_second_stage(step, second(deformation, first));
    update_shift();
  }

  /// Complete the step at a deformation gradient with the first Piola-Kirchhoff stress of the long term [Pa].
  void end_step(const RelaxationStep& step, const Matrix3<Scalar>& deformation, const Matrix3<Scalar>& first) noexcept {
    memory_.end_step(step, second(deformation, first));
  }

  /// Energy of the constant stress, per rest volume, J/m^3.
  [[nodiscard]] Scalar potential(const Matrix3<Scalar>& deformation) const noexcept {
    Scalar sum = Scalar(0.0);
    const Matrix3<Scalar> image = deformation * memory_.constant;
    for (int i = 0; i < 3; ++i) sum += deformation.row(i).dot(image.row(i)) - memory_.constant(i, i);
    return Scalar(0.5) * sum;
  }
  /// First Piola-Kirchhoff stress of the constant stress, Pa.
  [[nodiscard]] Matrix3<Scalar> stress(const Matrix3<Scalar>& deformation) const noexcept { return deformation * memory_.constant; }
  /// Constant stress times a shape gradient; the tangent has its product with another gradient on the diagonal. Not `exact`: made positive
  /// semidefinite.
  [[nodiscard]] Vector3<Scalar> image(const Vector3<Scalar>& gradient, bool exact) const noexcept {
    Vector3<Scalar> out = memory_.constant * gradient;
    if (!exact) out += shift_ * gradient;
    return out;
  }

  /// Largest compression of the constant stress, at least 0, Pa.
  [[nodiscard]] Scalar compression() const noexcept { return shift_; }

  /// Energy of the overstress without a `pressure` [Pa], in a spring of small strains with `ratio` times the moduli [Pa], per rest volume,
  /// J/m^3.
  [[nodiscard]] Scalar stored(Scalar pressure, Scalar ratio, Scalar shear, Scalar lame) const noexcept {
    Matrix3<Scalar> stress = memory_.overstress;
    for (int i = 0; i < 3; ++i) stress(i, i) -= pressure;
    const Scalar trace = stress(0, 0) + stress(1, 1) + stress(2, 2);
    const Scalar part = lame / (Scalar(3.0) * lame + Scalar(2.0) * shear);
    return (stress.squaredNorm() - part * trace * trace) / (Scalar(4.0) * ratio * shear);
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

  void update_shift() noexcept { shift_ = max_of(largest_eigenvalue(Matrix3<Scalar>(-memory_.constant)), Scalar(0.0)); }

  StressMemory<Matrix3<Scalar>, Scalar> memory_{Matrix3<Scalar>::Zero()};
  Scalar shift_ = Scalar(0.0);  // that makes H positive semidefinite, Pa
};

}  // namespace palpate::deformable
