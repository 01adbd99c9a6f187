#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "palpate/device/friction.hpp"
#include "palpate/device/hand.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// What moves: joints and, when tissue parts them from the tip, the hand.
template <int dof>
struct MotionState {
  Joints<dof> q = Joints<dof>::Zero();          ///< rad
  Joints<dof> qd = Joints<dof>::Zero();         ///< rad/s
  Vector3<> hand = Vector3<>::Zero();           ///< m
  Vector3<> hand_velocity = Vector3<>::Zero();  ///< m/s
};

/// The continuous physics between two samples: a mechanism with friction, held by a hand, under constant motor torques.
///
/// Runge-Kutta of order 4 where the motion is smooth. Dry friction makes it piecewise smooth: each joint sticks or
/// slides in a known direction, the instants at which that changes are located to rounding of the substep, and a stuck
/// joint has speed exactly zero: it neither chatters nor creeps.
template <class Mechanism>
class Motion {
 public:
  static constexpr int dof = Mechanism::dof;
  using State = MotionState<dof>;
  using Torque = Joints<dof>;

  Motion() = default;
  Motion(const Mechanism& mechanism, const Friction<dof>& friction, const Hand& hand)
      : mechanism_(mechanism), friction_(friction), hand_(hand), dry_(friction.dry()), loaded_(!hand.empty()) {}

  [[nodiscard]] const Mechanism& mechanism() const { return mechanism_; }
  [[nodiscard]] const Friction<dof>& friction() const { return friction_; }

  /// Moves `state` on by `period` [s] in `substeps` equal steps, under motor torques [N*m] held constant and the
  /// operator's force.
  void advance(State& state, const Torque& torque, const ForceSegment& force, double period, int substeps) const noexcept {
    const bool pushed = !(force.begin.isZero(0.0) && force.end.isZero(0.0));
    const double step = period / substeps;
    for (int i = 0; i < substeps; ++i) {
      const Push push{torque, force.at(static_cast<double>(i) / substeps), (force.end - force.begin) / period};
      if (dry_) {
        advance_with_sticking(state, push, step);
      } else if (hand_.tissue) {
        runge_kutta<true>(state, step, [&](const State& s, const Posture& at, double t) { return general_rate(s, at, push, t, free()); });
      } else if (loaded_) {
        runge_kutta<false>(state, step, [&](const State& s, const Posture& at, double t) { return general_rate(s, at, push, t, free()); });
      } else if (pushed) {
        advance_freely<true>(state, push, step);
      } else {
        advance_freely<false>(state, push, step);
      }
    }
  }

  /// Joint accelerations [rad/s^2] at one instant, sticking included, nobody holding the device.
  [[nodiscard]] Torque acceleration(const Torque& q, const Torque& qd, const Torque& torque) const noexcept {
    const State state{q, qd, Vector3<>::Zero(), Vector3<>::Zero()};
    const Push push{torque, Vector3<>::Zero(), Vector3<>::Zero()};
    const Posture& at = mechanism_.posture(q);
    if (!dry_) return free_acceleration<false>(at, qd, push, 0.0);
    return general_rate(state, at, push, 0.0, choose_modes(state, at, push, 0.0)).qdd;
  }

  /// Force of the operator on the tip [N] at a state (what a force sensor in the stylus would read, without the hand's inertia
  /// when the grip is rigid).
  [[nodiscard]] Vector3<> hand_force(const State& s, const Vector3<>& voluntary) const noexcept {
    if (!loaded_) return voluntary;
    return hand_force(s, mechanism_.posture(s.q), voluntary);
  }

 private:
  using Posture = std::decay_t<decltype(std::declval<Mechanism>().posture(std::declval<Torque>()))>;

  [[nodiscard]] Vector3<> hand_force(const State& s, const Posture& at, const Vector3<>& voluntary) const noexcept {
    const Vector3<> p = mechanism_.forward(at);
    const Vector3<> v = mechanism_.jacobian(at) * s.qd;
    if (hand_.tissue) return hand_.tissue_stiffness * (s.hand - p) + hand_.tissue_damping * (s.hand_velocity - v);
    return voluntary - hand_.stiffness * (p - hand_.rest) - hand_.damping * v;
  }

  struct Push {
    Torque torque;
    Vector3<> force;       // at the substep's beginning
    Vector3<> force_rate;  // N/s

    [[nodiscard]] Vector3<> at(double t) const { return force + t * force_rate; }
  };

  struct Rate {
    Torque qd, qdd;
    Vector3<> hand_velocity, hand_acceleration;
    Torque holding;  // torque that dry friction needs to keep stuck joints at rest
  };

  /// How each joint's dry friction acts: free of it, stuck, or sliding forwards or backwards.
  enum class Mode : signed char { backward = -1, stuck = 0, forward = 1, free = 2 };
  using Modes = std::array<Mode, dof>;

