#pragma once

namespace palpate::deformable {

/// Coulomb friction coefficients between a tip and a body. Zero disables friction.
struct DryFriction {
  double mu_static = 0.0;   ///< while at least part of the contact sticks
  double mu_dynamic = 0.0;  ///< from full sliding until the whole contact sticks again; at most `mu_static`

  [[nodiscard]] explicit operator bool() const noexcept { return mu_static > 0.0; }
};

}  // namespace palpate::deformable
