#pragma once

#include "palpate/math/dual.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// One mass on one axis: the device of the sampled-wall literature (Colgate & Schenkel 1997; Gil et al. 2004).
/// Its joint is the tip's x [m]; "torques" are forces along x [N].
class Slider {
 public:
  static constexpr int dof = 1;
  template <class Scalar>
  using Angles = Joints<1, Scalar>;

  Slider() = default;
  explicit Slider(double mass) : mass_(mass) {}

  /// A slider's pose needs nothing computed beforehand.
  template <class Scalar>
  [[nodiscard]] const Angles<Scalar>& posture(const Angles<Scalar>& q) const {
    return q;
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> turned(const Angles<Scalar>& from, const Angles<Scalar>& shift) const {
    return from + shift;
  }
  template <class Scalar>
  [[nodiscard]] Angles<Dual<1, Scalar>> moving(const Angles<Scalar>& at, const Angles<Scalar>& qd) const {
    return Angles<Dual<1, Scalar>>(Dual<1, Scalar>(at[0], qd));
  }

  /// Tip position (q, 0, 0) [m].
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Angles<Scalar>& q) const {
    return {q[0], Scalar(0.0), Scalar(0.0)};
  }

  /// dp/dq = (1, 0, 0).
  template <class Scalar>
  [[nodiscard]] TipJacobian<1, Scalar> jacobian(const Angles<Scalar>& /*q*/) const {
    return TipJacobian<1, Scalar>(Scalar(1.0), Scalar(0.0), Scalar(0.0));
  }

  /// The part of a tip force [N] along the axis.
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> torque(const Angles<Scalar>& /*q*/, const Vector3<Scalar>& force) const {
    return Angles<Scalar>(force[0]);
  }

  /// The mass [kg], 1 x 1.
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 1, 1> mass_matrix(const Angles<Scalar>& /*q*/) const {
    return Eigen::Matrix<Scalar, 1, 1>(Scalar(mass_));
  }

  /// Zero: nothing turns.
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 1, 1> coriolis(const Angles<Scalar>& /*q*/, const Angles<Scalar>& /*qd*/) const {
    return Eigen::Matrix<Scalar, 1, 1>(Scalar(0.0));
  }

  /// Zero: the axis is level.
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const Angles<Scalar>& /*q*/) const {
    return Angles<Scalar>(Scalar(0.0));
  }

  template <class Scalar>
  [[nodiscard]] Scalar potential(const Angles<Scalar>& /*q*/) const {
    return Scalar(0.0);
  }

  /// force / mass [m/s^2].
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const Angles<Scalar>& /*q*/, const Angles<Scalar>& /*qd*/, const Angles<Scalar>& force) const {
    return Angles<Scalar>(force[0] / mass_);
  }

 private:
  double mass_ = 1.0;
};

}  // namespace palpate
