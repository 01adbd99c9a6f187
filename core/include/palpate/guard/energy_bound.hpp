#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "palpate/guard/guard.hpp"
#include "palpate/guard/held_torque.hpp"
#include "palpate/guard/least_square_travel.hpp"
#include "palpate/guard/least_travel.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Friction that an EnergyBound relies on. Plain data.
template <int dof>
struct EnergyBoundParameters {
  math::Joints<dof> damping = math::Joints<dof>::Zero();  ///< b, viscous friction of the joints, positive, N*m*s/rad
  math::Joints<dof> coulomb = math::Joints<dof>::Zero();  ///< f_c, dry friction of the joints, N*m
  double lateness = 0.0;                                  ///< most by which the time between two ticks exceeds the period, s

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    if (!damping.allFinite() || !(damping.minCoeff() > 0.0)) return "damping must be positive and finite at each joint [N*m*s/rad]";
    if (!coulomb.allFinite() || !(coulomb.minCoeff() >= 0.0)) return "coulomb must not be negative [N*m]";
    if (!(lateness >= 0.0) || !std::isfinite(lateness)) return "lateness must not be negative [s]";
    return nullptr;
  }
};

/// Bounds the torque so that the motors never deliver more energy than the friction of the device dissipates.
///
/// With the energy E that display and friction have absorbed, the held torque h, and the time T between two ticks:
///   E += -h . dq + sum_i (b_i/T dq_i^2 + f_i |dq_i|)
///   sum_i max(0, |tau_i| - f_i)^2 T/(4 b_i) <= E;   one joint: |tau| <= f_c + sqrt(4 b E/T)
/// The sum is the most that the next motion can take from E, so E >= 0 for every motion of the operator. A torque above the bound is scaled
/// as a whole. No law that relies on b and f_c alone can admit more torque. It is the least conservative member of the family of Kim & Ryu
/// (2010), with exact work and dry friction.
///
/// - Delay: the torques that are computed but not yet held reserve their own part of E.
/// - Encoder counts: with the error r of a measurement, E is reduced by r |h_k - h_{k-1}| at each change of the torque and by r |h| now
///   (summation by parts). The credits are those of the least motions that the counts admit, see LeastTravel and LeastSquareTravel.
/// - Late ticks: T is the longest time between two ticks.
/// - An invalid sample: E is reduced by the most that the unknown motion can take.
template <class Mechanism>
class EnergyBound {
 public:
  static constexpr int dof = Mechanism::dof;
  using Angles = math::Joints<dof>;

  EnergyBound() = default;
  /// The parameters must have no fault().
  explicit EnergyBound(const EnergyBoundParameters<dof>& p) : parameters_(p) {}

  void prepare(const Surroundings<Mechanism>& s) noexcept {
    half_count_ = 0.5 * s.encoder_step;
    interval_ = s.period + parameters_.lateness;
    torque_ = HeldTorque<dof>(s.delay);
    for (int i = 0; i < dof; ++i) {
      travel_[static_cast<std::size_t>(i)] = LeastTravel(half_count_[i]);
      squares_[static_cast<std::size_t>(i)] = LeastSquareTravel(half_count_[i]);
    }
    reset();
  }

  /// Return the energy [J] that the next torque may rely on.
  [[nodiscard]] double energy() const noexcept { return energy_ - half_count_.dot(torque_.held().cwiseAbs()) - pending_; }

  /// Return the largest share, 0 to 1, of the torque [N*m] computed at the sample `q` [rad] that is within the bound.
  double share(const Angles& q, const Angles& torque) noexcept {
    const bool known = torque_.sample(q);
    if (!known && started_) energy_ -= loss(torque_.held());
    energy_ -= torque_.work();
    for (int i = 0; i < dof; ++i) {
      const auto joint = static_cast<std::size_t>(i);
      if (!known) {
        travel_[joint].reset();
        squares_[joint].reset();
      }
      energy_ += parameters_.damping[i] / interval_ * squares_[joint].move(q[i]) + parameters_.coulomb[i] * travel_[joint].move(q[i]);
    }
    started_ = true;
    return admitted(torque, std::max(0.0, energy()));
  }

  /// The torque [N*m] computed at this sample, as it leaves the servo.
  void commit(const Angles& torque) noexcept {
    const Angles before = torque_.held();
    const Angles& now = torque_.commit(torque);
    energy_ -= half_count_.dot((now - before).cwiseAbs());
    pending_ += loss(torque);
    pending_ = std::max(0.0, pending_ - loss(now));
  }

  void lose_sample() noexcept {
    if (started_) energy_ -= loss(torque_.held());
    torque_.lose_sample();
  }

  void reset() noexcept {
    torque_.reset();
    for (LeastTravel& one : travel_) one.reset();
    for (LeastSquareTravel& one : squares_) one.reset();
    energy_ = pending_ = 0.0;
    started_ = false;
  }

  /// Return the most energy [J] that a motion of one period can take out with this torque [N*m].
  [[nodiscard]] double loss(const Angles& torque) const noexcept {
    double sum = 0.0;
    for (int i = 0; i < dof; ++i) {
      const double excess = std::max(0.0, std::abs(torque[i]) - parameters_.coulomb[i]);
      sum += excess * excess * interval_ / (4.0 * parameters_.damping[i]);
    }
    return sum;
  }

 private:
  /// Return the largest s in [0, 1] with loss(s torque) <= energy [J], from the roots of its quadratic pieces.
  [[nodiscard]] double admitted(const Angles& torque, double energy) const noexcept {
    if (loss(torque) <= energy) return 1.0;
    std::array<int, static_cast<std::size_t>(dof)> order{};
    for (int i = 0; i < dof; ++i) order[static_cast<std::size_t>(i)] = i;
    const auto begins = [&](int i) {  // share above which joint i counts
      return torque[i] == 0.0 ? std::numeric_limits<double>::infinity() : parameters_.coulomb[i] / std::abs(torque[i]);
    };
    std::sort(order.begin(), order.end(), [&](int i, int j) { return begins(i) < begins(j); });
    double a = 0.0, b = 0.0, c = -energy;  // a s^2 - 2 b s + c = 0 of the joints that count so far
    for (std::size_t n = 0; n < order.size(); ++n) {
      const int i = order[n];
      const double weight = interval_ / (4.0 * parameters_.damping[i]), size = std::abs(torque[i]), f = parameters_.coulomb[i];
      a += weight * size * size;
      b += weight * size * f;
      c += weight * f * f;
      const double root = (b + std::sqrt(std::max(0.0, b * b - a * c))) / a;
      if (n + 1 == order.size() || root <= begins(order[n + 1])) return std::min(1.0, root);
    }
    return 0.0;
  }

  EnergyBoundParameters<dof> parameters_;
  double interval_ = 1e-3;  // longest time between two ticks, s
  Angles half_count_ = Angles::Zero();
  HeldTorque<dof> torque_;
  std::array<LeastTravel, static_cast<std::size_t>(dof)> travel_{};
  std::array<LeastSquareTravel, static_cast<std::size_t>(dof)> squares_{};
  double energy_ = 0.0;   // absorbed, J
  double pending_ = 0.0;  // loss of the torques that are not yet held, J
  bool started_ = false;
};

}  // namespace palpate::guard
