#pragma once

#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tangential_compliance.hpp"
#include "palpate/math/shared_buffer.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Massless linear elastic body: surface compliance condensed from finite elements (James & Pai 1999), along the inward normals.
class Compliance {
 public:
  Compliance() = default;
  /// Zero compliance of `nodes` nodes, for set().
  explicit Compliance(std::size_t nodes) : count_(nodes), normal_(nodes * nodes) {}

  /// Project the full compliance onto the normals. `full` is 3n x 3n [m/N], symmetric; row 3 x node + axis. Stores n^2 values in single
  /// precision, and 4 n^2 more if `tangential` (required by friction).
  Compliance(const SurfaceNodes& nodes, const float* full, bool tangential = false)
      : count_(static_cast<std::size_t>(nodes.size())), normal_(count_ * count_) {
    const std::size_t row = 3 * count_;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vector3<>& ni = nodes.normal(static_cast<std::int32_t>(i));
      for (std::size_t j = 0; j <= i; ++j) {
        const Vector3<>& nj = nodes.normal(static_cast<std::int32_t>(j));
        double sum = 0.0;
        for (std::size_t a = 0; a < 3; ++a) {
          const float* c = full + (3 * i + a) * row + 3 * j;
          sum += ni[static_cast<int>(a)] *
                 (static_cast<double>(c[0]) * nj[0] + static_cast<double>(c[1]) * nj[1] + static_cast<double>(c[2]) * nj[2]);
        }
        normal_[i * count_ + j] = normal_[j * count_ + i] = static_cast<float>(sum);
      }
    }
    if (tangential) tangential_ = TangentialCompliance(nodes, full);
  }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(normal_[static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j)]);
  }
  /// Set entries (i, j) and (j, i) [m/N].
  void set(std::int32_t i, std::int32_t j, double value) noexcept {
    normal_[static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j)] = static_cast<float>(value);
    normal_[static_cast<std::size_t>(j) * count_ + static_cast<std::size_t>(i)] = static_cast<float>(value);
  }
  [[nodiscard]] bool has_tangential() const noexcept { return !tangential_.empty(); }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept { return tangential_(i, j); }
  /// Set block (i, j) and its transpose (j, i) [m/N].
  void set_tangential(std::int32_t i, std::int32_t j, const Eigen::Matrix2d& block) noexcept { tangential_.set(i, j, block); }
  [[nodiscard]] double free_displacement(std::int32_t) const noexcept { return 0.0; }
  [[nodiscard]] bool group_free_displacement_at_least(std::size_t, double value) const noexcept { return value <= 0.0; }
  void advance(const std::int32_t*, const double*, int) noexcept {}
  void reset() noexcept {}

 private:
  std::size_t count_ = 0;
  SharedBuffer<float> normal_;  // n x n, m/N
  TangentialCompliance tangential_;
};

}  // namespace palpate::deformable
