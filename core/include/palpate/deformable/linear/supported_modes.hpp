#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/cholesky_factor.hpp"
#include "palpate/deformable/linear/condensed_surface.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Vibration modes of a condensed body between two changes of its supports, from those of the body without these supports.
///
/// With the coordinates q of the body's modes (frequencies W, shapes Phi), the nodes have the displacements
///   u = Phi q + R f,   R = C - Phi W^-2 Phi^T,   q'' + damping + W^2 q = Phi^T f,
/// where f includes the forces r of the supports on the held nodes s. Constant u_s determine r, and leave (t: nodes not held)
///   q'' + damping + K q = Psi_t^T f_t + ...,   K = W^2 + Phi_s^T R_ss^-1 Phi_s,   Psi_t = Phi_t - R_ts R_ss^-1 Phi_s.
/// The eigenvectors V of K are orthonormal, so p = V^T (q - q_0) are the coordinates of mass-normalized modes with the shapes Psi V about
/// the rest q_0 = W^-2 Phi_s^T w, where the forces w alone hold the nodes. Together with the static compliance
/// C' = C_tt - C_ts C_ss^-1 C_st they are a body of modes again: R is eliminated exactly. With many modes R_ss is rounding, so the supports
/// yield a little.
class SupportedModes {
 public:
  SupportedModes() = default;

  /// Factor R_ss plus the compliance of the supports, `yielding` [m/N]. It counts as definite if rounding changes its pivots by less than
  /// half of that.
  [[nodiscard]] static CholeskyFactor remainder(const CondensedSurface& surface, const std::vector<std::int32_t>& held, double yielding) {
    const std::size_t m = surface.modes(), width = 3 * surface.size();
    const auto entry = [&](std::size_t r, std::size_t c) {
      const std::size_t row = row_of(held, r), column = row_of(held, c);
      double sum = static_cast<double>(surface.compliance[row * width + column]) + (r == c ? yielding : 0.0);
      const float *one = surface.shape(row), *other = surface.shape(column);
      for (std::size_t k = 0; k < m; ++k)
        sum -= static_cast<double>(one[k]) * static_cast<double>(other[k]) / (surface.frequencies[k] * surface.frequencies[k]);
      return sum;
    };
    return {3 * held.size(), entry, [yielding](std::size_t /*row*/) { return 0.5 * yielding; }};
  }

  /// `capacitance` is the factor of C_ss, which like `remainder` includes the compliance of the supports. Without modes of the body every
  /// share is zero.
  SupportedModes(const CondensedSurface& surface, const SupportNodes& nodes, const CholeskyFactor& capacitance,
                 const CholeskyFactor& remainder)
      : surface_(&surface), count_(surface.modes()), frequencies_(surface.frequencies) {
    if (count_ == 0) return;
    for (std::size_t r = 0; r < 3 * nodes.held.size(); ++r) held_.push_back(row_of(nodes.held, r));
    const std::size_t n = held_.size(), m = count_;
    std::vector<double> soft(m);  // W^-2, s^2
    for (std::size_t k = 0; k < m; ++k) soft[k] = 1.0 / (frequencies_[k] * frequencies_[k]);
    if (n > 0) {
      std::vector<double> solved = shapes_of_held();
      remainder.solve_lower(solved.data(), m);
      find_modes(solved);
      remainder.solve_upper(solved.data(), m);  // R_ss^-1 Phi_s
      couple(nodes.touched, solved, soft);
      shares_ = shapes_of_held();
      for (std::size_t r = 0; r < n; ++r)
        for (std::size_t k = 0; k < m; ++k) shares_[r * m + k] *= soft[k];
      rest_ = shares_;
      capacitance.solve_lower(shares_.data(), m);
      capacitance.solve_upper(shares_.data(), m);
    } else {
      for (const std::int32_t node : nodes.touched) {
        const float* from = surface.shape(3 * static_cast<std::size_t>(node));
        shapes_.insert(shapes_.end(), from, from + 3 * m);
      }
    }
  }

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  /// Of the supported body, rad/s, in ascending order if nodes are held.
  [[nodiscard]] const std::vector<double>& frequencies() const noexcept { return frequencies_; }
  /// Of the touched nodes, 3t x m [1/sqrt(kg)], row 3 x node + axis, mass-normalized.
  [[nodiscard]] const std::vector<float>& shapes() const noexcept { return shapes_; }

