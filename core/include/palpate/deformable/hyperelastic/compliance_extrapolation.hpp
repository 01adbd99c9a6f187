#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// The compliance of a snapshot's outer nodes, whose columns have not been solved for, from that of the inner ones, which have: so that a
/// tip that leaves those finds a surface, if not the exact one.
///
/// Inner nodes i with their compliance C_ii, and outer ones o whose displacement by forces on the inner ones, C_oi, is in their columns.
/// Then
///   C_oo = C_oi C_ii^-1 C_io + k (B_oo - B_oi B_ii^-1 B_io),   B(x, y) = 1 / sqrt(|x - y|^2 + a^2):
/// what the inner nodes tell of the outer ones, and for the rest that of a kernel like Boussinesq's (1885), 1 / distance, with a patch's
/// size for a and k fitted to the inner nodes. A kernel of this form is positive definite (Micchelli 1986), so the whole is. It is taken on
/// the stiff side: a surface felt too soft keeps less energy than the next snapshot asks for, and that would have to wait.
class ComplianceExtrapolation {
 public:
  static constexpr std::size_t capacity = LocalModel::capacity;

  /// Completes s.compliance and s.ahead: those of inner nodes are there already.
  void complete(LocalModel& s) {
    in_.clear();
    out_.clear();
    for (std::int32_t i = 0; i < s.nodes.size(); ++i) (s.inner[static_cast<std::size_t>(i)] ? in_ : out_).push_back(i);
    if (out_.empty() || in_.empty()) return;
    fit(s);
    factor(exact_, [&](std::int32_t i, std::int32_t j) { return s.between(i, j); });
    factor(kernel_, [&](std::int32_t i, std::int32_t j) { return kernel(s, i, j); });
    std::array<double, capacity> rest{};  // L^-1 of what the inner nodes are to move
    for (std::size_t a = 0; a < in_.size(); ++a) rest[a] = s.ahead[static_cast<std::size_t>(in_[a])];
    solve(exact_, rest.data());
    told_.resize(out_.size() * capacity);
    kept_.resize(out_.size() * capacity);
    for (std::size_t o = 0; o < out_.size(); ++o) {
      double *told = &told_[o * capacity], *kept = &kept_[o * capacity];
      for (std::size_t a = 0; a < in_.size(); ++a) {
        told[a] = s.between(out_[o], in_[a]);
        kept[a] = kernel(s, out_[o], in_[a]);
      }
      solve(exact_, told);
      solve(kernel_, kept);
      s.ahead[static_cast<std::size_t>(out_[o])] = dot(told, rest.data());
      for (std::size_t p = 0; p <= o; ++p) {
        const double value = dot(told, &told_[p * capacity]) + scale_ * (kernel(s, out_[o], out_[p]) - dot(kept, &kept_[p * capacity]));
        at(s, out_[o], out_[p]) = at(s, out_[p], out_[o]) = value;
      }
    }
  }

 private:
  /// k and a, so that the kernel has the inner nodes' mean compliance by themselves and by pairs.
  void fit(const LocalModel& s) {
    double own = 0.0, pairs = 0.0, least = 1e300;
    for (std::size_t a = 0; a < in_.size(); ++a) {
      own += s.between(in_[a], in_[a]) / static_cast<double>(in_.size());
      for (std::size_t b = 0; b < a; ++b) {
        pairs += s.between(in_[a], in_[b]);
        least = std::min(least, (s.nodes.point(in_[a]) - s.nodes.point(in_[b])).squaredNorm());
      }
    }
    width_ = in_.size() > 1 ? 0.16 * least : 1.0;
    for (int k = 0; k < 20; ++k) {
      double sum = 0.0;
      for (std::size_t a = 0; a < in_.size(); ++a)
        for (std::size_t b = 0; b < a; ++b) sum += kernel(s, in_[a], in_[b]);
      const double wide = std::clamp(pairs > 0.0 ? pairs / (sum * own) : 0.0, 0.2 * std::sqrt(least), std::sqrt(least));
      width_ = wide * wide;
    }
    scale_ = stiff_side * own * std::sqrt(width_);
  }

  [[nodiscard]] double kernel(const LocalModel& s, std::int32_t i, std::int32_t j) const noexcept {
    return 1.0 / std::sqrt((s.nodes.point(i) - s.nodes.point(j)).squaredNorm() + width_);
  }

  /// Cholesky's factor of a matrix between the inner nodes; one that depends on those before it counts for nothing.
  template <class Entry>
  void factor(std::vector<double>& to, Entry entry) {
    to.assign(capacity * capacity, 0.0);
    for (std::size_t a = 0; a < in_.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        double sum = entry(in_[a], in_[b]);
        for (std::size_t c = 0; c < b; ++c) sum -= to[a * capacity + c] * to[b * capacity + c];
        to[a * capacity + b] = to[b * capacity + b] > 0.0 ? sum / to[b * capacity + b] : 0.0;
      }
      const double whole = entry(in_[a], in_[a]);
      double square = whole;
      for (std::size_t c = 0; c < a; ++c) square -= to[a * capacity + c] * to[a * capacity + c];
      to[a * capacity + a] = square > 1e-6 * whole ? std::sqrt(square) : 0.0;
    }
  }

  /// x becomes L^-1 x.
  void solve(const std::vector<double>& factor, double* x) const noexcept {
    for (std::size_t a = 0; a < in_.size(); ++a) {
      const double own = factor[a * capacity + a];
      for (std::size_t c = 0; c < a; ++c) x[a] -= factor[a * capacity + c] * x[c];
      x[a] = own > 0.0 ? x[a] / own : 0.0;
    }
  }

  [[nodiscard]] double dot(const double* x, const double* y) const noexcept {
    double sum = 0.0;
    for (std::size_t a = 0; a < in_.size(); ++a) sum += x[a] * y[a];
    return sum;
  }

  static double& at(LocalModel& s, std::int32_t i, std::int32_t j) noexcept {
    return s.compliance[static_cast<std::size_t>(i) * capacity + static_cast<std::size_t>(j)];
  }

  static constexpr double stiff_side = 0.8;

  std::vector<std::int32_t> in_, out_;  // places in the snapshot
  std::vector<double> exact_, kernel_;  // factors
  std::vector<double> told_, kept_;     // L^-1 C_io and L^-1 B_io, by outer node
  double width_ = 0.0;                  // a^2, m^2
  double scale_ = 0.0;                  // k, m^2/N
};

}  // namespace palpate::deformable
