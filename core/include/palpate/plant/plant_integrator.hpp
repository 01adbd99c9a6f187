#pragma once

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/plant/human_arm.hpp"
#include "palpate/plant/joint_friction.hpp"
#include "palpate/plant/plant_dynamics.hpp"
#include "palpate/plant/stick_slip.hpp"

namespace palpate::plant {

/// Integrates the continuous plant between two samples: a mechanism with joint friction, held by a human arm, under constant motor torques.
///
/// Smooth motion is integrated by the method of Nystrom of order 4, motion with dry friction by StickSlip.
/// The scalar is double for one loop or Pack for several side by side. Each lane sticks, slides and changes its mode independently.
template <class Mechanism, class Scalar = double>
class PlantIntegrator {
 public:
  static constexpr int dof = Mechanism::dof;
  using State = PlantState<dof, Scalar>;
  using Torque = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;
  using Kinematics = mechanism::IncrementalKinematics<Mechanism, Scalar>;

  PlantIntegrator() = default;
  PlantIntegrator(const Mechanism& mechanism, const JointFriction<dof, Scalar>& friction, const BasicHumanArm<Scalar>& human_arm)
      : plant_(mechanism, friction, human_arm), has_dry_friction_(friction.dry()), is_held_(!human_arm.empty()) {}

  [[nodiscard]] const Mechanism& mechanism() const { return plant_.mechanism(); }
  [[nodiscard]] const JointFriction<dof, Scalar>& friction() const { return plant_.friction(); }

  /// Copy the plant of one loop into a lane. All lanes have the same mechanism, and all or none have an arm, tissue and dry friction.
  void set_lane(int lane, const PlantIntegrator<Mechanism>& one) {
    plant_.set_lane(lane, one.plant_);
    has_dry_friction_ = one.has_dry_friction_;
    is_held_ = one.is_held_;
  }

  /// Integrate `state` over `period` [s] in `substeps` equal steps, under constant motor torques [N*m] and the voluntary force.
  /// @tparam Time  double for all loops, or Scalar for a period per lane
  template <class Time>
  void advance(State& state, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period, int substeps) const noexcept {
    Kinematics kinematics(mechanism().kinematics(state.q));
    advance(state, kinematics, torque, force, period, substeps);
  }

  /// As above, with the kinematics of `state`, which are updated too.
  template <class Time>
  void advance(State& state, Kinematics& kinematics, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period,
               int substeps) const noexcept {
    if (plant_.human_arm().tissue) {
      advance_coupled<HandCoupling::tissue>(state, kinematics, torque, force, period, substeps);
    } else if (is_held_) {
      advance_coupled<HandCoupling::rigid>(state, kinematics, torque, force, period, substeps);
    } else if (has_dry_friction_ || is_nonzero(force.begin) || is_nonzero(force.end)) {
      advance_coupled<HandCoupling::force_only>(state, kinematics, torque, force, period, substeps);
    } else {
      advance_coupled<HandCoupling::none>(state, kinematics, torque, force, period, substeps);
    }
  }

  /// Joint accelerations [rad/s^2] at one instant without an operator, sticking included.
  [[nodiscard]] Torque acceleration(const Torque& q, const Torque& qd, const Torque& torque) const noexcept {
    State state;
    state.q = q;
    state.qd = qd;
    return joint_acceleration<HandCoupling::none>(mechanism().kinematics(q), state, {torque, Vector::Constant(0.0), Vector::Constant(0.0)});
  }

  /// Force of the operator on the tip [N], as a force sensor in the stylus would read it. With a rigid coupling, without the inertial force
  /// of the arm.
  [[nodiscard]] Vector operator_force(const State& s, const Vector& voluntary_force) const noexcept {
    if (!is_held_) return voluntary_force;
    const auto kinematics = mechanism().kinematics(s.q);
    return plant_.human_arm().tissue ? plant_.template operator_force<HandCoupling::tissue>(kinematics, s, voluntary_force)
                                     : plant_.template operator_force<HandCoupling::rigid>(kinematics, s, voluntary_force);
  }

  /// As operator_force(), with the inertial force of the arm under these motor torques [N*m].
  [[nodiscard]] Vector sensed_force(const State& s, const Kinematics& kinematics, const Torque& torque,
                                    const Vector& voluntary_force) const noexcept {
    Vector force = operator_force(s, voluntary_force);
    if (!is_held_ || plant_.human_arm().tissue) return force;
    const Torque joints = joint_acceleration<HandCoupling::rigid>(kinematics.current, s, {torque, voluntary_force, Vector::Constant(0.0)});
    const Vector tip = mechanism().velocity(kinematics.current, joints) + mechanism().velocity_product(kinematics.current, s.qd);
    force -= plant_.human_arm().mass * tip;
    return force;
  }

 private:
  template <class, class>
  friend class PlantIntegrator;

  using Dynamics = PlantDynamics<Mechanism, Scalar>;
  using PointDynamics = typename Dynamics::PointDynamics;
  using AppliedLoad = typename Dynamics::AppliedLoad;
  using NoDryFriction = typename Dynamics::NoDryFriction;

  static bool is_nonzero(const Vector& force) {
    const Scalar zero = 0.0;
    return any(force[0] != zero) || any(force[1] != zero) || any(force[2] != zero);
  }

  /// Joint accelerations [rad/s^2] at one instant, sticking included.
  template <HandCoupling coupling>
  [[nodiscard]] Torque joint_acceleration(const typename Dynamics::KinematicsCache& at, const State& state,
                                          const AppliedLoad& load) const noexcept {
    const PointDynamics here = plant_.template at<coupling>(at);
    if (has_dry_friction_) {
      const auto modes = StickSlip<Mechanism, Scalar>(plant_).template choose_modes<coupling>(here, state, load, Scalar(0.0));
      return plant_.template acceleration<coupling>(here, state, load, Scalar(0.0), modes).joints;
    }
    return plant_.template acceleration<coupling>(here, state, load, Scalar(0.0), NoDryFriction{}).joints;
  }

  template <HandCoupling coupling, class Time>
  void advance_coupled(State& state, Kinematics& kinematics, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period,
                       int substeps) const {
    const Time step = period / static_cast<double>(substeps);
    AppliedLoad load{torque, force.begin, Vector::Constant(0.0)};
    if constexpr (coupling != HandCoupling::none) load.force_rate = force.rate(period);
    for (int i = 0; i < substeps; ++i) {
      if constexpr (coupling != HandCoupling::none) {
        load.force = force.at(static_cast<double>(i) / substeps);
        if (has_dry_friction_) {
          StickSlip<Mechanism, Scalar>(plant_).template step<coupling>(state, kinematics.current, load, Scalar(step));
          kinematics.update(mechanism(), state.q);
          continue;
        }
      }
      const PointDynamics here = plant_.template at<coupling>(kinematics.current);
      const auto first = plant_.template acceleration<coupling>(here, state, load, Scalar(0.0), NoDryFriction{});
      plant_.template step<coupling>(state, here, first, load, Scalar(0.0), step, NoDryFriction{});
      kinematics.update(mechanism(), state.q);
    }
  }

  Dynamics plant_;
  bool has_dry_friction_ = false;
  bool is_held_ = false;
};

}  // namespace palpate::plant
