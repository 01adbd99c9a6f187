#pragma once

#include <utility>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/plant/human_arm.hpp"
#include "palpate/plant/joint_friction.hpp"

namespace palpate::plant {

/// State of the plant: joints and, with a tissue coupling, the operator's hand.
template <int dof, class Scalar = double>
struct PlantState {
  Joints<dof, Scalar> q = Joints<dof, Scalar>::Constant(0.0);      ///< rad
  Joints<dof, Scalar> qd = Joints<dof, Scalar>::Constant(0.0);     ///< rad/s
  Vector3<Scalar> hand_position = Vector3<Scalar>::Constant(0.0);  ///< m
  Vector3<Scalar> hand_velocity = Vector3<Scalar>::Constant(0.0);  ///< m/s

  /// Copy the state of one loop into a lane.
  void set_lane(int lane, const PlantState<dof>& one) {
    using math::set_lane;
    set_lane(q, lane, one.q);
    set_lane(qd, lane, one.qd);
    set_lane(hand_position, lane, one.hand_position);
    set_lane(hand_velocity, lane, one.hand_velocity);
  }
};

/// Each entry of `yes` where the condition is true, otherwise of `no`.
template <int dof, class Scalar>
[[nodiscard]] inline PlantState<dof, Scalar> select_state(const Condition<Scalar>& condition, const PlantState<dof, Scalar>& yes,
                                                          const PlantState<dof, Scalar>& no) {
  return {select_each(condition, yes.q, no.q), select_each(condition, yes.qd, no.qd),
          select_each(condition, yes.hand_position, no.hand_position), select_each(condition, yes.hand_velocity, no.hand_velocity)};
}

/// How the operator is coupled to the tip: not at all, by a voluntary force only, by an arm that moves with the tip, or by an arm behind
/// fingertip tissue.
enum class HandCoupling { none, force_only, rigid, tissue };

/// Equations of motion of a mechanism with friction and a human arm, M qdd + C qd + N + friction = tau + J^T f, and one integration step.
template <class Mechanism, class Scalar>
class PlantDynamics {
 public:
  static_assert(mechanism::MechanismCheck<Mechanism>::passed);
  static constexpr int dof = Mechanism::dof;
  using State = PlantState<dof, Scalar>;
  using Torque = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;
  using Friction = JointFriction<dof, Scalar>;
  using KinematicsCache = mechanism::KinematicsCacheOf<Mechanism, Scalar>;
  using MechanismDynamics = typename Mechanism::template Dynamics<Scalar>;
  using InverseInertia = typename MechanismDynamics::Inverse;

  /// A pose and the equations of motion there.
  struct PointDynamics {
    KinematicsCache kinematics;
    MechanismDynamics dynamics;
  };

  /// Motor torques, constant during a substep, and the voluntary force, linear in time.
  struct AppliedLoad {
    Torque torque;      // N*m
    Vector force;       // N, at the begin of the substep
    Vector force_rate;  // N/s

    [[nodiscard]] Vector force_at(const Scalar& t) const { return force + t * force_rate; }
  };

  struct Acceleration {
    Torque joints;  // rad/s^2
    Vector hand;    // m/s^2
  };

  /// The joint modes of a plant without dry friction.
  struct NoDryFriction {
    [[nodiscard]] InverseInertia inverse(const MechanismDynamics& dynamics) const { return dynamics.inverse(); }
    [[nodiscard]] const Torque& after_friction(const Torque& generalized_force, const Torque& /*qd*/, const Friction& /*friction*/) const {
      return generalized_force;
    }
  };

  PlantDynamics() = default;
  PlantDynamics(const Mechanism& mechanism, const Friction& friction, const BasicHumanArm<Scalar>& human_arm)
      : mechanism_(mechanism), friction_(friction), human_arm_(human_arm) {
    update_constants();
  }

  /// Copy the equations of one loop into a lane. All lanes have the same mechanism.
  void set_lane(int lane, const PlantDynamics<Mechanism, double>& one) {
    mechanism_ = one.mechanism_;
    friction_.set_lane(lane, one.friction_);
    human_arm_.set_lane(lane, one.human_arm_);
    update_constants();
  }

