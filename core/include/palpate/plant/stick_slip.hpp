#pragma once

#include <array>
#include <cmath>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/plant/plant_dynamics.hpp"

namespace palpate::plant {

/// Integrates a plant with dry friction from one change between sticking and sliding to the next.
///
/// Dry friction makes the motion piecewise smooth. Each joint sticks or slides in a known direction. Changes of mode are located to 1e-10
/// of the substep. A stuck joint has exactly zero speed: it neither chatters nor creeps.
template <class Mechanism, class Scalar>
class StickSlip {
 public:
  using Dynamics = PlantDynamics<Mechanism, Scalar>;
  static constexpr int dof = Dynamics::dof;
  using State = typename Dynamics::State;
  using Torque = typename Dynamics::Torque;
  using PointDynamics = typename Dynamics::PointDynamics;
  using AppliedLoad = typename Dynamics::AppliedLoad;
  using Acceleration = typename Dynamics::Acceleration;
  using Bool = Condition<Scalar>;

  explicit StickSlip(const Dynamics& plant) : plant_(plant) {}

  /// Mode of the dry friction of each joint: stuck, sliding forward (direction 1) or backward (-1), or without dry friction.
  struct JointModes {
    std::array<Bool, dof> stuck{};
    Torque direction = Torque::Constant(0.0);

    [[nodiscard]] bool any_stuck() const {
      Bool some = false;
      for (int i = 0; i < dof; ++i) some = some | stuck[i];
      return any(some);
    }
    [[nodiscard]] auto inverse(const typename Dynamics::MechanismDynamics& dynamics) const { return dynamics.inverse(stuck); }
    [[nodiscard]] Torque after_friction(Torque generalized_force, const Torque& qd, const typename Dynamics::Friction& friction) const {
      for (int i = 0; i < dof; ++i) generalized_force[i] -= direction[i] * friction.sliding(i, qd[i]);
      return generalized_force;
    }
  };

  /// Return the modes at a state. A joint at rest sticks if breakaway friction can hold it. Of the joints that it cannot hold, the one
  /// with the largest excess torque over the root of its inertia is released first: the motion of one other cannot push it back.
  template <HandCoupling coupling>
  [[nodiscard]] JointModes choose_modes(const PointDynamics& here, const State& s, const AppliedLoad& load, const Scalar& t) const {
    const Torque& breakaway = plant_.friction().breakaway;
    const Scalar zero = 0.0;
    JointModes modes;
    for (int i = 0; i < dof; ++i) {
      const Bool has_friction = breakaway[i] > zero;
      modes.stuck[i] = has_friction & (s.qd[i] == zero);
      modes.direction[i] =
          select(has_friction & (s.qd[i] > zero), Scalar(1.0), select(has_friction & (s.qd[i] < zero), Scalar(-1.0), zero));
    }
    for (int released = 0; released < dof && modes.any_stuck(); ++released) {
      const Torque required = holding_torque<coupling>(here, s, load, t, modes);
      Torque excess;
      Bool some = false;
      for (int i = 0; i < dof; ++i) {
        excess[i] = select(modes.stuck[i], magnitude(required[i]) - breakaway[i], zero);
        some = some | (excess[i] > zero);
      }
      if (!any(some)) break;
      const std::array<Bool, dof> worst = worst_of(here, excess);
      for (int i = 0; i < dof; ++i) {
        // The joint begins to slide against the friction torque that would be required.
        modes.stuck[i] = modes.stuck[i] & !worst[i];
        modes.direction[i] = select(worst[i], select(required[i] > zero, Scalar(-1.0), Scalar(1.0)), modes.direction[i]);
      }
    }
    return modes;
  }

  /// Integrate `state` over one substep of `duration` [s].
  template <HandCoupling coupling>
  void step(State& state, const typename Dynamics::KinematicsCache& kinematics, const AppliedLoad& load, const Scalar& duration) const {
    constexpr int max_events = 4 * dof;  // bounds the computing time: the rest of the substep then keeps the last modes
    PointDynamics here = plant_.template at<coupling>(kinematics);
    Scalar t = 0.0;
    Bool running = true;
    for (int event = 0; event < max_events; ++event) {
      const JointModes modes = choose_modes<coupling>(here, state, load, t);
      const Acceleration first = plant_.template acceleration<coupling>(here, state, load, t, modes);
      const auto integrate = [&](const Scalar& h) {
        State end = state;
        plant_.template step<coupling>(end, here, first, load, t, h, modes);
        return end;
      };
      const Scalar remaining = duration - t;
      State next = integrate(remaining);
      if (event == max_events - 1) {
        state = select_state(running, next, state);
        return;
      }
      const Torque violation = mode_violation<coupling>(here, state, next, load, duration, modes);
      const Bool mode_ends = running & any_positive(violation);
      state = select_state(running & !mode_ends, next, state);
      if (!any(mode_ends)) return;
      const Scalar elapsed = locate_event<coupling>(here, state, modes, integrate, violation, load, t, remaining, mode_ends, next);
      for (int i = 0; i < dof; ++i) next.qd[i] = select(modes.direction[i] * next.qd[i] < Scalar(0.0), Scalar(0.0), next.qd[i]);
      state = select_state(mode_ends, next, state);
      t = select(mode_ends, t + elapsed, t);
      running = mode_ends & (t < duration);
      if (!any(running)) return;
      here = plant_.template at<coupling>(plant_.mechanism().kinematics(state.q));
    }
  }

