#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/control/controller.hpp"
#include "palpate/control/stiffness_normalization.hpp"
#include "palpate/control/tip_positioning.hpp"
#include "palpate/control/workspace_gains.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

/// Force tracking that responds alike at every pose and for every stiffness of the object. Runs in SIMD lanes.
///
/// - Reference and object force are divided by the object's stiffness (StiffnessNormalization): the controller positions the tip
///   (TipPositioning).
/// - A reference model moves to the target in nearly least time within the drive's limit of the tick (Workman 1987).
///
/// The measured position is the deflection d = F_object/K, and the target of the reference model r = F_ref/K. The command is u of
/// TipPositioning without the gravity compensation.
///
/// With `normal_only`, an object with a normal n is tracked along n alone: u = weight + (F_ref - F_object)_t + n f, where f gives the
/// acceleration n . a. Along the surface the motors display the object's force, such as friction, and the operator moves the tip. Before
/// the first contact the motors carry the weight alone.
template <class Mechanism, class Number = double>
class WorkspaceController : public TipPositioning<Mechanism, Number> {
  using Base = TipPositioning<Mechanism, Number>;

 public:
  using Base::dof;
  using typename Base::Angles;
  using typename Base::Scalar;
  using typename Base::Vector;

  WorkspaceController() = default;
  /// @param mechanism  as the controller knows it
  /// @param friction   viscous, of the joints, N*m*s/rad
  /// @param p          must have no fault()
  /// @param period     servo period, s
  WorkspaceController(const Mechanism& mechanism, const Joints<dof>& friction, const WorkspaceParameters& p, double period)
      : Base(mechanism, friction, WorkspaceGains(p, period), period), parameters_(p), normalization_(p.stiffness) {
    operator_mass_ = p.operator_mass;
  }

  /// Return the same controller for a lane scalar.
  template <class Other>
  [[nodiscard]] WorkspaceController<Mechanism, Other> cast() const {
    WorkspaceController<Mechanism, Other> out;
    out.copy_parameters(*this);
    out.parameters_ = parameters_;
    out.normalization_ = BasicStiffnessNormalization<Other>(normalization_.design_stiffness());
    return out;
  }

  /// Set the state of one lane; all lanes share the parameters.
  void set_lane(int lane, const WorkspaceController<Mechanism>& one) {
    using math::set_lane;
    Base::set_lane(lane, one);
    normalization_.set_lane(lane, one.normalization_);
    set_lane(normal_, lane, one.normal_);
    set_lane(last_object_, lane, one.last_object_);
  }

  /// Return the tip force [N] for the signals of a tick; zero at a singular pose.
  Vector command(const BasicTickInput<Scalar>& input) noexcept {
    const Condition<Scalar> regular = Base::update(input.angles);
    const auto dynamics = Base::dynamics();
    const auto forces = normalization_.apply(input);
    const Vector force = parameters_.normal_only ? along_normal(input, forces.reference, forces.object, dynamics)
                                                 : in_space(input, forces.reference, forces.object, dynamics);
    return Base::hand_over(regular, Vector(force - input.gravity_compensation));
  }

  /// Predict the next sample with the force that the drive gave [N].
  void applied(const Vector& force) noexcept {
    Base::predict(force, [this](const Vector& change) -> Vector {
      if (parameters_.normal_only) return normal_ * normal_.dot(change);
      return change;
    });
  }

  void reset() noexcept {
    Base::forget();
    normalization_.reset();
    normal_ = last_object_ = Vector::Constant(0.0);
  }

 private:
  template <class, class>
  friend class WorkspaceController;
  using Base::acceleration_, Base::disturbance_, Base::friction_, Base::gains_, Base::inverse_, Base::jacobian_;
  using Base::lost_, Base::model_position_, Base::model_velocity_, Base::operator_mass_, Base::period_, Base::position_, Base::started_;
  using Base::velocity_;

  /// Return the force of operator and motors [N] that tracks the scaled forces in all directions in which the tip can move.
  template <class Dynamics>
  Vector in_space(const BasicTickInput<Scalar>& input, const Vector& reference, const Vector& object, const Dynamics& dynamics) noexcept {
    const Vector stiffness = parameters_.stiffness.template cast<Scalar>();
    const Vector target = inverse_.reachable(jacobian_, Vector(reference.cwiseQuotient(stiffness)));
    Base::observe(inverse_.reachable(jacobian_, Vector(object.cwiseQuotient(stiffness))), Vector(Vector::Constant(0.0)));
    const Angles held = Base::holding_torque(dynamics);
    const Vector weight = Base::weight_force(held, dynamics);
    const Vector pulled = inverse_.reachable(jacobian_, input.reference);
    const Vector model_acceleration =
        plan(Vector(target - model_position_), Vector(weight - pulled), input.force_limit,
             [&](const Vector& a) { return inverse_.to_tip(dynamics.inertia_torque(inverse_.to_joints(a))); });
    Base::feed_back(model_acceleration);
    const Vector motion = Base::motion_force(held, dynamics);
    move_model(model_acceleration);
    // In directions in which the tip cannot move, the operator's share is all of the force.
    return weight + motion + (input.reference - pulled);
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
    Base::observe(Vector(normal * (per_stiffness * normal.dot(object))), Vector(normal * normal.dot(input.velocity())));
    const auto inverse_inertia = dynamics.inverse();
    const auto mobility = [&](const Vector& f) {
      return math::product(jacobian_, Angles(inverse_inertia * math::transposed_product(jacobian_, f)));
    };
    const Vector along = mobility(normal);
    const Scalar movable = normal.dot(along);
    const Scalar inertia = select(none < movable, 1.0 / movable, none);
    const auto tangential = [&](const Vector& f) { return Vector(f - normal * normal.dot(f)); };

    const Angles speed = inverse_.to_joints(model_velocity_);
    Angles torque = Base::holding_torque(dynamics);
    for (int i = 0; i < dof; ++i) torque[i] += friction_[i] * speed[i];
    const Vector weight = Base::weight_force(torque, dynamics);
    const Vector felt = input.object_force + display_lead * (input.object_force - last_object_);
    last_object_ = input.object_force;
    const Vector target = normal * (per_stiffness * normal.dot(reference));
    const Vector model_acceleration =
        plan(Vector(target - model_position_), Vector(weight - normal * normal.dot(input.reference) - tangential(felt)), input.force_limit,
             [&](const Vector& a) { return Vector(normal * (inertia * normal.dot(a))); });
    Base::feed_back(model_acceleration);
    const Vector beside = tangential(Vector(input.reference - felt));
    const Scalar force = inertia * (normal.dot(Vector(acceleration_ - lost_)) - along.dot(beside));
    lost_ = Vector::Constant(0.0);
    move_model(model_acceleration);
    return weight + beside + force * normal;
  }

  /// Move the reference model by one period.
  void move_model(const Vector& acceleration) noexcept {
    model_position_ += period_ * (model_velocity_ + 0.5 * period_ * acceleration);
    model_velocity_ += period_ * acceleration;
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

  static constexpr double least_share = 0.05;  // of the limit that always accelerates the model
  static constexpr double display_lead = 4.0;  // periods by which the displayed force leads, so that a sampled spring is damped

  WorkspaceParameters parameters_;
  BasicStiffnessNormalization<Scalar> normalization_;
  Vector normal_ = Vector::Constant(0.0), last_object_ = Vector::Constant(0.0);  // of the last tick, with normal_only
};

}  // namespace palpate::control
