#pragma once

#include "palpate/math/vector.hpp"

namespace palpate {

/// The simplest surfaces a tip can touch. Deflection is how far the tip has pushed the surface in [m]: a displacement, zero
/// when they are apart.
struct Anchor {
  enum class Kind {
    none,        ///< nothing there
    point,       ///< a point held from all sides: deflection = tip - point (thesis ch. 3-5)
    half_space,  ///< a wall: one-sided, along its normal
  };
  Kind kind = Kind::none;
  Vector3<> point = Vector3<>::Zero();    ///< on the surface, m
  Vector3<> normal = Vector3<>::UnitZ();  ///< unit, out of the wall

  struct Contact {
    bool touching = false;
    Vector3<> deflection = Vector3<>::Zero();
  };

  [[nodiscard]] Contact contact(const Vector3<>& tip) const noexcept {
    if (kind == Kind::none) return {};
    const Vector3<> away = tip - point;
    if (kind == Kind::point) return {true, away};
    const double height = normal.dot(away);
    if (height >= 0.0) return {};
    return {true, height * normal};
  }
};

}  // namespace palpate
