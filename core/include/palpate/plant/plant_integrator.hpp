#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/plant/human_arm.hpp"
#include "palpate/plant/joint_friction.hpp"

namespace palpate::plant {

/// What a mechanism computes of a pose once, for all that is asked there.
template <class Mechanism, class Scalar = double>
using KinematicsCacheOf = std::decay_t<decltype(std::declval<Mechanism>().kinematics(std::declval<Joints<Mechanism::dof, Scalar>>()))>;

/// Where a mechanism is on its way: its posture, and one near by that it is turned from.
template <class Mechanism, class Scalar = double>
struct IncrementalKinematics {
  KinematicsCacheOf<Mechanism, Scalar> at{};
  KinematicsCacheOf<Mechanism, Scalar> anchor{};

  IncrementalKinematics() = default;
  explicit IncrementalKinematics(const KinematicsCacheOf<Mechanism, Scalar>& start) : at(start), anchor(start) {}

  /// Puts one loop's track into a lane.
  void set_lane(int lane, const IncrementalKinematics<Mechanism>& one) {
    set_lane(at, lane, one.at);
    set_lane(anchor, lane, one.anchor);
  }

 private:
  template <class Pose, class One>
  static void set_lane(Pose& pose, int lane, const One& one) {
    if constexpr (requires { pose.set_lane(lane, one); })
      pose.set_lane(lane, one);
    else
      math::set_lane(pose, lane, one);
  }
};

/// What moves: joints and, when tissue parts them from the tip, the hand.
template <int dof, class Scalar = double>
struct PlantState {
  Joints<dof, Scalar> q = Joints<dof, Scalar>::Constant(0.0);      ///< rad
  Joints<dof, Scalar> qd = Joints<dof, Scalar>::Constant(0.0);     ///< rad/s
  Vector3<Scalar> hand = Vector3<Scalar>::Constant(0.0);           ///< m
  Vector3<Scalar> hand_velocity = Vector3<Scalar>::Constant(0.0);  ///< m/s

  /// Puts one loop's state into a lane.
  void set_lane(int lane, const PlantState<dof>& one) {
    using math::set_lane;
    set_lane(q, lane, one.q);
    set_lane(qd, lane, one.qd);
    set_lane(hand, lane, one.hand);
    set_lane(hand_velocity, lane, one.hand_velocity);
  }
};

/// The continuous physics between two samples: a mechanism with friction, held by a hand, under constant motor torques.
///
/// Nystroem's method of order 4 where the motion is smooth. Dry friction makes it piecewise smooth: each joint sticks or
/// slides in a known direction, the instants at which that changes are located to 1e-10 of the substep, and a stuck
/// joint has speed exactly zero: it neither chatters nor creeps.
///
/// Written once for one loop (double) and for several side by side (Pack): there each lane sticks, slides and changes by itself.
template <class Mechanism, class Scalar = double>
class PlantIntegrator {
 public:
  static constexpr int dof = Mechanism::dof;
  using State = PlantState<dof, Scalar>;
  using Torque = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;

  PlantIntegrator() = default;
  PlantIntegrator(const Mechanism& mechanism, const JointFriction<dof, Scalar>& friction, const BasicHumanArm<Scalar>& hand)
      : mechanism_(mechanism), friction_(friction), hand_(hand), dry_(friction.dry()), loaded_(!hand.empty()) {
    prepare();
  }

  [[nodiscard]] const Mechanism& mechanism() const { return mechanism_; }
  [[nodiscard]] const JointFriction<dof, Scalar>& friction() const { return friction_; }

  /// Puts one loop's physics into a lane; all lanes have the same mechanism, and all or none a hand, tissue, dry friction.
  void set_lane(int lane, const PlantIntegrator<Mechanism>& one) {
    mechanism_ = one.mechanism_;
    friction_.set_lane(lane, one.friction_);
    hand_.set_lane(lane, one.hand_);
    dry_ = one.dry_;
    loaded_ = one.loaded_;
    prepare();
  }

  /// Moves `state` on by `period` [s], one for all or each loop's own, in `substeps` equal steps, under motor torques [N*m] held
  /// constant and the operator's force.
  template <class Time>
  void advance(State& state, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period, int substeps) const noexcept {
    IncrementalKinematics<Mechanism, Scalar> track(mechanism_.kinematics(state.q));
    advance(state, track, torque, force, period, substeps);
  }

