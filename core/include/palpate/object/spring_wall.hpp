#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::object {

/// What a tip can touch.
enum class SpringWallKind {
  none,        ///< nothing there
  point,       ///< a point held from all sides: deflection = tip - point (thesis ch. 3-5)
  half_space,  ///< a wall: one-sided, along its normal
};

/// The simplest surfaces a tip can touch. Deflection is how far the tip has pushed the surface in [m]: a displacement, zero
/// when they are apart.
template <class Scalar>
struct BasicSpringWall {
  using Kind = SpringWallKind;
  Kind kind = Kind::none;
  Vector3<Scalar> point = Vector3<Scalar>::Constant(0.0);                           ///< on the surface, m
  Vector3<Scalar> normal = Vector3<Scalar>(Scalar(0.0), Scalar(0.0), Scalar(1.0));  ///< unit, out of the wall

  struct Contact {
    Condition<Scalar> touching = false;
    Vector3<Scalar> deflection = Vector3<Scalar>::Constant(0.0);
  };

  /// Puts one loop's surface, of the same kind, into a lane.
  void set_lane(int lane, const BasicSpringWall<double>& one) {
    using math::set_lane;
    kind = one.kind;
    set_lane(point, lane, one.point);
    set_lane(normal, lane, one.normal);
  }

  [[nodiscard]] Contact contact(const Vector3<Scalar>& tip) const noexcept {
    if (kind == Kind::none) return {};
    const Vector3<Scalar> away = tip - point;
    if (kind == Kind::point) return {true, away};
    const Scalar height = normal.dot(away);
    const auto apart = height >= Scalar(0.0);
    return {!apart, select(apart, Scalar(0.0), height) * normal};
  }
};
using SpringWall = BasicSpringWall<double>;

}  // namespace palpate::object
