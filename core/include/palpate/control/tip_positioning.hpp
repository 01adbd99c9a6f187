#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/control/workspace_gains.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/mechanism/tip_inverse.hpp"

namespace palpate::control {

/// Position control of the tip by its decoupled inertia: the part that WorkspaceController and AdmittanceController share.
///
/// - The tip's inertia L(q) = J^+T M J^+ is decoupled (Khatib 1987), and gravity, Coriolis forces and friction are fed forward.
/// - An observer per axis estimates position, velocity and a constant disturbance. It is driven by the force that was applied, so that a
///   limit winds nothing up. The disturbance is the integrator.
/// - With fewer than three joints, all of this happens in the directions in which the tip can move (range of J).
/// - An operator who holds the tip adds a mass to it, M + m J^T J; the weight of that mass is left to the operator.
/// - Near a singular pose the inverse of the mobility A = J M^-1 J^T is damped, so that no direction takes all of the drive's force.
///
/// With the motion to follow (x_r, v_r, a_r) and the estimate (x, v, w):
///   a = a_r + k_p (x_r - x) + k_d (v_r - v) - w
///   u = J^+T (M J^+ (a - J' qd_r) + C qd_r + N + friction qd_r),   qd_r = J^+ v_r
template <class Mechanism, class Number>
class TipPositioning {
  static_assert(Mechanism::dof <= 3, "palpate: a workspace controller needs a mechanism with at most three joints");

 public:
  using Scalar = Number;
  static constexpr int dof = Mechanism::dof;
  using Vector = Vector3<Scalar>;
  using Angles = Joints<dof, Scalar>;

  [[nodiscard]] const WorkspaceGains& gains() const noexcept { return gains_; }

 protected:
  TipPositioning() = default;
  /// @param mechanism  as the controller knows it
  /// @param friction   viscous, of the joints, N*m*s/rad
  /// @param period     servo period, s
  TipPositioning(const Mechanism& mechanism, const Joints<dof>& friction, const WorkspaceGains& gains, double period)
      : mechanism_(mechanism), friction_(friction), gains_(gains), period_(period) {}

  /// Take the parameters of a controller with another scalar.
  template <class Other>
  void copy_parameters(const TipPositioning<Mechanism, Other>& one) {
    mechanism_ = one.mechanism_;
    friction_ = one.friction_;
    gains_ = one.gains_;
    period_ = one.period_;
    operator_mass_ = one.operator_mass_;
  }

  /// Set the state of one lane; all lanes share the parameters.
  void set_lane(int lane, const TipPositioning<Mechanism, double>& one) {
    using math::set_lane;
    kinematics_.set_lane(lane, one.kinematics_);
    set_lane(started_, lane, one.started_);
    set_lane(position_, lane, one.position_);
    set_lane(velocity_, lane, one.velocity_);
    set_lane(disturbance_, lane, one.disturbance_);
    set_lane(model_position_, lane, one.model_position_);
    set_lane(model_velocity_, lane, one.model_velocity_);
    set_lane(lost_, lane, one.lost_);
  }

  /// Update kinematics and Jacobian for measured joint angles. Return whether the pose is regular.
  Condition<Scalar> update(const Scalar* angles) noexcept {
    kinematics_.update(mechanism_, Eigen::Map<const Angles>(angles));
    jacobian_ = mechanism_.jacobian(kinematics_.current);
    lost_ = Vector::Constant(0.0);
    return inverse_.update(jacobian_);
  }

  /// Return the equations of motion of this tick, with the operator's mass at the tip.
  [[nodiscard]] auto dynamics() const noexcept {
    if (operator_mass_ > 0.0) return mechanism_.dynamics(kinematics_.current, mechanism_.inertia_parameters(operator_mass_));
    return mechanism_.dynamics(kinematics_.current);
  }

  /// Remember the command of this tick [N]: `force` at a regular pose, zero at a singular one, from which the estimate starts again.
  Vector hand_over(const Condition<Scalar>& regular, const Vector& force) noexcept {
    command_ = select_each(regular, force, Vector(Vector::Constant(0.0)));
    started_ = started_ & regular;
    return command_;
  }

  /// Correct the estimate by the measured position [m]. The first one, and the first after a singular pose, starts estimate and model,
  /// with the velocity `begin` [m/s].
  void observe(const Vector& measured, const Vector& begin) noexcept {
    const Vector zero = Vector::Constant(0.0), error = measured - position_;
    position_ = select_each(started_, Vector(position_ + gains_.observer[0] * error), measured);
    velocity_ = select_each(started_, Vector(velocity_ + gains_.observer[1] * error), begin);
    disturbance_ = select_each(started_, Vector(disturbance_ + gains_.observer[2] * error), zero);
    model_position_ = select_each(started_, model_position_, measured);
    model_velocity_ = select_each(started_, model_velocity_, begin);
    started_ = true;
  }

  /// Set the acceleration of this tick from that of the motion to follow [m/s^2].
  void feed_back(const Vector& model_acceleration) noexcept {
    acceleration_ = model_acceleration + gains_.position * (model_position_ - position_) + gains_.velocity * (model_velocity_ - velocity_) -
                    disturbance_;
  }

  /// Return the joint torques that hold the device at rest [N*m].
  template <class Dynamics>
  [[nodiscard]] Angles holding_torque(const Dynamics& dynamics) const noexcept {
    const Angles none = Angles::Constant(0.0);
    return -dynamics.generalized_force(none, none);
  }

  /// Return the tip force of the weight [N].
  template <class Dynamics>
  Vector weight_force(const Angles& held, const Dynamics& dynamics) noexcept {
    return tip_force(held, dynamics, weight_damping);
  }