  /// The same for whoever keeps the posture of `state` too: it moves with it.
  template <class Time>
  void advance(State& state, IncrementalKinematics<Mechanism, Scalar>& track, const Torque& torque, const ForceSegment<Scalar>& force,
               const Time& period, int substeps) const noexcept {
    if (hand_.tissue) {
      advance_held<HandCoupling::tissue>(state, track, torque, force, period, substeps);
    } else if (loaded_) {
      advance_held<HandCoupling::rigid>(state, track, torque, force, period, substeps);
    } else if (dry_ || acts(force.begin) || acts(force.end)) {
      advance_held<HandCoupling::pushed>(state, track, torque, force, period, substeps);
    } else {
      advance_held<HandCoupling::none>(state, track, torque, force, period, substeps);
    }
  }

  /// Joint accelerations [rad/s^2] at one instant, sticking included, nobody holding the device.
  [[nodiscard]] Torque acceleration(const Torque& q, const Torque& qd, const Torque& torque) const noexcept {
    State state;
    state.q = q;
    state.qd = qd;
    const PointDynamics here = dynamics_at<HandCoupling::none>(mechanism_.kinematics(q));
    const AppliedLoad push{torque, Vector::Constant(0.0), Vector::Constant(0.0)};
    if (dry_)
      return acceleration_at<HandCoupling::none>(here, state, push, Scalar(0.0),
                                                 choose_modes<HandCoupling::none>(here, state, push, Scalar(0.0)))
          .joints;
    return acceleration_at<HandCoupling::none>(here, state, push, Scalar(0.0), NoDryFriction{}).joints;
  }

  /// Force of the operator on the tip [N] at a state (what a force sensor in the stylus would read, without the hand's inertia
  /// when the grip is rigid).
  [[nodiscard]] Vector hand_force(const State& s, const Vector& voluntary) const noexcept {
    if (!loaded_) return voluntary;
    const KinematicsCache at = mechanism_.kinematics(s.q);
    return hand_.tissue ? hand_force<HandCoupling::tissue>(at, s, voluntary) : hand_force<HandCoupling::rigid>(at, s, voluntary);
  }

 private:
  template <class, class>
  friend class PlantIntegrator;

  using KinematicsCache = KinematicsCacheOf<Mechanism, Scalar>;
  using Where = Condition<Scalar>;
  using Dynamics = typename Mechanism::template Dynamics<Scalar>;
  using Inverse = typename Dynamics::Inverse;

  /// How the operator acts on the tip: not at all, with a force, or an arm that moves with the tip or through tissue.
  enum class HandCoupling { none, pushed, rigid, tissue };

  /// A posture and the equations of motion there.
  struct PointDynamics {
    KinematicsCache at;
    Dynamics dynamics;
  };

  struct AppliedLoad {
    Torque torque;
    Vector force;       // at the substep's beginning
    Vector force_rate;  // N/s

    [[nodiscard]] Vector at(const Scalar& t) const { return force + t * force_rate; }
  };

  /// Accelerations.
  struct Acceleration {
    Torque joints;
    Vector hand;
  };

  /// No dry friction.
  struct NoDryFriction {
    [[nodiscard]] Inverse inverse(const Dynamics& dynamics) const { return dynamics.inverse(); }
    [[nodiscard]] const Torque& after_friction(const Torque& generalized_force, const Torque& /*qd*/,
                                               const JointFriction<dof, Scalar>& /*friction*/) const {
      return generalized_force;
    }
  };

  /// How each joint's dry friction acts: stuck, sliding forwards (direction 1) or backwards (-1), or (neither) free of it.
  struct Modes {
    std::array<Where, dof> stuck{};
    Torque direction = Torque::Constant(0.0);

    [[nodiscard]] bool any_stuck() const {
      Where some = false;
      for (int i = 0; i < dof; ++i) some = some | stuck[i];
      return any(some);
    }
    [[nodiscard]] Inverse inverse(const Dynamics& dynamics) const { return dynamics.inverse(stuck); }
    [[nodiscard]] Torque after_friction(Torque generalized_force, const Torque& qd, const JointFriction<dof, Scalar>& friction) const {
      for (int i = 0; i < dof; ++i) generalized_force[i] -= direction[i] * friction.sliding(i, qd[i]);
      return generalized_force;
    }
  };

