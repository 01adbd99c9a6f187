#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/hyperelastic/compliance_column_cache.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Compliance of a contact as a whole, 3 x 3. A unit force along each axis is spread over the nodes in the shares of their loads; the
/// displacement is the mean of those nodes with the same shares.
class ContactCompliance {
 public:
  ContactCompliance() = default;
  explicit ContactCompliance(std::size_t unknowns) : columns_(unknowns, 3), no_force_(unknowns, 0.0F) {}

  void reset() { columns_.select({}); }

  /// Set the loads [N] by free node.
  void set_loads(const std::vector<std::pair<std::size_t, double>>& loads) {
    double total = 0.0;
    for (const auto& load : loads) total += load.second;
    forces_.clear();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const auto& [node, load] : loads) forces_.entries.push_back({3 * node + axis, static_cast<float>(load / total)});
      forces_.begin.push_back(forces_.entries.size());
    }
  }

  /// Refine the compliance [m/N] for the loads and a stiffness. Return whether the stiffness is positive definite, as far as found.
  bool refine(const BlockMatrix& stiffness, TwoLevelPreconditioner& preconditioner, const ColumnRefinement& options) {
    columns_.select({0, 1, 2});
    const auto report = columns_.refine(stiffness, preconditioner, forces_, axes_, options);
    std::array<double, 3> unused{};
    columns_.project(forces_, axes_, no_force_, matrix_.data(), 3, unused.data());
    return !report.indefinite;
  }
  [[nodiscard]] const Matrix3<>& matrix() const noexcept { return matrix_; }  ///< symmetric, m/N

 private:
  ComplianceColumnCache columns_;
  UnitForces forces_;
  std::vector<std::size_t> axes_{0, 1, 2};  // load vector of each column
  std::vector<float> no_force_;
  Matrix3<> matrix_ = Matrix3<>::Zero();
};

}  // namespace palpate::deformable
