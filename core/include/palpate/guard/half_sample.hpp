#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/guard/adaptive_window.hpp"
#include "palpate/guard/guard.hpp"
#include "palpate/guard/held_torque.hpp"
#include "palpate/guard/velocity_observer.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// How a HalfSample estimates joint velocities.
enum class VelocityEstimate {
  backward,         ///< difference of the last two samples
  adaptive_window,  ///< over the longest window that a line fits to one count, see AdaptiveWindow
  observer,         ///< three states, driven by the known torque, see VelocityObserver
};

/// Parameters of a HalfSample. Plain data.
struct HalfSampleParameters {
  VelocityEstimate velocity = VelocityEstimate::backward;
  double horizon = 0.5;      ///< time of the prediction, servo periods
  double observer = 1000.0;  ///< rate of the observer, rad/s

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    if (!(horizon >= 0.0) || !(horizon <= 100.0)) return "horizon must be 0 to 100 servo periods";
    if (!(observer > 0.0) || !std::isfinite(observer)) return "observer must be positive and finite [rad/s]";
    return nullptr;
  }
};

/// Half-sample prediction (Gillespie & Cutkosky 1996): the object sees the tip where it will be after half a period, q + v T/2.
///
/// The hold delays a sampled force by half a period on average, so the prediction removes the energy that the hold of a spring generates.
/// An object that the predicted tip does not touch exerts no force: the exit of a wall is deadbeat. With a delay of n periods, a horizon of
/// n + 1/2 compensates both.
template <class Mechanism>
class HalfSample {
 public:
  static constexpr int dof = Mechanism::dof;
  using Angles = math::Joints<dof>;

  HalfSample() = default;
  /// The parameters must have no fault().
  explicit HalfSample(const HalfSampleParameters& p) : parameters_(p) {}

  void prepare(const Surroundings<Mechanism>& s) noexcept {
    mechanism_ = s.mechanism;
    time_ = parameters_.horizon * s.period;
    torque_ = HeldTorque<dof>(s.delay);
    for (int i = 0; i < dof; ++i) {
      window_[static_cast<std::size_t>(i)] = AdaptiveWindow(s.encoder_step[i], s.period);
      observer_[static_cast<std::size_t>(i)] = VelocityObserver(VelocityObserver::gains(parameters_.observer, s.period), s.period);
    }
    reset();
  }

  [[nodiscard]] static bool predicts() noexcept { return true; }

  /// Return the angles [rad] after the horizon of the prediction; `rate` is 1 over the time since the last sample, 1/s.
  Angles predict(const Angles& q, double rate) noexcept { return q + time_ * velocity(q, rate); }

  /// The torque [N*m] computed at this sample, as it leaves the servo.
  void commit(const Angles& torque) noexcept { torque_.commit(torque); }

  void reset() noexcept {
    torque_.reset();
    for (AdaptiveWindow& one : window_) one.reset();
    for (VelocityObserver& one : observer_) one.reset();
    started_ = false;
  }

 private:
  Angles velocity(const Angles& q, double rate) noexcept {
    torque_.sample(q);
    Angles out = Angles::Zero();
    if (parameters_.velocity == VelocityEstimate::backward) return torque_.moved() * rate;
    if (parameters_.velocity == VelocityEstimate::adaptive_window) {
      for (int i = 0; i < dof; ++i) out[i] = window_[static_cast<std::size_t>(i)].velocity(q[i]);
      return out;
    }
    const Angles acceleration =
        started_ ? Angles(mechanism_.dynamics(mechanism_.kinematics(last_)).inverse() * torque_.held()) : Angles(Angles::Zero());
    for (int i = 0; i < dof; ++i) out[i] = observer_[static_cast<std::size_t>(i)].velocity(q[i], acceleration[i]);
    last_ = q;
    started_ = true;
    return out;
  }

  Mechanism mechanism_{};
  HalfSampleParameters parameters_;
  double time_ = 5e-4;  // s
  HeldTorque<dof> torque_;
  std::array<AdaptiveWindow, static_cast<std::size_t>(dof)> window_{};
  std::array<VelocityObserver, static_cast<std::size_t>(dof)> observer_{};
  Angles last_ = Angles::Zero();  // pose at which the held torque was computed, rad
  bool started_ = false;
};

}  // namespace palpate::guard
