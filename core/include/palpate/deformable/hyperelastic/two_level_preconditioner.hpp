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

/// Two levels that together come near to a stiffness's inverse: each node's own block, and a coarse grid of some hundred points around the
/// body on which displacements are interpolated (linear in each axis, so that all of a body's slow ways to deform are among them).
class TwoLevelPreconditioner {
 public:
  TwoLevelPreconditioner() = default;

  /// `points` at rest of the nodes [m].
  explicit TwoLevelPreconditioner(const std::vector<Vector3<>>& points, int coarse_points = 120)
      : own_(points.size()), near_(points.size()) {
    if (points.empty()) return;
    Vector3<> low = points[0], high = points[0];
    for (const Vector3<>& p : points) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const Vector3<> size = (high - low).cwiseMax(1e-3 * (high - low).maxCoeff());
    // Cells alike in all axes, as fine as the number of points allows.
    std::array<int, 3> count{2, 2, 2};
    for (int k = 0; k < 200; ++k) {
      const double cell = size.maxCoeff() * std::pow(0.97, k);
      std::array<int, 3> next{};
      for (int a = 0; a < 3; ++a) next[static_cast<std::size_t>(a)] = 2 + static_cast<int>(size[a] / cell - 1e-9);
      if (next[0] * next[1] * next[2] > coarse_points) break;
      count = next;
    }
    std::vector<std::int32_t> number(static_cast<std::size_t>(count[0] * count[1] * count[2]), -1);
    std::vector<double> reached(number.size(), 0.0);
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        std::array<int, 3> cell{};
        std::array<double, 3> part{};
        for (std::size_t a = 0; a < 3; ++a) {
          const double at = (points[i][static_cast<int>(a)] - low[static_cast<int>(a)]) / size[static_cast<int>(a)] * (count[a] - 1);
          cell[a] = std::clamp(static_cast<int>(at), 0, count[a] - 2);
          part[a] = at - cell[a];
        }
        for (std::size_t corner = 0; corner < 8; ++corner) {
          double weight = 1.0;
          std::size_t at = 0;
          for (std::size_t a = 0; a < 3; ++a) {
            const int up = static_cast<int>(corner >> a) & 1;
            weight *= up == 1 ? part[a] : 1.0 - part[a];
            at = at * static_cast<std::size_t>(count[a]) + static_cast<std::size_t>(cell[a] + up);
          }
          if (pass == 0)
            reached[at] += weight;
          else
            near_[i][corner] = {std::max(number[at], 0), number[at] < 0 ? 0.0F : static_cast<float>(weight)};
        }
      }
      // A coarse point that hardly any node hangs on would leave the coarse matrix near singular.
      if (pass == 0)
        for (std::size_t k = 0; k < number.size(); ++k)
          if (reached[k] > 0.3) number[k] = coarse_++;
    }
    const auto unknowns = static_cast<std::size_t>(3 * coarse_);
    inverse_.resize(unknowns * unknowns);
    sums_.resize(unknowns);
    sums_of_columns_.resize(unknowns);
    answers_.resize(unknowns);
    answers_of_columns_.resize(unknowns);
  }

  /// Inverts each node's own block.
  void update(const BlockMatrix& matrix) noexcept {
    for (std::size_t i = 0; i < own_.size(); ++i) {
      const Eigen::Matrix3f inverse = Eigen::Map<const Eigen::Matrix3f>(matrix.own(i)).inverse();
      std::copy(inverse.data(), inverse.data() + 9, own_[i].begin());
    }
  }

  /// Inverts the coarse matrix too: ten times as long as update(), for now and then. False, and all as before, if it is not positive.
  bool update_coarse(const BlockMatrix& matrix) {
    const Eigen::Index unknowns = 3 * coarse_;
    Eigen::MatrixXd half = Eigen::MatrixXd::Zero(unknowns, unknowns);
    std::vector<Eigen::Matrix3d> row(static_cast<std::size_t>(coarse_));
    std::vector<std::int32_t> touched;
    for (std::size_t i = 0; i < own_.size(); ++i) {
      touched.clear();
      matrix.row(static_cast<std::int32_t>(i), [&](std::int32_t j, const float* m) {
        const double share_of_pair = static_cast<std::size_t>(j) == i ? 0.5 : 1.0;
        const Eigen::Matrix3d block = share_of_pair * Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(m).cast<double>();
        for (const Share& share : near_[static_cast<std::size_t>(j)]) {
          if (share.weight == 0.0F) continue;
          auto& sum = row[static_cast<std::size_t>(share.point)];
          if (std::find(touched.begin(), touched.end(), share.point) == touched.end()) {
            touched.push_back(share.point);
            sum.setZero();
          }
          sum += static_cast<double>(share.weight) * block;
        }
      });
      for (const Share& share : near_[i])
        if (share.weight != 0.0F)
          for (const std::int32_t k : touched)
            half.block<3, 3>(3 * share.point, 3 * k) += static_cast<double>(share.weight) * row[static_cast<std::size_t>(k)];
    }
    const Eigen::MatrixXd coarse = half + half.transpose();
    const Eigen::LLT<Eigen::MatrixXd> factor(coarse);
    if (factor.info() != Eigen::Success) return false;
    const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    for (std::size_t k = 0; k < inverse_.size(); ++k) inverse_[k] = static_cast<float>(inverse.data()[k]);
    return true;
  }

  /// product = r . M r with M, what comes near to the inverse. `before(k)` is called before r[k] is looked at, and may change it.
  template <class Number, class Before>
  void measure(const Number* r, Number& product, Before before) noexcept {
    Number* sums = space<Number>(sums_, sums_of_columns_).data();
    Number* answers = space<Number>(answers_, answers_of_columns_).data();
    const auto unknowns = static_cast<std::size_t>(3 * coarse_);
    std::fill(sums, sums + unknowns, Number{});
    Number own{};
    for (std::size_t i = 0; i < own_.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) before(3 * i + a);
      const Number u = r[3 * i], v = r[3 * i + 1], w = r[3 * i + 2];
      const auto& m = own_[i];
      own += (((m[0] * u + m[1] * v) + m[2] * w) * u + ((m[3] * u + m[4] * v) + m[5] * w) * v) + ((m[6] * u + m[7] * v) + m[8] * w) * w;
      for (const Share& share : near_[i]) {
        Number* to = sums + 3 * static_cast<std::size_t>(share.point);
        to[0] += share.weight * u;
        to[1] += share.weight * v;
        to[2] += share.weight * w;
      }
    }
    for (std::size_t k = 0; k < unknowns; ++k) {
      const float* row = inverse_.data() + k * unknowns;
      Number part[4] = {};  // sums side by side
      std::size_t l = 0;
      for (; l + 4 <= unknowns; l += 4)
        for (std::size_t p = 0; p < 4; ++p) part[p] += row[l + p] * sums[l + p];
      for (; l < unknowns; ++l) part[0] += row[l] * sums[l];
      answers[k] = (part[0] + part[1]) + (part[2] + part[3]);
      own += sums[k] * answers[k];
    }
    product = own;
  }
  template <class Number>
  void measure(const Number* r, Number& product) noexcept {
    measure(r, product, [](std::size_t) {});
  }

  /// Calls take(k, (M r)[k]) for each k; r as it was measured last.
  template <class Number, class Take>
  void each_answer(const Number* r, Take take) noexcept {
    const Number* answers = space<Number>(answers_, answers_of_columns_).data();
    for (std::size_t i = 0; i < own_.size(); ++i) {
      const auto& m = own_[i];
      const Number u = r[3 * i], v = r[3 * i + 1], w = r[3 * i + 2];
      Number a = (m[0] * u + m[1] * v) + m[2] * w, b = (m[3] * u + m[4] * v) + m[5] * w, c = (m[6] * u + m[7] * v) + m[8] * w;
      for (const Share& share : near_[i]) {
        const Number* from = answers + 3 * static_cast<std::size_t>(share.point);
        a += share.weight * from[0];
        b += share.weight * from[1];
        c += share.weight * from[2];
      }
      take(3 * i, a);
      take(3 * i + 1, b);
      take(3 * i + 2, c);
    }
  }

 private:
  struct Share {
    std::int32_t point = 0;
    float weight = 0.0F;
  };

  template <class Number>
  static std::vector<Number>& space(std::vector<float>& one, std::vector<Columns>& many) noexcept {
    if constexpr (sizeof(Number) == sizeof(float))
      return one;
    else
      return many;
  }

  std::int32_t coarse_ = 0;                 // points
  std::vector<std::array<float, 9>> own_;   // inverse of each node's own block, m/N
  std::vector<std::array<Share, 8>> near_;  // coarse points that a node hangs on
  std::vector<float> inverse_;              // of the coarse matrix, m/N
  std::vector<float> sums_, answers_;
  std::vector<Columns> sums_of_columns_, answers_of_columns_;
};

}  // namespace palpate::deformable