  /// What follows from the hand.
  void prepare() {
    masses_ = mechanism_.inertia_parameters(hand_.mass);
    if (hand_.tissue) per_hand_mass_ = 1.0 / hand_.mass;
  }

  static bool acts(const Vector& force) {
    const Scalar none = 0.0;
    return any(force[0] != none) || any(force[1] != none) || any(force[2] != none);
  }

  template <HandCoupling grip, class Time>
  void advance_held(State& state, IncrementalKinematics<Mechanism, Scalar>& track, const Torque& torque, const ForceSegment<Scalar>& force,
                    const Time& period, int substeps) const {
    const Time step = period / static_cast<double>(substeps);
    AppliedLoad push{torque, force.begin, Vector::Constant(0.0)};
    if constexpr (grip != HandCoupling::none) push.force_rate = (force.end - force.begin) / period;
    for (int i = 0; i < substeps; ++i) {
      if constexpr (grip != HandCoupling::none) push.force = force.at(static_cast<double>(i) / substeps);
      if constexpr (grip != HandCoupling::none) {
        if (dry_) {
          slide_and_stick<grip>(state, track.at, push, Scalar(step));
          track.at = mechanism_.kinematics_near(track.anchor, state.q);
          continue;
        }
      }
      const PointDynamics here = dynamics_at<grip>(track.at);
      const Acceleration first = acceleration_at<grip>(here, state, push, Scalar(0.0), NoDryFriction{});
      step_from<grip>(state, here, first, push, Scalar(0.0), step, NoDryFriction{});
      track.at = mechanism_.kinematics_near(track.anchor, state.q);
    }
  }

  template <HandCoupling grip>
  [[nodiscard, gnu::always_inline]] PointDynamics dynamics_at(const KinematicsCache& at) const {
    // An arm that grips rigidly moves with the tip: its mass is a point mass there, which gravity does not pull.
    if constexpr (grip == HandCoupling::rigid) return {at, mechanism_.dynamics(at, masses_)};
    return {at, mechanism_.dynamics(at)};
  }

  /// Force on the tip [N] of whoever acts on it.
  template <HandCoupling grip>
  [[nodiscard, gnu::always_inline]] Vector hand_force(const KinematicsCache& at, const State& s, const Vector& voluntary) const {
    if constexpr (grip == HandCoupling::pushed) return voluntary;
    const Vector p = mechanism_.forward(at);
    const Vector v = mechanism_.velocity(at, s.qd);
    if constexpr (grip == HandCoupling::tissue) return hand_.tissue_stiffness * (s.hand - p) + hand_.tissue_damping * (s.hand_velocity - v);
    return (voluntary - hand_.stiffness * (p - hand_.rest)) - hand_.damping * v;
  }

  /// Accelerations at one place, time `t` [s] after the substep's beginning; of `s` the positions of the joints are not looked at.
  template <HandCoupling grip, class Sticking>
  [[nodiscard, gnu::always_inline]] Acceleration acceleration_at(const PointDynamics& there, const State& s, const AppliedLoad& push,
                                                                 const Scalar& t, const Sticking& sticking) const {
    return acceleration_at<grip>(there, sticking.inverse(there.dynamics), s, push, t, sticking);
  }

  template <HandCoupling grip, class Sticking>
  [[nodiscard, gnu::always_inline]] Acceleration acceleration_at(const PointDynamics& there, const Inverse& inverse, const State& s,
                                                                 const AppliedLoad& push, const Scalar& t, const Sticking& sticking) const {
    Acceleration out;
    out.joints = inverse * sticking.after_friction(generalized_force<grip>(there, s, push, t, out.hand), s.qd, friction_);
    return out;
  }

