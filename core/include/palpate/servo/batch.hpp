#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "palpate/actuation/tick_schedule.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/control/workspace_controller.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/object/spring_wall.hpp"
#include "palpate/servo/servo.hpp"
#include "palpate/servo/simulation.hpp"
#include "palpate/servo/stability_monitor.hpp"

namespace palpate::servo {

/// One loop at its first tick, and the row of outcome_width<dof> that receives its outcome.
/// @tparam Controller  a control::StateSpace or a control::WorkspaceController<Mechanism>
template <class Mechanism, class Controller = control::StateSpace>
struct BatchJob {
  Servo<Mechanism, object::SpringWall, Controller> servo;
  detail::MovingPlant<Mechanism> plant;
  Vector3<> tip;  ///< at the first tick, m
  actuation::TickSchedule<double> clock;
  double speed_limit;
  int window_start;
  double* row;

  BatchJob(const SimulationSetup<Mechanism>& s, double* row)
      : servo(s, *s.object.template get_if<object::SpringWall>(), *s.controller.template get_if<Controller>()),
        plant(s),
        tip(plant.tip()),
        clock(s.period, s.jitter, s.seed),
        speed_limit(s.speed_limit),
        window_start(s.window_start),
        row(row) {}
};

/// Return true if the loop has a workspace controller.
template <class Mechanism>
[[nodiscard]] bool has_workspace_controller(const SimulationSetup<Mechanism>& s) noexcept {
  if constexpr (Mechanism::dof <= 3)
    return s.controller.template get_if<control::WorkspaceController<Mechanism>>() != nullptr;
  else
    return false;
}

/// Return true if the loop can run in lanes: a moving rigid device, a spring or wall, a linear or a workspace controller, and
/// no guard.
template <class Mechanism>
[[nodiscard]] bool runs_in_lanes(const SimulationSetup<Mechanism>& s) noexcept {
  return !s.fixed && !s.linear && !s.flexible && !s.guard.active() && s.object.template get_if<object::SpringWall>() &&
         (s.controller.template get_if<control::StateSpace>() || has_workspace_controller(s));
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
template <class Mechanism, class Controller = control::StateSpace>
struct JobQueue {
  const BatchJob<Mechanism, Controller>* (*next)(void* owner) = nullptr;
  void* owner = nullptr;
};

namespace detail {

/// Forces at every sample, for lanes at different ticks.
template <int lanes>
class SignalTable {
 public:
  using Vector = Vector3<Pack<lanes>>;

  /// @param table  (ticks + 1) x 3, row by row, N
  [[gnu::always_inline]] SignalTable(const double* table, int ticks)
      : table_(table), ticks_(ticks), silent_(std::all_of(table, table + 3 * (ticks + 1), [](double f) { return f == 0.0; })) {}

  /// Return the force at tick `k` of each lane, after the last one its force; `together`: all lanes are at the same tick.
  [[nodiscard, gnu::always_inline]] Vector at(const Pack<lanes>& k, bool together) const noexcept {
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
template <class Mechanism, class Controller, int lanes>
class LaneRunner {
 public:
  using Scalar = Pack<lanes>;
  using Where = Mask<lanes>;
  using Job = BatchJob<Mechanism, Controller>;
  using LaneController = decltype(std::declval<const Controller&>().template cast<Scalar>());

  LaneRunner(const JobQueue<Mechanism, Controller>& queue, const Job& first, int ticks)
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
      if (const Job* next = queue_.next(queue_.owner)) {
        last_ = next;
        rows_[static_cast<std::size_t>(lane)] = next->row;
        ++running_;
      } else {
        queue_.next = nullptr;
      }
    }
    begin(lane, *last_);
  }

  void begin(int lane, const Job& one) noexcept {
    servo_.set_lane(lane, one.servo);
    plant_.set_lane(lane, one.plant);
    clock_.set_lane(lane, one.clock);
    monitor_.set_lane(lane, one.plant.angles(), one.tip, one.tip);
    tick_.set(lane, 0.0);
  }

  JobQueue<Mechanism, Controller> queue_;
  const Job* last_;
  int ticks_;
  double fastest_;
  Servo<Mechanism, object::BasicSpringWall<Scalar>, LaneController> servo_;
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
template <class Mechanism, class Controller, int lanes>
void simulate_side_by_side(const JobQueue<Mechanism, Controller>& queue, int ticks, const double* reference, const double* operator_force) {
  if (const BatchJob<Mechanism, Controller>* first = queue.next(queue.owner))
    detail::LaneRunner<Mechanism, Controller, lanes>(queue, *first, ticks).run(reference, operator_force);
}

namespace detail {

/// Feeds a single loop to a StabilityMonitor.
template <class Mechanism>
class SingleLoopMonitor {
 public:
  SingleLoopMonitor(const SimulationSetup<Mechanism>& s, int ticks, const Vector3<>& tip)
      : clock_(s.period, s.jitter, s.seed), monitor_(ticks, s.window_start) {
    monitor_.set_lane(0, s.start, tip, s.mechanism.forward(s.start));
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
  const auto observe = [&](auto plant) {
    detail::SingleLoopMonitor<Mechanism> monitor(setup, ticks, plant.tip());
    detail::run(setup, plant, ticks, reference, operator_force, monitor);
    monitor.write(row);
  };
  if (setup.flexible)
    observe(detail::FlexiblePlant<Mechanism>(setup));
  else
    observe(detail::MovingPlant<Mechanism>(setup));
}

}  // namespace palpate::servo
