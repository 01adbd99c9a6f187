#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "palpate/math/dual.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/mechanism.hpp"

namespace palpate::mechanism {

/// Lowest flexible mode of a device, between its motors, which carry the encoders, and its tip.
///
/// A share of the inertia moves with the tip, behind a spring and a damper. Both are proportional to the inertia, so the mode has one
/// frequency in every direction of the tip.
struct FlexibleMode {
  double frequency = 0.0;      ///< with motors and tip free, Hz
  double tip_share = 0.0;      ///< of the inertia on the tip's side, above 0 and below 1
  double damping_ratio = 0.0;  ///< at least 0 and below 1

  static constexpr double max_phase = 0.2;    ///< of the mode in one integration step, rad
  static constexpr int max_substeps = 10000;  ///< in one servo period

  [[nodiscard]] double rate() const noexcept { return 2.0 * std::numbers::pi * frequency; }           ///< rad/s
  [[nodiscard]] double reduced() const noexcept { return tip_share * (1.0 - tip_share); }             ///< reduced over whole mass
  [[nodiscard]] double stiffness() const noexcept { return rate() * rate() * reduced(); }             ///< over the inertia, 1/s^2
  [[nodiscard]] double damping() const noexcept { return 2.0 * damping_ratio * rate() * reduced(); }  ///< over the inertia, 1/s

  /// Return the integration steps in a period [s] that resolve the mode, where `rigid` steps resolve the rigid device. Each side has a
  /// share of the inertia only, so friction and the operator's hand act on it faster by up to the inverse of that share.
  [[nodiscard]] int substeps(double period, int rigid) const noexcept {
    const double lighter = tip_share < 0.5 ? tip_share : 1.0 - tip_share;
    const double steps = std::ceil(std::fmax(rate() * period / max_phase, rigid / lighter));
    return steps < max_substeps ? static_cast<int>(steps) : max_substeps;
  }

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault(double period) const noexcept {
    if (!(frequency > 0.0) || !std::isfinite(frequency)) return "frequency must be positive and finite [Hz]";
    if (!(tip_share > 0.0 && tip_share < 1.0)) return "tip_share must be above 0 and below 1";
    if (!(damping_ratio >= 0.0 && damping_ratio < 1.0)) return "damping_ratio must be at least 0 and below 1";
    if (rate() * period > max_phase * max_substeps)
      return "frequency needs more than 10000 integration steps per servo period: take the device as rigid";
    return nullptr;
  }
};

/// A mechanism with its lowest flexible mode, as a mechanism with twice the joints.
///
/// The first n joint coordinates theta are those of motors and encoders, the others phi those that the joints would have at the tip. With
/// the inertia M, the potential V and the tip position p of the rigid mechanism, and the tip's share s of the inertia,
///
///   T = (1-s)/2 theta'^T M(theta) theta' + s/2 phi'^T M(phi) phi',   V = (1-s) V(theta) + s V(phi) + k/2 d^T M(theta) d,   tip = p(phi),
///
/// where d = phi - theta is the stretch. A damper c M(theta) acts on its rate. Friction and motors act on theta, the operator on phi.
template <class Rigid>
class FlexibleMechanism : public MechanismDefaults<FlexibleMechanism<Rigid>, 2 * Rigid::dof> {
 public:
  static constexpr int side = Rigid::dof;  ///< joints of the rigid mechanism
  static constexpr int dof = 2 * side;
  template <class Scalar>
  using Angles = Joints<dof, Scalar>;
  template <class Scalar>
  using Side = Joints<side, Scalar>;

  FlexibleMechanism() = default;
  FlexibleMechanism(const Rigid& rigid, const FlexibleMode& mode)
      : rigid_(rigid), share_(mode.tip_share), stiffness_(mode.stiffness()), damping_(mode.damping()) {}

  [[nodiscard]] const Rigid& rigid() const { return rigid_; }

  template <class Scalar>
  [[nodiscard]] static Side<Scalar> motors(const Angles<Scalar>& all) {
    return all.template head<side>();
  }
  template <class Scalar>
  [[nodiscard]] static Side<Scalar> tip(const Angles<Scalar>& all) {
    return all.template tail<side>();
  }
  template <class Scalar>
  [[nodiscard]] static Angles<Scalar> joined(const Side<Scalar>& motors, const Side<Scalar>& tip) {
    Angles<Scalar> out;
    out.template head<side>() = motors;
    out.template tail<side>() = tip;
    return out;
  }

