#pragma once

#include <cmath>
#include <limits>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Parameters of a Vibration. Plain data.
struct VibrationParameters {
  Vector3<> force = Vector3<>::Zero();                     ///< amplitude of the force on the tip, N
  double frequency = 0.0;                                  ///< positive, Hz
  double decay = std::numeric_limits<double>::infinity();  ///< time constant, positive, s
  bool at_contact = false;                                 ///< it begins anew whenever the tip enters the half-space below a plane
  Vector3<> point = Vector3<>::Zero();                     ///< on the plane, m
  Vector3<> normal = Vector3<>::UnitZ();                   ///< of the plane, outward, unit

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    if (!force.allFinite()) return "force must be finite [N]";
    if (!(frequency > 0.0) || !std::isfinite(frequency)) return "frequency must be positive and finite [Hz]";
    if (!(decay > 0.0)) return "decay must be positive [s]";
    return nullptr;
  }
};

/// Sinusoidal force on the tip, A sin(2 pi f t) exp(-t/decay), from the first tick on or from each contact with a plane on: the transient
/// of an impact (Okamura, Cutkosky & Dennerlein 2001). Off the plane there is no force.
class Vibration {
 public:
  using Scalar = double;

  explicit Vibration(const VibrationParameters& p) : p_(p) {}

  const ContactResult& step(const TipState& tip) noexcept {
    const bool before = result_.touching;
    result_.touching = !p_.at_contact || p_.normal.dot(p_.point - tip.position) > 0.0;
    if (p_.at_contact && result_.touching && !before) since_ = tip.time;
    const double time = tip.time - since_;
    constexpr double turn = 6.283185307179586;
    const double size = result_.touching ? std::sin(turn * p_.frequency * time) * std::exp(-time / p_.decay) : 0.0;
    result_.force = -size * p_.force;
    return result_;
  }

  void reset() noexcept {
    result_ = {};
    since_ = 0.0;
  }

 private:
  VibrationParameters p_;
  ContactResult result_;
  double since_ = 0.0;  // time at which the vibration began, s
};

}  // namespace palpate::object
