#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::math {

/// Sparse Cholesky factorization of a positive definite matrix with a solver for three right-hand
/// sides (one per axis).
///
/// Rows are ordered by approximate minimum degree. Consecutive columns with the same row pattern
/// form a supernode (Ashcraft et al. 1987), so that a row below them is loaded once for all of
/// them. solve() does not allocate.
class SupernodalCholesky {
 public:
  SupernodalCholesky() = default;

  /// Factorize `matrix`; only its lower triangle is read.
  explicit SupernodalCholesky(const Eigen::SparseMatrix<double>& matrix) {
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky(matrix);
    positive_definite_ = cholesky.info() == Eigen::Success;
    if (!positive_definite_) return;
    const Eigen::SparseMatrix<double> lower = cholesky.matrixL();
    const auto size = static_cast<std::size_t>(lower.cols());
    workspace_.resize(size, PaddedVector::Zero());
    permutation_.assign(cholesky.permutationP().indices().data(), cholesky.permutationP().indices().data() + size);
    nonzeros_ = static_cast<std::size_t>(lower.nonZeros());
    const int *begin = lower.outerIndexPtr(), *row = lower.innerIndexPtr();
    const double* value = lower.valuePtr();
    for (std::size_t c = 0; c < size;) {
      std::size_t width = 1;
      while (width < max_width && c + width < size && continues_supernode(begin, row, c + width)) ++width;
      Supernode supernode{static_cast<std::int32_t>(c), static_cast<std::int32_t>(width), rows_.size(), rows_.size(), values_.size()};
      for (std::size_t i = 0; i < width; ++i)
        for (std::size_t j = 0; j < width; ++j) {  // triangle of the supernode, by column; diagonal inverted
          const double v = j >= i ? value[static_cast<std::size_t>(begin[c + i]) + j - i] : 0.0;
          values_.push_back(i == j ? 1.0 / v : v);
        }
      const auto below = static_cast<std::size_t>(begin[c + width] - begin[c + width - 1]) - 1;
      for (std::size_t e = 0; e < below; ++e) {
        rows_.push_back(row[static_cast<std::size_t>(begin[c]) + width + e]);
        for (std::size_t i = 0; i < width; ++i) values_.push_back(value[static_cast<std::size_t>(begin[c + i]) + width - i + e]);
      }
      supernode.last = rows_.size();
      supernodes_.push_back(supernode);
      c += width;
    }
  }

  /// Return whether the factorization succeeded; if false, solve() must not be called.
  [[nodiscard]] bool positive_definite() const noexcept { return positive_definite_; }
  [[nodiscard]] std::size_t nonzeros() const noexcept { return nonzeros_; }

  /// Solve in place. `right_hand_sides` has one entry per matrix row; the components are the three
  /// right-hand sides.
  void solve(Vector3<>* right_hand_sides) noexcept {
    const std::size_t size = workspace_.size();
    for (std::size_t i = 0; i < size; ++i) workspace_[static_cast<std::size_t>(permutation_[i])].template head<3>() = right_hand_sides[i];
    for (const Supernode& b : supernodes_) dispatch_width<max_width>(b, [this, &b](auto width) { forward<width.value>(b); });
    for (std::size_t k = supernodes_.size(); k-- > 0;) {
      const Supernode& b = supernodes_[k];
      dispatch_width<max_width>(b, [this, &b](auto width) { backward<width.value>(b); });
    }
    for (std::size_t i = 0; i < size; ++i) right_hand_sides[i] = workspace_[static_cast<std::size_t>(permutation_[i])].template head<3>();
  }

 private:
  using PaddedVector = Eigen::Array<double, 4, 1>;  // three axes, padded to a vector register
  static constexpr std::size_t max_width = 6;

  /// Adjacent columns with the same row pattern below the diagonal block.
  struct Supernode {
    std::int32_t column, width;  // first column, number of columns
    std::size_t first, last;     // range in rows_
    std::size_t value;           // offset in values_: width x width triangle by column, then `width` values per row
  };

  /// Return whether column `c` has the row pattern of column c - 1.
  static bool continues_supernode(const int* begin, const int* row, std::size_t c) {
    return begin[c + 1] - begin[c] == begin[c] - begin[c - 1] - 1 && row[static_cast<std::size_t>(begin[c - 1]) + 1] == static_cast<int>(c);
  }

  template <std::size_t width, class Function>
  static void dispatch_width(const Supernode& b, Function function) noexcept {
    if constexpr (width == 1) {
      function(std::integral_constant<std::size_t, 1>{});
    } else {
      if (static_cast<std::size_t>(b.width) == width) return function(std::integral_constant<std::size_t, width>{});
      dispatch_width<width - 1>(b, function);
    }
  }

  template <std::size_t width>
  void forward(const Supernode& b) noexcept {
    const double* value = values_.data() + b.value;
    PaddedVector* const own = workspace_.data() + b.column;
    PaddedVector x[width];
    for (std::size_t i = 0; i < width; ++i) {
      x[i] = own[i];
      for (std::size_t j = 0; j < i; ++j) x[i] -= value[j * width + i] * x[j];
      own[i] = x[i] *= value[i * width + i];
    }
    value += width * width;
    for (std::size_t r = b.first; r < b.last; ++r, value += width) {
      PaddedVector& y = workspace_[static_cast<std::size_t>(rows_[r])];
      PaddedVector sum = value[0] * x[0];
      for (std::size_t i = 1; i < width; ++i) sum += value[i] * x[i];
      y -= sum;
    }
  }

  template <std::size_t width>
  void backward(const Supernode& b) noexcept {
    const double* const start = values_.data() + b.value;
    const double* value = start + width * width;
    PaddedVector* const own = workspace_.data() + b.column;
    PaddedVector x[width];
    for (std::size_t i = 0; i < width; ++i) x[i] = own[i];
    for (std::size_t r = b.first; r < b.last; ++r, value += width) {
      const PaddedVector y = workspace_[static_cast<std::size_t>(rows_[r])];
      for (std::size_t i = 0; i < width; ++i) x[i] -= value[i] * y;
    }
    for (std::size_t i = width; i-- > 0;) {
      for (std::size_t j = i + 1; j < width; ++j) x[i] -= start[i * width + j] * x[j];
      own[i] = x[i] *= start[i * width + i];
    }
  }

  bool positive_definite_ = false;
  std::size_t nonzeros_ = 0;
  std::vector<std::int32_t> permutation_;  // position in the factor of each matrix row
  std::vector<Supernode> supernodes_;
  std::vector<std::int32_t> rows_;  // row indices below the diagonal blocks
  std::vector<double> values_;
  std::vector<PaddedVector> workspace_;
};

}  // namespace palpate::math
