#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "palpate/device/friction.hpp"
#include "palpate/device/hand.hpp"
#include "palpate/math/choose.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// What a mechanism computes of a pose once, for all that is asked there.
template <class Mechanism, class Scalar = double>
using PostureOf = std::decay_t<decltype(std::declval<Mechanism>().posture(std::declval<Joints<Mechanism::dof, Scalar>>()))>;

/// Where a mechanism is on its way: its posture, and one near by that it is turned from.
template <class Mechanism, class Scalar = double>
struct Track {
  PostureOf<Mechanism, Scalar> at{};
  PostureOf<Mechanism, Scalar> anchor{};

  Track() = default;
  explicit Track(const PostureOf<Mechanism, Scalar>& start) : at(start), anchor(start) {}

  /// Puts one loop's track into a lane.
  void put(int lane, const Track<Mechanism>& one) {
    put(at, lane, one.at);
    put(anchor, lane, one.anchor);
  }

 private:
  template <class Pose, class One>
  static void put(Pose& pose, int lane, const One& one) {
    if constexpr (requires { pose.put(lane, one); })
      pose.put(lane, one);
    else
      palpate::put(pose, lane, one);
  }
};

/// What moves: joints and, when tissue parts them from the tip, the hand.
template <int dof, class Scalar = double>
struct MotionState {
  Joints<dof, Scalar> q = Joints<dof, Scalar>::Constant(0.0);      ///< rad
  Joints<dof, Scalar> qd = Joints<dof, Scalar>::Constant(0.0);     ///< rad/s
  Vector3<Scalar> hand = Vector3<Scalar>::Constant(0.0);           ///< m
  Vector3<Scalar> hand_velocity = Vector3<Scalar>::Constant(0.0);  ///< m/s

