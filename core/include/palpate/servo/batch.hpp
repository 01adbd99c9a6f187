#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "palpate/actuation/tick_schedule.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/object/spring_wall.hpp"
#include "palpate/servo/servo.hpp"
#include "palpate/servo/simulation.hpp"

namespace palpate::servo {

/// Columns of a loop's outcome, see StabilityMonitor for the definitions:
///   0       tick of divergence, -1 if there was none
///   1-3     oscillation early, prior and late, m
///   4       ripple, m
///   5-7     steady tip displacement, m
///   8, 9    peak object force and command, N
///   10, 11  fraction of the run in contact and at the limits of the drive
///   12, 13  the same for the last fifth of the judged window
///   14      contacts that begin in that fifth
///   15-     joint angles (dof) and velocities (dof) at the end
template <int dof>
constexpr int outcome_width = 15 + 2 * dof;

/// One loop at its first tick, and the row of outcome_width<dof> that receives its outcome.
template <class Mechanism>
struct BatchJob {
  Servo<Mechanism, object::SpringWall, control::StateSpace> servo;
  detail::MovingPlant<Mechanism> plant;
  actuation::TickSchedule<double> clock;
  double speed_limit;
  int window_start;
  double* row;

  BatchJob(const SimulationSetup<Mechanism>& s, double* row)
      : servo(s, *s.object.template get_if<object::SpringWall>(), *s.controller.template get_if<control::StateSpace>()),
        plant(s),
        clock(s.period, s.jitter, s.seed),
        speed_limit(s.speed_limit),
        window_start(s.window_start),
        row(row) {}
};

/// Return true if the loop can run in lanes: a moving device, a spring or wall, and a linear controller.
template <class Mechanism>
[[nodiscard]] bool runs_in_lanes(const SimulationSetup<Mechanism>& s) noexcept {
  return !s.fixed && !s.linear && s.object.template get_if<object::SpringWall>() && s.controller.template get_if<control::StateSpace>();
}

/// Properties that loops of one base setup must share to run side by side.
struct BatchKey {
  bool dry, held, tissue, jitters, counts;

  template <class Mechanism>
  explicit BatchKey(const SimulationSetup<Mechanism>& s)
      : dry(s.friction.dry()),
        held(!s.human_arm.empty()),
        tissue(s.human_arm.tissue),
        jitters(s.jitter > 0.0),
        counts(!s.encoder.exact()) {}
  bool operator==(const BatchKey&) const = default;
};

/// Source of the loops: `next(owner)` returns the next one, with the same BatchKey as those before; null if there is none. The result is
/// valid until the next call, and after a null until the queue is destroyed.
template <class Mechanism>
struct JobQueue {
  const BatchJob<Mechanism>* (*next)(void* owner) = nullptr;
  void* owner = nullptr;
};

namespace detail {

/// Set a scalar value; counterpart of math::set_lane.
inline void set_lane(double& value, int /*lane*/, double one) noexcept {
  value = one;
}
template <int rows, int columns>
void set_lane(Eigen::Matrix<double, rows, columns>& value, int /*lane*/, const Eigen::Matrix<double, rows, columns>& one) noexcept {
  value = one;
}

/// Return the value of one lane.
inline double lane_of(double value, int /*lane*/) noexcept {
  return value;
}
template <int lanes>
double lane_of(const Pack<lanes>& value, int lane) noexcept {
  return value[lane];
}

/// Measures loops in lanes, each at its own tick, or one loop (Scalar double). The judged window goes from tick `from` to the last one. An
/// oscillation is the largest second difference of the tip position over a fifth of the window: "early" the second fifth, "prior" the
/// fourth, "late" the last. Ripple is half the range of the tip over the last fifth, along the axis with the largest range.
template <class Mechanism, class Number>
class StabilityMonitor {
 public:
  static constexpr int dof = Mechanism::dof;
  using Scalar = Number;
  using Where = Condition<Scalar>;
  using Vector = Vector3<Scalar>;

  /// @param ticks  number of the last tick
  /// @param from   first tick of the judged window
  StabilityMonitor(int ticks, int from) : ticks_(ticks), from_(from), fifth_((ticks - from) / 5) {}