  /// Compute coordinates q = q_0 + V p of the body's modes from those of the supported body, or velocities q' = V p'. `forces` are w.
  void to_body(const double* own, const std::vector<Vector3<>>& forces, double* body) const noexcept {
    velocity_to_body(own, body);
    add_rest(1.0, forces, body);
  }
  void velocity_to_body(const double* own, double* body) const noexcept { turn<false>(own, body); }
  /// The reverse; `body` is changed.
  void from_body(double* body, const std::vector<Vector3<>>& forces, double* own) const noexcept {
    add_rest(-1.0, forces, body);
    velocity_from_body(body, own);
  }
  void velocity_from_body(const double* body, double* own) const noexcept { turn<true>(body, own); }

  /// Add the forces C_ss^-1 Phi_s W^-2 g that free the held nodes of the displacement by loads g on the body's modes.
  void add_share(const std::vector<double>& loads, std::vector<Vector3<>>& forces) const noexcept {
    for (std::size_t r = 0; r < held_.size(); ++r) forces[r / 3][static_cast<int>(r % 3)] += share(r, loads);
  }
  /// Subtract them from the loads of the held nodes.
  void subtract_share(const std::vector<double>& loads, NodeLoad* supports) const noexcept {
    for (std::size_t r = 0; r < held_.size(); ++r) supports[r / 3].force[static_cast<int>(r % 3)] -= share(r, loads);
  }
  /// Work of loads on the modes over the rest q_0, N m.
  [[nodiscard]] double work(const std::vector<double>& loads, const std::vector<Vector3<>>& forces) const noexcept {
    double sum = 0.0;
    for (std::size_t r = 0; r < held_.size(); ++r)
      sum += forces[r / 3][static_cast<int>(r % 3)] * dot(rest_.data() + r * count_, loads.data());
    return sum;
  }
  /// Displacement of any node of the body without supports by loads g on its modes, m.
  [[nodiscard]] Vector3<> displacement(std::int32_t node, const std::vector<double>& loads) const noexcept {
    Vector3<> u = Vector3<>::Zero();
    for (std::size_t a = 0; a < 3; ++a) {
      const float* shape = surface_->shape(3 * static_cast<std::size_t>(node) + a);
      for (std::size_t k = 0; k < count_; ++k)
        u[static_cast<int>(a)] += static_cast<double>(shape[k]) * loads[k] / (surface_->frequencies[k] * surface_->frequencies[k]);
    }
    return u;
  }

 private:
  /// Row 3 x node + axis of row `r` of a list of nodes.
  [[nodiscard]] static std::size_t row_of(const std::vector<std::int32_t>& nodes, std::size_t r) noexcept {
    return 3 * static_cast<std::size_t>(nodes[r / 3]) + r % 3;
  }

  [[nodiscard]] std::vector<double> shapes_of_held() const {
    std::vector<double> rows;
    rows.reserve(held_.size() * count_);
    for (const std::size_t row : held_) rows.insert(rows.end(), surface_->shape(row), surface_->shape(row) + count_);
    return rows;
  }

  /// Add `times` q_0 under the forces w on the held nodes.
  void add_rest(double times, const std::vector<Vector3<>>& forces, double* body) const noexcept {
    for (std::size_t r = 0; r < held_.size(); ++r)
      CholeskyFactor::subtract(-times * forces[r / 3][static_cast<int>(r % 3)], rest_.data() + r * count_, body, count_);
  }
  [[nodiscard]] double share(std::size_t r, const std::vector<double>& loads) const noexcept {
    return dot(shares_.data() + r * count_, loads.data());
  }
  [[nodiscard]] double dot(const double* one, const double* other) const noexcept {
    double part[8] = {};  // in a fixed order, which registers of any width can follow
    std::size_t k = 0;
    for (; k + 8 <= count_; k += 8)
      for (std::size_t l = 0; l < 8; ++l) part[l] += one[k + l] * other[k + l];
    for (; k < count_; ++k) part[0] += one[k] * other[k];
    return ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
  }

