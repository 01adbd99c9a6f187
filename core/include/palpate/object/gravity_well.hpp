#pragma once

#include <algorithm>
#include <cmath>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Parameters of a GravityWell. Plain data.
struct GravityWellParameters {
  Vector3<> center = Vector3<>::Zero();  ///< m
  double stiffness = 0.0;                ///< positive, N/m
  double radius = 0.0;                   ///< beyond it there is no force, positive, m
  double cap = 0.0;                      ///< largest force, positive, N

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    if (!(stiffness > 0.0) || !std::isfinite(stiffness)) return "stiffness must be positive and finite [N/m]";
    if (!(radius > 0.0) || !std::isfinite(radius)) return "radius must be positive and finite [m]";
    if (!(cap > 0.0)) return "cap must be positive [N]";
    return nullptr;
  }
};

/// Attraction toward a center: a spring whose force is capped, without force beyond a radius. It is the gradient of a potential.
class GravityWell {
 public:
  using Scalar = double;
  static constexpr int columns = 1;  ///< stored energy

  explicit GravityWell(const GravityWellParameters& p) : p_(p) {}

  const ContactResult& step(const TipState& tip) noexcept {
    const Vector3<> offset = tip.position - p_.center;
    const double distance = offset.norm();
    energy_ = energy(distance);
    result_ = {};
    result_.touching = distance < p_.radius;
    if (!result_.touching) return result_;
    const double secant = p_.stiffness * distance > p_.cap ? p_.cap / distance : p_.stiffness;
    result_.deflection = offset;
    result_.force = secant * offset;
    result_.axis_stiffness.setConstant(secant);
    return result_;
  }

  /// Return the energy at a distance [m] from the center, above that at the center [J].
  [[nodiscard]] double energy(double distance) const noexcept {
    const double d = std::min(distance, p_.radius), linear = p_.cap / p_.stiffness;
    return d <= linear ? 0.5 * p_.stiffness * d * d : p_.cap * (d - 0.5 * linear);
  }

  void reset() noexcept {
    result_ = {};
    energy_ = 0.0;
  }
  [[nodiscard]] int record_width() const noexcept { return columns; }
  void record(double* row) const noexcept { row[0] = energy_; }

 private:
  GravityWellParameters p_;
  ContactResult result_;
  double energy_ = 0.0;  // J
};

}  // namespace palpate::object
