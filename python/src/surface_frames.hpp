#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <palpate/math/latest_value.hpp>
#include <palpate/object/deformable_object.hpp>
#include <thread>
#include <vector>

/// Computes the displacement of the whole surface of a body in a thread at a fixed rate: compliance times the contact forces of the
/// servo's latest tick. Neither the servo nor the reader waits.
class SurfaceFrames {
 public:
  struct Frame {
    std::int64_t number = 0;           // of frames since the start
    std::int64_t tick = -1;            // that the frame shows; -1: none yet
    std::vector<double> displacement;  // 3 x node + axis, m
  };

  /// @param compliance  (3n)^2, symmetric, m/N; it must outlive this object
  /// @param rate        frames per second, Hz
  SurfaceFrames(std::size_t nodes, const float* compliance, double rate)
      : nodes_(nodes),
        compliance_(compliance),
        every_(std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(1.0 / rate))) {
    for (Frame& frame : frames_.slots()) frame.displacement.assign(3 * nodes_, 0.0);
    thread_ = std::thread([this] { draw(); });
  }
  SurfaceFrames(const SurfaceFrames&) = delete;
  SurfaceFrames& operator=(const SurfaceFrames&) = delete;
  SurfaceFrames(SurfaceFrames&&) = delete;
  SurfaceFrames& operator=(SurfaceFrames&&) = delete;
  ~SurfaceFrames() {
    {
      const std::lock_guard<std::mutex> held(ending_);
      ended_ = true;
    }
    end_.notify_one();
    thread_.join();
  }

  [[nodiscard]] std::shared_ptr<palpate::math::LatestValue<palpate::object::ContactFrame>> pressed() const noexcept { return pressed_; }
  [[nodiscard]] std::size_t size() const noexcept { return nodes_; }

  /// Return the last frame. Only one thread may call this.
  const Frame& latest() noexcept {
    frames_.acquire();
    return frames_.value();
  }

 private:
  void draw() {
    auto next = std::chrono::steady_clock::now();
    std::unique_lock<std::mutex> held(ending_);
    for (std::int64_t number = 1; !ended_; ++number) {
      next += every_;
      if (end_.wait_until(held, next, [this] { return ended_; })) return;
      if (pressed_->acquire()) show(number);
    }
  }

  void show(std::int64_t number) noexcept {
    const palpate::object::ContactFrame& pressed = pressed_->value();
    Frame& frame = frames_.write_slot();
    const std::size_t row = 3 * nodes_;
    for (double& d : frame.displacement) d = 0.0;
    for (int k = 0; k < pressed.count; ++k) {
      const auto node = static_cast<std::size_t>(pressed.node[static_cast<std::size_t>(k)]);
      for (int a = 0; a < 3; ++a) {
        const double force = pressed.force[static_cast<std::size_t>(k)][a];
        const float* c = compliance_ + (3 * node + static_cast<std::size_t>(a)) * row;  // a column, which equals the row
        for (std::size_t i = 0; i < row; ++i) frame.displacement[i] += force * static_cast<double>(c[i]);
      }
    }
    frame.tick = pressed.tick;
    frame.number = number;
    frames_.publish();
  }

  std::size_t nodes_;
  const float* compliance_;
  std::chrono::steady_clock::duration every_;
  std::shared_ptr<palpate::math::LatestValue<palpate::object::ContactFrame>> pressed_ =
      std::make_shared<palpate::math::LatestValue<palpate::object::ContactFrame>>();
  palpate::math::LatestValue<Frame> frames_;
  std::mutex ending_;
  std::condition_variable end_;
  bool ended_ = false;
  std::thread thread_;
};