  /// Compute eigenvectors and frequencies of K from L^-1 Phi_s, where R_ss = L L^T.
  void find_modes(const std::vector<double>& half) {
    const auto m = static_cast<Eigen::Index>(count_);
    Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(m, m);
    for (Eigen::Index k = 0; k < m; ++k) {
      const double w = frequencies_[static_cast<std::size_t>(k)];
      stiffness(k, k) = w * w;
    }
    for (std::size_t r = 0; r < held_.size(); ++r)
      for (Eigen::Index k = 0; k < m; ++k)
        for (Eigen::Index l = 0; l <= k; ++l)
          stiffness(k, l) += half[r * count_ + static_cast<std::size_t>(k)] * half[r * count_ + static_cast<std::size_t>(l)];
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> found(stiffness);  // reads the lower triangle
    vectors_.resize(count_ * count_);
    for (Eigen::Index k = 0; k < m; ++k) {
      frequencies_[static_cast<std::size_t>(k)] = std::sqrt(found.eigenvalues()[k]);
      for (Eigen::Index l = 0; l < m; ++l) vectors_[static_cast<std::size_t>(l * m + k)] = found.eigenvectors()(l, k);
    }
  }

  /// Compute the shapes Psi V of touched nodes, with Psi_t = Phi_t (1 + W^-2 Phi_s^T Y) - C_ts Y from Y = R_ss^-1 Phi_s.
  void couple(const std::vector<std::int32_t>& touched, const std::vector<double>& y, const std::vector<double>& soft) {
    const std::size_t n = held_.size(), m = count_;
    std::vector<double> own = vectors_, held_turned(n * m, 0.0);  // (1 + W^-2 Phi_s^T Y) V and Y V
    for (std::size_t r = 0; r < n; ++r) turn_row(y.data() + r * m, held_turned.data() + r * m);
    for (std::size_t r = 0; r < n; ++r) {
      const float* shape = surface_->shape(held_[r]);
      for (std::size_t k = 0; k < m; ++k)
        CholeskyFactor::subtract(-soft[k] * static_cast<double>(shape[k]), held_turned.data() + r * m, own.data() + k * m, m);
    }
    std::vector<double> sum(m);
    for (const std::int32_t node : touched)
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t row = 3 * static_cast<std::size_t>(node) + a;
        std::fill(sum.begin(), sum.end(), 0.0);
        for (std::size_t k = 0; k < m; ++k)
          CholeskyFactor::subtract(-static_cast<double>(surface_->shape(row)[k]), own.data() + k * m, sum.data(), m);
        const float* compliance = surface_->compliance.data() + row * 3 * surface_->size();
        for (std::size_t r = 0; r < n; ++r)
          CholeskyFactor::subtract(static_cast<double>(compliance[held_[r]]), held_turned.data() + r * m, sum.data(), m);
        for (const double x : sum) shapes_.push_back(static_cast<float>(x));
      }
  }

  /// Add x V to a row.
  void turn_row(const double* x, double* row) const noexcept {
    for (std::size_t k = 0; k < count_; ++k) CholeskyFactor::subtract(-x[k], vectors_.data() + k * count_, row, count_);
  }

  template <bool transposed>
  void turn(const double* from, double* to) const noexcept {
    if (vectors_.empty()) {
      std::copy_n(from, count_, to);
      return;
    }
    if constexpr (transposed) {  // by rows of V in both cases
      std::fill_n(to, count_, 0.0);
      for (std::size_t k = 0; k < count_; ++k) CholeskyFactor::subtract(-from[k], vectors_.data() + k * count_, to, count_);
    } else {
      for (std::size_t k = 0; k < count_; ++k) to[k] = dot(vectors_.data() + k * count_, from);
    }
  }

  const CondensedSurface* surface_ = nullptr;
  std::size_t count_ = 0;
  std::vector<std::size_t> held_;  // rows
  std::vector<double> frequencies_;
  std::vector<float> shapes_;
  std::vector<double> vectors_;        // V, row-major; empty: 1
  std::vector<double> shares_, rest_;  // by held row: C_ss^-1 Phi_s W^-2, Phi_s W^-2
};

}  // namespace palpate::deformable