  static Modes free() {
    Modes modes;
    modes.fill(Mode::free);
    return modes;
  }

  /// Joint accelerations [rad/s^2] without dry friction, nobody's mass at the tip; `pushed`: under the operator's force.
  template <bool pushed>
  [[nodiscard, gnu::always_inline]] Torque free_acceleration(const Posture& at, const Torque& qd, const Push& push, double t) const {
    Torque net = push.torque - friction_.viscous.cwiseProduct(qd);
    if constexpr (pushed) net += mechanism_.torque(at, push.at(t));
    return mechanism_.acceleration(at, qd, net);
  }

  /// The common case, where a second of servo ticks is a second of these: Runge-Kutta written out for q' = v, v' = a(q, v, t).
  template <bool pushed>
  void advance_freely(State& s, const Push& push, double h) const {
    const Posture at = mechanism_.posture(s.q);
    const Torque v1 = s.qd;
    const Torque a1 = free_acceleration<pushed>(at, v1, push, 0.0);
    const Torque v2 = v1 + 0.5 * h * a1;
    const Torque a2 = free_acceleration<pushed>(mechanism_.turned(at, 0.5 * h * v1), v2, push, 0.5 * h);
    const Torque v3 = v1 + 0.5 * h * a2;
    const Torque a3 = free_acceleration<pushed>(mechanism_.turned(at, 0.5 * h * v2), v3, push, 0.5 * h);
    const Torque v4 = v1 + h * a3;
    const Torque a4 = free_acceleration<pushed>(mechanism_.turned(at, h * v3), v4, push, h);
    s.q += (h / 6.0) * (v1 + 2.0 * (v2 + v3) + v4);
    s.qd += (h / 6.0) * (a1 + 2.0 * (a2 + a3) + a4);
  }

  [[nodiscard]] Rate general_rate(const State& s, const Posture& at, const Push& push, double t, const Modes& modes) const {
    Rate r;
    r.qd = s.qd;
    Eigen::Matrix<double, dof, dof> inertia = mechanism_.mass_matrix(at);
    Torque net = push.torque - friction_.viscous.cwiseProduct(s.qd) - mechanism_.coriolis(at, s.qd) * s.qd - mechanism_.gravity(at);
    const auto j = mechanism_.jacobian(at);
    if (hand_.tissue) {
      const Vector3<> on_tip = hand_force(s, at, push.at(t));
      net += j.transpose() * on_tip;
      r.hand_velocity = s.hand_velocity;
      r.hand_acceleration = (push.at(t) - on_tip - hand_.stiffness * (s.hand - hand_.rest) - hand_.damping * s.hand_velocity) / hand_.mass;
    } else {
      net += j.transpose() * hand_force(s, at, push.at(t));
      if (hand_.mass > 0.0) {
        inertia += hand_.mass * j.transpose() * j;
        net -= hand_.mass * j.transpose() * tip_acceleration_at_rest_joints(s);
      }
    }
    for (int i = 0; i < dof; ++i) {
      if (modes[i] == Mode::forward) net[i] -= friction_.sliding(i, s.qd[i]);
      if (modes[i] == Mode::backward) net[i] += friction_.sliding(i, s.qd[i]);
    }
    Eigen::Matrix<double, dof, dof> constrained = inertia;
    Torque right = net;
    for (int i = 0; i < dof; ++i) {
      if (modes[i] != Mode::stuck) continue;
      constrained.row(i).setZero();
      constrained.col(i).setZero();
      constrained(i, i) = 1.0;
      right[i] = 0.0;
    }
    r.qdd = constrained.llt().solve(right);
    for (int i = 0; i < dof; ++i) {
      if (modes[i] == Mode::stuck) r.qdd[i] = 0.0;
    }
    r.holding = inertia * r.qdd - net;
    return r;
  }

  /// dJ/dt qd: the part of the tip's acceleration that needs no joint acceleration [m/s^2].
  [[nodiscard]] Vector3<> tip_acceleration_at_rest_joints(const State& s) const {
    using Time = Dual<1>;
    Joints<dof, Time> q;
    for (int i = 0; i < dof; ++i) q[i] = Time(s.q[i], Eigen::Matrix<double, 1, 1>(s.qd[i]));
    const TipJacobian<dof, Time> j = mechanism_.jacobian(q);
    Vector3<> a = Vector3<>::Zero();
    for (int row = 0; row < 3; ++row) {
      for (int i = 0; i < dof; ++i) a[row] += j(row, i).gradient[0] * s.qd[i];
    }
    return a;
  }

  template <bool with_hand>
  static State moved(const State& s, const Rate& r, double h) {
    State out = s;
    out.q += h * r.qd;
    out.qd += h * r.qdd;
    if constexpr (with_hand) {
      out.hand += h * r.hand_velocity;
      out.hand_velocity += h * r.hand_acceleration;
    }
    return out;
  }

