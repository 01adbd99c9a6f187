#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace palpate::deformable {

/// Cholesky's factor L of a symmetric positive definite matrix. Sums are in a fixed order, so the bits do not depend on the registers.
class CholeskyFactor {
 public:
  CholeskyFactor() = default;

  /// Factor the matrix of size n with `entry(row, column)`. It counts as definite if each pivot exceeds `least(row)`.
  template <class Entry, class Least>
  CholeskyFactor(std::size_t n, Entry entry, Least least) : n_(n), columns_(n * n), definite_(false) {
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t r = c; r < n; ++r) columns_[c * n + r] = entry(r, c);
    for (std::size_t c = 0; c < n; ++c) {
      double* const column = columns_.data() + c * n;
      if (!(column[c] > least(c))) return;
      scale(1.0 / std::sqrt(column[c]), column + c, n - c);
      for (std::size_t next = c + 1; next < n; ++next) subtract(column[next], column + next, columns_.data() + next * n + next, n - next);
    }
    definite_ = true;
  }

  [[nodiscard]] bool definite() const noexcept { return definite_; }

  /// Replace the n rows B of `rows`, `width` numbers each, by L^-1 B.
  void solve_lower(double* rows, std::size_t width) const noexcept {
    for (std::size_t r = 0; r < n_; ++r) {
      scale(1.0 / columns_[r * n_ + r], rows + r * width, width);
      for (std::size_t next = r + 1; next < n_; ++next) subtract(columns_[r * n_ + next], rows + r * width, rows + next * width, width);
    }
  }

  /// The same by L^-T B.
  void solve_upper(double* rows, std::size_t width) const noexcept {
    for (std::size_t r = n_; r-- > 0;) {
      for (std::size_t k = r + 1; k < n_; ++k) subtract(columns_[r * n_ + k], rows + k * width, rows + r * width, width);
      scale(1.0 / columns_[r * n_ + r], rows + r * width, width);
    }
  }

  /// Subtract a multiple of a row from another.
  static void subtract(double times, const double* row, double* from, std::size_t count) noexcept {
    for (std::size_t c = 0; c < count; ++c) from[c] -= times * row[c];
  }

 private:
  static void scale(double times, double* row, std::size_t count) noexcept {
    for (std::size_t c = 0; c < count; ++c) row[c] *= times;
  }

  std::size_t n_ = 0;
  std::vector<double> columns_;  // row c: column c of L
  bool definite_ = true;
};

}  // namespace palpate::deformable