  /// Puts one loop's state into a lane.
  void put(int lane, const MotionState<dof>& one) {
    using palpate::put;
    put(q, lane, one.q);
    put(qd, lane, one.qd);
    put(hand, lane, one.hand);
    put(hand_velocity, lane, one.hand_velocity);
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
class Motion {
 public:
  static constexpr int dof = Mechanism::dof;
  using State = MotionState<dof, Scalar>;
  using Torque = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;

  Motion() = default;
  Motion(const Mechanism& mechanism, const Friction<dof, Scalar>& friction, const BasicHand<Scalar>& hand)
      : mechanism_(mechanism), friction_(friction), hand_(hand), dry_(friction.dry()), loaded_(!hand.empty()) {
    prepare();
  }

  [[nodiscard]] const Mechanism& mechanism() const { return mechanism_; }
  [[nodiscard]] const Friction<dof, Scalar>& friction() const { return friction_; }

  /// Puts one loop's physics into a lane; all lanes have the same mechanism, and all or none a hand, tissue, dry friction.
  void put(int lane, const Motion<Mechanism>& one) {
    mechanism_ = one.mechanism_;
    friction_.put(lane, one.friction_);
    hand_.put(lane, one.hand_);
    dry_ = one.dry_;
    loaded_ = one.loaded_;
    prepare();
  }

  /// Moves `state` on by `period` [s], one for all or each loop's own, in `substeps` equal steps, under motor torques [N*m] held
  /// constant and the operator's force.
  template <class Time>
  void advance(State& state, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period, int substeps) const noexcept {
    Track<Mechanism, Scalar> track(mechanism_.posture(state.q));
    advance(state, track, torque, force, period, substeps);
  }

  /// The same for whoever keeps the posture of `state` too: it moves with it.
  template <class Time>
  void advance(State& state, Track<Mechanism, Scalar>& track, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period,
               int substeps) const noexcept {
    if (hand_.tissue) {
      advance_held<Grip::tissue>(state, track, torque, force, period, substeps);
    } else if (loaded_) {
      advance_held<Grip::rigid>(state, track, torque, force, period, substeps);
    } else if (dry_ || acts(force.begin) || acts(force.end)) {
      advance_held<Grip::pushed>(state, track, torque, force, period, substeps);
    } else {
      advance_held<Grip::none>(state, track, torque, force, period, substeps);
    }
  }

  /// Joint accelerations [rad/s^2] at one instant, sticking included, nobody holding the device.
  [[nodiscard]] Torque acceleration(const Torque& q, const Torque& qd, const Torque& torque) const noexcept {
    State state;
    state.q = q;
    state.qd = qd;
    const Place here = place<Grip::none>(mechanism_.posture(q));
    const Push push{torque, Vector::Constant(0.0), Vector::Constant(0.0)};
    if (dry_) return rate<Grip::none>(here, state, push, Scalar(0.0), choose_modes<Grip::none>(here, state, push, Scalar(0.0))).joints;
    return rate<Grip::none>(here, state, push, Scalar(0.0), Frictionless{}).joints;
  }

  /// Force of the operator on the tip [N] at a state (what a force sensor in the stylus would read, without the hand's inertia
  /// when the grip is rigid).
  [[nodiscard]] Vector hand_force(const State& s, const Vector& voluntary) const noexcept {
    if (!loaded_) return voluntary;
    const Posture at = mechanism_.posture(s.q);
    return hand_.tissue ? hand_force<Grip::tissue>(at, s, voluntary) : hand_force<Grip::rigid>(at, s, voluntary);
  }

 private:
  template <class, class>
  friend class Motion;

  using Posture = PostureOf<Mechanism, Scalar>;
  using Where = Condition<Scalar>;
  using Dynamics = typename Mechanism::template Dynamics<Scalar>;
  using Inverse = typename Dynamics::Inverse;

  /// How the operator acts on the tip: not at all, with a force, or an arm that moves with the tip or through tissue.
  enum class Grip { none, pushed, rigid, tissue };

  /// A posture and the equations of motion there.
  struct Place {
    Posture at;
    Dynamics dynamics;
  };

  struct Push {
    Torque torque;
    Vector force;       // at the substep's beginning
    Vector force_rate;  // N/s

    [[nodiscard]] Vector at(const Scalar& t) const { return force + t * force_rate; }
  };

  /// Accelerations.
  struct Rate {
    Torque joints;
    Vector hand;
  };

  /// No dry friction.
  struct Frictionless {
    [[nodiscard]] Inverse inverse(const Dynamics& dynamics) const { return dynamics.inverse(); }
    [[nodiscard]] const Torque& left(const Torque& net, const Torque& /*qd*/, const Friction<dof, Scalar>& /*friction*/) const {
      return net;
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
    [[nodiscard]] Torque left(Torque net, const Torque& qd, const Friction<dof, Scalar>& friction) const {
      for (int i = 0; i < dof; ++i) net[i] -= direction[i] * friction.sliding(i, qd[i]);
      return net;
    }
  };

  /// What follows from the hand.
  void prepare() {
    masses_ = mechanism_.masses(hand_.mass);
    if (hand_.tissue) per_hand_mass_ = 1.0 / hand_.mass;
  }

  static bool acts(const Vector& force) {
    const Scalar none = 0.0;
    return any(force[0] != none) || any(force[1] != none) || any(force[2] != none);
  }

  template <Grip grip, class Time>
  void advance_held(State& state, Track<Mechanism, Scalar>& track, const Torque& torque, const ForceSegment<Scalar>& force,
                    const Time& period, int substeps) const {
    const Time step = period / static_cast<double>(substeps);
    Push push{torque, force.begin, Vector::Constant(0.0)};
    if constexpr (grip != Grip::none) push.force_rate = (force.end - force.begin) / period;
    for (int i = 0; i < substeps; ++i) {
      if constexpr (grip != Grip::none) push.force = force.at(static_cast<double>(i) / substeps);
      if constexpr (grip != Grip::none) {
        if (dry_) {
          slide_and_stick<grip>(state, track.at, push, Scalar(step));
          track.at = mechanism_.posture_near(track.anchor, state.q);
          continue;
        }
      }
      const Place here = place<grip>(track.at);
      const Rate first = rate<grip>(here, state, push, Scalar(0.0), Frictionless{});
      step_from<grip>(state, here, first, push, Scalar(0.0), step, Frictionless{});
      track.at = mechanism_.posture_near(track.anchor, state.q);
    }
  }

  template <Grip grip>
  [[nodiscard, gnu::always_inline]] Place place(const Posture& at) const {
    // An arm that grips rigidly moves with the tip: its mass is a point mass there, which gravity does not pull.
    if constexpr (grip == Grip::rigid) return {at, mechanism_.dynamics(at, masses_)};
    return {at, mechanism_.dynamics(at)};
  }

  /// Force on the tip [N] of whoever acts on it.
  template <Grip grip>
  [[nodiscard, gnu::always_inline]] Vector hand_force(const Posture& at, const State& s, const Vector& voluntary) const {
    if constexpr (grip == Grip::pushed) return voluntary;
    const Vector p = mechanism_.forward(at);
    const Vector v = mechanism_.velocity(at, s.qd);
    if constexpr (grip == Grip::tissue) return hand_.tissue_stiffness * (s.hand - p) + hand_.tissue_damping * (s.hand_velocity - v);
    return (voluntary - hand_.stiffness * (p - hand_.rest)) - hand_.damping * v;
  }

  /// Accelerations at one place, time `t` [s] after the substep's beginning; of `s` the positions of the joints are not looked at.
  template <Grip grip, class Sticking>
  [[nodiscard, gnu::always_inline]] Rate rate(const Place& there, const State& s, const Push& push, const Scalar& t,
                                              const Sticking& sticking) const {
    return rate<grip>(there, sticking.inverse(there.dynamics), s, push, t, sticking);
  }

  template <Grip grip, class Sticking>
  [[nodiscard, gnu::always_inline]] Rate rate(const Place& there, const Inverse& inverse, const State& s, const Push& push, const Scalar& t,
                                              const Sticking& sticking) const {
    Rate out;
    out.joints = inverse * sticking.left(net<grip>(there, s, push, t, out.hand), s.qd, friction_);
    return out;
  }

  /// Torques [N*m] that are left to accelerate the joints, but for dry friction; and the acceleration of the hand.
  template <Grip grip>
  [[nodiscard, gnu::always_inline]] Torque net(const Place& there, const State& s, const Push& push, const Scalar& t, Vector& hand) const {
    Torque torque;
    for (int i = 0; i < dof; ++i) torque[i] = push.torque[i] - friction_.viscous[i] * s.qd[i];
    if constexpr (grip != Grip::none) {
      const Vector voluntary = push.at(t);
      const Vector on_tip = hand_force<grip>(there.at, s, voluntary);
      if constexpr (grip == Grip::tissue)
        hand = per_hand_mass_ * ((voluntary - on_tip) - (hand_.stiffness * (s.hand - hand_.rest) + hand_.damping * s.hand_velocity));
      torque += mechanism_.torque(there.at, on_tip);
    }
    return there.dynamics.net(torque, s.qd);
  }

  /// One step; where a joint turns far in it, with new sines and cosines.
  template <Grip grip, class Time, class Sticking>
  [[gnu::always_inline]] void step_from(State& s, const Place& here, const Rate& k1, const Push& push, const Scalar& t, const Time& h,
                                        const Sticking& sticking) const {
    State next = s;
    if (all(nystroem<grip, false>(next, here, k1, push, t, h, sticking))) [[likely]]
      s = next;
    else
      step_far<grip>(s, here, k1, push, t, h, sticking);
  }
  template <Grip grip, class Time, class Sticking>
  [[gnu::noinline, gnu::cold]] void step_far(State& s, const Place& here, const Rate& k1, const Push& push, const Scalar& t, const Time& h,
                                             const Sticking& sticking) const {
    nystroem<grip, true>(s, here, k1, push, t, h, sticking);
  }

  /// One step of y'' = f(t, y, y') by Nystroem's method of order 4 (1925; Hairer, Norsett & Wanner, II.14): as Runge and Kutta's, but both
  /// stages in the middle are at one place, whose equations of motion are set up and inverted once.
  /// @tparam far  joints may turn far; if not, what is returned tells where it holds
  /// @param k1  accelerations at `here`, where the step begins, at time t
  template <Grip grip, bool far, class Time, class Sticking>
  [[gnu::always_inline]] Where nystroem(State& s, const Place& here, const Rate& k1, const Push& push, const Scalar& t, const Time& h,
                                        const Sticking& sticking) const {
    const Time half = 0.5 * h;
    const Time eighth = 0.5 * half * half;
    State stage = s;
    const auto speeds = [&](const Rate& k, const Time& after) {
      stage.qd = s.qd + after * k.joints;
      if constexpr (grip == Grip::tissue) stage.hand_velocity = s.hand_velocity + after * k.hand;
    };
    Where little = true;
    const auto turned = [&](const Torque& turn) {
      if constexpr (far) return mechanism_.turned(here.at, turn);
      little = little & mechanism_.little(turn);
      return mechanism_.turned_little(here.at, turn);
    };
    const Place middle = place<grip>(turned(half * s.qd + eighth * k1.joints));
    if constexpr (grip == Grip::tissue) stage.hand = s.hand + (half * s.hand_velocity + eighth * k1.hand);
    const Inverse inverse = sticking.inverse(middle.dynamics);
    speeds(k1, half);
    const Rate k2 = rate<grip>(middle, inverse, stage, push, t + half, sticking);
    speeds(k2, half);
    const Rate k3 = rate<grip>(middle, inverse, stage, push, t + half, sticking);
    const Place last = place<grip>(turned(h * s.qd + (h * half) * k3.joints));
    if constexpr (grip == Grip::tissue) stage.hand = s.hand + (h * s.hand_velocity + (h * half) * k3.hand);
    speeds(k3, h);
    const Rate k4 = rate<grip>(last, stage, push, t + h, sticking);
    const Time sixth = h * (1.0 / 6.0);
    const auto move = [&](auto& y, auto& v, const auto& a1, const auto& a2, const auto& a3, const auto& a4) {
      y += h * (v + sixth * (a1 + (a2 + a3)));
      v += sixth * ((a1 + a4) + 2.0 * (a2 + a3));
    };
    move(s.q, s.qd, k1.joints, k2.joints, k3.joints, k4.joints);
    if constexpr (grip == Grip::tissue) move(s.hand, s.hand_velocity, k1.hand, k2.hand, k3.hand, k4.hand);
    return little;
  }

  /// `to` where the condition holds, else `from`.
  static State chosen(const Where& condition, const State& to, const State& from) {
    return {choose_each(condition, to.q, from.q), choose_each(condition, to.qd, from.qd), choose_each(condition, to.hand, from.hand),
            choose_each(condition, to.hand_velocity, from.hand_velocity)};
  }

  /// Torques [N*m] that dry friction needs to hold the stuck joints at rest.
  template <Grip grip>
  [[nodiscard]] Torque holding(const Place& there, const State& s, const Push& push, const Scalar& t, const Modes& modes) const {
    Vector hand;
    const Torque left = modes.left(net<grip>(there, s, push, t, hand), s.qd, friction_);
    return there.dynamics.inertial(modes.inverse(there.dynamics) * left) - left;
  }

  /// For joints at rest: stuck if breakaway friction can hold them all, else the worst is let go, one by one.
  template <Grip grip>
  [[nodiscard]] Modes choose_modes(const Place& here, const State& s, const Push& push, const Scalar& t) const {
    const Scalar rest = 0.0;
    Modes modes;
    for (int i = 0; i < dof; ++i) {
      const Where rubs = friction_.breakaway[i] > rest;
      modes.stuck[i] = rubs & (s.qd[i] == rest);
      modes.direction[i] = choose(rubs & (s.qd[i] > rest), Scalar(1.0), choose(rubs & (s.qd[i] < rest), Scalar(-1.0), rest));
    }
    for (int released = 0; released < dof && modes.any_stuck(); ++released) {
      const Torque needed = holding<grip>(here, s, push, t, modes);
      std::array<Where, dof> worst{};
      Scalar excess = 0.0;
      Where some = false;
      for (int i = 0; i < dof; ++i) {
        const Scalar over = size_of(needed[i]) / friction_.breakaway[i] - 1.0;
        worst[i] = modes.stuck[i] & (over > excess);
        excess = choose(worst[i], over, excess);
        some = some | worst[i];
        for (int before = 0; before < i; ++before) worst[before] = worst[before] & !worst[i];
      }
      if (!any(some)) break;
      for (int i = 0; i < dof; ++i) {
        // Friction would have to push with what is needed; the joint gives way to the opposite side.
        modes.stuck[i] = modes.stuck[i] & !worst[i];
        modes.direction[i] = choose(worst[i], choose(needed[i] > rest, Scalar(-1.0), Scalar(1.0)), modes.direction[i]);
      }
    }
    return modes;
  }

  /// By how much each joint has passed the end of its mode in state `s`: has turned round [rad/s], or needs more than breakaway friction
  /// to be held [N*m]. Not above zero: it goes on.
  template <Grip grip>
  [[nodiscard]] Torque passed(const Place& here, const State& begin, const State& s, const Push& push, const Scalar& t,
                              const Modes& modes) const {
    Torque by = -modes.direction.cwiseProduct(s.qd);
    if (!modes.any_stuck()) return by;
    const Torque needed = holding<grip>(place<grip>(mechanism_.turned(here.at, Torque(s.q - begin.q))), s, push, t, modes);
    for (int i = 0; i < dof; ++i) by[i] = choose(modes.stuck[i], size_of(needed[i]) - friction_.breakaway[i], by[i]);
    return by;
  }

  static Where any_above_zero(const Torque& by) {
    Where out = false;
    for (int i = 0; i < dof; ++i) out = out | (by[i] > Scalar(0.0));
    return out;
  }

  /// A substep with dry friction: from one change between sticking and sliding to the next.
  template <Grip grip>
  void slide_and_stick(State& state, const Posture& at, const Push& push, const Scalar& step) const {
    constexpr int most_events = 4 * dof;  // bounds the tick: the rest of the substep then keeps the last modes
    Place here = place<grip>(at);
    Scalar t = 0.0;
    Where running = true;
    for (int event = 0; event < most_events; ++event) {
      const Modes modes = choose_modes<grip>(here, state, push, t);
      const Rate first = rate<grip>(here, state, push, t, modes);
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
      for (int i = 0; i < dof; ++i) next.qd[i] = choose(modes.direction[i] * next.qd[i] < Scalar(0.0), Scalar(0.0), next.qd[i]);
      state = chosen(ends, next, state);
      t = choose(ends, t + gone, t);
      running = ends & (t < step);
      if (!any(running)) return;
      here = place<grip>(mechanism_.posture(state.q));
    }
  }

  /// Where a mode ends, time after `t`: a false position for each joint, the first of them tried next (Illinois: an end of the bracket that
  /// stays is given half its weight; every fourth time the middle). `next` is the state there, just past the end.
  template <Grip grip, class After>
  [[nodiscard]] Scalar locate(const Place& here, const State& state, const Modes& modes, const After& after, const Torque& end_by,
                              const Push& push, const Scalar& t, const Scalar& rest, const Where& ends, State& next) const {
    constexpr int most_trials = 60;
    constexpr double close = 1e-10;  // of the substep
    const Scalar none = 0.0;
    Scalar low = 0.0;
    Scalar high = rest;
    Torque low_by = passed<grip>(here, state, state, push, t, modes);
    Torque high_by = end_by;
    for (int i = 0; i < dof; ++i) low_by[i] = lesser(low_by[i], none);
    const Torque aim = (close * (high_by - low_by)).eval();  // just past the end
    Scalar last = 0.0;                                       // which end of the bracket was moved: 1 the high one, -1 the low one
    Where open = ends;
    for (int trial = 0; trial < most_trials && any(open); ++trial) {
      const Scalar width = high - low;
      Scalar share = 1.0;
      for (int i = 0; i < dof; ++i) {
        const Scalar here_share = (aim[i] - low_by[i]) / (high_by[i] - low_by[i]);
        share = choose((high_by[i] > none) & (here_share < share), here_share, share);
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
        near = near & (by[i] <= 2.0 * greater(aim[i], none));
        low_by[i] = choose(before, lesser(by[i], none), choose(again_beyond, 0.5 * low_by[i], low_by[i]));
        high_by[i] = choose(beyond, by[i], choose(again_before, 0.5 * high_by[i], high_by[i]));
      }
      low = choose(before, tried, low);
      high = choose(beyond, tried, high);
      next = chosen(beyond, there, next);
      last = choose(beyond, Scalar(1.0), choose(before, Scalar(-1.0), last));
      open = open & !(beyond & near) & (high - low > Scalar(1e-12) * rest);
    }
    return high;
  }

  static Scalar size_of(const Scalar& x) {
    using std::abs;
    return abs(x);
  }

  Mechanism mechanism_;
  Friction<dof, Scalar> friction_;
  BasicHand<Scalar> hand_;
  decltype(std::declval<Mechanism>().masses(std::declval<Scalar>())) masses_{};  // with the hand's
  Scalar per_hand_mass_ = 0.0;
  bool dry_ = false;
  bool loaded_ = false;
};

}  // namespace palpate
