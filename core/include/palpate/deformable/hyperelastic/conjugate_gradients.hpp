#pragma once

#include <cstddef>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/two_level_preconditioner.hpp"

namespace palpate::deformable {

/// Preconditioned conjugate gradients on one column (Number = float) or on sixteen side by side (Columns). Owns its workspace.
///
/// The error measure is r . M r with the residual r and the preconditioner M, nearly twice the energy of the error. The passes over the
/// vectors are fused, because sixteen columns do not fit into the caches.
template <class Number>
class ConjugateGradients {
 public:
  struct Result {
    int steps = 0;
    bool indefinite = false;  ///< negative curvature was found in a column above its limit; the result so far is kept
  };

  ConjugateGradients() = default;
  explicit ConjugateGradients(std::size_t unknowns) : direction_(unknowns), image_(unknowns) {}

  /// Improve x until r . M r of each column is at most `limit`, or for `max_steps` steps. The residual r = b - A x is updated along. A
  /// column with negative curvature is not changed.
  Result solve(const BlockMatrix& matrix, TwoLevelPreconditioner& preconditioner, Number* x, Number* r, const Number& limit,
               int max_steps) noexcept {
    Result result;
    const Number none{};
    Number norm, curvature, next_norm;
    preconditioner.compute_norm(r, norm);
    if (all_below(norm, limit)) return result;
    preconditioner.for_each_preconditioned(r, [this](std::size_t k, const Number& preconditioned) { direction_[k] = preconditioned; });
    while (result.steps < max_steps) {
      ++result.steps;
      matrix.multiply(direction_.data(), image_.data(), curvature);
      const Number alpha = curvature > none ? norm / curvature : none;
      result.indefinite = result.indefinite || !all_below(norm > limit ? none - curvature : none - 1.0F, none);
      preconditioner.compute_norm(r, next_norm, [&](std::size_t k) {
        x[k] += alpha * direction_[k];
        r[k] -= alpha * image_[k];
      });
      if (all_below(next_norm, limit)) break;
      const Number beta = norm > none ? next_norm / norm : none;
      preconditioner.for_each_preconditioned(
          r, [&](std::size_t k, const Number& preconditioned) { direction_[k] = preconditioned + beta * direction_[k]; });
      norm = next_norm;
    }
    return result;
  }

 private:
  /// Whether a <= b in each column.
  static bool all_below(const Number& a, const Number& b) noexcept {
    if constexpr (sizeof(Number) == sizeof(float)) {
      return a <= b;
    } else {
      bool all = true;
      for (std::size_t l = 0; l < sizeof(Number) / sizeof(float); ++l) all = all && a[l] <= b[l];
      return all;
    }
  }

  std::vector<Number> direction_, image_;
};

}  // namespace palpate::deformable
