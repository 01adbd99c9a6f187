#pragma once

#include <algorithm>
#include <cmath>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Parameters of a TexturedWall. Plain data.
struct TexturedWallParameters {
  Vector3<> point = Vector3<>::Zero();    ///< on the mean plane, where the texture has phase 0, m
  Vector3<> normal = Vector3<>::UnitZ();  ///< of the mean plane, outward, unit
  Vector3<> across = Vector3<>::UnitX();  ///< direction in which the texture varies, unit, normal to `normal`
  double stiffness = 0.0;                 ///< along the normal, N/m
  double damping = 0.0;                   ///< along the normal, N*s/m
  double wavelength = 0.0;                ///< positive, m
  double height = 0.0;                    ///< amplitude of the surface's height, m
  double lateral_force = 0.0;             ///< amplitude of a force along `across` while the tip touches, N

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    const auto positive = [](double x) { return x > 0.0 && std::isfinite(x); };
    const auto not_negative = [](double x) { return x >= 0.0 && std::isfinite(x); };
    if (!positive(wavelength)) return "wavelength must be positive and finite [m]";
    if (!not_negative(stiffness) || !not_negative(damping)) return "stiffness and damping must not be negative [N/m, N*s/m]";
    if (!not_negative(height) || !not_negative(lateral_force)) return "height and lateral_force must not be negative [m, N]";
    if (!(std::abs(normal.dot(across)) < 1e-9)) return "across must be normal to the normal";
    return nullptr;
  }
};

/// Unilateral plane wall with a sinusoidal texture along one direction s.
///
/// - Height h(s) = a sin(2 pi s/wavelength): the depth d is that below the surface, and the force on the tip is N (n - h'(s) t) with
///   N = K d + B d' >= 0. Without damping it is the gradient of K d^2/2 (Minsky 1995).
/// - Lateral force: -A sin(2 pi s/wavelength) t while the tip touches. It is the gradient of a potential as long as contact lasts; a
///   contact that begins and ends elsewhere gives or takes at most A wavelength/pi.
class TexturedWall {
 public:
  using Scalar = double;
  static constexpr int columns = 2;  ///< depth, stored energy

  explicit TexturedWall(const TexturedWallParameters& p) : p_(p), number_(turn / p.wavelength) {
    result_.normal = p.normal;
    result_.stiffness = p.stiffness;
  }

  const ContactResult& step(const TipState& tip) noexcept {
    const Vector3<> offset = tip.position - p_.point;
    const double phase = number_ * p_.across.dot(offset), sine = std::sin(phase), cosine = std::cos(phase);
    const double depth = p_.height * sine - p_.normal.dot(offset), pressed = std::max(depth, 0.0);
    result_.depth = depth;
    result_.touching = depth > 0.0;
    result_.deflection = -pressed * p_.normal;
    const double size = result_.touching ? std::max(p_.stiffness * depth + p_.damping * (pressed - pressed_) * tip.rate, 0.0) : 0.0;
    const double lateral = result_.touching ? p_.lateral_force : 0.0;
    pressed_ = pressed;
    result_.force = -size * p_.normal + (size * p_.height * number_ * cosine + lateral * sine) * p_.across;
    energy_ = 0.5 * p_.stiffness * pressed * pressed + lateral / number_ * (1.0 - cosine);
    return result_;
  }

  void reset() noexcept {
    pressed_ = energy_ = 0.0;
    result_.force.setZero();
    result_.touching = false;
  }
  [[nodiscard]] int record_width() const noexcept { return columns; }
  void record(double* row) const noexcept {
    row[0] = result_.depth;
    row[1] = energy_;
  }

 private:
  static constexpr double turn = 6.283185307179586;

  TexturedWallParameters p_;
  double number_;  // wave number, rad/m
  ContactResult result_;
  double pressed_ = 0.0;  // depth of the last sample, at least 0, m
  double energy_ = 0.0;   // J
};

}  // namespace palpate::object
