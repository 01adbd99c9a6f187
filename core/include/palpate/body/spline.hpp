#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/body/nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// A body that moves as a free-form deformation: cubic B-splines over a uniform grid of control points (Sederberg & Parry 1986), moved by
/// the least squares of control points that satisfy the contact (Hsu, Hughes & Kaufman 1992). A law of force goes with it: each control
/// point hangs on a spring, and each node rests on a layer of its own, so much give per pressure. Both store energy, and of all ways to
/// satisfy the contact the one that stores least is taken. No inertia, no continuum: beyond four cells of the grid nothing moves.
class Spline {
 public:
  Spline() = default;

  /// Patches' areas [m^2] by node; the grid's `spacing` [m]; how far a control point goes by its force, `give` [m/N]; how far a node goes
  /// into its layer by a pressure, `layer` [m/Pa].
  Spline(const BodyNodes& nodes, const std::vector<double>& areas, double spacing, double give, double layer) : give_(give) {
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      Node node;
      node.inward = -nodes.normal(i);
      node.own = layer / areas[static_cast<std::size_t>(i)];
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
    return between(a, b) * a.inward.dot(b.inward) + (i == j ? a.own : 0.0);
  }
  [[nodiscard]] double at_rest(std::int32_t) const noexcept { return 0.0; }
  void advance(const std::int32_t*, const double*, int) noexcept {}
  void reset() noexcept {}

  /// Displacement of node i [m] under `forces` [N] along the inward normals of `nodes`.
  [[nodiscard]] Vector3<> displacement(std::int32_t i, const std::int32_t* nodes, const double* forces, int count) const noexcept {
    const Node& at = nodes_[static_cast<std::size_t>(i)];
    Vector3<> sum = Vector3<>::Zero();
    for (int c = 0; c < count; ++c) {
      const Node& pressed = nodes_[static_cast<std::size_t>(nodes[c])];
      sum += (forces[c] * (between(at, pressed) + (nodes[c] == i ? at.own : 0.0))) * pressed.inward;
    }
    return sum;
  }

 private:
  struct Node {
    Vector3<> inward = Vector3<>::Zero();
    double own = 0.0;                               // of its layer, m/N
    std::array<std::int32_t, 3> cell{};             // first of its four control points, by axis
    std::array<std::array<double, 4>, 3> weight{};  // of the four, by axis
  };

  /// How far a goes by a force on b, any axis alike: the control points that they share, axis by axis, m/N.
  [[nodiscard]] double between(const Node& a, const Node& b) const noexcept {
    double product = give_;
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

  double give_ = 0.0;  // of a control point, m/N
  std::vector<Node> nodes_;
};

}  // namespace palpate
