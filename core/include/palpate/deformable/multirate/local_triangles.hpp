#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/layer_point.hpp"
#include "palpate/deformable/multirate/multi_tip_result.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Surface triangles of a local model in single precision, side by side for registers of any width.
class LocalTriangles {
 public:
  static constexpr std::size_t max_triangles = 384;  ///< a multiple of 16

  struct Corner {
    std::int16_t node = -1;                      ///< of the model; -1: it does not move
    Vector3<> position = Vector3<>::Zero();      ///< at the state, m
    Vector3<> direction = Vector3<>::Zero();     ///< unit vector in which the node moves
    Vector3<> displacement = Vector3<>::Zero();  ///< of the state, m
    LayerCorner layer;
  };
  struct Triangle {
    std::array<Corner, 3> corner;
    Vector3<> normal = Vector3<>::Zero();  ///< of the surface at the state, outward
    bool complete = true;                  ///< whether the model has all contact nodes among the corners
    std::uint8_t cones = 0xFF;             ///< bit t: the cone of tip t presses it, see depth_in_sphere()
  };

  /// Rows of numbers: 3 x corner + axis for vectors of the corners, axis for the normal, corner for numbers of the corners, tip for
  /// LayerPoint::cone.
  enum Row : std::size_t {
    position = 0,
    direction = 9,
    displacement = 18,
    normal = 27,
    radius = 30,
    round_stiffness = 33,
    flat_stiffness = 36,
    cone = 39,
    row_count = 39 + TipPair::max_tips
  };

  /// Replace all triangles; at most max_triangles are taken. Positions are stored relative to `origin`.
  void assign(const Vector3<>& origin, const std::vector<Triangle>& triangles) {
    origin_ = origin;
    count_ = std::min(triangles.size(), max_triangles);
    stride_ = (count_ + 15) / 16 * 16;
    lines_.assign(row_count * stride_ / 16, detail::FloatLine{});
    nodes_.assign(stride_, {-1, -1, -1});
    complete_.assign(stride_, 1);
    for (std::size_t t = 0; t < count_; ++t)
      for (std::size_t tip = 0; tip < TipPair::max_tips; ++tip)
        entry(cone + tip, t) = ((triangles[t].cones >> tip) & 1) != 0 ? 0.0F : static_cast<float>(no_cone);
    for (std::size_t t = 0; t < stride_; ++t)
      for (std::size_t c = 0; c < 3; ++c) {
        if (t >= count_) {  // out of reach of any tip
          entry(position + 3 * c, t) = 1e6F;
          entry(radius + c, t) = 1e-4F;
          continue;
        }
        const Corner& corner = triangles[t].corner[c];
        nodes_[t][c] = corner.node;
        complete_[t] = triangles[t].complete ? 1 : 0;
        for (std::size_t a = 0; a < 3; ++a) {
          const int axis = static_cast<int>(a);
          entry(position + 3 * c + a, t) = static_cast<float>(corner.position[axis] - origin[axis]);
          entry(direction + 3 * c + a, t) = corner.node < 0 ? 0.0F : static_cast<float>(corner.direction[axis]);
          entry(displacement + 3 * c + a, t) = static_cast<float>(corner.displacement[axis]);
          if (c == 0) entry(normal + a, t) = static_cast<float>(triangles[t].normal[axis]);
        }
        entry(round_stiffness + c, t) = static_cast<float>(corner.layer.stiffness.round);
        entry(flat_stiffness + c, t) = static_cast<float>(corner.layer.stiffness.flat);
        entry(radius + c, t) = corner.layer.exists() ? static_cast<float>(corner.layer.radius) : 1e-4F;
      }
  }

  [[nodiscard]] const Vector3<>& origin() const noexcept { return origin_; }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  /// Consecutive triangles from `first` on, a multiple of the lanes; lanes beyond count() are out of reach of any tip.
  [[nodiscard, gnu::always_inline]] detail::FloatPack load(std::size_t row, std::size_t first) const noexcept {
    return *detail::as_packs(lines_.data()->value.data() + row * stride_ + first);
  }
  [[nodiscard, gnu::always_inline]] Vector3<detail::FloatPack> load_vector(std::size_t row, std::size_t first) const noexcept {
    return {load(row, first), load(row + 1, first), load(row + 2, first)};
  }
  [[nodiscard]] const std::array<std::int16_t, 3>& nodes(std::size_t triangle) const noexcept { return nodes_[triangle]; }
  [[nodiscard]] bool is_complete(std::size_t triangle) const noexcept { return complete_[triangle] != 0; }

 private:
  [[nodiscard]] float& entry(std::size_t row, std::size_t triangle) noexcept {
    return lines_[(row * stride_ + triangle) / 16].value[(row * stride_ + triangle) % 16];
  }

  Vector3<> origin_ = Vector3<>::Zero();
  std::size_t count_ = 0, stride_ = 0;
  std::vector<detail::FloatLine> lines_;
  std::vector<std::array<std::int16_t, 3>> nodes_;  // by triangle
  std::vector<std::uint8_t> complete_;              // same
};

}  // namespace palpate::deformable
