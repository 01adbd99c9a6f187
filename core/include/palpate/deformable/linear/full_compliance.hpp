#pragma once

#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/shared_buffer.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Surface compliance of a static elastic body in all three directions: a 3 x 3 block per pair of nodes, single precision, 36 n^2 bytes.
/// Copies share the blocks.
class FullCompliance {
 public:
  FullCompliance() = default;

  /// Copy the compliance of `nodes` nodes. `full` is 3n x 3n [m/N], symmetric positive definite; row 3 x node + axis.
  FullCompliance(std::size_t nodes, const float* full) : FullCompliance(nodes) {
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j < count_; ++j) set(i, j, symmetric(full, i, j));
  }

  /// Copy the compliance. `full` is 3n x 3n [m/N], symmetric positive definite; row 3 x node + axis.
  ///
  /// With `sideways` below 1 the contact counts only this fraction of the displacement across a node's normal at rest: the blocks become
  /// B_i C_ij B_j, B = N N^T + sideways (1 - N N^T). They stay positive definite, so forces keep an energy. 1 is linear elasticity.
  FullCompliance(const SurfaceNodes& nodes, const float* full, double sideways = 1.0)
      : FullCompliance(static_cast<std::size_t>(nodes.size())) {
    for (std::size_t i = 0; i < count_; ++i) {
      const Matrix3<float> left = counted(nodes, i, sideways);
      for (std::size_t j = 0; j < count_; ++j) {
        const Matrix3<float> block = symmetric(full, i, j);
        set(i, j, sideways == 1.0 ? block : (left * block * counted(nodes, j, sideways)).eval());
      }
    }
  }

  [[nodiscard]] std::int32_t size() const noexcept { return static_cast<std::int32_t>(count_); }

  /// Displacement of node i per force on node j [m/N]: nine entries, row-major. The blocks of one i are contiguous.
  [[nodiscard]] const float* block(std::int32_t i, std::int32_t j) const noexcept {
    return blocks_.data() + 9 * (static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j));
  }

 private:
  explicit FullCompliance(std::size_t nodes) : count_(nodes), blocks_(9 * nodes * nodes) {}

  /// Block (i, j): the mean with the transposed entries, so that the compliance is exactly symmetric.
  [[nodiscard]] Matrix3<float> symmetric(const float* full, std::size_t i, std::size_t j) const {
    const std::size_t row = 3 * count_;
    Matrix3<float> block;
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        block(static_cast<int>(a), static_cast<int>(b)) =
            0.5F * (full[(3 * i + a) * row + 3 * j + b] + full[(3 * j + b) * row + 3 * i + a]);
    return block;
  }

  void set(std::size_t i, std::size_t j, const Matrix3<float>& block) {
    float* out = blocks_.data() + 9 * (i * count_ + j);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) out[3 * a + b] = block(a, b);
  }

  [[nodiscard]] static Matrix3<float> counted(const SurfaceNodes& nodes, std::size_t i, double sideways) {
    const Vector3<>& n = nodes.normal(static_cast<std::int32_t>(i));
    return (sideways * Matrix3<>::Identity() + (1.0 - sideways) * n * n.transpose()).cast<float>();
  }

  std::size_t count_ = 0;
  SharedBuffer<float> blocks_;
};

}  // namespace palpate::deformable
