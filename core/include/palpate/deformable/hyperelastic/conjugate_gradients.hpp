#pragma once

#include <cstddef>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/two_level_preconditioner.hpp"

namespace palpate::deformable {

/// Preconditioned conjugate gradients on one column (Number = float) or on sixteen side by side (Columns). Holds its work space.
///
/// What is left is measured as r . M r, with the residual r and the preconditioner M that comes near to the inverse: nearly twice the
/// energy that the error holds. Few passes are made over the vectors, for with sixteen columns these do not stay in the caches.
template <class Number>
class ConjugateGradients {
 public:
  struct Result {
    int steps = 0;
    bool negative = false;  ///< the matrix was seen not to be positive definite; what was found before is kept
  };

  ConjugateGradients() = default;
  explicit ConjugateGradients(std::size_t unknowns) : way_(unknowns), pull_(unknowns) {}

  /// Betters x, with the residual r = b - A x that is kept up, until r . M r of each column is below `limit` or the steps are spent. A
  /// column along which the matrix is not positive stays as it is.
  Result solve(const BlockMatrix& matrix, TwoLevelPreconditioner& precondition, Number* x, Number* r, const Number& limit,
               int most) noexcept {
    Result result;
    const Number none{};
    Number product, curvature, next;
    precondition.measure(r, product);
    if (below(product, limit)) return result;
    precondition.each_answer(r, [this](std::size_t k, const Number& near) { way_[k] = near; });
    while (result.steps < most) {
      ++result.steps;
      matrix.multiply(way_.data(), pull_.data(), curvature);
      const Number length = curvature > none ? product / curvature : none;
      result.negative = result.negative || !below(product > none ? none - curvature : none - 1.0F, none);
      precondition.measure(r, next, [&](std::size_t k) {
        x[k] += length * way_[k];
        r[k] -= length * pull_[k];
      });
      if (below(next, limit)) break;
      const Number keep = product > none ? next / product : none;
      precondition.each_answer(r, [&](std::size_t k, const Number& near) { way_[k] = near + keep * way_[k]; });
      product = next;
    }
    return result;
  }

 private:
  /// Whether a <= b in each column.
  static bool below(const Number& a, const Number& b) noexcept {
    if constexpr (sizeof(Number) == sizeof(float)) {
      return a <= b;
    } else {
      bool all = true;
      for (std::size_t l = 0; l < sizeof(Number) / sizeof(float); ++l) all = all && a[l] <= b[l];
      return all;
    }
  }

  std::vector<Number> way_, pull_;
};

}  // namespace palpate::deformable
