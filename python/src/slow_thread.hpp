#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

/// Runs the model updates of a body in a thread until it is destroyed or joined.
class SlowThread {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param step  one model update
  explicit SlowThread(std::function<void()> step)
      : thread_([this, step = std::move(step)] {
          while (!stop_.load(std::memory_order_relaxed)) {
            const auto begin = Clock::now();
            step();
            seconds_.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
            std::this_thread::sleep_until(begin + min_interval_);
          }
        }) {}
  ~SlowThread() { join(); }
  SlowThread(const SlowThread&) = delete;
  SlowThread& operator=(const SlowThread&) = delete;
  SlowThread(SlowThread&&) = delete;
  SlowThread& operator=(SlowThread&&) = delete;

  /// Stop the thread. Return the duration of each update, s.
  const std::vector<double>& join() {
    stop_.store(true, std::memory_order_relaxed);
    if (thread_.joinable()) thread_.join();
    return seconds_;
  }

 private:
  static constexpr std::chrono::milliseconds min_interval_{4};  // between updates: a body at rest must not use a whole core
  std::vector<double> seconds_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  // last member: it uses the others
};
