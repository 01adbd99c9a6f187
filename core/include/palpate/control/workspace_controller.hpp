#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/control/controller.hpp"
#include "palpate/control/stiffness_normalization.hpp"
#include "palpate/control/workspace_gains.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/mechanism/tip_inverse.hpp"

namespace palpate::control {

/// Force tracking that responds alike at every pose and for every stiffness of the object. Runs in SIMD lanes.
///
/// - Reference and object force are divided by the object's stiffness (StiffnessNormalization): the controller positions the tip.
/// - The tip's inertia L(q) = J^+T M J^+ is decoupled (Khatib 1987), and gravity, Coriolis forces and friction are fed forward.
/// - A reference model moves to the target in nearly least time within the drive's limit of the tick (Workman 1987).
/// - An observer per axis estimates deflection, velocity and a constant disturbance. It is driven by the force that was applied, so that a
///   limit winds nothing up. The disturbance is the integrator.
/// - With fewer than three joints, all of this happens in the directions in which the tip can move (range of J).
/// - Near a singular pose the inverse of the mobility A = J M^-1 J^T is damped, so that no direction takes all of the drive's force.
///
/// With d = F_object/K, r = F_ref/K, model (x_r, v_r, a_r) and estimate (x, v, w):
///   a = a_r + k_p (x_r - x) + k_d (v_r - v) - w
///   u = J^+T (M J^+ (a - J' qd_r) + C qd_r + N + friction qd_r) - gravity compensation,   qd_r = J^+ v_r
///
/// With `normal_only`, an object with a normal n is tracked along n alone: u = weight + (F_ref - F_object)_t + n f, where f gives the
/// acceleration n . a. Along the surface the motors display the object's force, such as friction, and the operator moves the tip. Before
/// the first contact the motors carry the weight alone.
template <class Mechanism, class Number = double>
class WorkspaceController {
  static_assert(Mechanism::dof <= 3, "palpate: a workspace controller needs a mechanism with at most three joints");

 public:
  using Scalar = Number;
  static constexpr int dof = Mechanism::dof;
  using Vector = Vector3<Scalar>;
  using Angles = Joints<dof, Scalar>;

  WorkspaceController() = default;
  /// @param mechanism  as the controller knows it
  /// @param friction   viscous, of the joints, N*m*s/rad
  /// @param p          must have no fault()
  /// @param period     servo period, s
  WorkspaceController(const Mechanism& mechanism, const Joints<dof>& friction, const WorkspaceParameters& p, double period)
      : mechanism_(mechanism), friction_(friction), parameters_(p), gains_(p, period), period_(period), normalization_(p.stiffness) {}

  /// Return the same controller for a lane scalar.
  template <class Other>
  [[nodiscard]] WorkspaceController<Mechanism, Other> cast() const {
    WorkspaceController<Mechanism, Other> out;
    out.mechanism_ = mechanism_;
    out.friction_ = friction_;
    out.parameters_ = parameters_;
    out.gains_ = gains_;
    out.period_ = period_;
    out.normalization_ = BasicStiffnessNormalization<Other>(normalization_.design_stiffness());
    return out;
  }

  /// Set the state of one lane; all lanes share the parameters.
  void set_lane(int lane, const WorkspaceController<Mechanism>& one) {
    using math::set_lane;
    normalization_.set_lane(lane, one.normalization_);
    kinematics_.set_lane(lane, one.kinematics_);
    set_lane(started_, lane, one.started_);
    set_lane(position_, lane, one.position_);
    set_lane(velocity_, lane, one.velocity_);
    set_lane(disturbance_, lane, one.disturbance_);
    set_lane(model_position_, lane, one.model_position_);
    set_lane(model_velocity_, lane, one.model_velocity_);
    set_lane(lost_, lane, one.lost_);
    set_lane(normal_, lane, one.normal_);
    set_lane(last_object_, lane, one.last_object_);
  }

  [[nodiscard]] const WorkspaceGains& gains() const noexcept { return gains_; }

