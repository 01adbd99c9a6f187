#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <optional>
#include <palpate/math/machine_lanes.hpp>
#include <palpate/servo/batch.hpp>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate::batch {

/// One thread's way to the cells that all threads share: one cell after the other, as long as they are of one shape.
template <class Mechanism, class Controller, class Setup, class Cell>
class JobScheduler {
 public:
  using Job = servo::BatchJob<Mechanism, Controller>;

  JobScheduler(const Setup& base, const Cell& cell, std::ptrdiff_t count, std::atomic<std::ptrdiff_t>& taken, double* rows)
      : setup_(base), cell_(cell), count_(count), taken_(taken), rows_(rows) {}

  /// Loops for lanes to begin with; whether there are any.
  bool begin() {
    shape_.reset();
    return look();
  }

  servo::JobQueue<Mechanism, Controller> queue() {
    return {[](void* self) { return static_cast<JobScheduler*>(self)->next(); }, this};
  }

 private:
  /// Takes a cell if none is at hand.
  bool look() {
    if (!at_hand_) {
      at_ = taken_.fetch_add(1);
      if (at_ >= count_) return false;
      cell_(at_, setup_);
      at_hand_ = true;
    }
    return true;
  }

  const Job* next() {
    if (!look()) return nullptr;
    const servo::BatchKey shape(setup_);
    if (shape_ && shape != *shape_) return nullptr;  // it waits until the lanes are empty
    shape_ = shape;
    at_hand_ = false;
    return &beginning_.emplace(setup_, rows_ + at_ * servo::outcome_width<Mechanism::dof>);
  }

  Setup setup_;
  const Cell& cell_;
  std::ptrdiff_t count_;
  std::atomic<std::ptrdiff_t>& taken_;
  double* rows_;
  std::ptrdiff_t at_ = 0;
  bool at_hand_ = false;
  std::optional<servo::BatchKey> shape_;
  std::optional<Job> beginning_;
};

/// As run_cells(), with one kind of controller.
template <class Mechanism, class Controller, class Setup, class Cell>
void run_cells_with(const Setup& base, const Cell& cell, std::ptrdiff_t count, int ticks, const double* reference,
                    const double* operator_force, double* rows, int threads, int lanes) {
  using RunLanes = void (*)(std::size_t, bool, const void*, int, const double*, const double*);
  const std::pair<int, RunLanes> widest =
      math::with_widest_lanes([](auto n) { return std::pair<int, RunLanes>(n, run_lanes<n()>); }, lanes);
  constexpr std::size_t index = mechanism::Registry::index_of<Mechanism>();
  static_assert(index < mechanism::Registry::size, "batches run the mechanisms of the registry");
  std::atomic<std::ptrdiff_t> taken = 0;
  const auto work = [&] {
    JobScheduler<Mechanism, Controller, Setup, Cell> cells(base, cell, count, taken, rows);
    while (cells.begin()) {
      const servo::JobQueue<Mechanism, Controller> queue = cells.queue();
      widest.second(index, !std::is_same_v<Controller, control::StateSpace>, &queue, ticks, reference, operator_force);
    }
  };
  const auto most = static_cast<int>((count + widest.first - 1) / widest.first);
  std::vector<std::thread> others;
  for (int i = 1; i < std::min(threads, most); ++i) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
}

/// As run_cells(), one loop at a time: a device with a flexible mode does not run in lanes.
template <class Mechanism, class Setup, class Cell>
void run_singly(const Setup& base, const Cell& cell, std::ptrdiff_t count, int ticks, const double* reference, const double* operator_force,
                double* rows, int threads) {
  std::atomic<std::ptrdiff_t> taken = 0;
  const auto work = [&] {
    Setup setup = base;
    for (std::ptrdiff_t i = taken.fetch_add(1); i < count; i = taken.fetch_add(1)) {
      cell(i, setup);
      servo::simulate_outcome<Mechanism>(setup, ticks, reference, operator_force, rows + i * servo::outcome_width<Mechanism::dof>);
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < std::min(static_cast<std::ptrdiff_t>(threads), count); ++i) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
}

template <class Mechanism, class Setup, class Cell>
void run_cells(const Setup& base, const Cell& cell, std::ptrdiff_t count, int ticks, const double* reference, const double* operator_force,
               double* rows, int threads, int lanes) {
  using Workspace = control::WorkspaceController<Mechanism>;
  if (base.flexible)
    run_singly<Mechanism>(base, cell, count, ticks, reference, operator_force, rows, threads);
  else if (servo::has_workspace_controller(base))
    run_cells_with<Mechanism, Workspace>(base, cell, count, ticks, reference, operator_force, rows, threads, lanes);
  else
    run_cells_with<Mechanism, control::StateSpace>(base, cell, count, ticks, reference, operator_force, rows, threads, lanes);
}

}  // namespace palpate::batch
