#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "palpate/device/friction.hpp"
#include "palpate/device/hand.hpp"
#include "palpate/math/choose.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/solve.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// What a mechanism computes of a pose once, for all that is asked there.
template <class Mechanism, class Scalar = double>
using PostureOf = std::decay_t<decltype(std::declval<Mechanism>().posture(std::declval<Joints<Mechanism::dof, Scalar>>()))>;

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
/// Runge-Kutta of order 4 where the motion is smooth. Dry friction makes it piecewise smooth: each joint sticks or
/// slides in a known direction, the instants at which that changes are located to rounding of the substep, and a stuck
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
      : mechanism_(mechanism),
        friction_(friction),
        hand_(hand),
        dry_(friction.dry()),
        loaded_(!hand.empty()),
        heavy_(any(hand.mass > Scalar(0.0))) {}

  [[nodiscard]] const Mechanism& mechanism() const { return mechanism_; }
  [[nodiscard]] const Friction<dof, Scalar>& friction() const { return friction_; }

  /// Puts one loop's physics into a lane; all lanes have the same mechanism, and all or none a hand, its mass, dry friction.
  void put(int lane, const Motion<Mechanism>& one) {
    mechanism_ = one.mechanism_;
    friction_.put(lane, one.friction_);
    hand_.put(lane, one.hand_);
    dry_ = one.dry_;
    loaded_ = one.loaded_;
    heavy_ = one.heavy_;
  }

  /// Moves `state` on by `period` [s], one for all or each loop's own, in `substeps` equal steps, under motor torques [N*m] held
  /// constant and the operator's force.
  template <class Time>
  void advance(State& state, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period, int substeps) const noexcept {
    Posture at = mechanism_.posture(state.q);
    advance(state, at, torque, force, period, substeps);
  }

  /// The same for whoever keeps the posture `at` of `state` too: it moves with it.
  template <class Time>
  void advance(State& state, PostureOf<Mechanism, Scalar>& at, const Torque& torque, const ForceSegment<Scalar>& force, const Time& period,
               int substeps) const noexcept {
    const bool pushed = acts(force.begin) || acts(force.end);
    const Time step = period / static_cast<double>(substeps);
    for (int i = 0; i < substeps; ++i) {
      const Push push{torque, force.at(static_cast<double>(i) / substeps), (force.end - force.begin) / period};
      if (dry_) {
        advance_with_sticking(state, push, step);
      } else if (hand_.tissue) {
        runge_kutta<true>(state, at, step,
                          [&](const State& s, const Posture& at, Scalar t) { return general_rate(s, at, push, t, Modes{}); });
      } else if (loaded_) {
        runge_kutta<false>(state, at, step,
                           [&](const State& s, const Posture& at, Scalar t) { return general_rate(s, at, push, t, Modes{}); });
      } else if (pushed) {
        advance_freely<true>(state, at, push, step);
      } else {
        advance_freely<false>(state, at, push, step);
      }
      at = mechanism_.posture(state.q);
    }
  }

  /// Joint accelerations [rad/s^2] at one instant, sticking included, nobody holding the device.
  [[nodiscard]] Torque acceleration(const Torque& q, const Torque& qd, const Torque& torque) const noexcept {
    const State state{q, qd, Vector::Constant(0.0), Vector::Constant(0.0)};
    const Push push{torque, Vector::Constant(0.0), Vector::Constant(0.0)};
    const Posture& at = mechanism_.posture(q);
    if (!dry_) return free_acceleration<false>(at, qd, push, 0.0);
    return general_rate(state, at, push, 0.0, choose_modes(state, at, push, 0.0)).qdd;
  }

  /// Force of the operator on the tip [N] at a state (what a force sensor in the stylus would read, without the hand's inertia
  /// when the grip is rigid).
  [[nodiscard]] Vector hand_force(const State& s, const Vector& voluntary) const noexcept {
    if (!loaded_) return voluntary;
    return hand_force(s, mechanism_.posture(s.q), voluntary);
  }

 private:
  template <class, class>
  friend class Motion;

  using Posture = PostureOf<Mechanism, Scalar>;
  using Where = Condition<Scalar>;
  using Matrix = Eigen::Matrix<Scalar, dof, dof>;

  [[nodiscard]] Vector hand_force(const State& s, const Posture& at, const Vector& voluntary) const noexcept {
    return hand_force(s, at, mechanism_.jacobian(at), voluntary);
  }
  [[nodiscard]] Vector hand_force(const State& s, const Posture& at, const TipJacobian<dof, Scalar>& j,
                                  const Vector& voluntary) const noexcept {
    const Vector p = mechanism_.forward(at);
    const Vector v = j * s.qd;
    if (hand_.tissue) return hand_.tissue_stiffness * (s.hand - p) + hand_.tissue_damping * (s.hand_velocity - v);
    return voluntary - hand_.stiffness * (p - hand_.rest) - hand_.damping * v;
  }

  static bool acts(const Vector& force) {
    const Scalar none = 0.0;
    return any(force[0] != none) || any(force[1] != none) || any(force[2] != none);
  }

  struct Push {
    Torque torque;
    Vector force;       // at the substep's beginning
    Vector force_rate;  // N/s

    [[nodiscard]] Vector at(const Scalar& t) const { return force + t * force_rate; }
  };

  struct Rate {
    Torque qd, qdd;
    Vector hand_velocity, hand_acceleration;
    Torque holding;  // torque that dry friction needs to keep stuck joints at rest
  };

  /// How each joint's dry friction acts: stuck, sliding forwards or backwards, or (none of these) free of it.
  struct Modes {
    std::array<Where, dof> stuck{}, forward{}, backward{};

    [[nodiscard]] bool any_stuck() const {
      Where some = false;
      for (int i = 0; i < dof; ++i) some = some | stuck[i];
      return any(some);
    }
  };

  /// Joint accelerations [rad/s^2] without dry friction, nobody's mass at the tip; `pushed`: under the operator's force.
  template <bool pushed>
  [[nodiscard, gnu::always_inline]] Torque free_acceleration(const Posture& at, const Torque& qd, const Push& push, const Scalar& t) const {
    Torque net = push.torque - friction_.viscous.cwiseProduct(qd);
    if constexpr (pushed) net += mechanism_.torque(at, push.at(t));
    return mechanism_.acceleration(at, qd, net);
  }

  /// The common case, where a second of servo ticks is a second of these: Runge-Kutta written out for q' = v, v' = a(q, v, t).
  template <bool pushed, class Time>
  void advance_freely(State& s, const Posture& at, const Push& push, const Time& h) const {
    const Torque v1 = s.qd;
    const Torque a1 = free_acceleration<pushed>(at, v1, push, 0.0);
    const Torque v2 = v1 + 0.5 * h * a1;
    const Torque a2 = free_acceleration<pushed>(mechanism_.turned(at, Torque(0.5 * h * v1)), v2, push, 0.5 * h);
    const Torque v3 = v1 + 0.5 * h * a2;
    const Torque a3 = free_acceleration<pushed>(mechanism_.turned(at, Torque(0.5 * h * v2)), v3, push, 0.5 * h);
    const Torque v4 = v1 + h * a3;
    const Torque a4 = free_acceleration<pushed>(mechanism_.turned(at, Torque(h * v3)), v4, push, h);
    s.q += (h / 6.0) * (v1 + 2.0 * (v2 + v3) + v4);
    s.qd += (h / 6.0) * (a1 + 2.0 * (a2 + a3) + a4);
  }

  [[nodiscard]] Rate general_rate(const State& s, const Posture& at, const Push& push, const Scalar& t, const Modes& modes) const {
    Rate r;
    r.qd = s.qd;
    Matrix inertia = mechanism_.mass_matrix(at);
    Torque net = push.torque - friction_.viscous.cwiseProduct(s.qd) - mechanism_.coriolis(at, s.qd) * s.qd - mechanism_.gravity(at);
    const TipJacobian<dof, Scalar> j = mechanism_.jacobian(at);
    if (hand_.tissue) {
      const Vector on_tip = hand_force(s, at, j, push.at(t));
      net += j.transpose() * on_tip;
      r.hand_velocity = s.hand_velocity;
      r.hand_acceleration = (push.at(t) - on_tip - hand_.stiffness * (s.hand - hand_.rest) - hand_.damping * s.hand_velocity) / hand_.mass;
    } else {
      net += j.transpose() * hand_force(s, at, j, push.at(t));
      if (heavy_) {
        inertia += hand_.mass * (j.transpose() * j).eval();
        net -= hand_.mass * (j.transpose() * tip_acceleration_at_rest_joints(at, s.qd)).eval();
      }
    }
    if (!dry_) {
      r.qdd = solve_positive_definite(inertia, net);
      return r;
    }
    for (int i = 0; i < dof; ++i) {
      if (!any(modes.forward[i] | modes.backward[i])) continue;
      const Scalar against = friction_.sliding(i, s.qd[i]);
      net[i] = choose(modes.forward[i], net[i] - against, choose(modes.backward[i], net[i] + against, net[i]));
    }
    Matrix constrained = inertia;
    Torque right = net;
    for (int i = 0; i < dof; ++i) {
      if (!any(modes.stuck[i])) continue;
      for (int k = 0; k < dof; ++k) {
        constrained(i, k) = choose(modes.stuck[i], Scalar(i == k ? 1.0 : 0.0), constrained(i, k));
        constrained(k, i) = choose(modes.stuck[i], Scalar(i == k ? 1.0 : 0.0), constrained(k, i));
      }
      right[i] = choose(modes.stuck[i], Scalar(0.0), right[i]);
    }
    r.qdd = solve_positive_definite(constrained, right);
    for (int i = 0; i < dof; ++i) r.qdd[i] = choose(modes.stuck[i], Scalar(0.0), r.qdd[i]);
    r.holding = inertia * r.qdd - net;
    return r;
  }

  /// dJ/dt qd: the part of the tip's acceleration that needs no joint acceleration [m/s^2].
  [[nodiscard]] Vector tip_acceleration_at_rest_joints(const Posture& at, const Torque& qd) const {
    const TipJacobian<dof, Dual<1, Scalar>> j = mechanism_.jacobian(mechanism_.moving(at, qd));
    Vector a = Vector::Constant(0.0);
    for (int row = 0; row < 3; ++row) {
      for (int i = 0; i < dof; ++i) a[row] += j(row, i).gradient[0] * qd[i];
    }
    return a;
  }

  template <bool with_hand>
  static State moved(const State& s, const Rate& r, const Scalar& h) {
    State out = s;
    out.q += h * r.qd;
    out.qd += h * r.qdd;
    if constexpr (with_hand) {
      out.hand += h * r.hand_velocity;
      out.hand_velocity += h * r.hand_acceleration;
    }
    return out;
  }

  /// `to` where the condition holds, else `from`.
  static State chosen(const Where& condition, const State& to, const State& from) {
    return {choose_each(condition, to.q, from.q), choose_each(condition, to.qd, from.qd), choose_each(condition, to.hand, from.hand),
            choose_each(condition, to.hand_velocity, from.hand_velocity)};
  }

  template <bool with_hand, class RateOf>
  void runge_kutta(State& s, const Posture& at, const Scalar& h, const RateOf& rate) const {
    const auto later = [&](const Rate& k, const Scalar& t) {
      const State there = moved<with_hand>(s, k, t);
      return rate(there, mechanism_.turned(at, Torque(t * k.qd)), t);
    };
    const Rate k1 = rate(s, at, Scalar(0.0));
    const Rate k2 = later(k1, 0.5 * h);
    const Rate k3 = later(k2, 0.5 * h);
    const Rate k4 = later(k3, h);
    const Scalar sixth = h / 6.0;
    const auto add = [&sixth](auto& y, const auto& a, const auto& b, const auto& c, const auto& d) {
      y += sixth * (a + 2.0 * (b + c) + d).eval();
    };
    add(s.q, k1.qd, k2.qd, k3.qd, k4.qd);
    add(s.qd, k1.qdd, k2.qdd, k3.qdd, k4.qdd);
    if constexpr (with_hand) {
      add(s.hand, k1.hand_velocity, k2.hand_velocity, k3.hand_velocity, k4.hand_velocity);
      add(s.hand_velocity, k1.hand_acceleration, k2.hand_acceleration, k3.hand_acceleration, k4.hand_acceleration);
    }
  }

  /// For joints at rest: stuck if breakaway friction can hold them all, else the worst is let go, one by one.
  [[nodiscard]] Modes choose_modes(const State& s, const Posture& at, const Push& push, const Scalar& t) const {
    const Scalar rest = 0.0;
    Modes modes;
    for (int i = 0; i < dof; ++i) {
      const Where rubs = friction_.breakaway[i] > rest;
      modes.stuck[i] = rubs & (s.qd[i] == rest);
      modes.forward[i] = rubs & (s.qd[i] > rest);
      modes.backward[i] = rubs & !(modes.stuck[i] | modes.forward[i]);
    }
    for (int released = 0; released < dof && modes.any_stuck(); ++released) {
      const Rate r = general_rate(s, at, push, t, modes);
      std::array<Where, dof> worst{};
      Scalar excess = 0.0;
      for (int i = 0; i < dof; ++i) {
        const Scalar over = size_of(r.holding[i]) / friction_.breakaway[i] - 1.0;
        worst[i] = modes.stuck[i] & (over > excess);
        excess = choose(worst[i], over, excess);
        for (int before = 0; before < i; ++before) worst[before] = worst[before] & !worst[i];
      }
      Where some = false;
      for (int i = 0; i < dof; ++i) {
        // Friction would have to push with `holding`; the joint gives way to the opposite side.
        const Where pushed_forward = r.holding[i] > rest;
        modes.stuck[i] = modes.stuck[i] & !worst[i];
        modes.backward[i] = modes.backward[i] | (worst[i] & pushed_forward);
        modes.forward[i] = modes.forward[i] | (worst[i] & !pushed_forward);
        some = some | worst[i];
      }
      if (!any(some)) break;
    }
    return modes;
  }

  /// Has a sliding joint turned round, or a stuck one been torn loose, by state `s`?
  [[nodiscard]] Where mode_ends(const State& s, const Push& push, const Scalar& t, const Modes& modes) const {
    Where ends = false;
    for (int i = 0; i < dof; ++i) {
      ends = ends | (modes.forward[i] & (s.qd[i] < Scalar(0.0))) | (modes.backward[i] & (s.qd[i] > Scalar(0.0)));
    }
    if (!modes.any_stuck()) return ends;
    const Rate r = general_rate(s, mechanism_.posture(s.q), push, t, modes);
    for (int i = 0; i < dof; ++i) ends = ends | (modes.stuck[i] & (size_of(r.holding[i]) > friction_.breakaway[i]));
    return ends;
  }

  void advance_with_sticking(State& state, const Push& push, const Scalar& step) const {
    constexpr int most_events = 4 * dof;  // bounds the tick: the rest of the substep then keeps the last modes
    constexpr int bisections = 40;
    const Scalar end = step;
    Scalar t = 0.0;
    Where running = true;
    for (int event = 0; event < most_events && any(running); ++event) {
      const Posture here = mechanism_.posture(state.q);
      const Modes modes = choose_modes(state, here, push, t);
      const auto slide = [&](const Scalar& h) {
        const auto rate = [&](const State& s, const Posture& at, const Scalar& dt) { return general_rate(s, at, push, t + dt, modes); };
        State there = state;
        hand_.tissue ? runge_kutta<true>(there, here, h, rate) : runge_kutta<false>(there, here, h, rate);
        return there;
      };
      State next = slide(end - t);
      Where ends = false;
      if (event < most_events - 1) ends = running & mode_ends(next, push, end, modes);
      state = chosen(running & !ends, next, state);
      running = ends;
      if (!any(ends)) return;
      Scalar before = 0.0;
      Scalar after = end - t;
      for (int i = 0; i < bisections; ++i) {
        const Where open = ends & (after - before > Scalar(1e-12 * step));
        if (!any(open)) break;
        const Scalar middle = 0.5 * (before + after);
        const State trial = slide(middle);
        const Where ended = mode_ends(trial, push, t + middle, modes);
        after = choose(open & ended, middle, after);
        next = chosen(open & ended, trial, next);
        before = choose(open & !ended, middle, before);
      }
      for (int i = 0; i < dof; ++i) {
        const Where turned = (modes.forward[i] & (next.qd[i] < Scalar(0.0))) | (modes.backward[i] & (next.qd[i] > Scalar(0.0)));
        next.qd[i] = choose(turned, Scalar(0.0), next.qd[i]);
      }
      state = chosen(ends, next, state);
      t = choose(ends, t + after, t);
      running = ends & (t < end);
    }
  }

  static Scalar size_of(const Scalar& x) {
    using std::abs;
    return abs(x);
  }

  Mechanism mechanism_;
  Friction<dof, Scalar> friction_;
  BasicHand<Scalar> hand_;
  bool dry_ = false;
  bool loaded_ = false;
  bool heavy_ = false;  // a mass in the hand
};

}  // namespace palpate
