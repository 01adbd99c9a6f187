#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"

namespace palpate::deformable {

/// Two-level preconditioner for stiffness matrices: block Jacobi plus a coarse grid of about a hundred points around the body with
/// trilinear interpolation, which captures the soft deformation modes.
class TwoLevelPreconditioner {
 public:
  TwoLevelPreconditioner() = default;

  /// `points` are the rest positions of the nodes [m].
  explicit TwoLevelPreconditioner(const std::vector<Vector3<>>& points, int coarse_points = 120)
      : block_inverse_(points.size()), interpolation_(points.size()) {
    if (points.empty()) return;
    Vector3<> box_min = points[0], box_max = points[0];
    for (const Vector3<>& p : points) {
      box_min = box_min.cwiseMin(p);
      box_max = box_max.cwiseMax(p);
    }
    const Vector3<> size = (box_max - box_min).cwiseMax(1e-3 * (box_max - box_min).maxCoeff());
    // Cubic cells, as fine as the number of points allows.
    std::array<int, 3> count{2, 2, 2};
    for (int k = 0; k < 200; ++k) {
      const double cell = size.maxCoeff() * std::pow(0.97, k);
      std::array<int, 3> next{};
      for (int a = 0; a < 3; ++a) next[static_cast<std::size_t>(a)] = 2 + static_cast<int>(size[a] / cell - 1e-9);
      if (next[0] * next[1] * next[2] > coarse_points) break;
      count = next;
    }
    std::vector<std::int32_t> number(static_cast<std::size_t>(count[0] * count[1] * count[2]), -1);
    std::vector<double> total_weight(number.size(), 0.0);
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        std::array<int, 3> cell{};
        std::array<double, 3> weight_up{};
        for (std::size_t a = 0; a < 3; ++a) {
          const double at = (points[i][static_cast<int>(a)] - box_min[static_cast<int>(a)]) / size[static_cast<int>(a)] * (count[a] - 1);
          cell[a] = std::clamp(static_cast<int>(at), 0, count[a] - 2);
          weight_up[a] = at - cell[a];
        }
        for (std::size_t corner = 0; corner < 8; ++corner) {
          double weight = 1.0;
          std::size_t at = 0;
          for (std::size_t a = 0; a < 3; ++a) {
            const int up = static_cast<int>(corner >> a) & 1;
            weight *= up == 1 ? weight_up[a] : 1.0 - weight_up[a];
            at = at * static_cast<std::size_t>(count[a]) + static_cast<std::size_t>(cell[a] + up);
          }
          if (pass == 0)
            total_weight[at] += weight;
          else
            interpolation_[i][corner] = {std::max(number[at], 0), number[at] < 0 ? 0.0F : static_cast<float>(weight)};
        }
      }
      // A coarse point with hardly any node would make the coarse matrix nearly singular.
      if (pass == 0)
        for (std::size_t k = 0; k < number.size(); ++k)
          if (total_weight[k] > 0.3) number[k] = coarse_count_++;
    }
    const auto unknowns = static_cast<std::size_t>(3 * coarse_count_);
    coarse_inverse_.resize(unknowns * unknowns);
    coarse_residual_.resize(unknowns);
    coarse_residual_columns_.resize(unknowns);
    coarse_solution_.resize(unknowns);
    coarse_solution_columns_.resize(unknowns);
  }

  /// Update the inverses of the diagonal blocks.
  void update(const BlockMatrix& matrix) noexcept {
    for (std::size_t i = 0; i < block_inverse_.size(); ++i)
      std::copy(matrix.diagonal_block(i), matrix.diagonal_block(i) + 9, block_inverse_[i].begin());
    for (std::size_t row = 0; row < matrix.factor_rows(); ++row)
      matrix.for_each_factor(row, [&](std::int32_t j, const float* g) {
        auto& block = block_inverse_[static_cast<std::size_t>(j)];
        for (std::size_t k = 0; k < 9; ++k) block[k] += g[k / 3] * g[k % 3];
      });
    for (auto& block : block_inverse_) {
      const Eigen::Matrix3f inverse = Eigen::Map<const Eigen::Matrix3f>(block.data()).inverse();
      std::copy(inverse.data(), inverse.data() + 9, block.begin());
    }
  }

  /// Update the inverse of the coarse matrix: ten times the cost of update(), so only now and then. Return false, with no change, if it is
  /// not positive definite.
  bool update_coarse(const BlockMatrix& matrix) {
    const Eigen::Index unknowns = 3 * coarse_count_;
    Eigen::MatrixXd half = Eigen::MatrixXd::Zero(unknowns, unknowns);
    std::vector<Eigen::Matrix3d> row(static_cast<std::size_t>(coarse_count_));
    std::vector<std::int32_t> touched;
    for (std::size_t i = 0; i < block_inverse_.size(); ++i) {
      touched.clear();
      matrix.for_each_in_row(static_cast<std::int32_t>(i), [&](std::int32_t j, const float* m) {
        const double pair_factor = static_cast<std::size_t>(j) == i ? 0.5 : 1.0;
        const Eigen::Matrix3d block = pair_factor * Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(m).cast<double>();
        for (const InterpolationWeight& share : interpolation_[static_cast<std::size_t>(j)]) {
          if (share.weight == 0.0F) continue;
          auto& sum = row[static_cast<std::size_t>(share.point)];
          if (std::find(touched.begin(), touched.end(), share.point) == touched.end()) {
            touched.push_back(share.point);
            sum.setZero();
          }
          sum += static_cast<double>(share.weight) * block;
        }
      });
      for (const InterpolationWeight& share : interpolation_[i])
        if (share.weight != 0.0F)
          for (const std::int32_t k : touched)
            half.block<3, 3>(3 * share.point, 3 * k) += static_cast<double>(share.weight) * row[static_cast<std::size_t>(k)];
    }
    std::vector<Vector3<>> coarse_row(static_cast<std::size_t>(coarse_count_));
    for (std::size_t i = 0; i < matrix.factor_rows(); ++i) {
      touched.clear();
      matrix.for_each_factor(i, [&](std::int32_t j, const float* g) {
        for (const InterpolationWeight& share : interpolation_[static_cast<std::size_t>(j)]) {
          if (share.weight == 0.0F) continue;
          auto& sum = coarse_row[static_cast<std::size_t>(share.point)];
          if (std::find(touched.begin(), touched.end(), share.point) == touched.end()) {
            touched.push_back(share.point);
            sum.setZero();
          }
          sum += static_cast<double>(share.weight) * Eigen::Map<const Eigen::Vector3f>(g).cast<double>();
        }
      });
      for (const std::int32_t k : touched)
        for (const std::int32_t l : touched)
          half.block<3, 3>(3 * k, 3 * l) +=
              (0.5 * coarse_row[static_cast<std::size_t>(k)]) * coarse_row[static_cast<std::size_t>(l)].transpose();
    }
    const Eigen::MatrixXd coarse = half + half.transpose();
    const Eigen::LLT<Eigen::MatrixXd> factor(coarse);
    if (factor.info() != Eigen::Success) return false;
    const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    for (std::size_t k = 0; k < coarse_inverse_.size(); ++k) coarse_inverse_[k] = static_cast<float>(inverse.data()[k]);
    return true;
  }

  /// Compute product = r . M r with the preconditioner M. `before(k)` is called before r[k] is read, and may change it.
  template <class Number, class Before>
  void compute_norm(const Number* r, Number& product, Before before) noexcept {
    Number* coarse_residual = workspace<Number>(coarse_residual_, coarse_residual_columns_).data();
    Number* coarse_solution = workspace<Number>(coarse_solution_, coarse_solution_columns_).data();
    const auto unknowns = static_cast<std::size_t>(3 * coarse_count_);
    std::fill(coarse_residual, coarse_residual + unknowns, Number{});
    Number sum{};
    for (std::size_t i = 0; i < block_inverse_.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) before(3 * i + a);
      const Number u = r[3 * i], v = r[3 * i + 1], w = r[3 * i + 2];
      const auto& m = block_inverse_[i];
      sum += (((m[0] * u + m[1] * v) + m[2] * w) * u + ((m[3] * u + m[4] * v) + m[5] * w) * v) + ((m[6] * u + m[7] * v) + m[8] * w) * w;
      for (const InterpolationWeight& share : interpolation_[i]) {
        Number* to = coarse_residual + 3 * static_cast<std::size_t>(share.point);
        to[0] += share.weight * u;
        to[1] += share.weight * v;
        to[2] += share.weight * w;
      }
    }
    for (std::size_t k = 0; k < unknowns; ++k) {
      const float* row = coarse_inverse_.data() + k * unknowns;
      Number partial[4] = {};  // partial sums
      std::size_t l = 0;
      for (; l + 4 <= unknowns; l += 4)
        for (std::size_t p = 0; p < 4; ++p) partial[p] += row[l + p] * coarse_residual[l + p];
      for (; l < unknowns; ++l) partial[0] += row[l] * coarse_residual[l];
      coarse_solution[k] = (partial[0] + partial[1]) + (partial[2] + partial[3]);
      sum += coarse_residual[k] * coarse_solution[k];
    }
    product = sum;
  }
  template <class Number>
  void compute_norm(const Number* r, Number& product) noexcept {
    compute_norm(r, product, [](std::size_t) {});
  }

  /// Call visit(k, (M r)[k]) for each k, with the r of the last compute_norm().
  template <class Number, class Visit>
  void for_each_preconditioned(const Number* r, Visit visit) noexcept {
    const Number* coarse_solution = workspace<Number>(coarse_solution_, coarse_solution_columns_).data();
    for (std::size_t i = 0; i < block_inverse_.size(); ++i) {
      const auto& m = block_inverse_[i];
      const Number u = r[3 * i], v = r[3 * i + 1], w = r[3 * i + 2];
      Number a = (m[0] * u + m[1] * v) + m[2] * w, b = (m[3] * u + m[4] * v) + m[5] * w, c = (m[6] * u + m[7] * v) + m[8] * w;
      for (const InterpolationWeight& share : interpolation_[i]) {
        const Number* from = coarse_solution + 3 * static_cast<std::size_t>(share.point);
        a += share.weight * from[0];
        b += share.weight * from[1];
        c += share.weight * from[2];
      }
      visit(3 * i, a);
      visit(3 * i + 1, b);
      visit(3 * i + 2, c);
    }
  }

 private:
  struct InterpolationWeight {
    std::int32_t point = 0;
    float weight = 0.0F;
  };

  template <class Number>
  static std::vector<Number>& workspace(std::vector<float>& single, std::vector<Columns>& columns) noexcept {
    if constexpr (sizeof(Number) == sizeof(float))
      return single;
    else
      return columns;
  }

  std::int32_t coarse_count_ = 0;                                  // coarse points
  std::vector<std::array<float, 9>> block_inverse_;                // by node, m/N
  std::vector<std::array<InterpolationWeight, 8>> interpolation_;  // coarse points of each node
  std::vector<float> coarse_inverse_;                              // m/N
  std::vector<float> coarse_residual_, coarse_solution_;
  std::vector<Columns> coarse_residual_columns_, coarse_solution_columns_;
};

}  // namespace palpate::deformable
