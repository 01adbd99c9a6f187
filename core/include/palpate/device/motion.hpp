#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cmath>

#include "palpate/device/friction.hpp"
#include "palpate/device/hand.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// What moves: joints and, when tissue parts them from the tip, the hand.
template <int dof>
struct MotionState {
  Joints<dof> q = Joints<dof>::Zero();   ///< rad
  Joints<dof> qd = Joints<dof>::Zero();  ///< rad/s
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
        state = runge_kutta<true>(state, step, [&](const State& s, double t) { return general_rate(s, push, t, free()); });
      } else if (loaded_) {
        state = runge_kutta<false>(state, step, [&](const State& s, double t) { return general_rate(s, push, t, free()); });
      } else if (pushed) {
        state = runge_kutta<false>(state, step, [&](const State& s, double t) { return pushed_rate(s, push, t); });
      } else {
        state = runge_kutta<false>(state, step, [&](const State& s, double) { return bare_rate(s, push); });
      }
    }
  }

  /// Joint accelerations [rad/s^2] at one instant, sticking included, nobody holding the device.
  [[nodiscard]] Torque acceleration(const Torque& q, const Torque& qd, const Torque& torque) const noexcept {
    const State state{q, qd, Vector3<>::Zero(), Vector3<>::Zero()};
    const Push push{torque, Vector3<>::Zero(), Vector3<>::Zero()};
    if (!dry_) return bare_rate(state, push).qdd;
    return general_rate(state, push, 0.0, choose_modes(state, push, 0.0)).qdd;
  }

  /// Force of the operator on the tip [N] at a state (what a force sensor in the stylus would read, without the hand's inertia
  /// when the grip is rigid).
  [[nodiscard]] Vector3<> hand_force(const State& s, const Vector3<>& voluntary) const noexcept {
    if (!loaded_) return voluntary;
    const Vector3<> p = mechanism_.forward(s.q);
    const Vector3<> v = mechanism_.jacobian(s.q) * s.qd;
    if (hand_.tissue) return hand_.tissue_stiffness * (s.hand - p) + hand_.tissue_damping * (s.hand_velocity - v);
    return voluntary - hand_.stiffness * (p - hand_.rest) - hand_.damping * v;
  }

 private:
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

  [[nodiscard]] Rate bare_rate(const State& s, const Push& push) const {
    Rate r;
    r.qd = s.qd;
    const Torque net = push.torque - friction_.viscous.cwiseProduct(s.qd);
    r.qdd = mechanism_.acceleration(s.q, s.qd, net);
    return r;
  }

  [[nodiscard]] Rate pushed_rate(const State& s, const Push& push, double t) const {
    Rate r;
    r.qd = s.qd;
    const Torque net = push.torque - friction_.viscous.cwiseProduct(s.qd) + mechanism_.jacobian(s.q).transpose() * push.at(t);
    r.qdd = mechanism_.acceleration(s.q, s.qd, net);
    return r;
  }

  [[nodiscard]] Rate general_rate(const State& s, const Push& push, double t, const Modes& modes) const {
    Rate r;
    r.qd = s.qd;
    Eigen::Matrix<double, dof, dof> inertia = mechanism_.mass_matrix(s.q);
    Torque net = push.torque - friction_.viscous.cwiseProduct(s.qd) - mechanism_.coriolis(s.q, s.qd) * s.qd - mechanism_.gravity(s.q);
    const auto j = mechanism_.jacobian(s.q);
    if (hand_.tissue) {
      const Vector3<> on_tip = hand_force(s, push.at(t));
      net += j.transpose() * on_tip;
      r.hand_velocity = s.hand_velocity;
      r.hand_acceleration = (push.at(t) - on_tip - hand_.stiffness * (s.hand - hand_.rest) - hand_.damping * s.hand_velocity) / hand_.mass;
    } else {
      net += j.transpose() * hand_force(s, push.at(t));
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
  static State runge_kutta(const State& s, double h, const RateOf& rate) {
    const Rate k1 = rate(s, 0.0);
    const Rate k2 = rate(moved<with_hand>(s, k1, 0.5 * h), 0.5 * h);
    const Rate k3 = rate(moved<with_hand>(s, k2, 0.5 * h), 0.5 * h);
    const Rate k4 = rate(moved<with_hand>(s, k3, h), h);
    State out = s;
    out.q += (h / 6.0) * (k1.qd + 2.0 * (k2.qd + k3.qd) + k4.qd);
    out.qd += (h / 6.0) * (k1.qdd + 2.0 * (k2.qdd + k3.qdd) + k4.qdd);
    if constexpr (with_hand) {
      out.hand += (h / 6.0) * (k1.hand_velocity + 2.0 * (k2.hand_velocity + k3.hand_velocity) + k4.hand_velocity);
      out.hand_velocity +=
          (h / 6.0) * (k1.hand_acceleration + 2.0 * (k2.hand_acceleration + k3.hand_acceleration) + k4.hand_acceleration);
    }
    return out;
  }

  /// For joints at rest: stuck if breakaway friction can hold them all, else the worst is let go, one by one.
  [[nodiscard]] Modes choose_modes(const State& s, const Push& push, double t) const {
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
      const Rate r = general_rate(s, push, t, modes);
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
    const Rate r = general_rate(s, push, t, modes);
    for (int i = 0; i < dof; ++i) {
      if (modes[i] == Mode::stuck && std::abs(r.holding[i]) > friction_.breakaway[i]) return true;
    }
    return false;
  }

  void advance_with_sticking(State& state, const Push& push, double step) const {
    constexpr int most_events = 4 * dof;  // bounds the tick; more turn-rounds than this in a substep have no physics left
    constexpr int bisections = 40;
    double t = 0.0;
    for (int event = 0; event < most_events && t < step; ++event) {
      const Modes modes = choose_modes(state, push, t);
      const auto slide = [&](double h) {
        const auto rate = [&](const State& s, double dt) { return general_rate(s, push, t + dt, modes); };
        return hand_.tissue ? runge_kutta<true>(state, h, rate) : runge_kutta<false>(state, h, rate);
      };
      State next = slide(step - t);
      if (!mode_ends(next, push, step, modes)) {
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
