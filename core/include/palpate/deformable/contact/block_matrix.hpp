#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Sixteen right sides, solved side by side in vector registers.
using Columns [[gnu::vector_size(64)]] = float;

/// A symmetric matrix of 3 x 3 blocks in single precision, one row of blocks for each node; only blocks (i, j) with i <= j are kept.
/// Multiplies one column (Number = float) or sixteen (Number = Columns), row 3 x node + axis. One thread at a time.
class BlockMatrix {
 public:
  BlockMatrix() = default;

  /// `pairs`: nodes (i, j) with i <= j that have a block, rising; each node must have its own.
  BlockMatrix(std::int32_t nodes, const std::vector<std::pair<std::int32_t, std::int32_t>>& pairs)
      : begin_(static_cast<std::size_t>(nodes) + 1), from_(static_cast<std::size_t>(nodes)), to_(static_cast<std::size_t>(nodes)) {
    for (const auto& [i, j] : pairs) {
      ++begin_[static_cast<std::size_t>(i) + 1];
      column_.push_back(j);
    }
    for (std::size_t i = 0; i + 1 < begin_.size(); ++i) begin_[i + 1] += begin_[i];
    block_.resize(column_.size() + 1);  // one more, for rows are read by fours
  }

  [[nodiscard]] std::size_t nodes() const noexcept { return begin_.empty() ? 0 : begin_.size() - 1; }
  void clear() noexcept { std::fill(block_.begin(), block_.end(), Block{}); }

  /// Where the block of nodes i <= j is, which must exist.
  [[nodiscard]] std::size_t find(std::int32_t i, std::int32_t j) const noexcept {
    const auto row = static_cast<std::size_t>(i);
    const auto from = column_.begin() + begin_[row], to = column_.begin() + begin_[row + 1];
    return static_cast<std::size_t>(std::lower_bound(from, to, j) - column_.begin());
  }

  /// Nine numbers, row by row.
  [[nodiscard]] float* block(std::size_t at) noexcept { return block_[at].data(); }
  [[nodiscard]] const float* block(std::size_t at) const noexcept { return block_[at].data(); }
  /// A node's own.
  [[nodiscard]] const float* own(std::size_t node) const noexcept { return block_[static_cast<std::size_t>(begin_[node])].data(); }

  /// Calls take(j, block) for each block of node i's row that is kept: its own, then those of j > i.
  template <class Take>
  void row(std::int32_t i, Take take) const noexcept {
    for (std::int32_t k = begin_[static_cast<std::size_t>(i)]; k < begin_[static_cast<std::size_t>(i) + 1]; ++k)
      take(column_[static_cast<std::size_t>(k)], block_[static_cast<std::size_t>(k)].data());
  }

  /// y = this x, and `product` = x . y of each column.
  void multiply(const float* x, float* y, float& product) const noexcept {
    for (std::size_t i = 0; i < nodes(); ++i) {
      from_[i] = Four{x[3 * i], x[3 * i + 1], x[3 * i + 2], 0.0F};
      to_[i] = Four{};
    }
    for (std::size_t i = 0; i < nodes(); ++i) {
      const Four here = from_[i];
      auto k = static_cast<std::size_t>(begin_[i]);
      Four a = four(k, 0) * here, b = four(k, 3) * here, c = four(k, 6) * here;  // their sums are the row's products
      for (++k; k < static_cast<std::size_t>(begin_[i + 1]); ++k) {
        const Four first = four(k, 0), second = four(k, 3), third = four(k, 6);
        const auto j = static_cast<std::size_t>(column_[k]);
        const Four there = from_[j];
        a += first * there;
        b += second * there;
        c += third * there;
        to_[j] += (here[0] * first + here[1] * second) + here[2] * third;
      }
      to_[i] += Four{(a[0] + a[1]) + a[2], (b[0] + b[1]) + b[2], (c[0] + c[1]) + c[2], 0.0F};
    }
    Four sum{};
    for (std::size_t i = 0; i < nodes(); ++i) {
      sum += from_[i] * to_[i];
      for (std::size_t a = 0; a < 3; ++a) y[3 * i + a] = to_[i][a];
    }
    product = (sum[0] + sum[1]) + sum[2];
  }

  void multiply(const Columns* x, Columns* y, Columns& product) const noexcept {
    std::fill(y, y + 3 * nodes(), Columns{});
    Columns once{}, twice{};
    for (std::size_t i = 0; i < nodes(); ++i) {
      const Columns u = x[3 * i], v = x[3 * i + 1], w = x[3 * i + 2];
      auto k = static_cast<std::size_t>(begin_[i]);
      const Block& own = block_[k];
      const Columns p = (own[0] * u + own[1] * v) + own[2] * w, q = (own[3] * u + own[4] * v) + own[5] * w,
                    r = (own[6] * u + own[7] * v) + own[8] * w;
      Columns a{}, b{}, c{};
      for (++k; k < static_cast<std::size_t>(begin_[i + 1]); ++k) {
        const std::size_t j = 3 * static_cast<std::size_t>(column_[k]);
        const Columns* there = x + j;
        const Block& m = block_[k];
        a += (m[0] * there[0] + m[1] * there[1]) + m[2] * there[2];
        b += (m[3] * there[0] + m[4] * there[1]) + m[5] * there[2];
        c += (m[6] * there[0] + m[7] * there[1]) + m[8] * there[2];
        y[j] += (m[0] * u + m[3] * v) + m[6] * w;
        y[j + 1] += (m[1] * u + m[4] * v) + m[7] * w;
        y[j + 2] += (m[2] * u + m[5] * v) + m[8] * w;
      }
      once += (p * u + q * v) + r * w;
      twice += (a * u + b * v) + c * w;
      y[3 * i] += a + p;
      y[3 * i + 1] += b + q;
      y[3 * i + 2] += c + r;
    }
    product = once + (twice + twice);
  }

 private:
  using Block = std::array<float, 9>;
  using Four [[gnu::vector_size(16)]] = float;

  /// Four numbers from a block's number `at` on.
  [[nodiscard]] Four four(std::size_t block, std::size_t at) const noexcept {
    Four out;
    std::memcpy(&out, block_[block].data() + at, sizeof out);
    return out;
  }

  std::vector<std::int32_t> begin_;      // of each row in column_
  std::vector<std::int32_t> column_;     // node of each block, rising in a row
  std::vector<Block> block_;             // and one that is zero
  mutable std::vector<Four> from_, to_;  // work space: one column, three numbers and a zero for each node
};

}  // namespace palpate::deformable
