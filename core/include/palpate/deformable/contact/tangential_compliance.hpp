#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/shared_buffer.hpp"

namespace palpate::deformable {

/// Compliance of a surface in the nodes' tangent planes (basis: SurfaceNodes::tangent_basis), in single precision.
class TangentialCompliance {
 public:
  TangentialCompliance() = default;

  /// Zero compliance of `nodes` nodes.
  explicit TangentialCompliance(std::size_t nodes)
      : count_(nodes), blocks_(nodes * nodes, Eigen::Matrix<float, 2, 2, Eigen::DontAlign>::Zero()) {}

  /// Project the full compliance. `full` is 3n x 3n [m/N], symmetric; row 3 x node + axis.
  TangentialCompliance(const SurfaceNodes& nodes, const float* full)
      : count_(static_cast<std::size_t>(nodes.size())), blocks_(count_ * count_) {
    using Rows = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
    const Eigen::OuterStride<> row(static_cast<Eigen::Index>(3 * count_));
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        const Eigen::Map<const Rows, 0, Eigen::OuterStride<>> block(full + 9 * i * count_ + 3 * j, row);
        const Eigen::Matrix2d projected = nodes.tangent_basis(static_cast<std::int32_t>(i)).transpose() * block.cast<double>() *
                                          nodes.tangent_basis(static_cast<std::int32_t>(j));
        blocks_[i * count_ + j] = projected.cast<float>();
        blocks_[j * count_ + i] = projected.transpose().cast<float>();
      }
  }

  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

  /// Set block (i, j) and its transpose (j, i).
  void set(std::int32_t i, std::int32_t j, const Eigen::Matrix2d& block) noexcept {
    const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
    blocks_[a * count_ + b] = block.cast<float>();
    blocks_[b * count_ + a] = block.transpose().cast<float>();
  }

  /// Displacement of node i per unit force on node j, m/N.
  [[nodiscard]] Eigen::Matrix2d operator()(std::int32_t i, std::int32_t j) const noexcept {
    return blocks_[static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j)].cast<double>();
  }

 private:
  std::size_t count_ = 0;
  SharedBuffer<Eigen::Matrix<float, 2, 2, Eigen::DontAlign>> blocks_;  // n x n
};

}  // namespace palpate::deformable