  /// Restart one lane with the tip at `tip` [m].
  void set_lane(int lane, const Vector3<>& tip) noexcept {
    using detail::set_lane;
    using math::set_lane;
    for (Vector* v : {&start_, &before_, &last_}) set_lane(*v, lane, tip);
    for (Vector* v : {&lowest_, &highest_, &steady_}) set_lane(*v, lane, Vector3<>(Vector3<>::Zero()));
    for (Scalar* x : {&early_, &prior_, &late_, &object_force_, &command_, &touching_, &saturated_, &late_touching_, &late_saturated_,
                      &contacts_, &was_touching_})
      set_lane(*x, lane, 0.0);
    set_lane(share_before_, lane, 1.0);
  }

  /// Observe tick `k` of each lane.
  template <class Plant, class Servo>
  [[gnu::always_inline]] void observe(const Scalar& k, const Plant& plant, const Servo& servo,
                                      const actuation::TickSchedule<Scalar>& clock) noexcept {
    const auto& tick = servo.last();
    const Vector tip = plant.tip();
    const Vector second_difference = clock.has_jitter() ? second_difference_at(tip, clock) : Vector(tip - 2.0 * last_ + before_);
    const Scalar oscillation = second_difference.squaredNorm();
    before_ = last_;
    last_ = tip;
    const double fifth = fifth_;
    early_ = select((k > Scalar(from_ + fifth)) & (k <= Scalar(from_ + 2.0 * fifth)) & (early_ < oscillation), oscillation, early_);
    prior_ = select((k > Scalar(ticks_ - 2.0 * fifth)) & (k <= Scalar(ticks_ - fifth)) & (prior_ < oscillation), oscillation, prior_);
    object_force_ = max_of(object_force_, tick.object_force.squaredNorm());
    command_ = max_of(command_, tick.command.squaredNorm());
    const Scalar touching = select(tick.touching, Scalar(1.0), Scalar(0.0));
    const Scalar saturated = select(tick.saturated, Scalar(1.0), Scalar(0.0));
    touching_ += touching;
    saturated_ += saturated;
    const Where ending = k > Scalar(ticks_ - fifth);
    if (any(ending)) observe_ending(ending, k, plant, tip, oscillation, touching, saturated);
    was_touching_ = touching;
  }

  /// Write the row of one lane, outcome_width<dof> numbers; `unstable` is the tick of divergence, -1 if there was none.
  void write(int lane, double unstable, double* row) const noexcept {
    const double fifth = std::max(fifth_, 1);
    const bool ended = unstable < 0.0;
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    const double samples = ended ? ticks_ + 1.0 : std::max(unstable, 1.0);
    double ripple = 0.0;
    for (int i = 0; i < 3; ++i) ripple = std::max(ripple, 0.5 * (lane_of(highest_[i], lane) - lane_of(lowest_[i], lane)));
    row[0] = unstable;
    row[1] = std::sqrt(lane_of(early_, lane));
    row[2] = ended ? std::sqrt(lane_of(prior_, lane)) : unknown;
    row[3] = ended ? std::sqrt(lane_of(late_, lane)) : unknown;
    row[4] = ended ? ripple : unknown;
    for (int i = 0; i < 3; ++i) row[5 + i] = ended ? lane_of(steady_[i], lane) / fifth : unknown;
    row[8] = std::sqrt(lane_of(object_force_, lane));
    row[9] = std::sqrt(lane_of(command_, lane));
    row[10] = lane_of(touching_, lane) / samples;
    row[11] = lane_of(saturated_, lane) / samples;
    row[12] = ended ? lane_of(late_touching_, lane) / fifth : unknown;
    row[13] = ended ? lane_of(late_saturated_, lane) / fifth : unknown;
    row[14] = ended ? lane_of(contacts_, lane) : unknown;
    for (int i = 0; i < dof; ++i) {
      row[15 + i] = ended ? lane_of(q_[i], lane) : unknown;
      row[15 + dof + i] = ended ? lane_of(qd_[i], lane) : unknown;
    }
  }

 private:
  /// Second difference of the tip's position where times between ticks differ: the change of mean speed, times the period.
  Vector second_difference_at(const Vector& tip, const actuation::TickSchedule<Scalar>& clock) noexcept {
    const Scalar share = clock.period() / clock.elapsed();
    const Vector second_difference = share * (tip - last_) - share_before_ * (last_ - before_);
    share_before_ = share;
    return second_difference;
  }

