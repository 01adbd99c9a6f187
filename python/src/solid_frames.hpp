#pragma once

#include <cstddef>
#include <memory>
#include <palpate/math/latest_value.hpp>
#include <palpate/object/deformable_object.hpp>

/// Displacements of all points of a hyperelastic body after its last model update. Writer and reader never wait for each other.
class SolidFrames {
 public:
  explicit SolidFrames(std::size_t points) : points_(points) {
    for (palpate::object::DeformationFrame& moved : box_->slots()) moved.displacement.assign(3 * points, 0.0);
  }

  [[nodiscard]] std::shared_ptr<palpate::math::LatestValue<palpate::object::DeformationFrame>> box() const noexcept { return box_; }
  [[nodiscard]] std::size_t points() const noexcept { return points_; }

  /// Return the last frame. Only one thread may call this.
  const palpate::object::DeformationFrame& latest() noexcept {
    box_->acquire();
    return box_->value();
  }

 private:
  std::size_t points_;
  std::shared_ptr<palpate::math::LatestValue<palpate::object::DeformationFrame>> box_ =
      std::make_shared<palpate::math::LatestValue<palpate::object::DeformationFrame>>();
};