 private:
  /// Dry friction torques [N*m] required to hold the stuck joints at rest.
  template <HandCoupling coupling>
  [[nodiscard]] Torque holding_torque(const PointDynamics& point, const State& s, const AppliedLoad& load, const Scalar& t,
                                      const JointModes& modes) const {
    typename Dynamics::Vector hand_acceleration;
    const Torque after_friction =
        modes.after_friction(plant_.template generalized_force<coupling>(point, s, load, t, hand_acceleration), s.qd, plant_.friction());
    return point.dynamics.inertia_torque(modes.inverse(point.dynamics) * after_friction) - after_friction;
  }

  /// Return which joint has the largest positive `excess` [N*m] over the root of its inertia.
  static std::array<Bool, dof> worst_of(const PointDynamics& point, const Torque& excess) {
    std::array<Bool, dof> worst{};
    Scalar largest = 0.0;
    for (int i = 0; i < dof; ++i) {
      Torque unit = Torque::Constant(0.0);
      unit[i] = 1.0;
      const Torque inertia = point.dynamics.inertia_torque(unit);
      const Scalar size = excess[i] * excess[i] / inertia[i];
      worst[i] = (excess[i] > Scalar(0.0)) & (size > largest);
      largest = select(worst[i], size, largest);
      for (int before = 0; before < i; ++before) worst[before] = worst[before] & !worst[i];
    }
    return worst;
  }

  /// How far each joint in state `s` is past the end of its mode: reversed speed [rad/s] when sliding, torque beyond breakaway friction
  /// [N*m] when stuck. The mode continues while this is not positive.
  template <HandCoupling coupling>
  [[nodiscard]] Torque mode_violation(const PointDynamics& here, const State& begin, const State& s, const AppliedLoad& load,
                                      const Scalar& t, const JointModes& modes) const {
    Torque violation = -modes.direction.cwiseProduct(s.qd);
    if (!modes.any_stuck()) return violation;
    const PointDynamics there = plant_.template at<coupling>(plant_.mechanism().advance(here.kinematics, Torque(s.q - begin.q)));
    const Torque required = holding_torque<coupling>(there, s, load, t, modes);
    for (int i = 0; i < dof; ++i)
      violation[i] = select(modes.stuck[i], magnitude(required[i]) - plant_.friction().breakaway[i], violation[i]);
    return violation;
  }

  static Bool any_positive(const Torque& values) {
    Bool out = false;
    for (int i = 0; i < dof; ++i) out = out | (values[i] > Scalar(0.0));
    return out;
  }

  /// Return the time after `t` at which the first mode ends, and the state just past it in `next`.
  ///
  /// Illinois method: regula falsi for each joint, taking the earliest root. An end of the bracket that is kept twice gets half its
  /// weight, and every fourth trial bisects.
  template <HandCoupling coupling, class Integrate>
  [[nodiscard]] Scalar locate_event(const PointDynamics& here, const State& state, const JointModes& modes, const Integrate& integrate,
                                    const Torque& violation_at_end, const AppliedLoad& load, const Scalar& t, const Scalar& remaining,
                                    const Bool& mode_ends, State& next) const {
    constexpr int max_trials = 60;
    constexpr double tolerance = 1e-10;  // of the substep
    const Scalar zero = 0.0;
    Scalar low = 0.0;
    Scalar high = remaining;
    Torque at_low = mode_violation<coupling>(here, state, state, load, t, modes);
    Torque at_high = violation_at_end;
    for (int i = 0; i < dof; ++i) at_low[i] = min_of(at_low[i], zero);
    const Torque target = (tolerance * (at_high - at_low)).eval();  // just past the end
    Scalar last_moved = 0.0;                                        // end of the bracket moved last: 1 high, -1 low
    Bool open = mode_ends;
    for (int trial = 0; trial < max_trials && any(open); ++trial) {
      const Scalar width = high - low;
      Scalar fraction = 1.0;
      for (int i = 0; i < dof; ++i) {
        const Scalar candidate = (target[i] - at_low[i]) / (at_high[i] - at_low[i]);
        fraction = select((at_high[i] > zero) & (candidate < fraction), candidate, fraction);
      }
      if (trial % 4 == 3) fraction = 0.5;
      const Scalar tried = low + fraction * width;
      const State there = integrate(tried);
      const Torque violation = mode_violation<coupling>(here, state, there, load, t + tried, modes);
      const Bool beyond = open & any_positive(violation);
      const Bool before = open & !beyond;
      const Bool again_beyond = beyond & (last_moved > zero);
      const Bool again_before = before & (last_moved < zero);
      Bool converged = true;
      for (int i = 0; i < dof; ++i) {
        converged = converged & (violation[i] <= 2.0 * max_of(target[i], zero));
        at_low[i] = select(before, min_of(violation[i], zero), select(again_beyond, 0.5 * at_low[i], at_low[i]));
        at_high[i] = select(beyond, violation[i], select(again_before, 0.5 * at_high[i], at_high[i]));
      }
      low = select(before, tried, low);
      high = select(beyond, tried, high);
      next = select_state(beyond, there, next);
      last_moved = select(beyond, Scalar(1.0), select(before, Scalar(-1.0), last_moved));
      open = open & !(beyond & converged) & (high - low > Scalar(1e-12) * remaining);
    }
    return high;
  }

  static Scalar magnitude(const Scalar& x) {
    using std::abs;
    return abs(x);
  }

  const Dynamics& plant_;
};

}  // namespace palpate::plant
