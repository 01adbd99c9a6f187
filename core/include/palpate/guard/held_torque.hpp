#pragma once

#include "palpate/actuation/delay.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Exact motion and work of one servo period: a torque is held between two samples, so its work is held . (q_k - q_{k-1}).
template <int dof>
class HeldTorque {
 public:
  using Angles = math::Joints<dof>;

  HeldTorque() = default;
  /// @param delay  servo periods from commit() to the application of a torque
  explicit HeldTorque(int delay) : line_(delay, Angles(Angles::Zero())) {}

  /// Take the sample `q` [rad]. Return whether the motion since the last one is known.
  bool sample(const Angles& q) noexcept {
    const bool known = has_last_ && !lost_;
    moved_ = known ? Angles(q - last_) : Angles(Angles::Zero());
    last_ = q;
    has_last_ = true;
    lost_ = false;
    return known;
  }

  /// Pass on the torque computed at this sample [N*m]. Return the one that is held from now on.
  const Angles& commit(const Angles& torque) noexcept { return held_ = line_.pass(torque); }

  /// The sample of this tick is invalid: the motion before and after it is not known.
  void lose_sample() noexcept { lost_ = true; }

  [[nodiscard]] const Angles& moved() const noexcept { return moved_; }     ///< since the last sample, rad
  [[nodiscard]] const Angles& held() const noexcept { return held_; }       ///< N*m
  [[nodiscard]] double work() const noexcept { return held_.dot(moved_); }  ///< of the motors since the last sample, J
  [[nodiscard]] bool unknown() const noexcept { return lost_; }             ///< the last sample was invalid
  void reset() noexcept { *this = HeldTorque(line_.periods()); }

 private:
  actuation::Delay<Angles> line_{0, Angles(Angles::Zero())};
  Angles last_ = Angles::Zero(), moved_ = Angles::Zero(), held_ = Angles::Zero();
  bool has_last_ = false, lost_ = false;
};

}  // namespace palpate::guard
