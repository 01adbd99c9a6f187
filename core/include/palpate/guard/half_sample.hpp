#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "palpate/guard/adaptive_window.hpp"
#include "palpate/guard/guard.hpp"
#include "palpate/guard/held_torque.hpp"
#include "palpate/guard/tip_mobility.hpp"
#include "palpate/guard/velocity_observer.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

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
  bool deadbeat = false;     ///< leave a wall by two forces that end in the state in which the continuous wall leaves it

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
/// An object that the predicted tip does not touch exerts no force. With a delay of n periods, a horizon of n + 1/2 compensates both.
///
/// With `deadbeat`, the exit of a wall is exact too. A mass m on the spring K that leaves the wall before the next sample has the speed
/// v = sqrt(v_k^2 + K d_k^2/m) from then on. Two held forces along the normal bring the tip into this state after two periods, whatever the
/// instant of the exit. m is the tip's inertia at the pose; the operator is not known. It needs an object with normal and stiffness, and no
/// delay.
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
    period_ = s.period;
    torque_ = HeldTorque<dof>(s.delay);
    for (int i = 0; i < dof; ++i) {
      window_[static_cast<std::size_t>(i)] = AdaptiveWindow(s.encoder_step[i], s.period);
      observer_[static_cast<std::size_t>(i)] = VelocityObserver(VelocityObserver::gains(parameters_.observer, s.period), s.period);
    }
    reset();
  }

  [[nodiscard]] static bool predicts() noexcept { return true; }

  /// Return the angles [rad] after the horizon of the prediction; `rate` is 1 over the time since the last sample, 1/s.
  Angles predict(const Angles& q, double rate) noexcept {
    speed_ = velocity(q, rate);
    return q + time_ * speed_;
  }

  /// Take the contact of the object with the predicted tip.
  void contact(const object::ContactResult& result) noexcept {
    if (!parameters_.deadbeat) return;
    touching_ = result.touching;
    depth_known_ = result.stiffness > 0.0 && !result.normal.isZero(0.0);
    if (!depth_known_) return;
    depth_ = result.depth;
    stiffness_ = result.stiffness;
    normal_ = result.normal;
  }

  /// Return the tip force [N] in place of `wanted` at the sample `q` [rad], to which the tip has `moved` [m].
  math::Vector3<> command(const Angles& q, const math::Vector3<>& wanted, const math::Vector3<>& moved) noexcept {
    if (!parameters_.deadbeat || normal_.isZero(0.0)) return wanted;
    const math::Vector3<> velocity = math::product(mechanism_.jacobian(mechanism_.kinematics(q)), speed_);
    const double out = normal_.dot(velocity);
    depth_ = depth_known_ ? depth_ + time_ * out : depth_ - normal_.dot(moved);  // of the tip itself
    const bool leaving = std::exchange(leaving_, false);
    if (leaving && !touching_) return along_normal(wanted, second_);
    if (!(depth_ > 0.0) || !(out > 0.0)) return wanted;
    const double mass = 1.0 / tip_mobility(mechanism_, q, normal_), rate = std::sqrt(stiffness_ / mass);
    const double leaves = std::atan2(depth_ * rate, out) / rate;  // time until the mass on the spring leaves it, s
    if (!std::isfinite(rate) || !(leaves < period_)) return wanted;
    const double speed = std::hypot(out, rate * depth_), end = speed * (2.0 * period_ - leaves);
    const double sum = mass * (speed - out) / period_;
    const double first = mass * (end + depth_ - 2.0 * out * period_) / (period_ * period_) - 0.5 * sum;
    second_ = sum - first;
    leaving_ = true;
    return along_normal(wanted, first);
  }

  /// The torque [N*m] computed at this sample, as it leaves the servo.
  void commit(const Angles& torque) noexcept { torque_.commit(torque); }

  void reset() noexcept {
    torque_.reset();
    for (AdaptiveWindow& one : window_) one.reset();
    for (VelocityObserver& one : observer_) one.reset();
    started_ = false;
    speed_ = Angles::Zero();
    normal_.setZero();
    leaving_ = touching_ = depth_known_ = false;
  }

 private:
  /// Return the force with another part along the normal.
  [[nodiscard]] math::Vector3<> along_normal(const math::Vector3<>& force, double part) const noexcept {
    return force + (part - normal_.dot(force)) * normal_;
  }

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
  double time_ = 5e-4, period_ = 1e-3;  // s
  HeldTorque<dof> torque_;
  std::array<AdaptiveWindow, static_cast<std::size_t>(dof)> window_{};
  std::array<VelocityObserver, static_cast<std::size_t>(dof)> observer_{};
  Angles last_ = Angles::Zero();  // pose at which the held torque was computed, rad
  bool started_ = false;

  Angles speed_ = Angles::Zero();                     // estimate, rad/s
  math::Vector3<> normal_ = math::Vector3<>::Zero();  // of the last contact; zero: none yet
  double stiffness_ = 0.0, depth_ = 0.0;              // N/m, m
  double second_ = 0.0;                               // force of the next tick, N
  bool touching_ = false, depth_known_ = false, leaving_ = false;
};

}  // namespace palpate::guard
