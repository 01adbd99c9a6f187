#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "palpate/math/quad.hpp"

namespace palpate::math {

/// Sparse Cholesky factor of a positive definite matrix with a solver for three right-hand sides, one per axis.
///
/// Rows are ordered by approximate minimum degree. Up to eight columns along a path of the elimination tree form a supernode (Ashcraft &
/// Grimes 1989). In each pass the unknowns of a supernode are one product of a dense matrix of eight rows with the unknowns on which they
/// depend; the inverse of the supernode's own triangle is multiplied into that matrix. The numbers are in single precision, because they
/// are as many as fit into a cache: the relative error of a solution is about 1e-6. Solve for the change of a known solution to make the
/// error relative to the change. solve() does not allocate. Its results are the same bits for each width of the registers.
class SupernodalCholesky {
 public:
  SupernodalCholesky() = default;

  /// Factorize `matrix`; only its lower triangle is read.
  explicit SupernodalCholesky(const Eigen::SparseMatrix<double>& matrix) {
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky(matrix);
    positive_definite_ = cholesky.info() == Eigen::Success;
    if (!positive_definite_) return;
    const Eigen::SparseMatrix<double> lower = cholesky.matrixL();
    nonzeros_ = static_cast<std::size_t>(lower.nonZeros());
    std::vector<Columns> supernodes;
    for (Eigen::Index c = 0; c < lower.cols(); c += supernodes.back().count) supernodes.push_back(supernode_at(lower, c));
    std::vector<std::int32_t> slot_of;  // by row of the factor
    for (std::size_t s = 0; s < supernodes.size(); ++s)
      for (Eigen::Index i = 0; i < supernodes[s].count; ++i)
        slot_of.push_back(static_cast<std::int32_t>(s * 3 * width + static_cast<std::size_t>(i)));
    for (Eigen::Index row = 0; row < lower.cols(); ++row)
      slots_.push_back(slot_of[static_cast<std::size_t>(cholesky.permutationP().indices()[row])]);
    const Eigen::SparseMatrix<double> upper = lower.transpose();
    for (const Columns& s : supernodes) append_product(forward_, triangle(lower, s), upper, s, slot_of);
    for (std::size_t k = supernodes.size(); k-- > 0;)
      append_product(backward_, triangle(lower, supernodes[k]).transpose(), lower, supernodes[k], slot_of);
    workspace_.resize(supernodes.size() * 3);
  }

  /// Return whether the factorization succeeded; if false, solve() must not be called.
  [[nodiscard]] bool positive_definite() const noexcept { return positive_definite_; }
  [[nodiscard]] std::size_t nonzeros() const noexcept { return nonzeros_; }

  /// Solve in place. `right_hand_sides` has one entry per matrix row; the first three lanes are the right-hand sides, the last is zero.
  void solve(Quad* right_hand_sides) noexcept {
    const double scale = power_of_two_scale(right_hand_sides);
    float* const x = reinterpret_cast<float*>(workspace_.data());
    for (std::size_t i = 0; i < slots_.size(); ++i)
      for (std::size_t a = 0; a < 3; ++a)
        x[static_cast<std::size_t>(slots_[i]) + width * a] = static_cast<float>(scale * right_hand_sides[i][a]);
    for (const Product& p : forward_.products) apply(forward_, p);
    for (const Product& p : backward_.products) apply(backward_, p);
    const double back = 1.0 / scale;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const float* y = x + slots_[i];
      right_hand_sides[i] = back * Quad(y[0], y[width], y[2 * width], 0.0);
    }
  }

 private:
  static constexpr std::size_t width = 8;  // columns of a supernode

  /// A number for each column of a supernode.
  struct alignas(32) Line {
    using Vector [[gnu::vector_size(32)]] = float;
    Vector v{};
  };

  /// A supernode: its first column, number of columns.
  struct Columns {
    Eigen::Index first, count;
  };

  /// The unknowns of a supernode as sums over a range of lines.
  struct Product {
    std::int32_t target;     // slot of the first unknown
    std::size_t begin, end;  // lines
  };

  /// Products of one pass. A line has the coefficients of a supernode's unknowns, one in each lane, for the number in slot `source`.
  struct Pass {
    std::vector<Product> products;
    std::vector<std::int32_t> sources;
    std::vector<Line> lines;
  };

