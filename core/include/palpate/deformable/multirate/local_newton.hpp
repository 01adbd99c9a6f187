#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/multirate/local_model.hpp"

namespace palpate::deformable {

/// Newton step (I + s H C) x = r of the contact of a local model, over the nodes that are added. The factor is kept for later steps.
class LocalNewton {
 public:
  LocalNewton() { row_of_.fill(-1); }

  void clear() noexcept {
    for (std::size_t a = 0; a < count_; ++a) row_of_[node_[a]] = -1;
    count_ = 0;
  }

  /// Add a node without stiffness, if it is new. Nodes below zero do not move and have no row.
  std::size_t add_row(std::int16_t node) noexcept {
    const auto n = static_cast<std::size_t>(node);
    if (row_of_[n] >= 0) return static_cast<std::size_t>(row_of_[n]);
    const std::size_t a = count_++;
    row_of_[n] = static_cast<std::int16_t>(a);
    node_[a] = n;
    for (std::size_t b = 0; b <= a; ++b) stiffness(a, b) = stiffness(b, a) = 0.0F;
    return a;
  }
  [[nodiscard]] bool has_row(std::size_t node) const noexcept { return row_of_[node] >= 0; }

  /// Add to the symmetric stiffness H between two nodes, N/m.
  void add(std::int16_t one, std::int16_t two, float value) noexcept {
    if (one < 0 || two < 0) return;
    const std::size_t a = add_row(one), b = add_row(two);
    stiffness(a, b) += value;
    if (a != b) stiffness(b, a) += value;
  }

  /// Factor the system of the added nodes.
  void factor(const LocalModel& model, float scale) noexcept {
    width_ = (count_ + lanes - 1) / lanes * lanes;
    for (std::size_t a = 0; a < count_; ++a) {
      const float* row = model.row(node_[a]);
      for (std::size_t b = 0; b < width_; ++b) compliance_[a * capacity + b] = b < count_ ? scale * row[node_[b]] : 0.0F;
    }
    for (std::size_t a = 0; a < count_; ++a) {
      float* line = system_.data() + a * capacity;
      std::fill_n(line, width_, 0.0F);
      for (std::size_t c = 0; c < count_; ++c)
        if (const float h = stiffness(a, c); h != 0.0F) add_multiple(line, compliance_.data() + c * capacity, h, 0);
      line[a] += 1.0F;
    }
    eliminate();
  }

  /// Solve for x with r = right(node), over all nodes; zero at nodes without a row.
  template <class Right, std::size_t size>
  void solve(Right right, std::array<float, size>& x) noexcept {
    for (std::size_t a = 0; a < count_; ++a) right_[a] = right(node_[a]);
    for (std::size_t k = 0; k < count_; ++k) {
      std::swap(right_[k], right_[exchange_[k]]);
      for (std::size_t b = 0; b < k; ++b) right_[k] -= system_[k * capacity + b] * right_[b];
    }
    for (std::size_t k = count_; k-- > 0;) {
      float sum = right_[k];
      for (std::size_t b = k + 1; b < count_; ++b) sum -= system_[k * capacity + b] * right_[b];
      right_[k] = sum * pivot_[k];
    }
    x.fill(0.0F);
    for (std::size_t a = 0; a < count_; ++a) x[node_[a]] = right_[a];
  }

 private:
  static constexpr std::size_t capacity = LocalModel::capacity;
  static constexpr std::size_t lanes = detail::float_lanes;

  [[nodiscard]] float& stiffness(std::size_t a, std::size_t b) noexcept { return stiffness_[a * capacity + b]; }

  /// Add `factor` times a line to another, from entry `from` on, a multiple of the lanes.
  [[gnu::always_inline]] void add_multiple(float* to, const float* line, float factor, std::size_t from) const noexcept {
    for (std::size_t b = from; b < width_; b += lanes) *detail::as_packs(to + b) += factor * *detail::as_packs(line + b);
  }

  /// Factor the system in place by Gaussian elimination with row pivoting.
  void eliminate() noexcept {
    for (std::size_t k = 0; k < count_; ++k) {
      std::size_t pivot = k;
      for (std::size_t a = k + 1; a < count_; ++a)
        if (std::abs(system_[a * capacity + k]) > std::abs(system_[pivot * capacity + k])) pivot = a;
      exchange_[k] = pivot;
      float* line = system_.data() + k * capacity;
      if (pivot != k) std::swap_ranges(line, line + width_, system_.data() + pivot * capacity);
      const float inverse = line[k] != 0.0F ? 1.0F / line[k] : 0.0F;
      for (std::size_t a = k + 1; a < count_; ++a) {
        float* row = system_.data() + a * capacity;
        const float multiplier = row[k] * inverse;
        if (multiplier == 0.0F) continue;
        subtract_from(row, line, multiplier, k + 1);
        row[k] = multiplier;
      }
      pivot_[k] = inverse;
    }
  }

  /// Subtract `factor` times a line from another, from entry `from` on.
  [[gnu::always_inline]] void subtract_from(float* to, const float* line, float factor, std::size_t from) const noexcept {
    for (; from % lanes != 0 && from < width_; ++from) to[from] -= factor * line[from];
    if (from < width_) add_multiple(to, line, -factor, from);
  }

  std::size_t count_ = 0, width_ = 0;  // number of rows; length of a line, padded
  std::array<std::int16_t, capacity> row_of_{};
  std::array<std::size_t, capacity> node_{};                         // of each row
  std::array<float, capacity * capacity> stiffness_{};               // H, by rows
  alignas(64) std::array<float, capacity * capacity> compliance_{};  // s C, by rows
  alignas(64) std::array<float, capacity * capacity> system_{};      // factors
  std::array<float, capacity> pivot_{}, right_{};                    // pivot_: inverse
  std::array<std::size_t, capacity> exchange_{};                     // row that was exchanged with each
};

}  // namespace palpate::deformable
