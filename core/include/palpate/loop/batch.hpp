#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "palpate/loop/simulation.hpp"
#include "palpate/math/pack.hpp"

namespace palpate {

/// What a loop of a batch leaves behind: a row of numbers, not a trace.
/// unstable tick (-1: never); swing early and late, m; ripple, m; steady tip displacement (3), m; peak object force and command, N;
/// share of the time in touch and in saturation; joints (dof) and their speeds (dof) at the end.
template <int dof>
constexpr int outcome_width = 11 + 2 * dof;

namespace detail {

/// Watches loops side by side. A swing is the largest second difference of the tip's position over a fifth of the run: the second
/// fifth is early, the last is late. Ripple is half the tip's range along the axis of the largest, over the last fifth.
template <class Mechanism, int lanes>
class Watch {
 public:
  static constexpr int dof = Mechanism::dof;
  using Scalar = Pack<lanes>;
  using Where = Mask<lanes>;
  using Vector = Vector3<Scalar>;

  Watch(const SimulationSetup<Mechanism, Scalar>& s, int ticks)
      : mechanism_(s.mechanism), start_(s.mechanism.forward(s.start)), ticks_(ticks) {
    lowest_.setConstant(1e300);
    highest_.setConstant(-1e300);
    steady_.setConstant(0.0);
    before_ = last_ = start_;
  }

  void lost(const Where& which, int tick) noexcept { unstable_ = choose(which, Scalar(tick), unstable_); }

  template <class Plant, class Servo>
  void see(int k, const Where& alive, const Plant& plant, const Servo& servo, const Vector& /*force*/,
           const Clock<Scalar>& clock) noexcept {
    const auto& tick = servo.last();
    const Vector tip = mechanism_.forward(plant.posture());
    const Vector bend = clock.jitters() ? bend_to(tip, clock) : Vector(tip - 2.0 * last_ + before_);
    const Scalar swing = choose(alive, bend.squaredNorm(), Scalar(0.0));
    before_ = last_;
    last_ = tip;
    if (k > ticks_ / 5 && k <= 2 * (ticks_ / 5)) early_ = greater(early_, swing);
    object_force_ = greater(object_force_, choose(alive, tick.object_force.squaredNorm(), Scalar(0.0)));
    command_ = greater(command_, choose(alive, tick.command.squaredNorm(), Scalar(0.0)));
    touching_ += choose(alive & tick.touching, Scalar(1.0), Scalar(0.0));
    saturated_ += choose(alive & tick.saturated, Scalar(1.0), Scalar(0.0));
    if (k > ticks_ - ticks_ / 5) {
      late_ = greater(late_, swing);
      for (int i = 0; i < 3; ++i) {
        lowest_[i] = lesser(lowest_[i], tip[i]);
        highest_[i] = greater(highest_[i], tip[i]);
        steady_[i] += tip[i] - start_[i];
      }
    }
    if (k == ticks_) {
      q_ = plant.angles();
      qd_ = plant.speeds();
    }
  }

  /// Writes rows of outcome_width<dof> for the first `count` lanes.
  void write(double* rows, int count) const {
    const double fifth = ticks_ / 5 > 0 ? ticks_ / 5 : 1;
    for (int lane = 0; lane < count; ++lane) {
      double* row = rows + static_cast<std::ptrdiff_t>(lane) * outcome_width<dof>;
      const bool ended = unstable_[lane] < 0.0;
      const double unknown = std::numeric_limits<double>::quiet_NaN();
      const double samples = ended ? ticks_ + 1.0 : std::max(unstable_[lane], 1.0);
      double ripple = 0.0;
      for (int i = 0; i < 3; ++i) ripple = std::max(ripple, 0.5 * (highest_[i][lane] - lowest_[i][lane]));
      row[0] = unstable_[lane];
      row[1] = std::sqrt(early_[lane]);
      row[2] = ended ? std::sqrt(late_[lane]) : unknown;
      row[3] = ended ? ripple : unknown;
      for (int i = 0; i < 3; ++i) row[4 + i] = ended ? steady_[i][lane] / fifth : unknown;
      row[7] = std::sqrt(object_force_[lane]);
      row[8] = std::sqrt(command_[lane]);
      row[9] = touching_[lane] / samples;
      row[10] = saturated_[lane] / samples;
      for (int i = 0; i < dof; ++i) {
        row[11 + i] = ended ? q_[i][lane] : unknown;
        row[11 + dof + i] = ended ? qd_[i][lane] : unknown;
      }
    }
  }

 private:
  /// Second difference of the tip's position where times between ticks differ: the change of mean speed, times the period.
  Vector bend_to(const Vector& tip, const Clock<Scalar>& clock) noexcept {
    const Scalar share = clock.period() / clock.past();
    const Vector bend = share * (tip - last_) - share_before_ * (last_ - before_);
    share_before_ = share;
    return bend;
  }

