#pragma once

#include <cstddef>
#include <vector>

#include "palpate/body/block_matrix.hpp"
#include "palpate/body/precondition.hpp"

namespace palpate {

/// Preconditioned conjugate gradients on one column (Number = float) or on sixteen side by side (Columns). Holds its work space.
template <class Number>
class ConjugateGradients {
 public:
  struct Result {
    int steps = 0;
    bool negative = false;  ///< the matrix was seen not to be positive definite; what was found before is kept
  };

  ConjugateGradients() = default;
  explicit ConjugateGradients(std::size_t unknowns) : near_(unknowns), way_(unknowns), pull_(unknowns) {}

  /// Betters x, with the residual r = b - A x that is kept up, until each column's residual is below `tolerance` times its b's length
  /// (given as its square) or the steps are spent. A column along which the matrix is not positive stays as it is.
  Result solve(const BlockMatrix& matrix, Precondition& precondition, Number* x, Number* r, const Number& square_of_b, float tolerance,
               int most) noexcept {
    Result result;
    const Number limit = (tolerance * tolerance) * square_of_b, none{};
    Number product, curvature, next;
    dot(r, r, product);
    if (below(product, limit)) return result;
    precondition.apply(r, near_.data());
    way_ = near_;
    dot(r, near_.data(), product);
    while (result.steps < most) {
      ++result.steps;
      matrix.multiply(way_.data(), pull_.data());
      dot(way_.data(), pull_.data(), curvature);
      const Number length = curvature > none ? product / curvature : none;
      result.negative = result.negative || !below(product > none ? none - curvature : none - 1.0F, none);
      Number left[2] = {};
      for (std::size_t k = 0; k < way_.size(); ++k) {
        x[k] += length * way_[k];
        r[k] -= length * pull_[k];
        left[k % 2] += r[k] * r[k];
      }
      if (below(left[0] + left[1], limit)) break;
      precondition.apply(r, near_.data());
      dot(r, near_.data(), next);
      const Number keep = product > none ? next / product : none;
      for (std::size_t k = 0; k < way_.size(); ++k) way_[k] = near_[k] + keep * way_[k];
      product = next;
    }
    return result;
  }

  /// `sum` of the products; by reference, for a wide vector is not handed back alike on all machines.
  void dot(const Number* a, const Number* b, Number& sum) const noexcept {
    Number part[4] = {};  // sums side by side
    std::size_t k = 0;
    for (; k + 4 <= way_.size(); k += 4)
      for (std::size_t p = 0; p < 4; ++p) part[p] += a[k + p] * b[k + p];
    for (; k < way_.size(); ++k) part[0] += a[k] * b[k];
    sum = (part[0] + part[1]) + (part[2] + part[3]);
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

  std::vector<Number> near_, way_, pull_;
};

}  // namespace palpate
