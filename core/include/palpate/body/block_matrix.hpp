#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate {

/// Sixteen right sides, solved side by side in vector registers.
using Columns [[gnu::vector_size(64)]] = float;

/// A symmetric matrix of 3 x 3 blocks, one row of blocks for each node, in single precision. Multiplies one column (Number = float) or
/// sixteen (Number = Columns), row 3 x node + axis.
class BlockMatrix {
 public:
  BlockMatrix() = default;

  /// `pairs`: nodes (i, j) with i <= j that have a block; each node must have its own.
  BlockMatrix(std::int32_t nodes, std::vector<std::pair<std::int32_t, std::int32_t>> pairs) : begin_(static_cast<std::size_t>(nodes) + 1) {
    const std::size_t count = pairs.size();
    for (std::size_t k = 0; k < count; ++k)
      if (pairs[k].first != pairs[k].second) pairs.emplace_back(pairs[k].second, pairs[k].first);
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    for (const auto& [i, j] : pairs) ++begin_[static_cast<std::size_t>(i) + 1];
    for (std::size_t i = 0; i + 1 < begin_.size(); ++i) begin_[i + 1] += begin_[i];
    for (const auto& pair : pairs) column_.push_back(pair.second);
    block_.resize(column_.size());
  }

  [[nodiscard]] std::size_t nodes() const noexcept { return begin_.empty() ? 0 : begin_.size() - 1; }
  void clear() noexcept { std::fill(block_.begin(), block_.end(), Block{}); }

  /// Where the block of nodes i and j is, which must exist.
  [[nodiscard]] std::size_t find(std::int32_t i, std::int32_t j) const noexcept {
    const auto row = static_cast<std::size_t>(i);
    const auto from = column_.begin() + begin_[row], to = column_.begin() + begin_[row + 1];
    return static_cast<std::size_t>(std::lower_bound(from, to, j) - column_.begin());
  }

  /// Nine numbers, row by row.
  [[nodiscard]] float* block(std::size_t at) noexcept { return block_[at].data(); }
  [[nodiscard]] const float* block(std::size_t at) const noexcept { return block_[at].data(); }

  /// Calls take(j, block) for each block of node i's row.
  template <class Take>
  void row(std::int32_t i, Take take) const noexcept {
    for (std::int32_t k = begin_[static_cast<std::size_t>(i)]; k < begin_[static_cast<std::size_t>(i) + 1]; ++k)
      take(column_[static_cast<std::size_t>(k)], block_[static_cast<std::size_t>(k)].data());
  }

  /// y = this x.
  template <class Number>
  void multiply(const Number* x, Number* y) const noexcept {
    for (std::size_t i = 0; i < nodes(); ++i, y += 3) {
      Number a{}, b{}, c{};
      for (auto k = static_cast<std::size_t>(begin_[i]); k < static_cast<std::size_t>(begin_[i + 1]); ++k) {
        const Number* v = x + 3 * static_cast<std::size_t>(column_[k]);
        const Block& m = block_[k];
        a += (m[0] * v[0] + m[1] * v[1]) + m[2] * v[2];
        b += (m[3] * v[0] + m[4] * v[1]) + m[5] * v[2];
        c += (m[6] * v[0] + m[7] * v[1]) + m[8] * v[2];
      }
      y[0] = a;
      y[1] = b;
      y[2] = c;
    }
  }

 private:
  using Block = std::array<float, 9>;

  std::vector<std::int32_t> begin_;   // of each row in column_
  std::vector<std::int32_t> column_;  // node of each block, rising in a row
  std::vector<Block> block_;
};

}  // namespace palpate
