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

/// Sixteen columns (right-hand sides) processed side by side in vector registers.
using Columns [[gnu::vector_size(64)]] = float;

/// Symmetric sparse matrix B + G^T G in single precision. B has 3 x 3 blocks: each block row belongs to one node, and only blocks (i, j)
/// with i <= j are stored. Each row of G is a sparse vector; the product G^T G is not formed. Multiplies one column (Number = float) or
/// sixteen (Number = Columns); entries are numbered 3 x node + axis. Not thread-safe: multiply() uses a workspace of the object.
class BlockMatrix {
 public:
  using Pair = std::pair<std::int32_t, std::int32_t>;

  BlockMatrix() = default;

  /// Allocate the sparsity pattern. `pairs` lists the nodes (i, j), i <= j, of B in ascending order; every (i, i) must be included.
  /// `factors` lists the (row, node) of G in ascending order.
  BlockMatrix(std::int32_t nodes, const std::vector<Pair>& pairs, const std::vector<Pair>& factors = {})
      : begin_(static_cast<std::size_t>(nodes) + 1),
        factor_begin_(factors.empty() ? 1 : static_cast<std::size_t>(factors.back().first) + 2),
        factor_(factors.size()),
        input_(static_cast<std::size_t>(nodes)),
        output_(static_cast<std::size_t>(nodes)) {
    fill(pairs, begin_, column_);
    fill(factors, factor_begin_, factor_column_);
    block_.resize(column_.size() + 1);  // one padding block: four() reads four floats at a time
  }

  [[nodiscard]] std::size_t nodes() const noexcept { return begin_.empty() ? 0 : begin_.size() - 1; }
  void set_zero() noexcept {
    std::fill(block_.begin(), block_.end(), Block{});
    std::fill(factor_.begin(), factor_.end(), Four{});
  }

  /// Return the index of the block of nodes i <= j. The block must exist.
  [[nodiscard]] std::size_t block_index(std::int32_t i, std::int32_t j) const noexcept { return find(begin_, column_, i, j); }
  /// Return the index of the entry of G in `row` at `node`. The entry must exist.
  [[nodiscard]] std::size_t factor_index(std::int32_t row, std::int32_t node) const noexcept {
    return find(factor_begin_, factor_column_, row, node);
  }
  [[nodiscard]] std::size_t factor_rows() const noexcept { return factor_begin_.size() - 1; }

  /// The nine entries of a block, row-major.
  [[nodiscard]] float* block(std::size_t at) noexcept { return block_[at].data(); }
  [[nodiscard]] const float* block(std::size_t at) const noexcept { return block_[at].data(); }
  /// The three values of an entry of G, and a zero.
  [[nodiscard]] float* factor(std::size_t at) noexcept { return reinterpret_cast<float*>(&factor_[at]); }
  /// The diagonal block of a node, without G^T G.
  [[nodiscard]] const float* diagonal_block(std::size_t node) const noexcept {
    return block_[static_cast<std::size_t>(begin_[node])].data();
  }

  /// Call visit(j, block) for each stored block of row i: the diagonal block, then those with j > i.
  template <class Visit>
  void for_each_in_row(std::int32_t i, Visit visit) const noexcept {
    for (std::int32_t k = begin_[static_cast<std::size_t>(i)]; k < begin_[static_cast<std::size_t>(i) + 1]; ++k)
      visit(column_[static_cast<std::size_t>(k)], block_[static_cast<std::size_t>(k)].data());
  }

  /// Call visit(node, values) for each entry of a row of G.
  template <class Visit>
  void for_each_factor(std::size_t row, Visit visit) const noexcept {
    for (auto k = static_cast<std::size_t>(factor_begin_[row]); k < static_cast<std::size_t>(factor_begin_[row + 1]); ++k)
      visit(factor_column_[k], reinterpret_cast<const float*>(&factor_[k]));
  }

  /// Compute y = A x and `product` = x . y for each column.
  void multiply(const float* x, float* y, float& product) const noexcept {
    for (std::size_t i = 0; i < nodes(); ++i) {
      input_[i] = Four{x[3 * i], x[3 * i + 1], x[3 * i + 2], 0.0F};
      output_[i] = Four{};
    }
    for (std::size_t i = 0; i < nodes(); ++i) {
      const Four xi = input_[i];
      auto k = static_cast<std::size_t>(begin_[i]);
      Four a = four(k, 0) * xi, b = four(k, 3) * xi, c = four(k, 6) * xi;  // lane sums give the row of A x
      for (++k; k < static_cast<std::size_t>(begin_[i + 1]); ++k) {
        const Four first = four(k, 0), second = four(k, 3), third = four(k, 6);
        const auto j = static_cast<std::size_t>(column_[k]);
        const Four xj = input_[j];
        a += first * xj;
        b += second * xj;
        c += third * xj;
        output_[j] += (xi[0] * first + xi[1] * second) + xi[2] * third;
      }
      output_[i] += Four{(a[0] + a[1]) + a[2], (b[0] + b[1]) + b[2], (c[0] + c[1]) + c[2], 0.0F};
    }
    for (std::size_t row = 0; row < factor_rows(); ++row) {
      const auto from = static_cast<std::size_t>(factor_begin_[row]), to = static_cast<std::size_t>(factor_begin_[row + 1]);
      Four lanes{};
      for (std::size_t k = from; k < to; ++k) lanes += factor_[k] * input_[static_cast<std::size_t>(factor_column_[k])];
      const float along = (lanes[0] + lanes[1]) + lanes[2];
      for (std::size_t k = from; k < to; ++k) output_[static_cast<std::size_t>(factor_column_[k])] += along * factor_[k];
    }
    Four sum{};
    for (std::size_t i = 0; i < nodes(); ++i) {
      sum += input_[i] * output_[i];
      for (std::size_t a = 0; a < 3; ++a) y[3 * i + a] = output_[i][a];
    }
    product = (sum[0] + sum[1]) + sum[2];
  }