  /// Observe a tick of the last fifth.
  template <class Plant>
  void observe_ending(const Where& ending, const Scalar& k, const Plant& plant, const Vector& tip, const Scalar& oscillation,
                      const Scalar& touching, const Scalar& saturated) noexcept {
    const Where first = ending & (k <= Scalar(ticks_ - fifth_ + 1.0));
    late_touching_ = select(ending, late_touching_ + touching, late_touching_);
    late_saturated_ = select(ending, late_saturated_ + saturated, late_saturated_);
    contacts_ = select(ending & (was_touching_ < touching), contacts_ + 1.0, contacts_);
    late_ = select(ending & (late_ < oscillation), oscillation, late_);
    for (int i = 0; i < 3; ++i) {
      lowest_[i] = select(first | (ending & (tip[i] < lowest_[i])), tip[i], lowest_[i]);
      highest_[i] = select(first | (ending & (highest_[i] < tip[i])), tip[i], highest_[i]);
      steady_[i] = select(ending, steady_[i] + (tip[i] - start_[i]), steady_[i]);
    }
    const Where last = k == Scalar(ticks_);
    q_ = select_each(last, plant.angles(), q_);
    qd_ = select_each(last, plant.speeds(), qd_);
  }

  int ticks_, from_, fifth_;
  Vector start_, before_, last_;
  Vector lowest_, highest_, steady_;
  Scalar share_before_, early_, prior_, late_, object_force_, command_, touching_, saturated_;
  Scalar late_touching_, late_saturated_, contacts_, was_touching_;
  Joints<dof, Scalar> q_, qd_;
};

/// Forces at every sample, for lanes at different ticks.
template <int lanes>
class SignalTable {
 public:
  using Vector = Vector3<Pack<lanes>>;

  /// @param table  (ticks + 1) x 3, row by row, N
  SignalTable(const double* table, int ticks)
      : table_(table), ticks_(ticks), silent_(std::all_of(table, table + 3 * (ticks + 1), [](double f) { return f == 0.0; })) {}

  /// Return the force at tick `k` of each lane, after the last one its force; `together`: all lanes are at the same tick.
  [[nodiscard]] Vector at(const Pack<lanes>& k, bool together) const noexcept {
    Vector out = Vector::Constant(0.0);
    if (silent_) return out;
    if (together) {
      const double* row = table_ + 3 * std::min(static_cast<int>(k[0]), ticks_);
      for (int i = 0; i < 3; ++i) out[i] = row[i];
    } else {
      const Pack<lanes> row = 3.0 * min_of(k, Pack<lanes>(ticks_));
      for (int i = 0; i < 3; ++i) out[i] = gather(table_ + i, row);
    }
    return out;
  }

  /// Return the force from tick `k` of each lane to the next, as force_during() does for one loop.
  [[nodiscard]] plant::ForceSegment<Pack<lanes>> during(const Pack<lanes>& k, bool together,
                                                        const actuation::TickSchedule<Pack<lanes>>& clock) const noexcept {
    plant::ForceSegment<Pack<lanes>> out{at(k, together), at(k + 1.0, together)};
    if (silent_ || !clock.has_jitter()) return out;
    const Vector after = at(k + 2.0, together);
    const Vector begin = out.begin;
    out.begin = begin + (clock.lateness() / clock.period()) * (out.end - begin);
    out.end = out.end + (clock.next_lateness() / clock.period()) * (after - out.end);
    return out;
  }

 private:
  const double* table_;
  int ticks_;
  bool silent_;
};

/// Runs loops in the lanes of a pack. Each lane is at its own tick: when its loop ends or diverges, it takes the next.
template <class Mechanism, int lanes>
class LaneRunner {
 public:
  using Scalar = Pack<lanes>;
  using Where = Mask<lanes>;

  LaneRunner(const JobQueue<Mechanism>& queue, const BatchJob<Mechanism>& first, int ticks)
      : queue_(queue), last_(&first), ticks_(ticks), fastest_(first.speed_limit), servo_(first.servo), monitor_(ticks, first.window_start) {
    begin(0, first);
    rows_[0] = first.row;
    running_ = 1;
    for (int lane = 1; lane < lanes; ++lane) refill(lane);
  }

  /// Run until the queue and every lane are empty.
  void run(const double* reference, const double* operator_force) noexcept {
    const SignalTable<lanes> reference_table(reference, ticks_);
    const SignalTable<lanes> operator_table(operator_force, ticks_);
    for (;; tick_ += 1.0, clock_.tick()) {
      retire_finished();
      if (running_ == 0) return;
      const auto& tick = servo_.tick(plant_.angles(), plant_.kinematics(), reference_table.at(tick_, together_));
      monitor_.observe(tick_, plant_, servo_, clock_);
      plant_.advance(tick.torque, operator_table.during(tick_, together_, clock_), clock_);
    }
  }

