#pragma once

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Turn of a node's traction in a tick, from the plane across the direction `before` of its normal force to that across `now` (unit
/// vectors). The traction is transported in parallel, and the slip is the part of the node's way that is across the mean direction. The
/// energy of the layer then changes by the work of the mean traction, but for an error of third order in the angle and the way. Projecting
/// both on the plane of `now` leaves one of second order, of one sign while the depth swings.
class TractionTurn {
 public:
  TractionTurn(const Vector3<>& before, const Vector3<>& now) noexcept : now_(now), sum_(before + now) {
    const double square = sum_.squaredNorm();
    weight_ = square > least_square ? 1.0 / square : 0.0;
  }

  /// A traction after the turn, of the same size.
  [[nodiscard]] Vector3<> carried(const Vector3<>& traction) const noexcept {
    return across(traction - (2.0 * weight_ * traction.dot(now_)) * sum_);
  }
  /// The part of a way along the mean direction.
  [[nodiscard]] Vector3<> along(const Vector3<>& way) const noexcept { return (weight_ * way.dot(sum_)) * sum_; }
  /// The slip of a way, after the turn.
  [[nodiscard]] Vector3<> slip(const Vector3<>& way) const noexcept { return across(way - along(way)); }

 private:
  static constexpr double least_square = 0.1;  // of the sum: beyond a turn of 162 degrees both are projected

  [[nodiscard]] Vector3<> across(const Vector3<>& v) const noexcept { return v - v.dot(now_) * now_; }

  Vector3<> now_, sum_;
  double weight_;
};

}  // namespace palpate::deformable