  void multiply(const Columns* x, Columns* y, Columns& product) const noexcept {
    std::fill(y, y + 3 * nodes(), Columns{});
    Columns diagonal_part{}, upper_part{};
    for (std::size_t i = 0; i < nodes(); ++i) {
      const Columns u = x[3 * i], v = x[3 * i + 1], w = x[3 * i + 2];
      auto k = static_cast<std::size_t>(begin_[i]);
      const Block& d = block_[k];
      const Columns p = (d[0] * u + d[1] * v) + d[2] * w, q = (d[3] * u + d[4] * v) + d[5] * w, r = (d[6] * u + d[7] * v) + d[8] * w;
      Columns a{}, b{}, c{};
      for (++k; k < static_cast<std::size_t>(begin_[i + 1]); ++k) {
        const std::size_t j = 3 * static_cast<std::size_t>(column_[k]);
        const Columns* xj = x + j;
        const Block& m = block_[k];
        a += (m[0] * xj[0] + m[1] * xj[1]) + m[2] * xj[2];
        b += (m[3] * xj[0] + m[4] * xj[1]) + m[5] * xj[2];
        c += (m[6] * xj[0] + m[7] * xj[1]) + m[8] * xj[2];
        y[j] += (m[0] * u + m[3] * v) + m[6] * w;
        y[j + 1] += (m[1] * u + m[4] * v) + m[7] * w;
        y[j + 2] += (m[2] * u + m[5] * v) + m[8] * w;
      }
      diagonal_part += (p * u + q * v) + r * w;
      upper_part += (a * u + b * v) + c * w;
      y[3 * i] += a + p;
      y[3 * i + 1] += b + q;
      y[3 * i + 2] += c + r;
    }
    for (std::size_t row = 0; row < factor_rows(); ++row) {
      const auto from = static_cast<std::size_t>(factor_begin_[row]), to = static_cast<std::size_t>(factor_begin_[row + 1]);
      Columns along{};
      for (std::size_t k = from; k < to; ++k) {
        const Columns* xj = x + 3 * static_cast<std::size_t>(factor_column_[k]);
        along += (factor_[k][0] * xj[0] + factor_[k][1] * xj[1]) + factor_[k][2] * xj[2];
      }
      for (std::size_t k = from; k < to; ++k) {
        Columns* yj = y + 3 * static_cast<std::size_t>(factor_column_[k]);
        for (int a = 0; a < 3; ++a) yj[a] += factor_[k][a] * along;
      }
      diagonal_part += along * along;
    }
    product = diagonal_part + (upper_part + upper_part);
  }

 private:
  using Block = std::array<float, 9>;
  using Four [[gnu::vector_size(16)]] = float;

  /// Write a pattern by rows. `begin` has a zero for each row and one more.
  static void fill(const std::vector<Pair>& pairs, std::vector<std::int32_t>& begin, std::vector<std::int32_t>& column) {
    for (const auto& [i, j] : pairs) {
      ++begin[static_cast<std::size_t>(i) + 1];
      column.push_back(j);
    }
    for (std::size_t i = 0; i + 1 < begin.size(); ++i) begin[i + 1] += begin[i];
  }
  static std::size_t find(const std::vector<std::int32_t>& begin, const std::vector<std::int32_t>& column, std::int32_t i,
                          std::int32_t j) noexcept {
    const auto row = static_cast<std::size_t>(i);
    const auto from = column.begin() + begin[row], to = column.begin() + begin[row + 1];
    return static_cast<std::size_t>(std::lower_bound(from, to, j) - column.begin());
  }

  /// Load four floats from entry `at` of a block on.
  [[nodiscard]] Four four(std::size_t block, std::size_t at) const noexcept {
    Four out;
    std::memcpy(&out, block_[block].data() + at, sizeof out);
    return out;
  }

  std::vector<std::int32_t> begin_;                            // index of each row in column_
  std::vector<std::int32_t> column_;                           // node of each block, ascending within a row
  std::vector<Block> block_;                                   // and one padding block of zeros
  std::vector<std::int32_t> factor_begin_{0}, factor_column_;  // of G, as begin_ and column_
  std::vector<Four> factor_;                                   // three values and a zero
  mutable std::vector<Four> input_, output_;                   // workspace: one column, three entries and a zero per node
};

}  // namespace palpate::deformable
