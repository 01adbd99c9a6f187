#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace palpate::deformable {

/// Unilateral contact on a linear body as a linear complementarity problem (LCP) of up to `capacity` rows. Find the forces f [N] with
///   f >= 0,  C f >= g,  f (C f - g) = 0
/// for the symmetric positive definite compliance C [m/N] and the penetration depths g [m]. A row is basic (active) if its force may be
/// positive. The basis of the previous step is the initial guess. The Cholesky factor of the basic rows is kept and updated as rows enter
/// and leave the basis.
///
/// Method: block principal pivoting (Judice & Pires 1994). All infeasible rows are exchanged at once. If that does not reduce their number,
/// only the infeasible row with the highest index is exchanged, which terminates (Murty 1974).
class ContactLcp {
 public:
  static constexpr int capacity = 128;

  ContactLcp()
      : compliance_(capacity, capacity),
        factor_(capacity, capacity),
        depth_(capacity),
        basis_force_(capacity),
        violation_(capacity),
        force_(capacity) {
    compliance_.setZero();
    factor_.setZero();
    basis_force_.setZero();
  }

  /// Compliance between rows a and b [m/N]. Set all entries in use, both triangles, before solve(). A diagonal entry may change at any
  /// step.
  double& compliance(int a, int b) noexcept { return compliance_(a, b); }
  double& depth(int a) noexcept { return depth_[a]; }
  [[nodiscard]] double force(int a) const noexcept { return force_[a]; }  ///< N, result of solve()

  /// Discard the factor and resize to `size` rows. `active(a)` selects the initial basis.
  template <class Active>
  void reset(int size, Active active) noexcept {
    size_ = size;
    basis_size_ = edits_ = 0;
    for (int a = 0; a < size; ++a) {
      row_of_[static_cast<std::size_t>(a)] = -1;
      if (active(a)) add_to_basis(a);
    }
  }

  /// Remove row `a`; the rows after it move up by one. The rest of the basis is kept.
  void remove(int a) noexcept {
    if (row_of_[static_cast<std::size_t>(a)] >= 0) remove_from_basis(a);
    for (int b = 0; b < size_; ++b) {
      if (b == a) continue;
      const int to = b < a ? b : b - 1;
      for (int c = a; c + 1 < size_; ++c) compliance_(b, c) = compliance_(b, c + 1);
      if (to != b) compliance_.row(to).head(size_ - 1) = compliance_.row(b).head(size_ - 1);
    }
    std::copy(row_of_.begin() + a + 1, row_of_.begin() + size_, row_of_.begin() + a);
    for (int p = 0; p < basis_size_; ++p)
      if (basis_[static_cast<std::size_t>(p)] > a) --basis_[static_cast<std::size_t>(p)];
    --size_;
    note_edit();
  }

  /// Insert a nonbasic row at index `a`; the rows from there on move down by one. Set its compliance, both triangles, before solve().
  void insert(int a) noexcept {
    for (int b = size_ - 1; b >= 0; --b) {
      for (int c = size_; c > a; --c) compliance_(b, c) = compliance_(b, c - 1);
      if (b >= a) compliance_.row(b + 1).head(size_ + 1) = compliance_.row(b).head(size_ + 1);
    }
    std::copy_backward(row_of_.begin() + a, row_of_.begin() + size_, row_of_.begin() + size_ + 1);
    row_of_[static_cast<std::size_t>(a)] = -1;
    for (int p = 0; p < basis_size_; ++p)
      if (basis_[static_cast<std::size_t>(p)] >= a) ++basis_[static_cast<std::size_t>(p)];
    ++size_;
    note_edit();
  }

  /// Set the diagonal entry of row `a` [m/N].
  void set_diagonal(int a, double compliance) noexcept {
    if (compliance_(a, a) == compliance) return;
    compliance_(a, a) = compliance;
    stale_ = stale_ || row_of_[static_cast<std::size_t>(a)] >= 0;
  }

  /// Add row `a` to the initial basis of the next solve().
  void suggest_active(int a) noexcept {
    if (row_of_[static_cast<std::size_t>(a)] == -1) add_to_basis(a);
  }

