#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/multirate/local_triangles.hpp"
#include "palpate/deformable/multirate/multi_tip_result.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Linearization of a body about one of its states, at the nodes near the tips (local model, Barbagli, Prattichizzo & Salisbury 2005). Each
/// node moves along one direction, its inward normal; the triangles of the surface are interpolated between the nodes.
struct LocalModel {
  static constexpr int capacity = ContactLcp::capacity;
  static constexpr int max_inner = 64;  ///< nodes with computed compliance; that of the others is extrapolated (ComplianceExtrapolation)

  static constexpr double max_beyond = 0.01;  ///< part of the force that surface with nodes outside of the model may bear

  SurfaceNodes nodes;                                    ///< deformed positions and outward normals (negative displacement directions)
  std::array<std::int32_t, capacity> node_ids{};         ///< surface node of each, ascending
  std::array<bool, capacity> inner{};                    ///< whether the compliance was computed
  std::array<double, capacity> force{};                  ///< of the state, along the inward normals, N
  std::array<double, capacity> residual_displacement{};  ///< still to go to equilibrium under these forces, along the inward normals, m
  std::array<double, capacity> elastic_displacement{};   ///< compliance times force, m
  std::array<Vector3<>, capacity> displacement{};        ///< of the state, m
  /// Displacement of the nodes in contact per force on them, in the mean, weighted by their forces at the state, m/N; in the long term and
  /// without inertia. Zero without contact or without SolverOptions::contact_compliance.
  Matrix3<> contact_compliance = Matrix3<>::Zero();
  std::vector<double> compliance_matrix;            ///< capacity x capacity, along the inward normals, m/N
  std::vector<detail::FloatLine> single;            ///< same in single precision
  LocalTriangles triangles;                         ///< of the surface, by distance from the tips
  std::array<bool, TipPair::max_tips> continued{};  ///< of each tip, see Tip
  bool inverted = false;                            ///< whether the body has inverted tetrahedra since the state
  bool truncated = false;                           ///< whether the model lacks surface that bears force at the state
  bool has_memory = false;                          ///< whether the body may swing or recover when the tips have left
  double returnable = 0.0;                          ///< energy that the body with memory may still return, J
  long version = 0;                                 ///< of the state, increasing

  [[nodiscard]] bool empty() const noexcept { return nodes.size() == 0; }
  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return compliance_matrix[static_cast<std::size_t>(i) * capacity + static_cast<std::size_t>(j)];
  }
  /// Row of the compliance in single precision.
  [[nodiscard]] const float* row(std::size_t i) const noexcept { return single[i * capacity / 16].value.data(); }
  void round() {
    single.resize(compliance_matrix.size() / 16);
    for (std::size_t k = 0; k < compliance_matrix.size(); ++k) single[k / 16].value[k % 16] = static_cast<float>(compliance_matrix[k]);
  }
};

}  // namespace palpate::deformable
