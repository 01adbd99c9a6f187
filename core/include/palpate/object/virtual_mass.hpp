#pragma once

#include <cmath>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Parameters of a VirtualMass. Plain data.
struct VirtualMassParameters {
  double mass = 0.0;       ///< positive, kg
  double stiffness = 0.0;  ///< of the coupling, positive, N/m
  double damping = 0.0;    ///< of the coupling, N*s/m

  /// Return the first thing that is wrong at a servo period [s], as a sentence; null if nothing is.
  [[nodiscard]] const char* fault(double period) const noexcept {
    if (!(mass > 0.0) || !std::isfinite(mass)) return "mass must be positive and finite [kg]";
    if (!(stiffness > 0.0) || !std::isfinite(stiffness)) return "stiffness must be positive and finite [N/m]";
    if (!(damping >= 0.0) || !std::isfinite(damping)) return "damping must not be negative [N*s/m]";
    if (!(stiffness * period * period + 2.0 * damping * period < 4.0 * mass))
      return "the mass diverges on its coupling at this servo period: it needs stiffness T^2 + 2 damping T < 4 mass";
    return nullptr;
  }
};

/// A free mass that the tip carries through a spring and a damper (virtual coupling). The mass begins at rest at the tip's start.
///
/// Force of the tip on it: F = K (x - x_m) + B (x' - v_m), with x' by backward difference. v_m += T F/m; x_m += T v_m.
class VirtualMass {
 public:
  using Scalar = double;
  static constexpr int columns = 4;  ///< position of the mass (3), energy of mass and spring

  explicit VirtualMass(const VirtualMassParameters& p) : p_(p) { result_.touching = true; }

  void start(const Vector3<>& tip) noexcept {
    tip_ = position_ = tip;
    velocity_.setZero();
  }

  const ContactResult& step(const TipState& tip) noexcept {
    const Vector3<> offset = tip.position - position_;
    energy_ = 0.5 * (p_.mass * velocity_.squaredNorm() + p_.stiffness * offset.squaredNorm());
    result_.deflection = offset;
    result_.force = p_.stiffness * offset + p_.damping * ((tip.position - tip_) * tip.rate - velocity_);
    recorded_ = position_;
    tip_ = tip.position;
    if (!(tip.rate > 0.0)) return result_;
    velocity_ += result_.force / (p_.mass * tip.rate);
    position_ += velocity_ / tip.rate;
    return result_;
  }

  [[nodiscard]] const Vector3<>& position() const noexcept { return position_; }  ///< at the next sample, m
  [[nodiscard]] const Vector3<>& velocity() const noexcept { return velocity_; }  ///< m/s

  void reset() noexcept {
    result_ = {};
    result_.touching = true;
    start(tip_);
  }
  [[nodiscard]] int record_width() const noexcept { return columns; }
  void record(double* row) const noexcept {
    Eigen::Map<Vector3<>>{row} = recorded_;
    row[3] = energy_;
  }

 private:
  VirtualMassParameters p_;
  ContactResult result_;
  Vector3<> tip_ = Vector3<>::Zero(), position_ = Vector3<>::Zero(), velocity_ = Vector3<>::Zero();
  Vector3<> recorded_ = Vector3<>::Zero();  // position at the last sample, m
  double energy_ = 0.0;                     // J
};

}  // namespace palpate::object
