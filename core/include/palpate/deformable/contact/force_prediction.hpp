#pragma once

#include <array>
#include <cstddef>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Prediction of the force on a node and of its friction from the node's motion relative to a tip, by secant estimates of their
/// derivatives (Broyden 1965). Single precision, both side by side.
class ForcePrediction {
 public:
  /// Predicted change, N.
  struct Change {
    Vector3<> force, traction;
  };

  /// Begin without a derivative, with forces of zero. `way` is the motion of the present tick, m.
  void start(const Vector3<>& way) noexcept {
    *this = {};
    way_ = way;
  }

  /// Take the forces at the end of the last tick, N; return their change in a tick of the motion `way`. A motion much smaller than `least`
  /// hardly changes the derivatives; both in m.
  Change step(const Vector3<>& force, const Vector3<>& traction, const Vector3<>& way, double least) noexcept {
    detail::FloatPack now;
    for (std::size_t a = 0; a < 3; ++a) {
      const int axis = static_cast<int>(a);
      now.set(a, static_cast<float>(force[axis]));
      now.set(traction_lane + a, static_cast<float>(traction[axis]));
    }
    const double over = 1.0 / (way_.squaredNorm() + least * least);
    const detail::FloatPack missing = now - *row(last) - along(way_);
    for (std::size_t a = 0; a < 3; ++a) *row(a) += missing * detail::FloatPack(over * way_[static_cast<int>(a)]);
    *row(last) = now;
    way_ = way;
    const detail::FloatPack change = along(way);
    return {vector(change, 0), vector(change, traction_lane)};
  }

 private:
  static constexpr std::size_t traction_lane = 4, last = 3;

  [[nodiscard]] detail::FloatPack* row(std::size_t number) noexcept {
    return detail::as_packs(rows_.data()->value.data() + number * detail::float_lanes);
  }
  [[nodiscard]] const detail::FloatPack* row(std::size_t number) const noexcept {
    return detail::as_packs(rows_.data()->value.data() + number * detail::float_lanes);
  }

  [[nodiscard]] detail::FloatPack along(const Vector3<>& way) const noexcept {
    return *row(0) * detail::FloatPack(way[0]) + (*row(1) * detail::FloatPack(way[1]) + *row(2) * detail::FloatPack(way[2]));
  }
  [[nodiscard]] static Vector3<> vector(const detail::FloatPack& of, std::size_t lane) noexcept {
    return {static_cast<double>(of[lane]), static_cast<double>(of[lane + 1]), static_cast<double>(of[lane + 2])};
  }

  /// Rows of the force, then the traction: derivatives by the axes of the motion [N/m], and values at the end of the tick before [N].
  /// Not of FloatPack, whose layout depends on the width of the registers.
  std::array<detail::FloatLine, 2> rows_;
  Vector3<> way_ = Vector3<>::Zero();  // motion of the last tick, m
};

}  // namespace palpate::deformable