  Mechanism mechanism_;
  Vector start_;
  int ticks_;
  Scalar share_before_ = 1.0;
  Vector before_, last_;
  Vector lowest_, highest_, steady_;
  Scalar unstable_ = -1.0, early_ = 0.0, late_ = 0.0, object_force_ = 0.0, command_ = 0.0, touching_ = 0.0, saturated_ = 0.0;
  Joints<dof, Scalar> q_ = Joints<dof, Scalar>::Constant(0.0), qd_ = Joints<dof, Scalar>::Constant(0.0);
};

template <int lanes, class Setup, class Field>
Pack<lanes> lane_by_lane(const Setup* const* cells, const Field& field) {
  Pack<lanes> out;
  for (int i = 0; i < lanes; ++i) out.set(i, field(*cells[i]));
  return out;
}

template <int lanes, int size, class Setup, class Field>
Eigen::Matrix<Pack<lanes>, size, 1> rows_by_lane(const Setup* const* cells, const Field& field) {
  Eigen::Matrix<Pack<lanes>, size, 1> out;
  for (int i = 0; i < size; ++i) out[i] = lane_by_lane<lanes>(cells, [&](const Setup& s) { return field(s)[i]; });
  return out;
}

/// The setups of `lanes` loops as one.
template <class Mechanism, int lanes>
SimulationSetup<Mechanism, Pack<lanes>> side_by_side(const SimulationSetup<Mechanism>* const* cells) {
  using Setup = SimulationSetup<Mechanism>;
  constexpr int dof = Mechanism::dof;
  const Setup& first = *cells[0];
  SimulationSetup<Mechanism, Pack<lanes>> out;
  const auto one = [&](const auto& field) { return lane_by_lane<lanes>(cells, field); };
  const auto three = [&](const auto& field) { return rows_by_lane<lanes, 3>(cells, field); };
  const auto joints = [&](const auto& field) { return rows_by_lane<lanes, dof>(cells, field); };
  // Shared by all: what decides the shape of the computation.
  out.mechanism = first.mechanism;
  out.frozen_kinematics = first.frozen_kinematics;
  out.difference = first.difference;
  out.controller = first.controller.template cast<Pack<lanes>>();
  out.period = first.period;
  out.substeps = first.substeps;
  out.speed_limit = first.speed_limit;
  out.anchor.kind = first.anchor.kind;
  out.hand.tissue = first.hand.tissue;
  // Each loop's own.
  for (std::size_t i = 0; i < lanes; ++i) {
    out.delay[i] = cells[i]->delay;
    out.seed[i] = cells[i]->seed;
  }
  out.jitter = one([](const Setup& s) { return s.jitter; });
  out.anchor.point = three([](const Setup& s) -> const Vector3<>& { return s.anchor.point; });
  out.anchor.normal = three([](const Setup& s) -> const Vector3<>& { return s.anchor.normal; });
  out.stiffness = three([](const Setup& s) -> const Vector3<>& { return s.stiffness; });
  out.damping = three([](const Setup& s) -> const Vector3<>& { return s.damping; });
  out.hold = three([](const Setup& s) -> const Vector3<>& { return s.hold; });
  out.start = joints([](const Setup& s) -> const Joints<dof>& { return s.start; });
  out.start_speed = joints([](const Setup& s) -> const Joints<dof>& { return s.start_speed; });
  out.encoder.step = joints([](const Setup& s) -> const Joints<dof>& { return s.encoder.step; });
  out.limits.peak_force = one([](const Setup& s) { return s.limits.peak_force; });
  out.limits.continuous_force = one([](const Setup& s) { return s.limits.continuous_force; });
  out.limits.thermal_time = one([](const Setup& s) { return s.limits.thermal_time; });
  out.limits.peak_torque = joints([](const Setup& s) -> const Joints<dof>& { return s.limits.peak_torque; });
  out.friction.viscous = joints([](const Setup& s) -> const Joints<dof>& { return s.friction.viscous; });
  out.friction.coulomb = joints([](const Setup& s) -> const Joints<dof>& { return s.friction.coulomb; });
  out.friction.breakaway = joints([](const Setup& s) -> const Joints<dof>& { return s.friction.breakaway; });
  out.friction.stribeck_speed = joints([](const Setup& s) -> const Joints<dof>& { return s.friction.stribeck_speed; });
  out.hand.mass = one([](const Setup& s) { return s.hand.mass; });
  out.hand.damping = one([](const Setup& s) { return s.hand.damping; });
  out.hand.stiffness = one([](const Setup& s) { return s.hand.stiffness; });
  out.hand.tissue_stiffness = one([](const Setup& s) { return s.hand.tissue_stiffness; });
  out.hand.tissue_damping = one([](const Setup& s) { return s.hand.tissue_damping; });
  out.hand.rest = three([](const Setup& s) -> const Vector3<>& { return s.hand.rest; });
  return out;
}

}  // namespace detail

/// Whether two loops can run side by side, so that what each finds does not depend on the other: the same shape of computation.
/// What `side_by_side` shares must be the same too; cells of one base setup are.
template <class Mechanism>
bool alike(const SimulationSetup<Mechanism>& a, const SimulationSetup<Mechanism>& b) {
  return a.friction.dry() == b.friction.dry() && a.hand.empty() == b.hand.empty() && a.hand.tissue == b.hand.tissue &&
         (a.hand.mass > 0.0) == (b.hand.mass > 0.0) && (a.jitter > 0.0) == (b.jitter > 0.0);
}

/// Runs `count` <= lanes loops side by side, samples 0 to `ticks`: alike, moving (neither held nor linear).
/// @param rows  room for `count` rows of outcome_width<dof>
template <class Mechanism, int lanes>
void simulate_side_by_side(const SimulationSetup<Mechanism>* const* cells, int count, int ticks, const double* reference,
                           const double* operator_force, double* rows) {
  const SimulationSetup<Mechanism>* all[lanes];
  for (int i = 0; i < lanes; ++i) all[i] = cells[i < count ? i : 0];
  const SimulationSetup<Mechanism, Pack<lanes>> setup = detail::side_by_side<Mechanism, lanes>(all);
  detail::MovingPlant<Mechanism, Pack<lanes>> plant(setup);
  detail::Watch<Mechanism, lanes> watch(setup, ticks);
  detail::run(setup, plant, ticks, reference, operator_force, watch);
  watch.write(rows, count);
}

}  // namespace palpate
