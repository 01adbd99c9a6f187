#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// What yields of a spline, along the normals or along the surface.
struct FreeFormData {
  double control = 0.0;  ///< how far a control point goes by its force, m/N
  double layer = 0.0;    ///< how far a node goes in its layer by a pressure, m/Pa
};

/// A body that moves as a free-form deformation: cubic B-splines over a uniform grid of control points (Sederberg & Parry 1986), moved by
/// the least squares of control points that satisfy the contact (Hsu, Hughes & Kaufman 1992). A law of force goes with it: each control
/// point hangs on a spring, and each node rests on a layer of its own, so much give per pressure. Both store energy, and of all ways to
/// satisfy the contact the one that stores least is taken. What drags nodes along the surface finds springs and layers of its own. No
/// inertia, no continuum: beyond four cells of the grid nothing moves.
class FreeFormDeformation {
 public:
  FreeFormDeformation() = default;

  /// Patches' areas [m^2] by node; the grid's `spacing` [m]; what gives way `along` the normals, and `across` them, which friction needs.
  FreeFormDeformation(const SurfaceNodes& nodes, const std::vector<double>& areas, double spacing, FreeFormData along,
                      FreeFormData across = {})
      : along_(along), across_(across) {
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      Node node;
      node.inward = -nodes.normal(i);
      node.across = nodes.across(i);
      node.inverse = 1.0 / areas[static_cast<std::size_t>(i)];
      for (int a = 0; a < 3; ++a) {
        const double at = nodes.point(i)[a] / spacing, cell = std::floor(at), t = at - cell, s = 1.0 - t;
        node.cell[static_cast<std::size_t>(a)] = static_cast<std::int32_t>(cell);
        node.weight[static_cast<std::size_t>(a)] = {s * s * s / 6.0, (3.0 * t * t * (t - 2.0) + 4.0) / 6.0,
                                                    (3.0 * s * s * (s - 2.0) + 4.0) / 6.0, t * t * t / 6.0};
      }
      nodes_.push_back(node);
    }
  }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    const Node &a = nodes_[static_cast<std::size_t>(i)], &b = nodes_[static_cast<std::size_t>(j)];
    return along_.control * shared(a, b) * a.inward.dot(b.inward) + (i == j ? along_.layer * a.inverse : 0.0);
  }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    const Node &a = nodes_[static_cast<std::size_t>(i)], &b = nodes_[static_cast<std::size_t>(j)];
    Eigen::Matrix2d block = (across_.control * shared(a, b)) * a.across.transpose() * b.across;
    if (i == j) block.diagonal().array() += across_.layer * a.inverse;
    return block;
  }
  [[nodiscard]] double at_rest(std::int32_t) const noexcept { return 0.0; }
  [[nodiscard]] bool surely_above_all(std::size_t, double place) const noexcept { return place <= 0.0; }
  void advance(const std::int32_t*, const double*, int) noexcept {}
  void reset() noexcept {}

  /// How far node i goes [m] by a force on node j that presses it with `force` [N] and drags it with `drag` [N].
  [[nodiscard]] Vector3<> displacement(std::int32_t i, std::int32_t j, double force, const Vector3<>& drag) const noexcept {
    const Node &a = nodes_[static_cast<std::size_t>(i)], &b = nodes_[static_cast<std::size_t>(j)];
    const double between = shared(a, b), own = i == j ? a.inverse : 0.0;
    return (force * (along_.control * between + along_.layer * own)) * b.inward + (across_.control * between + across_.layer * own) * drag;
  }

 private:
  struct Node {
    Vector3<> inward = Vector3<>::Zero();
    Eigen::Matrix<double, 3, 2> across = Eigen::Matrix<double, 3, 2>::Zero();
    double inverse = 0.0;                           // of its patch's area, 1/m^2
    std::array<std::int32_t, 3> cell{};             // first of its four control points, by axis
    std::array<std::array<double, 4>, 3> weight{};  // of the four, by axis
  };

  /// How much of one node hangs on the control points of another: the sum of the products of their weights, axis by axis.
  [[nodiscard]] static double shared(const Node& a, const Node& b) noexcept {
    double product = 1.0;
    for (std::size_t x = 0; x < 3; ++x) {
      const std::int32_t apart = b.cell[x] - a.cell[x];
      if (apart > 3 || apart < -3) return 0.0;
      double sum = 0.0;
      for (std::int32_t k = std::max(apart, 0); k < std::min(apart + 4, 4); ++k)
        sum += a.weight[x][static_cast<std::size_t>(k)] * b.weight[x][static_cast<std::size_t>(k - apart)];
      product *= sum;
    }
    return product;
  }

  FreeFormData along_, across_;
  std::vector<Node> nodes_;
};

}  // namespace palpate::deformable