  /// Torques [N*m] that are left to accelerate the joints, but for dry friction; and the acceleration of the hand.
  template <HandCoupling grip>
  [[nodiscard, gnu::always_inline]] Torque generalized_force(const PointDynamics& there, const State& s, const AppliedLoad& push,
                                                             const Scalar& t, Vector& hand) const {
    Torque torque;
    for (int i = 0; i < dof; ++i) torque[i] = push.torque[i] - friction_.viscous[i] * s.qd[i];
    if constexpr (grip != HandCoupling::none) {
      const Vector voluntary = push.at(t);
      const Vector on_tip = hand_force<grip>(there.at, s, voluntary);
      if constexpr (grip == HandCoupling::tissue)
        hand = per_hand_mass_ * ((voluntary - on_tip) - (hand_.stiffness * (s.hand - hand_.rest) + hand_.damping * s.hand_velocity));
      torque += mechanism_.torque(there.at, on_tip);
    }
    return there.dynamics.net(torque, s.qd);
  }

  /// One step; where a joint turns far in it, with new sines and cosines.
  template <HandCoupling grip, class Time, class Sticking>
  [[gnu::always_inline]] void step_from(State& s, const PointDynamics& here, const Acceleration& k1, const AppliedLoad& push,
                                        const Scalar& t, const Time& h, const Sticking& sticking) const {
    State next = s;
    if (all(nystroem<grip, false>(next, here, k1, push, t, h, sticking))) [[likely]]
      s = next;
    else
      step_far<grip>(s, here, k1, push, t, h, sticking);
  }
  template <HandCoupling grip, class Time, class Sticking>
  [[gnu::noinline, gnu::cold]] void step_far(State& s, const PointDynamics& here, const Acceleration& k1, const AppliedLoad& push,
                                             const Scalar& t, const Time& h, const Sticking& sticking) const {
    nystroem<grip, true>(s, here, k1, push, t, h, sticking);
  }

  /// One step of y'' = f(t, y, y') by Nystroem's method of order 4 (1925; Hairer, Norsett & Wanner, II.14): as Runge and Kutta's, but both
  /// stages in the middle are at one place, whose equations of motion are set up and inverted once.
  /// @tparam far  joints may turn far; if not, what is returned tells where it holds
  /// @param k1  accelerations at `here`, where the step begins, at time t
  template <HandCoupling grip, bool far, class Time, class Sticking>
  [[gnu::always_inline]] Where nystroem(State& s, const PointDynamics& here, const Acceleration& k1, const AppliedLoad& push,
                                        const Scalar& t, const Time& h, const Sticking& sticking) const {
    const Time half = 0.5 * h;
    const Time eighth = 0.5 * half * half;
    State stage = s;
    const auto speeds = [&](const Acceleration& k, const Time& after) {
      stage.qd = s.qd + after * k.joints;
      if constexpr (grip == HandCoupling::tissue) stage.hand_velocity = s.hand_velocity + after * k.hand;
    };
    Where is_small = true;
    const auto turned = [&](const Torque& turn) {
      if constexpr (far) return mechanism_.turned(here.at, turn);
      is_small = is_small & mechanism_.is_small(turn);
      return mechanism_.advance_small(here.at, turn);
    };
    const PointDynamics middle = dynamics_at<grip>(turned(half * s.qd + eighth * k1.joints));
    if constexpr (grip == HandCoupling::tissue) stage.hand = s.hand + (half * s.hand_velocity + eighth * k1.hand);
    const Inverse inverse = sticking.inverse(middle.dynamics);
    speeds(k1, half);
    const Acceleration k2 = acceleration_at<grip>(middle, inverse, stage, push, t + half, sticking);
    speeds(k2, half);
    const Acceleration k3 = acceleration_at<grip>(middle, inverse, stage, push, t + half, sticking);
    const PointDynamics last = dynamics_at<grip>(turned(h * s.qd + (h * half) * k3.joints));
    if constexpr (grip == HandCoupling::tissue) stage.hand = s.hand + (h * s.hand_velocity + (h * half) * k3.hand);
    speeds(k3, h);
    const Acceleration k4 = acceleration_at<grip>(last, stage, push, t + h, sticking);
    const Time sixth = h * (1.0 / 6.0);
    const auto move = [&](auto& y, auto& v, const auto& a1, const auto& a2, const auto& a3, const auto& a4) {
      y += h * (v + sixth * (a1 + (a2 + a3)));
      v += sixth * ((a1 + a4) + 2.0 * (a2 + a3));
    };
    move(s.q, s.qd, k1.joints, k2.joints, k3.joints, k4.joints);
    if constexpr (grip == HandCoupling::tissue) move(s.hand, s.hand_velocity, k1.hand, k2.hand, k3.hand, k4.hand);
    return is_small;
  }