  [[nodiscard]] bool any_active() const noexcept { return basis_size_ > 0; }

  /// Number of bases examined by the last solve(): one if the previous basis was still feasible.
  [[nodiscard]] int iterations() const noexcept { return iterations_; }

  /// Solve for all rows. Return false if the iteration limit was reached: the forces then belong to an infeasible basis, with negative
  /// forces clamped to zero.
  bool solve() noexcept {
    if (stale_ || edits_ > max_edits) refactor();
    int fewest_infeasible = size_ + 1, trials_left = 3;
    bool found = false;
    for (iterations_ = 0; iterations_ < 10 * capacity && !found; ++iterations_) {
      solve_basis();
      const int infeasible = mark_infeasible();
      if (infeasible == 0) {
        found = true;
      } else if (infeasible < fewest_infeasible) {
        fewest_infeasible = infeasible;
        trials_left = 3;
        exchange_all();
      } else if (trials_left > 0) {
        --trials_left;
        exchange_all();
      } else {
        exchange_last();
      }
    }
    force_.head(size_).setZero();
    for (int p = 0; p < basis_size_; ++p) force_[basis_[static_cast<std::size_t>(p)]] = std::max(basis_force_[p], 0.0);
    return found;
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static constexpr int max_edits = 64;  // factor updates before a refactorization, to bound the accumulated round-off

  /// Recompute the factor for the present basis.
  void refactor() noexcept {
    std::array<bool, capacity> active{};
    for (int a = 0; a < size_; ++a) active[static_cast<std::size_t>(a)] = row_of_[static_cast<std::size_t>(a)] >= 0;
    reset(size_, [&active](int a) { return active[static_cast<std::size_t>(a)]; });
    stale_ = false;
  }

  /// Count an edit of the rows. Rows that were linearly dependent may be independent now.
  void note_edit() noexcept {
    ++edits_;
    for (int a = 0; a < size_; ++a)
      if (row_of_[static_cast<std::size_t>(a)] == -2) row_of_[static_cast<std::size_t>(a)] = -1;
  }

  /// Append row `a` to the basis, and one row to the factor. A row that is linearly dependent to round-off stays nonbasic.
  void add_to_basis(int a) noexcept {
    const int k = basis_size_;
    double pivot = compliance_(a, a);
    for (int p = 0; p < k; ++p) {
      const double sum = compliance_(a, basis_[static_cast<std::size_t>(p)]) - factor_.row(k).head(p).dot(factor_.row(p).head(p));
      factor_(k, p) = sum / factor_(p, p);
      pivot -= factor_(k, p) * factor_(k, p);
    }
    if (!(pivot > 1e-7 * compliance_(a, a))) {
      row_of_[static_cast<std::size_t>(a)] = -2;
      return;
    }
    factor_(k, k) = std::sqrt(pivot);
    basis_[static_cast<std::size_t>(k)] = a;
    row_of_[static_cast<std::size_t>(a)] = k;
    ++basis_size_;
  }

  /// Remove row `a` from the basis. Givens rotations of the columns restore the triangular form of the rows below.
  void remove_from_basis(int a) noexcept {
    const int at = row_of_[static_cast<std::size_t>(a)];
    for (int r = at; r + 1 < basis_size_; ++r) {
      factor_.row(r).head(r + 2) = factor_.row(r + 1).head(r + 2);
      basis_[static_cast<std::size_t>(r)] = basis_[static_cast<std::size_t>(r) + 1];
      row_of_[static_cast<std::size_t>(basis_[static_cast<std::size_t>(r)])] = r;
    }
    --basis_size_;
    row_of_[static_cast<std::size_t>(a)] = -1;
    for (int c = at; c < basis_size_; ++c) {
      const double x = factor_(c, c), y = factor_(c, c + 1), length = std::hypot(x, y), cosine = x / length, sine = y / length;
      for (int r = c; r < basis_size_; ++r) {
        const double u = factor_(r, c), v = factor_(r, c + 1);
        factor_(r, c) = cosine * u + sine * v;
        factor_(r, c + 1) = cosine * v - sine * u;
      }
    }
  }

  /// Solve C f = g on the basis, without the sign constraint.
  void solve_basis() noexcept {
    for (int p = 0; p < basis_size_; ++p)
      basis_force_[p] =
          (depth_[basis_[static_cast<std::size_t>(p)]] - factor_.row(p).head(p).dot(basis_force_.head(p).transpose())) / factor_(p, p);
    for (int p = basis_size_ - 1; p >= 0; --p) {
      basis_force_[p] /= factor_(p, p);
      basis_force_.head(p) -= basis_force_[p] * factor_.row(p).head(p).transpose();
    }
  }

  /// Mark basic rows with negative force and nonbasic rows with remaining penetration. Return the number of marked rows.
  int mark_infeasible() noexcept {
    int infeasible = 0;
    const double max_force = basis_size_ > 0 ? basis_force_.head(basis_size_).cwiseAbs().maxCoeff() : 0.0;
    violation_.head(size_) = depth_.head(size_);
    const double max_depth = size_ > 0 ? depth_.head(size_).maxCoeff() : 0.0;
    for (int p = 0; p < basis_size_; ++p)
      violation_.head(size_) -= basis_force_[p] * compliance_.row(basis_[static_cast<std::size_t>(p)]).head(size_).transpose();
    for (int a = 0; a < size_; ++a) {
      const int p = row_of_[static_cast<std::size_t>(a)];
      const bool violated = p >= 0 ? basis_force_[p] < -1e-12 * max_force : (p == -1 && violation_[a] > 1e-9 * max_depth);
      infeasible_[static_cast<std::size_t>(a)] = violated;
      infeasible += violated ? 1 : 0;
    }
    return infeasible;
  }

  void exchange(int a) noexcept {
    if (row_of_[static_cast<std::size_t>(a)] >= 0)
      remove_from_basis(a);
    else
      add_to_basis(a);
  }

  void exchange_all() noexcept {
    int out = 0;
    for (int a = 0; a < size_; ++a) out += infeasible_[static_cast<std::size_t>(a)] && row_of_[static_cast<std::size_t>(a)] >= 0 ? 1 : 0;
    if (2 * out > basis_size_) {  // refactoring is cheaper
      std::array<bool, capacity> next{};
      for (int a = 0; a < size_; ++a)
        next[static_cast<std::size_t>(a)] = (row_of_[static_cast<std::size_t>(a)] >= 0) != infeasible_[static_cast<std::size_t>(a)];
      reset(size_, [&next](int a) { return next[static_cast<std::size_t>(a)]; });
      return;
    }
    for (int a = 0; a < size_; ++a) {
      bool& infeasible = infeasible_[static_cast<std::size_t>(a)];
      if (!infeasible || row_of_[static_cast<std::size_t>(a)] < 0) continue;
      remove_from_basis(a);
      infeasible = false;  // do not add it again below
    }
    for (int a = 0; a < size_; ++a)
      if (infeasible_[static_cast<std::size_t>(a)] && row_of_[static_cast<std::size_t>(a)] == -1) add_to_basis(a);
  }

  void exchange_last() noexcept {
    for (int a = size_ - 1; a >= 0; --a)
      if (infeasible_[static_cast<std::size_t>(a)]) return exchange(a);
  }

  int size_ = 0;
  int basis_size_ = 0;
  int iterations_ = 0;
  int edits_ = 0;                                // since the last factorization
  bool stale_ = false;                           // the factor belongs to another compliance
  std::array<std::int32_t, capacity> basis_{};   // LCP row of each factor row
  std::array<std::int32_t, capacity> row_of_{};  // factor row of each LCP row; -1: nonbasic; -2: nonbasic because linearly dependent
  std::array<bool, capacity> infeasible_{};
  RowMajor compliance_;          // size x size, m/N
  RowMajor factor_;              // lower Cholesky factor of the basis
  Eigen::VectorXd depth_;        // g by LCP row, m
  Eigen::VectorXd basis_force_;  // by factor row, N
  Eigen::VectorXd violation_;    // g - C f by LCP row, m
  Eigen::VectorXd force_;        // by LCP row, N
};

}  // namespace palpate::deformable