  /// Return the coordinates at which the tip rests behind motors at `theta`, under its weight alone.
  [[nodiscard]] Angles<double> at_rest(const Side<double>& theta) const {
    const auto inverse = rigid_.dynamics(rigid_.kinematics(theta)).inverse();
    Side<double> phi = theta;
    for (int i = 0; i < 8; ++i) phi = theta - (share_ / stiffness_) * (inverse * Side<double>(rigid_.gravity(phi)));
    return joined(theta, phi);
  }

  /// The caches of both sides, and the stretch between them.
  template <class Scalar = double>
  struct KinematicsCache {
    KinematicsCacheOf<Rigid, Scalar> motors, tip;
    Side<Scalar> stretch;
  };

  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> kinematics(const Angles<Scalar>& q) const {
    return {rigid_.kinematics(motors(q)), rigid_.kinematics(tip(q)), tip(q) - motors(q)};
  }
  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> kinematics_near(KinematicsCache<Scalar>& reference, const Angles<Scalar>& q) const {
    return {rigid_.kinematics_near(reference.motors, motors(q)), rigid_.kinematics_near(reference.tip, tip(q)), tip(q) - motors(q)};
  }
  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> advance(const KinematicsCache<Scalar>& from, const Angles<Scalar>& dq) const {
    return {rigid_.advance(from.motors, motors(dq)), rigid_.advance(from.tip, tip(dq)), from.stretch + (tip(dq) - motors(dq))};
  }
  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> advance_small(const KinematicsCache<Scalar>& from, const Angles<Scalar>& dq) const {
    return {rigid_.advance_small(from.motors, motors(dq)), rigid_.advance_small(from.tip, tip(dq)), from.stretch + (tip(dq) - motors(dq))};
  }
  template <class Scalar>
  [[nodiscard]] static Condition<Scalar> is_small(const Angles<Scalar>& dq) {
    return Rigid::is_small(motors(dq)) & Rigid::is_small(tip(dq));
  }

