#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::math {

/// A sparse positive definite matrix, factorised once (Cholesky, rows in the order of least degree), that solves for three right sides side
/// by side, one for each axis, without taking memory.
///
/// Columns that follow each other with the same rows are kept together (supernodes, Ashcraft et al. 1987): a row below them is fetched
/// once for all of them.
class SupernodalCholesky {
 public:
  SupernodalCholesky() = default;

  /// The lower triangle of `matrix` is read.
  explicit SupernodalCholesky(const Eigen::SparseMatrix<double>& matrix) {
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky(matrix);
    definite_ = cholesky.info() == Eigen::Success;
    if (!definite_) return;
    const Eigen::SparseMatrix<double> lower = cholesky.matrixL();
    const auto size = static_cast<std::size_t>(lower.cols());
    work_.resize(size, Four::Zero());
    place_.assign(cholesky.permutationP().indices().data(), cholesky.permutationP().indices().data() + size);
    entries_ = static_cast<std::size_t>(lower.nonZeros());
    const int *begin = lower.outerIndexPtr(), *row = lower.innerIndexPtr();
    const double* value = lower.valuePtr();
    for (std::size_t c = 0; c < size;) {
      std::size_t width = 1;
      while (width < widest && c + width < size && follows(begin, row, c + width)) ++width;
      Block block{static_cast<std::int32_t>(c), static_cast<std::int32_t>(width), row_.size(), row_.size(), value_.size()};
      for (std::size_t i = 0; i < width; ++i)
        for (std::size_t j = 0; j < width; ++j) {  // of the block's own rows, by column; diagonals inverted
          const double v = j >= i ? value[static_cast<std::size_t>(begin[c + i]) + j - i] : 0.0;
          value_.push_back(i == j ? 1.0 / v : v);
        }
      const auto below = static_cast<std::size_t>(begin[c + width] - begin[c + width - 1]) - 1;
      for (std::size_t e = 0; e < below; ++e) {
        row_.push_back(row[static_cast<std::size_t>(begin[c]) + width + e]);
        for (std::size_t i = 0; i < width; ++i) value_.push_back(value[static_cast<std::size_t>(begin[c + i]) + width - i + e]);
      }
      block.last = row_.size();
      blocks_.push_back(block);
      c += width;
    }
  }

  /// False: the matrix was not positive definite, and nothing can be solved.
  [[nodiscard]] bool definite() const noexcept { return definite_; }
  [[nodiscard]] std::size_t entries() const noexcept { return entries_; }

  /// Replaces as many right sides as the matrix has rows by the solution.
  void solve(Vector3<>* sides) noexcept {
    const std::size_t size = work_.size();
    for (std::size_t i = 0; i < size; ++i) work_[static_cast<std::size_t>(place_[i])].template head<3>() = sides[i];
    for (const Block& b : blocks_) by_width<widest>(b, [this, &b](auto width) { forward<width.value>(b); });
    for (std::size_t k = blocks_.size(); k-- > 0;) {
      const Block& b = blocks_[k];
      by_width<widest>(b, [this, &b](auto width) { back<width.value>(b); });
    }
    for (std::size_t i = 0; i < size; ++i) sides[i] = work_[static_cast<std::size_t>(place_[i])].template head<3>();
  }

 private:
  using Four = Eigen::Array<double, 4, 1>;  // three axes, and one that fills the register
  static constexpr std::size_t widest = 6;

  /// Columns side by side that have the same rows below them.
  struct Block {
    std::int32_t column, width;  // the first, and how many
    std::size_t first, last;     // rows
    std::size_t value;           // width x width of its own, by column; then `width` for each row
  };

  /// Whether a column has the rows of the one before it.
  static bool follows(const int* begin, const int* row, std::size_t c) {
    return begin[c + 1] - begin[c] == begin[c] - begin[c - 1] - 1 && row[static_cast<std::size_t>(begin[c - 1]) + 1] == static_cast<int>(c);
  }

  template <std::size_t width, class Do>
  static void by_width(const Block& b, Do go) noexcept {
    if constexpr (width == 1) {
      go(std::integral_constant<std::size_t, 1>{});
    } else {
      if (static_cast<std::size_t>(b.width) == width) return go(std::integral_constant<std::size_t, width>{});
      by_width<width - 1>(b, go);
    }
  }

  template <std::size_t width>
  void forward(const Block& b) noexcept {
    const double* value = value_.data() + b.value;
    Four* const own = work_.data() + b.column;
    Four x[width];
    for (std::size_t i = 0; i < width; ++i) {
      x[i] = own[i];
      for (std::size_t j = 0; j < i; ++j) x[i] -= value[j * width + i] * x[j];
      own[i] = x[i] *= value[i * width + i];
    }
    value += width * width;
    for (std::size_t r = b.first; r < b.last; ++r, value += width) {
      Four& y = work_[static_cast<std::size_t>(row_[r])];
      Four sum = value[0] * x[0];
      for (std::size_t i = 1; i < width; ++i) sum += value[i] * x[i];
      y -= sum;
    }
  }

  template <std::size_t width>
  void back(const Block& b) noexcept {
    const double* const start = value_.data() + b.value;
    const double* value = start + width * width;
    Four* const own = work_.data() + b.column;
    Four x[width];
    for (std::size_t i = 0; i < width; ++i) x[i] = own[i];
    for (std::size_t r = b.first; r < b.last; ++r, value += width) {
      const Four y = work_[static_cast<std::size_t>(row_[r])];
      for (std::size_t i = 0; i < width; ++i) x[i] -= value[i] * y;
    }
    for (std::size_t i = width; i-- > 0;) {
      for (std::size_t j = i + 1; j < width; ++j) x[i] -= start[i * width + j] * x[j];
      own[i] = x[i] *= start[i * width + i];
    }
  }

  bool definite_ = false;
  std::size_t entries_ = 0;
  std::vector<std::int32_t> place_;  // in the factor of each row of the matrix
  std::vector<Block> blocks_;
  std::vector<std::int32_t> row_;  // below the blocks
  std::vector<double> value_;
  std::vector<Four> work_;
};

}  // namespace palpate::math
