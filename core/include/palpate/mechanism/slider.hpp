#pragma once

#include <array>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/inverse_kinematics.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/mechanism/parameters.hpp"

namespace palpate::mechanism {

/// Parameters of a Slider.
struct SliderParameters {
  double mass = 1.0;  ///< kg
};

/// One mass on one axis, the device of the literature on sampled walls (Colgate & Schenkel 1997; Gil, Avello, Rubio & Florez 2004).
/// Its joint coordinate is the tip position x [m]. Its joint torque is the force along x [N].
class Slider : public MechanismDefaults<Slider, 1> {
 public:
  using Parameters = SliderParameters;
  static constexpr const char* name = "slider";
  static constexpr std::array joints = {JointKind::prismatic};
  static constexpr std::array working_pose = {0.0};
  static constexpr std::array parameters = {
      parameter<&Parameters::mass>("mass.tip", "kg", ParameterRange::positive, "apparent mass"),
  };
  template <class Scalar>
  using Angles = Joints<1, Scalar>;

  Slider() = default;
  explicit Slider(double mass) : mass_(mass) {}
  explicit Slider(const Parameters& p) : mass_(p.mass) {}

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

  /// Tip velocity [m/s].
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> velocity(const Angles<Scalar>& /*q*/, const Angles<Scalar>& qd) const {
    return {qd[0], Scalar(0.0), Scalar(0.0)};
  }

  /// Component of a tip force along the axis [N].
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> apply_jacobian_transpose(const Angles<Scalar>& /*q*/, const Vector3<Scalar>& force) const {
    return Angles<Scalar>(force[0]);
  }

  /// Mass [kg], optionally with a point mass at the tip.
  [[nodiscard]] double inertia_parameters() const { return mass_; }
  template <class Scalar>
  [[nodiscard]] Scalar inertia_parameters(const Scalar& tip_mass) const {
    return mass_ + tip_mass;
  }

  /// Equation of motion, mass qdd = force.
  template <class Scalar>
  struct Dynamics {
    Scalar mass;

    /// 1 / mass, or 0 if the joint is stuck.
    struct Inverse {
      Scalar inverse_mass;
      Angles<Scalar> operator*(const Angles<Scalar>& force) const { return Angles<Scalar>(inverse_mass * force[0]); }
    };
    [[nodiscard]] const Angles<Scalar>& generalized_force(const Angles<Scalar>& force, const Angles<Scalar>& /*qd*/) const { return force; }
    [[nodiscard]] Inverse inverse() const { return {1.0 / mass}; }
    [[nodiscard]] Inverse inverse(const std::array<Condition<Scalar>, 1>& stuck) const {
      return {select(stuck[0], Scalar(0.0), 1.0 / mass)};
    }
    [[nodiscard]] Angles<Scalar> inertia_torque(const Angles<Scalar>& qdd) const { return Angles<Scalar>(mass * qdd[0]); }
  };

  template <class Scalar, class Mass>
  [[nodiscard]] Dynamics<Scalar> dynamics(const Angles<Scalar>& /*q*/, const Mass& mass) const {
    return {Scalar(mass)};
  }
  template <class Scalar>
  [[nodiscard]] Dynamics<Scalar> dynamics(const Angles<Scalar>& q) const {
    return dynamics(q, mass_);
  }

  /// Mass matrix [kg], 1 x 1.
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 1, 1> mass_matrix(const Angles<Scalar>& /*q*/) const {
    return Eigen::Matrix<Scalar, 1, 1>(Scalar(mass_));
  }

  /// Coriolis matrix: zero.
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 1, 1> coriolis(const Angles<Scalar>& /*q*/, const Angles<Scalar>& /*qd*/) const {
    return Eigen::Matrix<Scalar, 1, 1>(Scalar(0.0));
  }

  /// Potential energy: zero, because the axis is horizontal.
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Angles<Scalar>& /*q*/) const {
    return Scalar(0.0);
  }

  /// force / mass [m/s^2].
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const Angles<Scalar>& /*q*/, const Angles<Scalar>& /*qd*/, const Angles<Scalar>& force) const {
    return Angles<Scalar>(force[0] / mass_);
  }

  /// The pose whose tip is at `p` [m].
  [[nodiscard]] InverseKinematics<1> inverse_kinematics(const Vector3<>& p, const Joints<1>& /*nearest_to*/) const {
    if (p[1] != 0.0 || p[2] != 0.0) return {{}, "the tip of the slider stays on the x axis"};
    return {{Joints<1>(p[0])}, {}};
  }

 private:
  double mass_ = 1.0;
};

}  // namespace palpate::mechanism