  /// `to` where the condition holds, else `from`.
  static State chosen(const Where& condition, const State& to, const State& from) {
    return {select_each(condition, to.q, from.q), select_each(condition, to.qd, from.qd), select_each(condition, to.hand, from.hand),
            select_each(condition, to.hand_velocity, from.hand_velocity)};
  }

  /// Torques [N*m] that dry friction needs to hold the stuck joints at rest.
  template <HandCoupling grip>
  [[nodiscard]] Torque holding(const PointDynamics& there, const State& s, const AppliedLoad& push, const Scalar& t,
                               const Modes& modes) const {
    Vector hand;
    const Torque after_friction = modes.after_friction(generalized_force<grip>(there, s, push, t, hand), s.qd, friction_);
    return there.dynamics.inertial(modes.inverse(there.dynamics) * after_friction) - after_friction;
  }

  /// For joints at rest: stuck if breakaway friction can hold them all, else the worst is let go, one by one.
  template <HandCoupling grip>
  [[nodiscard]] Modes choose_modes(const PointDynamics& here, const State& s, const AppliedLoad& push, const Scalar& t) const {
    const Scalar rest = 0.0;
    Modes modes;
    for (int i = 0; i < dof; ++i) {
      const Where rubs = friction_.breakaway[i] > rest;
      modes.stuck[i] = rubs & (s.qd[i] == rest);
      modes.direction[i] = select(rubs & (s.qd[i] > rest), Scalar(1.0), select(rubs & (s.qd[i] < rest), Scalar(-1.0), rest));
    }
    for (int released = 0; released < dof && modes.any_stuck(); ++released) {
      const Torque needed = holding<grip>(here, s, push, t, modes);
      std::array<Where, dof> worst{};
      Scalar excess = 0.0;
      Where some = false;
      for (int i = 0; i < dof; ++i) {
        const Scalar over = size_of(needed[i]) / friction_.breakaway[i] - 1.0;
        worst[i] = modes.stuck[i] & (over > excess);
        excess = select(worst[i], over, excess);
        some = some | worst[i];
        for (int before = 0; before < i; ++before) worst[before] = worst[before] & !worst[i];
      }
      if (!any(some)) break;
      for (int i = 0; i < dof; ++i) {
        // Friction would have to push with what is needed; the joint gives way to the opposite side.
        modes.stuck[i] = modes.stuck[i] & !worst[i];
        modes.direction[i] = select(worst[i], select(needed[i] > rest, Scalar(-1.0), Scalar(1.0)), modes.direction[i]);
      }
    }
    return modes;
  }

  /// By how much each joint has passed the end of its mode in state `s`: has turned round [rad/s], or needs more than breakaway friction
  /// to be held [N*m]. Not above zero: it goes on.
  template <HandCoupling grip>
  [[nodiscard]] Torque passed(const PointDynamics& here, const State& begin, const State& s, const AppliedLoad& push, const Scalar& t,
                              const Modes& modes) const {
    Torque by = -modes.direction.cwiseProduct(s.qd);
    if (!modes.any_stuck()) return by;
    const Torque needed = holding<grip>(dynamics_at<grip>(mechanism_.turned(here.at, Torque(s.q - begin.q))), s, push, t, modes);
    for (int i = 0; i < dof; ++i) by[i] = select(modes.stuck[i], size_of(needed[i]) - friction_.breakaway[i], by[i]);
    return by;
  }

  static Where any_above_zero(const Torque& by) {
    Where out = false;
    for (int i = 0; i < dof; ++i) out = out | (by[i] > Scalar(0.0));
    return out;
  }

