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

/// Compliances of a free-form deformation in one direction (normal or tangential).
struct FreeFormData {
  double control_compliance = 0.0;  ///< displacement of a control point per unit force, m/N
  double surface_layer = 0.0;       ///< displacement of a node in its surface layer per unit pressure, m/Pa
};

/// Free-form deformation (Sederberg & Parry 1986) as a body model: cubic B-splines on a uniform grid of control points, moved by the
/// least-squares displacement that satisfies the contact (Hsu, Hughes & Kaufman 1992). Forces follow from a spring at each control point
/// and an elastic surface layer (a Winkler foundation) at each node. Among the displacements that satisfy the contact, the one of least
/// stored energy is taken. Tangential forces act on separate springs and layers.
///
/// No inertia and no continuum: displacements vanish beyond four grid cells.
class FreeFormDeformation {
 public:
  FreeFormDeformation() = default;

  /// `areas` of the patches [m^2] by node; grid `spacing` [m]; compliances in normal and tangential direction (the latter for friction).
  FreeFormDeformation(const SurfaceNodes& nodes, const std::vector<double>& areas, double spacing, FreeFormData normal,
                      FreeFormData tangential = {})
      : normal_(normal), tangential_(tangential) {
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      Node node;
      node.inward = -nodes.normal(i);
      node.tangent_basis = nodes.tangent_basis(i);
      node.inverse_area = 1.0 / areas[static_cast<std::size_t>(i)];
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
    return normal_.control_compliance * weight_overlap(a, b) * a.inward.dot(b.inward) +
           (i == j ? normal_.surface_layer * a.inverse_area : 0.0);
  }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    const Node &a = nodes_[static_cast<std::size_t>(i)], &b = nodes_[static_cast<std::size_t>(j)];
    Eigen::Matrix2d block = (tangential_.control_compliance * weight_overlap(a, b)) * a.tangent_basis.transpose() * b.tangent_basis;
    if (i == j) block.diagonal().array() += tangential_.surface_layer * a.inverse_area;
    return block;
  }
  [[nodiscard]] double free_displacement(std::int32_t) const noexcept { return 0.0; }
  [[nodiscard]] bool group_free_displacement_at_least(std::size_t, double value) const noexcept { return value <= 0.0; }
  void advance(const std::int32_t*, const double*, int) noexcept {}
  void reset() noexcept {}

  /// Displacement [m] of node i by a force on node j: `normal_force` along the inward normal and `tangential_force` [N].
  [[nodiscard]] Vector3<> displacement(std::int32_t i, std::int32_t j, double normal_force,
                                       const Vector3<>& tangential_force) const noexcept {
    const Node &a = nodes_[static_cast<std::size_t>(i)], &b = nodes_[static_cast<std::size_t>(j)];
    const double overlap = weight_overlap(a, b), self = i == j ? a.inverse_area : 0.0;
    return (normal_force * (normal_.control_compliance * overlap + normal_.surface_layer * self)) * b.inward +
           (tangential_.control_compliance * overlap + tangential_.surface_layer * self) * tangential_force;
  }

 private:
  struct Node {
    Vector3<> inward = Vector3<>::Zero();
    Eigen::Matrix<double, 3, 2> tangent_basis = Eigen::Matrix<double, 3, 2>::Zero();
    double inverse_area = 0.0;                      // of the patch area, 1/m^2
    std::array<std::int32_t, 3> cell{};             // first of the four control points, by axis
    std::array<std::array<double, 4>, 3> weight{};  // of the four control points, by axis
  };

  /// Overlap of two nodes' B-spline weights: product over the axes of the sums of weight products.
  [[nodiscard]] static double weight_overlap(const Node& a, const Node& b) noexcept {
    double product = 1.0;
    for (std::size_t x = 0; x < 3; ++x) {
      const std::int32_t offset = b.cell[x] - a.cell[x];
      if (offset > 3 || offset < -3) return 0.0;
      double sum = 0.0;
      for (std::int32_t k = std::max(offset, 0); k < std::min(offset + 4, 4); ++k)
        sum += a.weight[x][static_cast<std::size_t>(k)] * b.weight[x][static_cast<std::size_t>(k - offset)];
      product *= sum;
    }
    return product;
  }

  FreeFormData normal_, tangential_;
  std::vector<Node> nodes_;
};

}  // namespace palpate::deformable
