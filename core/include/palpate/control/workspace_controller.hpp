#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/control/controller.hpp"
#include "palpate/control/stiffness_normalization.hpp"
#include "palpate/control/workspace_gains.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/mechanism.hpp"

namespace palpate::control {

/// Force tracking that responds alike at every pose and for every stiffness of the object.
///
/// - Reference and object force are divided by the object's stiffness (StiffnessNormalization): the controller positions the tip.
/// - The tip's inertia L(q) = J^-T M J^-1 is decoupled (Khatib 1987), and gravity, Coriolis forces and friction are fed forward.
/// - A reference model moves to the target in nearly least time within the drive's limit of the tick (Workman 1987).
/// - An observer per axis estimates deflection, velocity and a constant disturbance. It is driven by the force that was applied, so that a
///   limit winds nothing up. The disturbance is the integrator.
///
/// With d = F_object/K, r = F_ref/K, model (x_r, v_r, a_r) and estimate (x, v, w):
///   a = a_r + k_p (x_r - x) + k_d (v_r - v) - w
///   u = J^-T (M J^-1 (a - J' qd_r) + C qd_r + N + friction qd_r) - gravity compensation,   qd_r = J^-1 v_r
template <class Mechanism>
class WorkspaceController {
  static_assert(Mechanism::dof == 3, "palpate: a workspace controller needs a mechanism with three joints");

 public:
  using Scalar = double;
  static constexpr int dof = 3;

  WorkspaceController() = default;
  /// @param mechanism  as the controller knows it
  /// @param friction   viscous, of the joints, N*m*s/rad
  /// @param p          must have no fault()
  /// @param period     servo period, s
  WorkspaceController(const Mechanism& mechanism, const Joints<dof>& friction, const WorkspaceParameters& p, double period)
      : mechanism_(mechanism), friction_(friction), parameters_(p), gains_(p, period), period_(period), normalization_(p.stiffness) {}

  [[nodiscard]] const WorkspaceGains& gains() const noexcept { return gains_; }

  /// Return the tip force [N] for the signals of a tick; zero at a singular pose.
  Vector3<> command(const TickInput& input) noexcept {
    const Joints<dof> q = Eigen::Map<const Joints<dof>>(input.angles);
    const auto cache = mechanism_.kinematics(q);
    jacobian_ = mechanism_.jacobian(cache);
    const double size = jacobian_.squaredNorm(), determinant = jacobian_.determinant();
    singular_ = !(determinant * determinant > 1e-18 * size * size * size);
    if (singular_) {
      started_ = false;
      return Vector3<>::Zero();
    }
    inverse_ = jacobian_.inverse();
    const auto dynamics = mechanism_.dynamics(cache);
    const auto [reference, object] = normalization_.apply(input);
    const Vector3<> target = reference.cwiseQuotient(parameters_.stiffness), deflection = object.cwiseQuotient(parameters_.stiffness);
    observe(deflection);

    const Joints<dof> none = Joints<dof>::Zero();
    const Vector3<> weight = to_tip(-dynamics.generalized_force(none, none));
    const Vector3<> model_acceleration = plan(target - model_position_, weight - input.reference, input.force_limit,
                                              [&](const Vector3<>& a) { return to_tip(dynamics.inertia_torque(inverse_ * a)); });
    acceleration_ = model_acceleration + gains_.position * (model_position_ - position_) + gains_.velocity * (model_velocity_ - velocity_) -
                    disturbance_;
    const Joints<dof> speed = inverse_ * model_velocity_;
    const Joints<dof> torque = dynamics.inertia_torque(inverse_ * (acceleration_ - turning(q, speed))) -
                               dynamics.generalized_force(none, speed) + friction_.cwiseProduct(speed);
    command_ = to_tip(torque) - input.gravity_compensation;
    model_position_ += period_ * (model_velocity_ + 0.5 * period_ * model_acceleration);
    model_velocity_ += period_ * model_acceleration;
    cache_ = cache;
    return command_;
  }

  /// Predict the next sample with the force that the drive gave [N].
  void applied(const Vector3<>& force) noexcept {
    if (singular_) return;
    Vector3<> acceleration = acceleration_ + disturbance_;
    if (const Vector3<> missing = force - command_; !missing.isZero(0.0))  // J M^-1 J^T times it
      acceleration += jacobian_ * (mechanism_.dynamics(cache_).inverse() * Joints<dof>(jacobian_.transpose() * missing));
    position_ += period_ * (velocity_ + 0.5 * period_ * acceleration);
    velocity_ += period_ * acceleration;
  }