  /// A substep with dry friction: from one change between sticking and sliding to the next.
  template <HandCoupling grip>
  void slide_and_stick(State& state, const KinematicsCache& at, const AppliedLoad& push, const Scalar& step) const {
    constexpr int most_events = 4 * dof;  // bounds the tick: the rest of the substep then keeps the last modes
    PointDynamics here = dynamics_at<grip>(at);
    Scalar t = 0.0;
    Where running = true;
    for (int event = 0; event < most_events; ++event) {
      const Modes modes = choose_modes<grip>(here, state, push, t);
      const Acceleration first = acceleration_at<grip>(here, state, push, t, modes);
      const auto after = [&](const Scalar& h) {
        State there = state;
        step_from<grip>(there, here, first, push, t, h, modes);
        return there;
      };
      const Scalar rest = step - t;
      State next = after(rest);
      if (event == most_events - 1) {
        state = chosen(running, next, state);
        return;
      }
      const Torque by = passed<grip>(here, state, next, push, step, modes);
      const Where ends = running & any_above_zero(by);
      state = chosen(running & !ends, next, state);
      if (!any(ends)) return;
      const Scalar gone = locate<grip>(here, state, modes, after, by, push, t, rest, ends, next);
      for (int i = 0; i < dof; ++i) next.qd[i] = select(modes.direction[i] * next.qd[i] < Scalar(0.0), Scalar(0.0), next.qd[i]);
      state = chosen(ends, next, state);
      t = select(ends, t + gone, t);
      running = ends & (t < step);
      if (!any(running)) return;
      here = dynamics_at<grip>(mechanism_.kinematics(state.q));
    }
  }

  /// Where a mode ends, time after `t`: a false position for each joint, the first of them tried next (Illinois: an end of the bracket that
  /// stays is given half its weight; every fourth time the middle). `next` is the state there, just past the end.
  template <HandCoupling grip, class After>
  [[nodiscard]] Scalar locate(const PointDynamics& here, const State& state, const Modes& modes, const After& after, const Torque& end_by,
                              const AppliedLoad& push, const Scalar& t, const Scalar& rest, const Where& ends, State& next) const {
    constexpr int most_trials = 60;
    constexpr double close = 1e-10;  // of the substep
    const Scalar none = 0.0;
    Scalar low = 0.0;
    Scalar high = rest;
    Torque low_by = passed<grip>(here, state, state, push, t, modes);
    Torque high_by = end_by;
    for (int i = 0; i < dof; ++i) low_by[i] = min_of(low_by[i], none);
    const Torque aim = (close * (high_by - low_by)).eval();  // just past the end
    Scalar last = 0.0;                                       // which end of the bracket was moved: 1 the high one, -1 the low one
    Where open = ends;
    for (int trial = 0; trial < most_trials && any(open); ++trial) {
      const Scalar width = high - low;
      Scalar share = 1.0;
      for (int i = 0; i < dof; ++i) {
        const Scalar here_share = (aim[i] - low_by[i]) / (high_by[i] - low_by[i]);
        share = select((high_by[i] > none) & (here_share < share), here_share, share);
      }
      if (trial % 4 == 3) share = 0.5;
      const Scalar tried = low + share * width;
      const State there = after(tried);
      const Torque by = passed<grip>(here, state, there, push, t + tried, modes);
      const Where beyond = open & any_above_zero(by);
      const Where before = open & !beyond;
      const Where again_beyond = beyond & (last > none);
      const Where again_before = before & (last < none);
      Where near = true;
      for (int i = 0; i < dof; ++i) {
        near = near & (by[i] <= 2.0 * max_of(aim[i], none));
        low_by[i] = select(before, min_of(by[i], none), select(again_beyond, 0.5 * low_by[i], low_by[i]));
        high_by[i] = select(beyond, by[i], select(again_before, 0.5 * high_by[i], high_by[i]));
      }
      low = select(before, tried, low);
      high = select(beyond, tried, high);
      next = chosen(beyond, there, next);
      last = select(beyond, Scalar(1.0), select(before, Scalar(-1.0), last));
      open = open & !(beyond & near) & (high - low > Scalar(1e-12) * rest);
    }
    return high;
  }

  static Scalar size_of(const Scalar& x) {
    using std::abs;
    return abs(x);
  }

  Mechanism mechanism_;
  JointFriction<dof, Scalar> friction_;
  BasicHumanArm<Scalar> hand_;
  decltype(std::declval<Mechanism>().inertia_parameters(std::declval<Scalar>())) masses_{};  // with the hand's
  Scalar per_hand_mass_ = 0.0;
  bool dry_ = false;
  bool loaded_ = false;
};

}  // namespace palpate::plant