  /// Position, velocity and acceleration at constant joint speeds of the tip, and the joint torques of a force on it.
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const KinematicsCache<Scalar>& at) const {
    return rigid_.forward(at.tip);
  }
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Angles<Scalar>& q) const {
    return rigid_.forward(tip(q));
  }
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> velocity(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd) const {
    return rigid_.velocity(at.tip, tip(qd));
  }
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> velocity_product(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd) const {
    return rigid_.velocity_product(at.tip, tip(qd));
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> apply_jacobian_transpose(const KinematicsCache<Scalar>& at, const Vector3<Scalar>& force) const {
    return joined(Side<Scalar>(Side<Scalar>::Constant(Scalar(0.0))), Side<Scalar>(rigid_.apply_jacobian_transpose(at.tip, force)));
  }

  /// Mass matrix: those of both sides on its diagonal.
  template <class Scalar>
  [[nodiscard]] JointMatrix<dof, Scalar> mass_matrix(const Angles<Scalar>& q) const {
    return diagonal<Scalar>(rigid_.mass_matrix(motors(q)), rigid_.mass_matrix(tip(q)));
  }
  template <class Scalar>
  [[nodiscard]] JointMatrix<dof, Scalar> coriolis(const Angles<Scalar>& q, const Angles<Scalar>& qd) const {
    return diagonal<Scalar>(rigid_.coriolis(motors(q), motors(qd)), rigid_.coriolis(tip(q), tip(qd)));
  }

  /// Potential energy [J], that of the spring included.
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Angles<Scalar>& q) const {
    const Side<Scalar> stretch = tip(q) - motors(q);
    const JointMatrix<side, Scalar> mass = rigid_.mass_matrix(motors(q));
    Scalar twice = 0.0;
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) twice += stretch[i] * mass(i, j) * stretch[j];
    return (1.0 - share_) * rigid_.potential(motors(q)) + share_ * rigid_.potential(tip(q)) + (0.5 * stiffness_) * twice;
  }

  /// The inertia parameters of the tip's side, with a point mass [kg] at the tip.
  template <class Scalar>
  [[nodiscard]] auto inertia_parameters(const Scalar& tip_mass) const {
    return rigid_.inertia_parameters(Scalar(tip_mass / share_));
  }

  /// Equations of motion at one pose, the spring and the damper included.
  template <class Scalar>
  struct Dynamics {
    using RigidDynamics = typename Rigid::template Dynamics<Scalar>;
    RigidDynamics motors, tip;
    Side<Scalar> spring;       ///< k d
    Side<Scalar> metric_turn;  ///< k/2 times the gradient of d^T M(theta) d by theta
    double motor_share, tip_share, damping;

    struct Inverse {
      typename RigidDynamics::Inverse motors, tip;
      double per_motor_share, per_tip_share;
      [[nodiscard]] Angles<Scalar> operator*(const Angles<Scalar>& force) const {
        return joined(Side<Scalar>(motors * scaled(per_motor_share, FlexibleMechanism::motors(force))),
                      Side<Scalar>(tip * scaled(per_tip_share, FlexibleMechanism::tip(force))));
      }
    };

    /// Generalized force that accelerates both sides [N*m].
    [[nodiscard]] Angles<Scalar> generalized_force(const Angles<Scalar>& torque, const Angles<Scalar>& qd) const {
      const Side<Scalar> speed = FlexibleMechanism::motors(qd), tip_speed = FlexibleMechanism::tip(qd);
      const Side<Scalar> damper = scaled(damping, Side<Scalar>(tip_speed - speed));
      const Side<Scalar> between = motors.inertia_torque(Side<Scalar>(spring + damper));
      const Side<Scalar> on_motors = scaled(1.0 / motor_share, Side<Scalar>(FlexibleMechanism::motors(torque) + between - metric_turn));
      const Side<Scalar> on_tip = scaled(1.0 / tip_share, Side<Scalar>(FlexibleMechanism::tip(torque) - between));
      return joined(scaled(motor_share, Side<Scalar>(motors.generalized_force(on_motors, speed))),
                    scaled(tip_share, Side<Scalar>(tip.generalized_force(on_tip, tip_speed))));
    }
    [[nodiscard]] Inverse inverse() const { return {motors.inverse(), tip.inverse(), 1.0 / motor_share, 1.0 / tip_share}; }
    [[nodiscard]] Inverse inverse(const std::array<Condition<Scalar>, dof>& stuck) const {
      std::array<Condition<Scalar>, side> first, second;
      for (std::size_t i = 0; i < side; ++i) {
        first[i] = stuck[i];
        second[i] = stuck[side + i];
      }
      return {motors.inverse(first), tip.inverse(second), 1.0 / motor_share, 1.0 / tip_share};
    }
    [[nodiscard]] Angles<Scalar> inertia_torque(const Angles<Scalar>& qdd) const {
      return joined(scaled(motor_share, Side<Scalar>(motors.inertia_torque(FlexibleMechanism::motors(qdd)))),
                    scaled(tip_share, Side<Scalar>(tip.inertia_torque(FlexibleMechanism::tip(qdd)))));
    }
  };

  template <class Scalar, class Mass>
  [[nodiscard]] Dynamics<Scalar> dynamics(const KinematicsCache<Scalar>& at, const Mass& tip_parameters) const {
    return dynamics_of(at, rigid_.dynamics(at.tip, tip_parameters));
  }
  template <class Scalar>
  [[nodiscard]] Dynamics<Scalar> dynamics(const KinematicsCache<Scalar>& at) const {
    return dynamics_of(at, rigid_.dynamics(at.tip));
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const Angles<Scalar>& q, const Angles<Scalar>& qd, const Angles<Scalar>& torque) const {
    const Dynamics<Scalar> d = dynamics(kinematics(q));
    return d.inverse() * d.generalized_force(torque, qd);
  }

 private:
  /// A multiple on any scalar: Eigen has no product of double and Dual.
  template <class Scalar>
  [[nodiscard]] static Side<Scalar> scaled(double factor, Side<Scalar> x) {
    for (int i = 0; i < side; ++i) x[i] = factor * x[i];
    return x;
  }

  template <class Scalar>
  [[nodiscard]] Dynamics<Scalar> dynamics_of(const KinematicsCache<Scalar>& at,
                                             const typename Rigid::template Dynamics<Scalar>& tip) const {
    // With the Christoffel matrix C of M, C(theta, d)^T d is half the gradient of d^T M(theta) d.
    const Side<Scalar> spring = scaled(stiffness_, at.stretch);
    const JointMatrix<side, Scalar> c = rigid_.coriolis(at.motors, at.stretch);
    return {rigid_.dynamics(at.motors), tip, spring, math::transposed_product(c, spring), 1.0 - share_, share_, damping_};
  }

  template <class Scalar>
  [[nodiscard]] JointMatrix<dof, Scalar> diagonal(const JointMatrix<side, Scalar>& motors, const JointMatrix<side, Scalar>& tip) const {
    JointMatrix<dof, Scalar> out = JointMatrix<dof, Scalar>::Constant(Scalar(0.0));
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) {
        out(i, j) = (1.0 - share_) * motors(i, j);
        out(side + i, side + j) = share_ * tip(i, j);
      }
    return out;
  }

  Rigid rigid_{};
  double share_ = 0.5;
  double stiffness_ = 1.0;  // of the spring over the inertia, 1/s^2
  double damping_ = 0.0;    // likewise, 1/s
};

}  // namespace palpate::mechanism
