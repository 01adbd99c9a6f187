#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/layer_point.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Triangulated surface with an elastic layer that tips press, at points that are interpolated linearly between the vertices
/// (corner_points). Corners that are no contact nodes have none.
class LayeredSurface {
 public:
  struct Triangle {
    std::array<std::int32_t, 3> vertex{};  ///< counterclockwise seen from outside
    std::array<LayerCorner, 3> corner{};
  };

  LayeredSurface() = default;

  /// @param vertices   of the mesh, at rest [m]
  /// @param triangles  counterclockwise seen from outside
  /// @param node       vertex of each contact node
  /// @param modulus    of the layer of each contact node
  LayeredSurface(const std::vector<Vector3<>>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles,
                 const std::vector<std::int32_t>& node, const std::vector<LayerModulus>& modulus)
      : area_(node.size(), 0.0) {
    std::vector<std::int32_t> node_of(vertices.size(), -1);
    for (std::size_t i = 0; i < node.size(); ++i) node_of[at(node[i])] = static_cast<std::int32_t>(i);
    const auto size_of = [&](const std::array<std::int32_t, 3>& t) {
      return 0.5 * (vertices[at(t[1])] - vertices[at(t[0])]).cross(vertices[at(t[2])] - vertices[at(t[0])]).norm();
    };
    for (const auto& t : triangles)
      for (const std::int32_t v : t)
        if (node_of[at(v)] >= 0) area_[at(node_of[at(v)])] += size_of(t) / 3.0;
    for (const auto& t : triangles) {
      Triangle& triangle = triangles_.emplace_back();
      triangle.vertex = t;
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int32_t i = node_of[at(t[c])];
        if (i < 0) continue;
        const double radius = std::sqrt(area_[at(i)] / M_PI), size = size_of(t) / 3.0 / radius;
        triangle.corner[c] = {{modulus[at(i)].round * size, modulus[at(i)].flat * size}, radius};
      }
    }
  }

  /// Area of a node's patch, a third of its triangles, m^2.
  [[nodiscard]] double area(std::int32_t node) const noexcept { return area_[at(node)]; }
  [[nodiscard]] const std::vector<Triangle>& triangles() const noexcept { return triangles_; }

 private:
  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  std::vector<double> area_;  // by node, m^2
  std::vector<Triangle> triangles_;
};

}  // namespace palpate::deformable