  void reset() noexcept {
    normalization_.reset();
    started_ = false;
    singular_ = false;
  }

 private:
  [[nodiscard]] Vector3<> to_tip(const Joints<dof>& torque) const noexcept { return inverse_.transpose() * torque; }

  /// Correct the estimate by the measured deflection [m]. The first one starts the estimate and the model.
  void observe(const Vector3<>& deflection) noexcept {
    if (!started_) {
      started_ = true;
      position_ = model_position_ = deflection;
      velocity_ = model_velocity_ = disturbance_ = Vector3<>::Zero();
      return;
    }
    const Vector3<> error = deflection - position_;
    position_ += gains_.observer[0] * error;
    velocity_ += gains_.observer[1] * error;
    disturbance_ += gains_.observer[2] * error;
  }

  /// Return the acceleration of the reference model [m/s^2]: proximate time-optimal, within the share of the drive's limit.
  /// @param way       from the model to the target, m
  /// @param constant  force of the motors without acceleration, N
  /// @param limit     of the motors, N
  /// @param inertia   force of an acceleration, N
  template <class Inertia>
  [[nodiscard]] Vector3<> plan(const Vector3<>& way, const Vector3<>& constant, double limit, Inertia inertia) const noexcept {
    const double kp = gains_.reference_position, kd = gains_.reference_velocity, distance = way.norm();
    Vector3<> speed = (kp / kd) * way;
    if (distance > 0.0 && std::isfinite(limit)) {
      const Vector3<> direction = way / distance;
      const double braking = available(inertia(-direction), constant, limit), linear = 0.5 * braking * kd * kd / (kp * kp);
      if (distance > linear) speed = (std::sqrt(2.0 * braking * distance) - (kp / kd) * linear) * direction;
    }
    Vector3<> wanted = kd * (speed - model_velocity_);
    const double size = wanted.norm();
    if (!(size > 0.0) || !std::isfinite(limit)) return wanted;
    const Vector3<> along = wanted / size;
    return std::min(size, available(inertia(along), constant, limit)) * along;
  }

  /// Return the share of the acceleration along one direction that the motors can give: |constant + a force| <= limit.
  /// @param force  of a unit acceleration in this direction, N s^2/m
  [[nodiscard]] double available(const Vector3<>& force, const Vector3<>& constant, double limit) const noexcept {
    const double a = force.squaredNorm(), b = constant.dot(force), c = constant.squaredNorm() - limit * limit;
    const double least = 0.05 * limit / std::sqrt(a);  // the motors hold nearly their limit already: go slowly
    const double most = c < 0.0 ? (-b + std::sqrt(b * b - a * c)) / a : 0.0;
    return parameters_.share * std::max(most, least);
  }

  /// Return J' qd [m/s^2]: acceleration of the tip at constant joint speeds.
  [[nodiscard]] Vector3<> turning(const Joints<dof>& q, const Joints<dof>& speed) const noexcept {
    using Variable = Dual<1>;
    Joints<dof, Variable> moving, constant;
    for (int i = 0; i < dof; ++i) {
      moving[i] = Variable(q[i]);
      moving[i].gradient[0] = speed[i];
      constant[i] = Variable(speed[i]);
    }
    const Vector3<Variable> velocity = mechanism_.velocity(mechanism_.kinematics(moving), constant);
    return {velocity[0].gradient[0], velocity[1].gradient[0], velocity[2].gradient[0]};
  }

  Mechanism mechanism_{};
  Joints<dof> friction_ = Joints<dof>::Zero();
  WorkspaceParameters parameters_;
  WorkspaceGains gains_;
  double period_ = 1e-3;
  StiffnessNormalization normalization_;
  bool started_ = false, singular_ = false;
  Vector3<> position_ = Vector3<>::Zero(), velocity_ = Vector3<>::Zero(), disturbance_ = Vector3<>::Zero();  // estimate
  Vector3<> model_position_ = Vector3<>::Zero(), model_velocity_ = Vector3<>::Zero();
  Vector3<> acceleration_ = Vector3<>::Zero(), command_ = Vector3<>::Zero();  // of this tick
  Eigen::Matrix3d jacobian_ = Eigen::Matrix3d::Identity(), inverse_ = Eigen::Matrix3d::Identity();
  mechanism::KinematicsCacheOf<Mechanism> cache_ = Mechanism().kinematics(Joints<dof>(Joints<dof>::Zero()));  // of this tick
};

}  // namespace palpate::control
