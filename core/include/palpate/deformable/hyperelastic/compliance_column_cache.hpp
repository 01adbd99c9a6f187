#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "palpate/deformable/hyperelastic/conjugate_gradients.hpp"
#include "palpate/deformable/hyperelastic/solver_options.hpp"

namespace palpate::deformable {

/// Unit load vectors B, each with a few nonzero entries.
struct UnitForces {
  struct Entry {
    std::size_t unknown = 0;
    float weight = 0.0F;
  };
  std::vector<std::size_t> begin{0};  ///< first entry of each load vector, and the end
  std::vector<Entry> entries;

  [[nodiscard]] std::size_t size() const noexcept { return begin.size() - 1; }
  void clear() {
    begin.assign(1, 0);
    entries.clear();
  }
  /// Call visit(unknown, weight) for each entry of load vector i.
  template <class Visit>
  void for_each(std::size_t i, Visit visit) const {
    for (std::size_t e = begin[i]; e < begin[i + 1]; ++e) visit(entries[e].unknown, entries[e].weight);
  }
};

/// Approximate compliance columns Z ~ K^-1 B of a slowly changing stiffness K. Columns are kept from step to step; each update refines the
/// least accurate ones by conjugate gradients, sixteen side by side.
///
/// The projected compliance uses the columns as a Ritz basis, B'Z (Z'K Z)^-1 Z'B. It is symmetric, its error is quadratic in that of the
/// columns, and it never exceeds the exact compliance.
class ComplianceColumnCache {
 public:
  using RefineOptions = ColumnRefinement;
  struct Report {
    int steps = 0;            ///< of conjugate gradients, summed over the batches of sixteen
    double max_error = 0.0;   ///< of the worst column before refinement; 1 if it was new
    bool indefinite = false;  ///< negative curvature was found in the stiffness
  };

  ComplianceColumnCache() = default;
  /// For up to `max_columns` columns at a time.
  ComplianceColumnCache(std::size_t unknowns, std::size_t max_columns)
      : slot_node_((max_columns + batch_size - 1) / batch_size * batch_size, -1),
        self_compliance_(slot_node_.size()),
        column_motions_(slot_node_.size()),
        residual_product_(slot_node_.size() * slot_node_.size()),
        column_(slot_node_.size() / batch_size, std::vector<Columns>(unknowns)),
        residual_(column_),
        correction_(unknowns),
        batch_residual_(unknowns),
        solver_(unknowns) {}

  [[nodiscard]] bool has(std::int32_t node) const noexcept {
    return std::find(slot_node_.begin(), slot_node_.end(), node) != slot_node_.end();
  }

  /// Add `factor` times the column of a node to `to`. The column must exist.
  void add(std::int32_t node, float factor, float* to) const noexcept {
    const std::size_t slot = slot_of(node);
    const std::vector<Columns>& column = column_[slot / batch_size];
    for (std::size_t k = 0; k < column.size(); ++k) to[k] += factor * column[k][slot % batch_size];
  }

  /// Keep the columns of these nodes (ascending). New columns start at zero, all others are dropped.
  void select(const std::vector<std::int32_t>& nodes) {
    for (std::int32_t& node : slot_node_)
      if (!std::binary_search(nodes.begin(), nodes.end(), node)) node = -1;
    slots_.clear();
    batch_count_ = 0;
    for (const std::int32_t node : nodes) {
      if (!has(node)) {
        const std::size_t slot = slot_of(-1);
        slot_node_[slot] = node;
        self_compliance_[slot] = 0.0F;
        for (Columns& c : column_[slot / batch_size]) c[slot % batch_size] = 0.0F;
      }
      slots_.push_back(slot_of(node));
      batch_count_ = std::max(batch_count_, slots_.back() / batch_size + 1);
    }
  }

