#pragma once

#include <algorithm>
#include <cmath>

#include "palpate/guard/guard.hpp"
#include "palpate/guard/held_torque.hpp"
#include "palpate/guard/tip_mobility.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Parameters of a PassivityController. Plain data.
struct PassivityControllerParameters {
  double cap = 0.5;  ///< largest damping over m/T

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept { return cap > 0.0 && cap <= 1.0 ? nullptr : "cap must be above 0 and at most 1"; }
};

/// Passivity observer and passivity controller (Hannaford & Ryu 2002), with exact work and capped damping.
///
/// The observer sums the work of all motors, E -= h . dq. While E < 0, the controller dissipates it: along the force of the tick (in free
/// space along the motion) it adds the damping alpha = min(cap m/T, -E T/dx^2), where m is the tip's inertia along this direction and dx
/// the last motion. Sampled damping above about m/(2T) is itself unstable. The observer counts the torque after the drive's limits and the
/// delay.
template <class Mechanism>
class PassivityController {
 public:
  static constexpr int dof = Mechanism::dof;
  using Angles = math::Joints<dof>;

  PassivityController() = default;
  /// The parameters must have no fault().
  explicit PassivityController(const PassivityControllerParameters& p) : cap_(p.cap) {}

  void prepare(const Surroundings<Mechanism>& s) noexcept {
    mechanism_ = s.mechanism;
    period_ = s.period;
    torque_ = HeldTorque<dof>(s.delay);
    reset();
  }

  /// Return the energy [J] that the display has absorbed; negative: delivered.
  [[nodiscard]] double energy() const noexcept { return energy_; }

  /// Return the tip force [N] in place of `wanted` at the sample `q` [rad], to which the tip has `moved` [m].
  math::Vector3<> command(const Angles& q, const math::Vector3<>& wanted, const math::Vector3<>& moved) noexcept {
    torque_.sample(q);
    energy_ -= torque_.work();
    if (!(energy_ < 0.0)) return wanted;
    const math::Vector3<>& axis = wanted.isZero(0.0) ? moved : wanted;
    const double size = axis.norm();
    if (!(size > 0.0) || !std::isfinite(size)) return wanted;
    const math::Vector3<> along = axis / size;
    const double way = along.dot(moved), mobility = tip_mobility(mechanism_, q, along);
    if (way == 0.0 || !(mobility > 0.0)) return wanted;
    const double damping = std::min(cap_ / (mobility * period_), -energy_ * period_ / (way * way));
    return wanted - (damping * way / period_) * along;
  }

  /// The torque [N*m] computed at this sample, as it leaves the servo.
  void commit(const Angles& torque) noexcept { torque_.commit(torque); }
  void lose_sample() noexcept { torque_.lose_sample(); }

  void reset() noexcept {
    torque_.reset();
    energy_ = 0.0;
  }

 private:
  Mechanism mechanism_{};
  double cap_ = 0.5;
  double period_ = 1e-3;
  HeldTorque<dof> torque_;
  double energy_ = 0.0;
};

}  // namespace palpate::guard