  template <bool with_hand, class RateOf>
  void runge_kutta(State& s, double h, const RateOf& rate) const {
    const Posture at = mechanism_.posture(s.q);
    const auto later = [&](const Rate& k, double t) {
      const State there = moved<with_hand>(s, k, t);
      return rate(there, mechanism_.turned(at, t * k.qd), t);
    };
    const Rate k1 = rate(s, at, 0.0);
    const Rate k2 = later(k1, 0.5 * h);
    const Rate k3 = later(k2, 0.5 * h);
    const Rate k4 = later(k3, h);
    const auto add = [h](auto& y, const auto& a, const auto& b, const auto& c, const auto& d) { y += (h / 6.0) * (a + 2.0 * (b + c) + d); };
    add(s.q, k1.qd, k2.qd, k3.qd, k4.qd);
    add(s.qd, k1.qdd, k2.qdd, k3.qdd, k4.qdd);
    if constexpr (with_hand) {
      add(s.hand, k1.hand_velocity, k2.hand_velocity, k3.hand_velocity, k4.hand_velocity);
      add(s.hand_velocity, k1.hand_acceleration, k2.hand_acceleration, k3.hand_acceleration, k4.hand_acceleration);
    }
  }

  /// For joints at rest: stuck if breakaway friction can hold them all, else the worst is let go, one by one.
  [[nodiscard]] Modes choose_modes(const State& s, const Posture& at, const Push& push, double t) const {
    Modes modes;
    for (int i = 0; i < dof; ++i) {
      if (!(friction_.breakaway[i] > 0.0)) {
        modes[i] = Mode::free;
      } else if (s.qd[i] == 0.0) {
        modes[i] = Mode::stuck;
      } else {
        modes[i] = s.qd[i] > 0.0 ? Mode::forward : Mode::backward;
      }
    }
    for (int released = 0; released < dof; ++released) {
      const Rate r = general_rate(s, at, push, t, modes);
      int worst = -1;
      double excess = 0.0;
      for (int i = 0; i < dof; ++i) {
        const double over = std::abs(r.holding[i]) / friction_.breakaway[i] - 1.0;
        if (modes[i] == Mode::stuck && over > excess) {
          excess = over;
          worst = i;
        }
      }
      if (worst < 0) break;
      // Friction would have to push with `holding`; the joint gives way to the opposite side.
      modes[worst] = r.holding[worst] > 0.0 ? Mode::backward : Mode::forward;
    }
    return modes;
  }

  /// Has a sliding joint turned round, or a stuck one been torn loose, by state `s`?
  [[nodiscard]] bool mode_ends(const State& s, const Push& push, double t, const Modes& modes) const {
    bool any_stuck = false;
    for (int i = 0; i < dof; ++i) {
      if (modes[i] == Mode::forward && s.qd[i] < 0.0) return true;
      if (modes[i] == Mode::backward && s.qd[i] > 0.0) return true;
      any_stuck = any_stuck || modes[i] == Mode::stuck;
    }
    if (!any_stuck) return false;
    const Rate r = general_rate(s, mechanism_.posture(s.q), push, t, modes);
    for (int i = 0; i < dof; ++i) {
      if (modes[i] == Mode::stuck && std::abs(r.holding[i]) > friction_.breakaway[i]) return true;
    }
    return false;
  }

  void advance_with_sticking(State& state, const Push& push, double step) const {
    constexpr int most_events = 4 * dof;  // bounds the tick: the rest of the substep then keeps the last modes
    constexpr int bisections = 40;
    double t = 0.0;
    for (int event = 0; event < most_events && t < step; ++event) {
      const Modes modes = choose_modes(state, mechanism_.posture(state.q), push, t);
      const auto slide = [&](double h) {
        const auto rate = [&](const State& s, const Posture& at, double dt) { return general_rate(s, at, push, t + dt, modes); };
        State end = state;
        hand_.tissue ? runge_kutta<true>(end, h, rate) : runge_kutta<false>(end, h, rate);
        return end;
      };
      State next = slide(step - t);
      if (event == most_events - 1 || !mode_ends(next, push, step, modes)) {
        state = next;
        return;
      }
      double before = 0.0;
      double after = step - t;
      for (int i = 0; i < bisections && after - before > 1e-12 * step; ++i) {
        const double middle = 0.5 * (before + after);
        const State trial = slide(middle);
        if (mode_ends(trial, push, t + middle, modes)) {
          after = middle;
          next = trial;
        } else {
          before = middle;
        }
      }
      for (int i = 0; i < dof; ++i) {
        if (static_cast<double>(modes[i]) * next.qd[i] < 0.0 && modes[i] != Mode::free) next.qd[i] = 0.0;
      }
      state = next;
      t += after;
    }
  }

  Mechanism mechanism_;
  Friction<dof> friction_;
  Hand hand_;
  bool dry_ = false;
  bool loaded_ = false;
};

}  // namespace palpate