  /// Return the tip force [N] that gives the acceleration of feed_back() at the velocity to follow, without the weight.
  template <class Dynamics>
  Vector motion_force(const Angles& held, const Dynamics& dynamics) noexcept {
    const Angles none = Angles::Constant(0.0);
    const Angles speed = inverse_.to_joints(model_velocity_);
    const Vector turning = mechanism_.velocity_product(kinematics_.current, speed);
    Angles torque =
        dynamics.inertia_torque(inverse_.to_joints(Vector(acceleration_ - turning))) - (dynamics.generalized_force(none, speed) + held);
    for (int i = 0; i < dof; ++i) torque[i] += friction_[i] * speed[i];
    return tip_force(torque, dynamics, motion_damping);
  }

  /// Return the tip force of joint torques [N], J^+T torque. Near a singular pose it is (A + e)^-1 A (A + e)^-1 y for the acceleration
  /// y = J M^-1 torque, at most |y|/(4 e). The acceleration that is then missing is added to `lost_`.
  /// @param share  of the trace of A, largest e
  template <class Dynamics>
  Vector tip_force(const Angles& torque, const Dynamics& dynamics, double share) noexcept {
    Vector force = inverse_.to_tip(torque);
    const Scalar limit = damped_above * damped_above, condition = inverse_.squared_condition(jacobian_);
    const auto damped = limit < condition;
    if (!any(damped)) return force;
    const Scalar excess = 1.0 - limit / condition;
    const auto inverse_inertia = dynamics.inverse();
    Eigen::Matrix<Scalar, 3, 3> mobility;
    for (int k = 0; k < 3; ++k) {
      const Angles row = jacobian_.row(k).transpose();
      mobility.col(k) = math::product(jacobian_, Angles(inverse_inertia * row));
    }
    const Scalar more = share * excess * excess * (mobility(0, 0) + mobility(1, 1) + mobility(2, 2));
    Eigen::Matrix<Scalar, 3, 3> stiffer = mobility;
    for (int k = 0; k < 3; ++k) stiffer(k, k) += more;
    const Eigen::Matrix<Scalar, 3, 3> inverse = mechanism::inverse_of_spd<3, Scalar>(stiffer);
    const Vector wanted = math::product(jacobian_, Angles(inverse_inertia * torque));
    const Vector bounded = math::product(inverse, math::product(mobility, math::product(inverse, wanted)));
    lost_ = select_each(damped, Vector(lost_ + math::product(mobility, bounded) - wanted), lost_);
    return select_each(damped, bounded, force);
  }

  /// Predict the next sample with the force that the drive gave [N]. Return the acceleration [m/s^2] that this force and a singular pose
  /// left out.
  /// @param restrict_to  restricts an acceleration to the directions that are controlled
  template <class Restrict>
  Vector predict(const Vector& force, Restrict restrict_to) noexcept {
    Vector acceleration = acceleration_ + disturbance_ + lost_;
    Vector left_out = lost_;
    const Vector missing = force - command_;
    Condition<Scalar> differs = missing[0] != Scalar(0.0);
    for (int i = 1; i < 3; ++i) differs = differs | (missing[i] != Scalar(0.0));
    if (any(differs)) {  // J M^-1 J^T times it
      const Angles more = dynamics().inverse() * math::transposed_product(jacobian_, missing);
      const Vector change = restrict_to(Vector(math::product(jacobian_, more)));
      acceleration = select_each(differs, Vector(acceleration + change), acceleration);
      left_out = select_each(differs, Vector(left_out + change), left_out);
    }
    position_ += period_ * (velocity_ + 0.5 * period_ * acceleration);
    velocity_ += period_ * acceleration;
    return left_out;
  }

  /// Forget the state.
  void forget() noexcept {
    kinematics_ = Kinematics(rest());
    started_ = false;
    lost_ = Vector::Constant(0.0);
  }

  static constexpr double damped_above = 12.0;                           // |J| |J^+| above which the inverse of the mobility is damped
  static constexpr double motion_damping = 0.02, weight_damping = 2e-4;  // of the mobility's trace, largest damping

  using Kinematics = mechanism::IncrementalKinematics<Mechanism, Scalar>;
  [[nodiscard]] static auto rest() { return Mechanism().kinematics(Angles(Angles::Constant(0.0))); }

  // NOLINTBEGIN(cppcoreguidelines-non-private-member-variables-in-classes,misc-non-private-member-variables-in-classes): of the controllers
  Mechanism mechanism_{};
  Joints<dof> friction_ = Joints<dof>::Zero();
  WorkspaceGains gains_;
  double period_ = 1e-3;
  double operator_mass_ = 0.0;  // at the tip, weightless, kg
  Kinematics kinematics_ = Kinematics(rest());
  Condition<Scalar> started_ = false;
  Vector position_ = Vector::Constant(0.0), velocity_ = Vector::Constant(0.0), disturbance_ = Vector::Constant(0.0);  // estimate
  Vector model_position_ = Vector::Constant(0.0), model_velocity_ = Vector::Constant(0.0);                            // to follow
  Vector acceleration_ = Vector::Constant(0.0), command_ = Vector::Constant(0.0);                                     // of this tick
  Vector lost_ = Vector::Constant(0.0);                                          // acceleration missing near a singular pose, m/s^2
  TipJacobian<dof, Scalar> jacobian_ = TipJacobian<dof, Scalar>::Constant(0.0);  // of this tick
  mechanism::TipInverse<dof, Scalar> inverse_;                                   // of this tick
  // NOLINTEND(cppcoreguidelines-non-private-member-variables-in-classes,misc-non-private-member-variables-in-classes)

 private:
  template <class, class>
  friend class TipPositioning;
};

}  // namespace palpate::control
