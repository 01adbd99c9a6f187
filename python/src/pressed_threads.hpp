#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <palpate/body/blended.hpp>
#include <palpate/math/latest.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "pressed.hpp"

namespace palpate::solid {

/// A solid with the two ends of its hand-over: slow steps, in turn with the servo's ticks or in a thread of their own.
class Pressing {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Pressing(std::unique_ptr<AnyPressed> solid) : slow_(std::move(solid)) {}

  AnyPressed& solid() noexcept { return *slow_; }
  BlendedContact& servo() noexcept { return *servo_; }

  /// One tick of the servo's, which neither waits nor takes memory.
  const TipsAnswer& tick(const BodyTips& tips) noexcept {
    where_->next() = tips;
    where_->publish();
    return servo_->step(*box_, tips);
  }

  /// One slow step with the tips where the servo said last, and its snapshot to the servo.
  void slow_step() {
    compute();
    box_->publish();
  }

  /// As slow_step(), but the servo gets the snapshot at the next call of hand_over(), as if the step had taken that long.
  void compute() {
    where_->fetch();
    last_ = slow_->step(where_->value(), box_->writing());
    ++steps_;
  }
  void hand_over() noexcept { box_->publish(); }

  /// What the servo took last; not while it runs.
  [[nodiscard]] const Snapshot& newest() noexcept { return servo_->newest(*box_); }
  [[nodiscard]] const PressedStep& last() const noexcept { return last_; }
  [[nodiscard]] long steps() const noexcept { return steps_; }

  /// Slow steps in a thread of their own, until it is destroyed.
  class Thread {
   public:
    explicit Thread(Pressing& pressing)
        : thread_([this, &pressing] {
            while (!stop_.load(std::memory_order_relaxed)) {
              const auto begin = Clock::now();
              pressing.slow_step();
              seconds_.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
              std::this_thread::sleep_until(begin + least_);
            }
          }) {}
    ~Thread() { join(); }
    Thread(const Thread&) = delete;
    Thread& operator=(const Thread&) = delete;

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
    std::thread thread_;
  };

  /// Everything back to rest; not while a thread runs.
  void reset() {
    slow_->reset();
    servo_ = std::make_unique<BlendedContact>();
    box_ = std::make_unique<BlendedContact::Box>();
    where_ = std::make_unique<Latest<BodyTips>>();
    steps_ = 0;
  }

 private:
  std::unique_ptr<AnyPressed> slow_;
  std::unique_ptr<BlendedContact> servo_ = std::make_unique<BlendedContact>();
  std::unique_ptr<BlendedContact::Box> box_ = std::make_unique<BlendedContact::Box>();
  std::unique_ptr<Latest<BodyTips>> where_ = std::make_unique<Latest<BodyTips>>();
  long steps_ = 0;
  PressedStep last_;
};

}  // namespace palpate::solid