  [[nodiscard]] const Mechanism& mechanism() const { return mechanism_; }
  [[nodiscard]] const Friction& friction() const { return friction_; }
  [[nodiscard]] const BasicHumanArm<Scalar>& human_arm() const { return human_arm_; }

  template <HandCoupling coupling>
  [[nodiscard, gnu::always_inline]] PointDynamics at(const KinematicsCache& kinematics) const {
    // An arm that grips rigidly moves with the tip: its mass is a point mass there, without weight.
    if constexpr (coupling == HandCoupling::rigid) return {kinematics, mechanism_.dynamics(kinematics, inertia_parameters_)};
    return {kinematics, mechanism_.dynamics(kinematics)};
  }

  /// Force of the operator on the tip [N].
  template <HandCoupling coupling>
  [[nodiscard, gnu::always_inline]] Vector operator_force(const KinematicsCache& kinematics, const State& s,
                                                          const Vector& voluntary_force) const {
    if constexpr (coupling == HandCoupling::force_only) return voluntary_force;
    const Vector p = mechanism_.forward(kinematics);
    const Vector v = mechanism_.velocity(kinematics, s.qd);
    if constexpr (coupling == HandCoupling::tissue)
      return human_arm_.tissue_stiffness * (s.hand_position - p) + human_arm_.tissue_damping * (s.hand_velocity - v);
    return (voluntary_force - human_arm_.stiffness * (p - human_arm_.rest)) - human_arm_.damping * v;
  }

  /// Accelerations at a pose, at time `t` [s] after the begin of the substep. The joint positions in `s` are not used.
  template <HandCoupling coupling, class JointModes>
  [[nodiscard, gnu::always_inline]] Acceleration acceleration(const PointDynamics& point, const State& s, const AppliedLoad& load,
                                                              const Scalar& t, const JointModes& modes) const {
    return acceleration<coupling>(point, modes.inverse(point.dynamics), s, load, t, modes);
  }

  template <HandCoupling coupling, class JointModes>
  [[nodiscard, gnu::always_inline]] Acceleration acceleration(const PointDynamics& point, const InverseInertia& inverse, const State& s,
                                                              const AppliedLoad& load, const Scalar& t, const JointModes& modes) const {
    Acceleration out;
    out.joints = inverse * modes.after_friction(generalized_force<coupling>(point, s, load, t, out.hand), s.qd, friction_);
    return out;
  }

  /// Joint torques [N*m] that accelerate the joints, before dry friction. Also computes the acceleration of the hand.
  template <HandCoupling coupling>
  [[nodiscard, gnu::always_inline]] Torque generalized_force(const PointDynamics& point, const State& s, const AppliedLoad& load,
                                                             const Scalar& t, Vector& hand_acceleration) const {
    Torque torque;
    for (int i = 0; i < dof; ++i) torque[i] = load.torque[i] - friction_.viscous[i] * s.qd[i];
    if constexpr (coupling != HandCoupling::none) {
      const Vector voluntary_force = load.force_at(t);
      const Vector on_tip = operator_force<coupling>(point.kinematics, s, voluntary_force);
      if constexpr (coupling == HandCoupling::tissue)
        hand_acceleration = inverse_hand_mass_ * ((voluntary_force - on_tip) - (human_arm_.stiffness * (s.hand_position - human_arm_.rest) +
                                                                                human_arm_.damping * s.hand_velocity));
      torque += mechanism_.apply_jacobian_transpose(point.kinematics, on_tip);
    }
    return point.dynamics.generalized_force(torque, s.qd);
  }

  /// Integrate `s` over `h` [s] from `here` at time `t`, where the accelerations are `k1`.
  template <HandCoupling coupling, class Time, class JointModes>
  [[gnu::always_inline]] void step(State& s, const PointDynamics& here, const Acceleration& k1, const AppliedLoad& load, const Scalar& t,
                                   const Time& h, const JointModes& modes) const {
    State next = s;
    if (all(nystrom_step<coupling, false>(next, here, k1, load, t, h, modes))) [[likely]]
      s = next;
    else
      large_step<coupling>(s, here, k1, load, t, h, modes);
  }

