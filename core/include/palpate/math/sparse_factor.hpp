#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate {

/// A sparse positive definite matrix, factorised once (Cholesky, rows in the order of least degree), that solves for three right sides side
/// by side, one for each axis, without taking memory.
class SparseFactor {
 public:
  SparseFactor() = default;

  /// The lower triangle of `matrix` is read.
  explicit SparseFactor(const Eigen::SparseMatrix<double>& matrix) {
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky(matrix);
    definite_ = cholesky.info() == Eigen::Success;
    if (!definite_) return;
    const Eigen::SparseMatrix<double> lower = cholesky.matrixL();
    const auto size = static_cast<std::size_t>(lower.cols());
    work_.resize(size, Four::Zero());
    place_.assign(cholesky.permutationP().indices().data(), cholesky.permutationP().indices().data() + size);
    begin_.assign(lower.outerIndexPtr(), lower.outerIndexPtr() + size + 1);
    row_.assign(lower.innerIndexPtr(), lower.innerIndexPtr() + lower.nonZeros());
    value_.assign(lower.valuePtr(), lower.valuePtr() + lower.nonZeros());
    for (std::size_t c = 0; c < size; ++c) value_[static_cast<std::size_t>(begin_[c])] = 1.0 / value_[static_cast<std::size_t>(begin_[c])];
  }

  /// False: the matrix was not positive definite, and nothing can be solved.
  [[nodiscard]] bool definite() const noexcept { return definite_; }
  [[nodiscard]] std::size_t entries() const noexcept { return value_.size(); }

  /// Replaces as many right sides as the matrix has rows by the solution.
  void solve(Vector3<>* sides) noexcept {
    const std::size_t size = work_.size();
    for (std::size_t i = 0; i < size; ++i) work_[static_cast<std::size_t>(place_[i])].template head<3>() = sides[i];
    for (std::size_t c = 0; c < size; ++c) {
      const auto first = static_cast<std::size_t>(begin_[c]), last = static_cast<std::size_t>(begin_[c + 1]);
      const Four x = work_[c] *= value_[first];
      for (std::size_t e = first + 1; e < last; ++e) work_[static_cast<std::size_t>(row_[e])] -= value_[e] * x;
    }
    for (std::size_t c = size; c-- > 0;) {
      const auto first = static_cast<std::size_t>(begin_[c]), last = static_cast<std::size_t>(begin_[c + 1]);
      Four x = work_[c];
      for (std::size_t e = first + 1; e < last; ++e) x -= value_[e] * work_[static_cast<std::size_t>(row_[e])];
      work_[c] = x * value_[first];
    }
    for (std::size_t i = 0; i < size; ++i) sides[i] = work_[static_cast<std::size_t>(place_[i])].template head<3>();
  }

 private:
  using Four = Eigen::Array<double, 4, 1>;  // three axes, and one that fills the register

  bool definite_ = false;
  std::vector<std::int32_t> place_;  // in the factor of each row of the matrix
  std::vector<std::int32_t> begin_;  // of each column of the factor; its diagonal is first, inverted
  std::vector<std::int32_t> row_;
  std::vector<double> value_;
  std::vector<Four> work_;
};

}  // namespace palpate