  /// Return the tip force [N] for the signals of a tick; zero at a singular pose.
  Vector command(const BasicTickInput<Scalar>& input) noexcept {
    kinematics_.update(mechanism_, Eigen::Map<const Angles>(input.angles));
    const auto& cache = kinematics_.current;
    jacobian_ = mechanism_.jacobian(cache);
    const Condition<Scalar> regular = inverse_.update(jacobian_);
    const auto dynamics = mechanism_.dynamics(cache);
    const auto forces = normalization_.apply(input);
    lost_ = Vector::Constant(0.0);
    const Vector force = parameters_.normal_only ? along_normal(input, forces.reference, forces.object, dynamics)
                                                 : in_space(input, forces.reference, forces.object, dynamics);
    command_ = select_each(regular, Vector(force - input.gravity_compensation), Vector(Vector::Constant(0.0)));
    started_ = started_ & regular;
    return command_;
  }

  /// Predict the next sample with the force that the drive gave [N].
  void applied(const Vector& force) noexcept {
    Vector acceleration = acceleration_ + disturbance_ + lost_;
    const Vector missing = force - command_;
    Condition<Scalar> differs = missing[0] != Scalar(0.0);
    for (int i = 1; i < 3; ++i) differs = differs | (missing[i] != Scalar(0.0));
    if (any(differs)) {  // J M^-1 J^T times it
      const Angles more = mechanism_.dynamics(kinematics_.current).inverse() * math::transposed_product(jacobian_, missing);
      Vector change = math::product(jacobian_, more);
      if (parameters_.normal_only) change = normal_ * normal_.dot(change);
      acceleration = select_each(differs, Vector(acceleration + change), acceleration);
    }
    position_ += period_ * (velocity_ + 0.5 * period_ * acceleration);
    velocity_ += period_ * acceleration;
  }

  void reset() noexcept {
    normalization_.reset();
    kinematics_ = Kinematics(rest());
    started_ = false;
    normal_ = last_object_ = lost_ = Vector::Constant(0.0);
  }

 private:
  template <class, class>
  friend class WorkspaceController;
  using Kinematics = mechanism::IncrementalKinematics<Mechanism, Scalar>;

  /// Return the force of operator and motors [N] that tracks the scaled forces in all directions in which the tip can move.
  template <class Dynamics>
  Vector in_space(const BasicTickInput<Scalar>& input, const Vector& reference, const Vector& object, const Dynamics& dynamics) noexcept {
    const Vector stiffness = parameters_.stiffness.template cast<Scalar>();
    const Vector target = inverse_.reachable(jacobian_, Vector(reference.cwiseQuotient(stiffness)));
    observe(inverse_.reachable(jacobian_, Vector(object.cwiseQuotient(stiffness))), Vector(Vector::Constant(0.0)));
    const Angles none = Angles::Constant(0.0);
    const Angles held = -dynamics.generalized_force(none, none);
    const Vector weight = tip_force(held, dynamics, weight_damping);
    const Vector pulled = inverse_.reachable(jacobian_, input.reference);
    const Vector model_acceleration =
        plan(Vector(target - model_position_), Vector(weight - pulled), input.force_limit,
             [&](const Vector& a) { return inverse_.to_tip(dynamics.inertia_torque(inverse_.to_joints(a))); });
    feed_back(model_acceleration);
    const Angles speed = inverse_.to_joints(model_velocity_);
    const Vector turning = mechanism_.velocity_product(kinematics_.current, speed);
    Angles torque =
        dynamics.inertia_torque(inverse_.to_joints(Vector(acceleration_ - turning))) - (dynamics.generalized_force(none, speed) + held);
    for (int i = 0; i < dof; ++i) torque[i] += friction_[i] * speed[i];
    move_model(model_acceleration);
    // In directions in which the tip cannot move, the operator's share is all of the force.
    return weight + tip_force(torque, dynamics, motion_damping) + (input.reference - pulled);
  }