 private:
  /// Write the outcome of every loop that has ended or diverged, and refill its lane.
  void retire_finished() noexcept {
    for (Where left;;) {
      const Where ended_run = tick_ > Scalar(ticks_);
      const Where diverged = !(ended_run | is_bounded(plant_, fastest_));
      left = ended_run | diverged;
      if (!any(left)) [[likely]]
        return;
      bool again = false;
      for (int lane = 0; lane < lanes; ++lane) {
        if (!left[lane]) continue;
        if (double*& row = rows_[static_cast<std::size_t>(lane)]; row != nullptr) {
          monitor_.write(lane, diverged[lane] ? tick_[lane] : -1.0, row);
          row = nullptr;
          --running_;
        }
        refill(lane);
        again = again || rows_[static_cast<std::size_t>(lane)] != nullptr;
      }
      together_ = all(tick_ == Scalar(tick_[0]));
      if (!again) return;
    }
  }

  /// Put the next loop into a lane; if there is none, the last one again, without a row.
  void refill(int lane) noexcept {
    if (queue_.next != nullptr) {
      if (const BatchJob<Mechanism>* next = queue_.next(queue_.owner)) {
        last_ = next;
        rows_[static_cast<std::size_t>(lane)] = next->row;
        ++running_;
      } else {
        queue_.next = nullptr;
      }
    }
    begin(lane, *last_);
  }

  void begin(int lane, const BatchJob<Mechanism>& one) noexcept {
    servo_.set_lane(lane, one.servo);
    plant_.set_lane(lane, one.plant);
    clock_.set_lane(lane, one.clock);
    monitor_.set_lane(lane, one.plant.tip());
    tick_.set(lane, 0.0);
  }

  JobQueue<Mechanism> queue_;
  const BatchJob<Mechanism>* last_;
  int ticks_;
  double fastest_;
  Servo<Mechanism, object::BasicSpringWall<Scalar>, control::BasicStateSpace<Scalar>> servo_;
  MovingPlant<Mechanism, Scalar> plant_;
  actuation::TickSchedule<Scalar> clock_;
  StabilityMonitor<Mechanism, Pack<lanes>> monitor_;
  Scalar tick_ = 0.0;
  bool together_ = true;
  int running_ = 0;
  std::array<double*, lanes> rows_{};
};

}  // namespace detail

/// Run the loops of a queue in lanes, samples 0 to `ticks`, until it is empty. All have one BatchKey and a moving plant.
template <class Mechanism, int lanes>
void simulate_side_by_side(const JobQueue<Mechanism>& queue, int ticks, const double* reference, const double* operator_force) {
  if (const BatchJob<Mechanism>* first = queue.next(queue.owner))
    detail::LaneRunner<Mechanism, lanes>(queue, *first, ticks).run(reference, operator_force);
}

namespace detail {

/// Feeds a single loop to a StabilityMonitor.
template <class Mechanism>
class SingleLoopMonitor {
 public:
  SingleLoopMonitor(const SimulationSetup<Mechanism>& s, int ticks) : clock_(s.period, s.jitter, s.seed), monitor_(ticks, s.window_start) {
    monitor_.set_lane(0, s.mechanism.forward(s.start));
  }

  template <class Plant, class Servo>
  void observe(const Plant& plant, const Servo& servo, const Vector3<>& /*force*/) noexcept {
    monitor_.observe(tick_, plant, servo, clock_);
    tick_ += 1.0;
    clock_.tick();
  }
  void mark_diverged(int tick) noexcept { unstable_ = tick; }
  void write(double* row) const noexcept { monitor_.write(0, unstable_, row); }

 private:
  actuation::TickSchedule<double> clock_;
  StabilityMonitor<Mechanism, double> monitor_;
  double tick_ = 0.0;
  double unstable_ = -1.0;
};

}  // namespace detail

/// Run one loop with a moving plant and any object and controller; write its outcome, outcome_width<dof> numbers.
template <class Mechanism>
void simulate_outcome(const SimulationSetup<Mechanism>& setup, int ticks, const double* reference, const double* operator_force,
                      double* row) noexcept {
  detail::SingleLoopMonitor<Mechanism> monitor(setup, ticks);
  detail::MovingPlant<Mechanism> plant(setup);
  detail::run(setup, plant, ticks, reference, operator_force, monitor);
  monitor.write(row);
}

}  // namespace palpate::servo