 private:
  template <class, class>
  friend class PlantDynamics;

  using Bool = Condition<Scalar>;

  /// A step in which a joint may move far, so that its sine and cosine are computed anew.
  template <HandCoupling coupling, class Time, class JointModes>
  [[gnu::noinline, gnu::cold]] void large_step(State& s, const PointDynamics& here, const Acceleration& k1, const AppliedLoad& load,
                                               const Scalar& t, const Time& h, const JointModes& modes) const {
    nystrom_step<coupling, true>(s, here, k1, load, t, h, modes);
  }

  /// One step of y'' = f(t, y, y') by the method of Nystrom of order 4 (1925; Hairer, Norsett & Wanner, Solving ODEs I, II.14).
  /// It is a Runge-Kutta method with both middle stages at one position, so that the equations of motion are inverted there only once.
  /// @tparam large  joints may move far; if false, the return value says in which lanes all displacements were small enough
  template <HandCoupling coupling, bool large, class Time, class JointModes>
  [[gnu::always_inline]] Bool nystrom_step(State& s, const PointDynamics& here, const Acceleration& k1, const AppliedLoad& load,
                                           const Scalar& t, const Time& h, const JointModes& modes) const {
    const Time half = 0.5 * h;
    const Time eighth = 0.5 * half * half;
    State stage = s;
    const auto update_velocities = [&](const Acceleration& k, const Time& after) {
      stage.qd = s.qd + after * k.joints;
      if constexpr (coupling == HandCoupling::tissue) stage.hand_velocity = s.hand_velocity + after * k.hand;
    };
    Bool is_small = true;
    const auto advance = [&](const Torque& displacement) {
      if constexpr (large) return mechanism_.advance(here.kinematics, displacement);
      is_small = is_small & mechanism_.is_small(displacement);
      return mechanism_.advance_small(here.kinematics, displacement);
    };
    const PointDynamics middle = at<coupling>(advance(half * s.qd + eighth * k1.joints));
    if constexpr (coupling == HandCoupling::tissue) stage.hand_position = s.hand_position + (half * s.hand_velocity + eighth * k1.hand);
    const InverseInertia inverse = modes.inverse(middle.dynamics);
    update_velocities(k1, half);
    const Acceleration k2 = acceleration<coupling>(middle, inverse, stage, load, t + half, modes);
    update_velocities(k2, half);
    const Acceleration k3 = acceleration<coupling>(middle, inverse, stage, load, t + half, modes);
    const PointDynamics last = at<coupling>(advance(h * s.qd + (h * half) * k3.joints));
    if constexpr (coupling == HandCoupling::tissue) stage.hand_position = s.hand_position + (h * s.hand_velocity + (h * half) * k3.hand);
    update_velocities(k3, h);
    const Acceleration k4 = acceleration<coupling>(last, stage, load, t + h, modes);
    const Time sixth = h * (1.0 / 6.0);
    const auto integrate = [&](auto& y, auto& v, const auto& a1, const auto& a2, const auto& a3, const auto& a4) {
      y += h * (v + sixth * (a1 + (a2 + a3)));
      v += sixth * ((a1 + a4) + 2.0 * (a2 + a3));
    };
    integrate(s.q, s.qd, k1.joints, k2.joints, k3.joints, k4.joints);
    if constexpr (coupling == HandCoupling::tissue) integrate(s.hand_position, s.hand_velocity, k1.hand, k2.hand, k3.hand, k4.hand);
    return is_small;
  }

  void update_constants() {
    inertia_parameters_ = mechanism_.inertia_parameters(human_arm_.mass);
    if (human_arm_.tissue) inverse_hand_mass_ = 1.0 / human_arm_.mass;
  }

  Mechanism mechanism_;
  Friction friction_;
  BasicHumanArm<Scalar> human_arm_;
  decltype(std::declval<Mechanism>().inertia_parameters(std::declval<Scalar>())) inertia_parameters_{};  // with the mass of the arm
  Scalar inverse_hand_mass_ = 0.0;
};

}  // namespace palpate::plant