  /// Return the force of operator and motors [N] that tracks the scaled forces along the normal of the contact alone.
  template <class Dynamics>
  Vector along_normal(const BasicTickInput<Scalar>& input, const Vector& reference, const Vector& object,
                      const Dynamics& dynamics) noexcept {
    const Vector normal = normalization_.normal();
    const Scalar none = 0.0;
    const auto touched = none < normal.squaredNorm();
    started_ = started_ & touched & (none < normal_.squaredNorm());
    for (Vector* one : {&position_, &velocity_, &disturbance_, &model_position_, &model_velocity_})  // the normal turns: keep the sizes
      *one = normal * normal_.dot(*one);
    normal_ = normal;

    const Scalar design = normal.cwiseProduct(normal).dot(parameters_.stiffness.template cast<Scalar>());
    const Scalar per_stiffness = select(touched, 1.0 / design, none);
    observe(Vector(normal * (per_stiffness * normal.dot(object))), Vector(normal * normal.dot(input.velocity())));
    const auto inverse_inertia = dynamics.inverse();
    const auto mobility = [&](const Vector& f) {
      return math::product(jacobian_, Angles(inverse_inertia * math::transposed_product(jacobian_, f)));
    };
    const Vector along = mobility(normal);
    const Scalar movable = normal.dot(along);
    const Scalar inertia = select(none < movable, 1.0 / movable, none);
    const auto tangential = [&](const Vector& f) { return Vector(f - normal * normal.dot(f)); };

    const Angles still = Angles::Constant(0.0);
    const Angles speed = inverse_.to_joints(model_velocity_);
    Angles torque = -dynamics.generalized_force(still, still);
    for (int i = 0; i < dof; ++i) torque[i] += friction_[i] * speed[i];
    const Vector weight = tip_force(torque, dynamics, weight_damping);
    const Vector felt = input.object_force + display_lead * (input.object_force - last_object_);
    last_object_ = input.object_force;
    const Vector target = normal * (per_stiffness * normal.dot(reference));
    const Vector model_acceleration =
        plan(Vector(target - model_position_), Vector(weight - normal * normal.dot(input.reference) - tangential(felt)), input.force_limit,
             [&](const Vector& a) { return Vector(normal * (inertia * normal.dot(a))); });
    feed_back(model_acceleration);
    const Vector beside = tangential(Vector(input.reference - felt));
    const Scalar force = inertia * (normal.dot(Vector(acceleration_ - lost_)) - along.dot(beside));
    lost_ = Vector::Constant(0.0);
    move_model(model_acceleration);
    return weight + beside + force * normal;
  }

  /// Set the acceleration of this tick from the model's [m/s^2].
  void feed_back(const Vector& model_acceleration) noexcept {
    acceleration_ = model_acceleration + gains_.position * (model_position_ - position_) + gains_.velocity * (model_velocity_ - velocity_) -
                    disturbance_;
  }