  /// Refine the least accurate columns: sixteen, or all above `batch_tolerance`. `column_force[j]` is the index of the load vector that
  /// belongs to column j.
  Report refine(const BlockMatrix& stiffness, TwoLevelPreconditioner& preconditioner, const UnitForces& forces,
                const std::vector<std::size_t>& column_force, const RefineOptions& options) {
    Columns unused;
    for (std::size_t g = 0; g < batch_count_; ++g) stiffness.multiply(column_[g].data(), residual_[g].data(), unused);
    for (std::size_t j = 0; j < slots_.size(); ++j)
      forces.for_each(column_force[j],
                      [&](std::size_t k, float weight) { residual_[slots_[j] / batch_size][k][slots_[j] % batch_size] -= weight; });
    const float tolerance = options.tolerance * options.tolerance, batch_tolerance = options.batch_tolerance * options.batch_tolerance;
    refinement_queue_.clear();
    for (std::size_t g = 0; g < batch_count_; ++g) {
      Columns squared_norm;
      Columns* residual = residual_[g].data();
      preconditioner.compute_norm(residual, squared_norm, [residual](std::size_t k) { residual[k] = -residual[k]; });
      for (std::size_t slot = g * batch_size; slot < (g + 1) * batch_size; ++slot) {
        if (slot_node_[slot] < 0) continue;
        const float error = self_compliance_[slot] > 0.0F ? std::min(squared_norm[slot % batch_size] / self_compliance_[slot], 1.0F) : 2.0F;
        if (error > tolerance) refinement_queue_.emplace_back(error, slot);
      }
    }
    std::sort(refinement_queue_.begin(), refinement_queue_.end(), std::greater<>());
    Report report;
    report.max_error = refinement_queue_.empty() ? 0.0 : std::min(std::sqrt(static_cast<double>(refinement_queue_[0].first)), 1.0);
    for (std::size_t from = 0; from < refinement_queue_.size() && (from == 0 || refinement_queue_[from].first > batch_tolerance);
         from += batch_size)
      refine_batch(stiffness, preconditioner, from, tolerance, options.max_steps, report);
    return report;
  }

