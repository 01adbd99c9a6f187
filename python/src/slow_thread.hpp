#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

/// A body's slow steps in a thread of their own, until it is destroyed.
class SlowThread {
 public:
  using Clock = std::chrono::steady_clock;

  /// `step` takes one slow step.
  explicit SlowThread(std::function<void()> step)
      : thread_([this, step = std::move(step)] {
          while (!stop_.load(std::memory_order_relaxed)) {
            const auto begin = Clock::now();
            step();
            seconds_.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
            std::this_thread::sleep_until(begin + least_);
          }
        }) {}
  ~SlowThread() { join(); }
  SlowThread(const SlowThread&) = delete;
  SlowThread& operator=(const SlowThread&) = delete;
  SlowThread(SlowThread&&) = delete;
  SlowThread& operator=(SlowThread&&) = delete;

  /// How long each step took, s.
  const std::vector<double>& join() {
    stop_.store(true, std::memory_order_relaxed);
    if (thread_.joinable()) thread_.join();
    return seconds_;
  }

 private:
  static constexpr std::chrono::milliseconds least_{4};  // between two steps: a body at rest does not need a whole core
  std::vector<double> seconds_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  // the last: it uses the others
};