  /// Move the reference model by one period.
  void move_model(const Vector& acceleration) noexcept {
    model_position_ += period_ * (model_velocity_ + 0.5 * period_ * acceleration);
    model_velocity_ += period_ * acceleration;
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

  /// Correct the estimate by the measured deflection [m]. The first one, and the first after a singular pose, starts estimate and model,
  /// with the velocity `begin` [m/s].
  void observe(const Vector& deflection, const Vector& begin) noexcept {
    const Vector zero = Vector::Constant(0.0), error = deflection - position_;
    position_ = select_each(started_, Vector(position_ + gains_.observer[0] * error), deflection);
    velocity_ = select_each(started_, Vector(velocity_ + gains_.observer[1] * error), begin);
    disturbance_ = select_each(started_, Vector(disturbance_ + gains_.observer[2] * error), zero);
    model_position_ = select_each(started_, model_position_, deflection);
    model_velocity_ = select_each(started_, model_velocity_, begin);
    started_ = true;
  }

  /// Return the acceleration of the reference model [m/s^2]: proximate time-optimal, within the share of the drive's limit.
  /// @param way       from the model to the target, m
  /// @param constant  force of the motors without acceleration, N
  /// @param limit     of the motors, N
  /// @param inertia   force of an acceleration, N
  template <class Inertia>
  [[nodiscard]] Vector plan(const Vector& way, const Vector& constant, const Scalar& limit, Inertia inertia) const noexcept {
    using std::sqrt;
    const double kp = gains_.reference_position, kd = gains_.reference_velocity, linear_time = 0.5 * kd * kd / (kp * kp);
    const Scalar none = 0.0;
    Vector speed = (kp / kd) * way;
    const auto bounded = is_finite(limit);
    if (!any(bounded)) return kd * (speed - model_velocity_);
    // Near the target, even the least braking force stops the model in its linear range; elsewhere roots and divisions follow.
    const Scalar near = (least_share * parameters_.share * linear_time) * limit;
    const auto far = bounded & (near * near < inertia(way).squaredNorm());
    if (any(far)) {
      const Scalar distance = sqrt(way.squaredNorm());
      const Vector direction = way * (1.0 / distance);
      const Scalar braking = available(inertia(Vector(-direction)), constant, limit), linear = braking * linear_time;
      const Scalar fastest = sqrt(2.0 * braking * distance) - (kp / kd) * linear;
      speed = select_each(far & (linear < distance), Vector(direction * fastest), speed);
    }
    Vector wanted = kd * (speed - model_velocity_);
    const Vector force = inertia(wanted);
    const auto exceeds = bounded & (limit * limit < Vector(constant + force * (1.0 / parameters_.share)).squaredNorm());
    if (!any(exceeds)) return wanted;
    const Scalar size = sqrt(wanted.squaredNorm());
    const Vector along = wanted * (1.0 / size);
    const Scalar most = min_of(size, available(inertia(along), constant, limit));
    return select_each(exceeds & (none < size), Vector(along * most), wanted);
  }

  /// Return the share of the acceleration along one direction that the motors can give: |constant + a force| <= limit.
  /// @param force  of a unit acceleration in this direction, N s^2/m
  [[nodiscard]] Scalar available(const Vector& force, const Vector& constant, const Scalar& limit) const noexcept {
    using std::sqrt;
    const Scalar none = 0.0, per_a = 1.0 / force.squaredNorm(), b = constant.dot(force), c = constant.squaredNorm() - limit * limit;
    const Scalar least = (least_share * limit) * sqrt(per_a);  // the motors hold nearly their limit already: go slowly
    const Scalar root = sqrt(max_of(b * b - c * force.squaredNorm(), none));
    const Scalar most = select(c < none, (root - b) * per_a, none);
    return parameters_.share * max_of(most, least);
  }

  static constexpr double least_share = 0.05;                            // of the limit that always accelerates the model
  static constexpr double damped_above = 12.0;                           // |J| |J^+| above which the inverse of the mobility is damped
  static constexpr double motion_damping = 0.02, weight_damping = 2e-4;  // of the mobility's trace, largest damping
  static constexpr double display_lead = 4.0;  // periods by which the displayed force leads, so that a sampled spring is damped

  [[nodiscard]] static auto rest() { return Mechanism().kinematics(Angles(Angles::Constant(0.0))); }

  Mechanism mechanism_{};
  Joints<dof> friction_ = Joints<dof>::Zero();
  WorkspaceParameters parameters_;
  WorkspaceGains gains_;
  double period_ = 1e-3;
  BasicStiffnessNormalization<Scalar> normalization_;
  Kinematics kinematics_ = Kinematics(rest());
  Condition<Scalar> started_ = false;
  Vector position_ = Vector::Constant(0.0), velocity_ = Vector::Constant(0.0), disturbance_ = Vector::Constant(0.0);  // estimate
  Vector model_position_ = Vector::Constant(0.0), model_velocity_ = Vector::Constant(0.0);
  Vector acceleration_ = Vector::Constant(0.0), command_ = Vector::Constant(0.0);  // of this tick
  Vector lost_ = Vector::Constant(0.0);                                            // acceleration missing near a singular pose, m/s^2
  Vector normal_ = Vector::Constant(0.0), last_object_ = Vector::Constant(0.0);    // of the last tick, with normal_only
  TipJacobian<dof, Scalar> jacobian_ = TipJacobian<dof, Scalar>::Constant(0.0);    // of this tick
  mechanism::TipInverse<dof, Scalar> inverse_;                                     // of this tick
};

}  // namespace palpate::control