  /// Project the compliance onto the Ritz basis: the matrix for all load vectors, including those without a column, into `compliance` [m/N]
  /// with row length `stride`; the displacements under `residual_force` [N] into `residual_displacement` [m].
  void project(const UnitForces& forces, const std::vector<std::size_t>& column_force, const std::vector<float>& residual_force,
               double* compliance, std::size_t stride, double* residual_displacement) {
    compute_products(residual_force);
    const std::size_t count = forces.size(), row = count + 1;
    // b_i . z_j, and z_j . residual_force as the last entry of the row
    ritz_.resize(slots_.size() * row);
    for (std::size_t g = 0; g < batch_count_; ++g)
      for (std::size_t i = 0; i < count; ++i) {
        Columns sum{};
        forces.for_each(i, [&](std::size_t k, float weight) { sum += weight * column_[g][k]; });
        for (std::size_t j = 0; j < slots_.size(); ++j)
          if (slots_[j] / batch_size == g) ritz_[j * row + i] = static_cast<double>(sum[slots_[j] % batch_size]);
      }
    for (std::size_t j = 0; j < slots_.size(); ++j) ritz_[j * row + count] = static_cast<double>(column_motions_[slots_[j]]);
    orthonormalize(column_force, row);
    const auto product = [&](std::size_t i, std::size_t j) {
      double sum = 0.0;
      for (std::size_t k = 0; k < slots_.size(); ++k) sum += ritz_[k * row + i] * ritz_[k * row + j];
      return sum;
    };
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j <= i; ++j) compliance[i * stride + j] = compliance[j * stride + i] = product(i, j);
      residual_displacement[i] = product(i, count);
    }
    for (std::size_t j = 0; j < slots_.size(); ++j)
      self_compliance_[slots_[j]] = static_cast<float>(compliance[column_force[j] * stride + column_force[j]]);
  }

 private:
  static constexpr std::size_t batch_size = sizeof(Columns) / sizeof(float);

  [[nodiscard]] std::size_t slot_of(std::int32_t node) const noexcept {
    return static_cast<std::size_t>(std::find(slot_node_.begin(), slot_node_.end(), node) - slot_node_.begin());
  }

  /// Refine up to sixteen columns of the queue side by side.
  void refine_batch(const BlockMatrix& stiffness, TwoLevelPreconditioner& preconditioner, std::size_t from, float tolerance, int max_steps,
                    Report& report) {
    const std::size_t count = std::min(refinement_queue_.size() - from, batch_size);
    std::array<Columns*, batch_size> column{}, residual{};
    std::array<std::size_t, batch_size> lane{};
    Columns limit{};
    for (std::size_t l = 0; l < count; ++l) {
      const std::size_t slot = refinement_queue_[from + l].second;
      column[l] = column_[slot / batch_size].data();
      residual[l] = residual_[slot / batch_size].data();
      lane[l] = slot % batch_size;
      limit[l] = tolerance * self_compliance_[slot];
    }
    for (std::size_t k = 0; k < batch_residual_.size(); ++k) {
      correction_[k] = batch_residual_[k] = Columns{};
      for (std::size_t l = 0; l < count; ++l) batch_residual_[k][l] = residual[l][k][lane[l]];
    }
    const auto solved = solver_.solve(stiffness, preconditioner, correction_.data(), batch_residual_.data(), limit, max_steps);
    for (std::size_t k = 0; k < batch_residual_.size(); ++k)
      for (std::size_t l = 0; l < count; ++l) {
        column[l][k][lane[l]] += correction_[k][l];
        residual[l][k][lane[l]] = batch_residual_[k][l];
      }
    report.steps += solved.steps;
    report.indefinite = report.indefinite || solved.indefinite;
  }

  /// Compute z_i . residual_force of all columns, and z_i . r_j for columns i in no later batch than j.
  void compute_products(const std::vector<float>& residual_force) {
    for (std::size_t g = 0; g < batch_count_; ++g) {
      Columns motion{};
      for (std::size_t k = 0; k < residual_force.size(); ++k) motion += residual_force[k] * column_[g][k];
      for (std::size_t l = 0; l < batch_size; ++l) column_motions_[g * batch_size + l] = motion[l];
      for (std::size_t h = g; h < batch_count_; ++h) {
        std::array<Columns, batch_size> sum{};
        for (std::size_t k = 0; k < residual_force.size(); ++k)
          for (std::size_t l = 0; l < batch_size; ++l) sum[l] += residual_[h][k][l] * column_[g][k];
        for (std::size_t l = 0; l < batch_size; ++l)
          for (std::size_t m = 0; m < batch_size; ++m)
            residual_product_[(g * batch_size + m) * slot_node_.size() + h * batch_size + l] = static_cast<double>(sum[l][m]);
      }
    }
  }

  /// Transform the rows of ritz_, one per column, to columns orthonormal in the energy inner product, by the Cholesky factor of Z'K Z. A
  /// linearly dependent column becomes zero.
  void orthonormalize(const std::vector<std::size_t>& column_force, std::size_t row) {
    const std::size_t count = slots_.size();
    lower_.resize(count * count);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j <= i; ++j) {  // z_i . K z_j = z_i . b_j - z_i . r_j
        const std::size_t si = slots_[i], sj = slots_[j];
        lower_[i * count + j] = si / batch_size <= sj / batch_size
                                    ? ritz_[i * row + column_force[j]] - residual_product_[si * slot_node_.size() + sj]
                                    : ritz_[j * row + column_force[i]] - residual_product_[sj * slot_node_.size() + si];
      }
    for (std::size_t j = 0; j < count; ++j) {
      const double* const line = &lower_[j * count];
      double pivot = line[j];
      for (std::size_t k = 0; k < j; ++k) pivot -= line[k] * line[k];
      const double inverse = pivot > 1e-5 * line[j] ? 1.0 / std::sqrt(pivot) : 0.0;
      for (std::size_t i = j + 1; i < count; ++i) {
        double sum = lower_[i * count + j];
        for (std::size_t k = 0; k < j; ++k) sum -= lower_[i * count + k] * line[k];
        lower_[i * count + j] = inverse * sum;
      }
      for (std::size_t i = 0; i < row; ++i) {
        double sum = ritz_[j * row + i];
        for (std::size_t k = 0; k < j; ++k) sum -= line[k] * ritz_[k * row + i];
        ritz_[j * row + i] = inverse * sum;
      }
    }
  }

  std::vector<std::int32_t> slot_node_;                          // node of each slot; -1: unused
  std::vector<std::size_t> slots_;                               // slot of each column, in node order
  std::size_t batch_count_ = 0;                                  // batches of sixteen columns in use
  std::vector<float> self_compliance_;                           // by slot, m/N; 0: unknown
  std::vector<float> column_motions_;                            // displacement under the residual force, by slot, m
  std::vector<double> residual_product_;                         // z_i . r_j, J
  std::vector<std::vector<Columns>> column_, residual_;          // Z [m] and R = B - K Z [N], in batches of sixteen
  std::vector<Columns> correction_, batch_residual_;             // of the batch being refined, m and N
  std::vector<std::pair<float, std::size_t>> refinement_queue_;  // squared relative error and slot, worst first
  std::vector<double> ritz_, lower_;
  ConjugateGradients<Columns> solver_;
};

}  // namespace palpate::deformable
