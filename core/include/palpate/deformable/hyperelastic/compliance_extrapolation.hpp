#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Extrapolates the compliance of a local model from its inner nodes, whose columns were computed, to the outer nodes, whose were not. A
/// tip that moves past the inner nodes then meets an approximate surface.
///
/// The columns of the inner nodes i give C_ii and the displacement C_oi of the outer nodes o. The remaining block is
///   C_oo = C_oi C_ii^-1 C_io + k (B_oo - B_oi B_ii^-1 B_io),   B(x, y) = 1 / sqrt(|x - y|^2 + a^2):
/// the part determined by the inner nodes, plus the complement of a kernel that decays as Boussinesq's solution (1885), with the size of a
/// patch as a and with k fitted to the inner nodes. The kernel is positive definite (Micchelli 1986), hence so is the result. The estimate
/// is biased stiff (factor 0.8): too soft a model would drain the energy tank at the next switch.
class ComplianceExtrapolation {
 public:
  static constexpr std::size_t capacity = LocalModel::capacity;

  /// Complete s.compliance_matrix and s.residual_displacement, which hold the values of the inner nodes.
  void complete(LocalModel& s) {
    inner_.clear();
    outer_.clear();
    for (std::int32_t i = 0; i < s.nodes.size(); ++i) (s.inner[static_cast<std::size_t>(i)] ? inner_ : outer_).push_back(i);
    if (outer_.empty() || inner_.empty()) return;
    fit(s);
    factor(inner_factor_, [&](std::int32_t i, std::int32_t j) { return s.compliance(i, j); });
    factor(kernel_factor_, [&](std::int32_t i, std::int32_t j) { return kernel(s, i, j); });
    std::array<double, capacity> motion{};  // L^-1 residual displacement of the inner nodes
    for (std::size_t a = 0; a < inner_.size(); ++a) motion[a] = s.residual_displacement[static_cast<std::size_t>(inner_[a])];
    solve(inner_factor_, motion.data());
    from_inner_.resize(outer_.size() * capacity);
    kernel_from_inner_.resize(outer_.size() * capacity);
    for (std::size_t o = 0; o < outer_.size(); ++o) {
      double *inner_row = &from_inner_[o * capacity], *kernel_row = &kernel_from_inner_[o * capacity];
      for (std::size_t a = 0; a < inner_.size(); ++a) {
        inner_row[a] = s.compliance(outer_[o], inner_[a]);
        kernel_row[a] = kernel(s, outer_[o], inner_[a]);
      }
      solve(inner_factor_, inner_row);
      solve(kernel_factor_, kernel_row);
      s.residual_displacement[static_cast<std::size_t>(outer_[o])] = dot(inner_row, motion.data());
      for (std::size_t p = 0; p <= o; ++p) {
        const double entry_value = dot(inner_row, &from_inner_[p * capacity]) +
                                   kernel_scale_ * (kernel(s, outer_[o], outer_[p]) - dot(kernel_row, &kernel_from_inner_[p * capacity]));
        entry(s, outer_[o], outer_[p]) = entry(s, outer_[p], outer_[o]) = entry_value;
      }
    }
  }

 private:
  /// Fit k and a to the inner nodes' mean self-compliance and mean cross compliance.
  void fit(const LocalModel& s) {
    double mean_self = 0.0, pair_sum = 0.0, min_square = 1e300;
    for (std::size_t a = 0; a < inner_.size(); ++a) {
      mean_self += s.compliance(inner_[a], inner_[a]) / static_cast<double>(inner_.size());
      for (std::size_t b = 0; b < a; ++b) {
        pair_sum += s.compliance(inner_[a], inner_[b]);
        min_square = std::min(min_square, (s.nodes.point(inner_[a]) - s.nodes.point(inner_[b])).squaredNorm());
      }
    }
    squared_width_ = inner_.size() > 1 ? 0.16 * min_square : 1.0;
    for (int k = 0; k < 20; ++k) {
      double sum = 0.0;
      for (std::size_t a = 0; a < inner_.size(); ++a)
        for (std::size_t b = 0; b < a; ++b) sum += kernel(s, inner_[a], inner_[b]);
      const double width =
          std::clamp(pair_sum > 0.0 ? pair_sum / (sum * mean_self) : 0.0, 0.2 * std::sqrt(min_square), std::sqrt(min_square));
      squared_width_ = width * width;
    }
    kernel_scale_ = compliance_bias * mean_self * std::sqrt(squared_width_);
  }

  [[nodiscard]] double kernel(const LocalModel& s, std::int32_t i, std::int32_t j) const noexcept {
    return 1.0 / std::sqrt((s.nodes.point(i) - s.nodes.point(j)).squaredNorm() + squared_width_);
  }

  /// Compute the Cholesky factor of a matrix over the inner nodes. Linearly dependent rows get a zero pivot and are ignored.
  template <class Entry>
  void factor(std::vector<double>& lower, Entry value) {
    lower.assign(capacity * capacity, 0.0);
    for (std::size_t a = 0; a < inner_.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        double sum = value(inner_[a], inner_[b]);
        for (std::size_t c = 0; c < b; ++c) sum -= lower[a * capacity + c] * lower[b * capacity + c];
        lower[a * capacity + b] = lower[b * capacity + b] > 0.0 ? sum / lower[b * capacity + b] : 0.0;
      }
      const double diagonal = value(inner_[a], inner_[a]);
      double pivot = diagonal;
      for (std::size_t c = 0; c < a; ++c) pivot -= lower[a * capacity + c] * lower[a * capacity + c];
      lower[a * capacity + a] = pivot > 1e-6 * diagonal ? std::sqrt(pivot) : 0.0;
    }
  }

  /// Replace x by L^-1 x.
  void solve(const std::vector<double>& factor, double* x) const noexcept {
    for (std::size_t a = 0; a < inner_.size(); ++a) {
      const double diagonal = factor[a * capacity + a];
      for (std::size_t c = 0; c < a; ++c) x[a] -= factor[a * capacity + c] * x[c];
      x[a] = diagonal > 0.0 ? x[a] / diagonal : 0.0;
    }
  }

  [[nodiscard]] double dot(const double* x, const double* y) const noexcept {
    double sum = 0.0;
    for (std::size_t a = 0; a < inner_.size(); ++a) sum += x[a] * y[a];
    return sum;
  }

  static double& entry(LocalModel& s, std::int32_t i, std::int32_t j) noexcept {
    return s.compliance_matrix[static_cast<std::size_t>(i) * capacity + static_cast<std::size_t>(j)];
  }

  static constexpr double compliance_bias = 0.8;

  std::vector<std::int32_t> inner_, outer_;             // indices in the local model
  std::vector<double> inner_factor_, kernel_factor_;    // Cholesky factors of C_ii and B_ii
  std::vector<double> from_inner_, kernel_from_inner_;  // L^-1 C_io and L^-1 B_io, by outer node
  double squared_width_ = 0.0;                          // a^2, m^2
  double kernel_scale_ = 0.0;                           // k, m^2/N
};

}  // namespace palpate::deformable