  /// Return the columns from `first` on, up to `width`, each of which is the parent of the one before in the elimination tree.
  static Columns supernode_at(const Eigen::SparseMatrix<double>& lower, Eigen::Index first) {
    Columns s{first, 1};
    while (s.count < static_cast<Eigen::Index>(width)) {
      const Eigen::Index last = first + s.count - 1;
      const int begin = lower.outerIndexPtr()[last], end = lower.outerIndexPtr()[last + 1];
      if (end - begin < 2 || lower.innerIndexPtr()[begin + 1] != last + 1) break;
      ++s.count;
    }
    return s;
  }

  /// Return the inverse of a supernode's triangle.
  static Eigen::MatrixXd triangle(const Eigen::SparseMatrix<double>& lower, const Columns& s) {
    const Eigen::MatrixXd block = Eigen::MatrixXd(lower.middleCols(s.first, s.count)).middleRows(s.first, s.count);
    return block.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(s.count, s.count));
  }

  /// Append the product of a supernode: `inverse` times (its own numbers, less its columns of `off` times the others).
  static void append_product(Pass& pass, const Eigen::MatrixXd& inverse, const Eigen::SparseMatrix<double>& off, const Columns& s,
                             const std::vector<std::int32_t>& slot_of) {
    Product p{slot_of[static_cast<std::size_t>(s.first)], pass.lines.size(), 0};
    const auto append = [&](Eigen::Index row, const Eigen::VectorXd& coefficients) {
      Line line;
      for (Eigen::Index i = 0; i < s.count; ++i) line.v[i] = static_cast<float>(coefficients[i]);
      pass.lines.push_back(line);
      pass.sources.push_back(slot_of[static_cast<std::size_t>(row)]);
    };
    std::map<Eigen::Index, Eigen::VectorXd> others;
    for (Eigen::Index i = 0; i < s.count; ++i) {
      append(s.first + i, inverse.col(i));
      for (Eigen::SparseMatrix<double>::InnerIterator e(off, s.first + i); e; ++e) {
        if (e.row() >= s.first && e.row() < s.first + s.count) continue;
        others.try_emplace(e.row(), Eigen::VectorXd::Zero(s.count)).first->second[i] = -e.value();
      }
    }
    for (const auto& [row, coefficients] : others) append(row, inverse * coefficients);
    p.end = pass.lines.size();
    pass.products.push_back(p);
  }

  /// Return the power of two by which the right-hand sides are about 1e18: no number within 1e-56 of the largest underflows, and a tick
  /// does not slow down while a motion decays.
  double power_of_two_scale(const Quad* values) const noexcept {
    Quad largest(0.0);
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const Quad negative = -values[i], magnitude = select(values[i] < negative, negative, values[i]);
      largest = select(largest < magnitude, magnitude, largest);
    }
    const double most = std::max(std::max(largest[0], largest[1]), largest[2]);
    if (!(most > 1e-290) || !(most < 1e290)) return 1.0;
    int exponent = 0;
    std::frexp(most, &exponent);
    return std::ldexp(1.0, 60 - exponent);
  }

  [[gnu::always_inline]] static void add(const Line& line, const float* source, Line* sum) noexcept {
    for (std::size_t a = 0; a < 3; ++a) sum[a].v += line.v * source[width * a];
  }

  void apply(const Pass& pass, const Product& p) noexcept {
    float* const x = reinterpret_cast<float*>(workspace_.data());
    const Line* const lines = pass.lines.data();
    const std::int32_t* const sources = pass.sources.data();
    Line even[3], odd[3];
    std::size_t k = p.begin;
    for (; k + 1 < p.end; k += 2) {
      add(lines[k], x + sources[k], even);
      add(lines[k + 1], x + sources[k + 1], odd);
    }
    if (k < p.end) add(lines[k], x + sources[k], even);
    for (std::size_t a = 0; a < 3; ++a) workspace_[static_cast<std::size_t>(p.target) / width + a].v = even[a].v + odd[a].v;
  }

  bool positive_definite_ = false;
  std::size_t nonzeros_ = 0;
  std::vector<std::int32_t> slots_;  // by matrix row: its place in the workspace
  Pass forward_, backward_;
  std::vector<Line> workspace_;  // three axes of each supernode
};

}  // namespace palpate::math
