#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "palpate/deformable/linear/compliance.hpp"
#include "palpate/deformable/linear/creep.hpp"

namespace palpate::deformable {

/// Massless body of a uniform standard linear solid. Under a force step the instantaneous modulus is `instantaneous_ratio` times the
/// long-term modulus; under constant force the displacement approaches its limit with the `retardation_time` [s]. Poisson's ratio is
/// constant, so displacements are the elastic ones (correspondence principle, Lee 1955) under the force
///   f / r + q,   retardation_time q' = (1 - 1 / r) f - q,   r = instantaneous_ratio,
/// exact over one period with constant forces. The delayed force q of a node is dropped below 1e-6 of the largest.
///
/// In Kelvin form, with the long-term compliance C: a spring of compliance C / r in series with a Kelvin element of (1 - 1 / r) C. The
/// springs store f.C f / (2 r) + q.C q / (2 (1 - 1 / r)).
class StandardLinearSolid {
 public:
  static constexpr std::size_t capacity = 512;  ///< nodes with a delayed force; beyond it the smallest are dropped

  StandardLinearSolid() = default;
  StandardLinearSolid(Compliance elastic, double instantaneous_ratio, double retardation_time, double period)
      : elastic_(std::move(elastic)),
        decay_(std::exp(-period / retardation_time)),
        gain_((1.0 - decay_) * (1.0 - 1.0 / instantaneous_ratio)),
        period_ratio_(1.0 / instantaneous_ratio + gain_),
        delayed_ratio_(1.0 - 1.0 / instantaneous_ratio) {}

  /// Creep law for the extra compliance of partially covered patches.
  [[nodiscard]] Creep creep() const noexcept { return {period_ratio_, decay_, gain_, delayed_ratio_}; }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept { return period_ratio_ * elastic_.compliance(i, j); }

  [[nodiscard]] double free_displacement(std::int32_t i) const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < count_; ++k) sum += elastic_.compliance(i, node_[k]) * creep_state_[k];
    return decay_ * sum;
  }

  [[nodiscard]] bool has_tangential() const noexcept { return elastic_.has_tangential(); }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    return period_ratio_ * elastic_.tangential(i, j);
  }

  [[nodiscard]] Eigen::Vector2d free_tangential_displacement(std::int32_t i) const noexcept {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::size_t k = 0; k < count_; ++k) sum += elastic_.tangential(i, node_[k]) * tangential_state_[k];
    return decay_ * sum;
  }

  /// `nodes` in ascending order; `tangential` are forces in their tangent planes, or null.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* tangential, int count) noexcept {
    for (std::size_t k = 0; k < count_; ++k) {
      creep_state_[k] *= decay_;
      tangential_state_[k] *= decay_;
      period_force_[k] = 0.0;
      period_tangential_[k].setZero();
    }
    for (int c = 0; c < count; ++c) {
      const auto end = node_.begin() + static_cast<std::ptrdiff_t>(count_);
      const auto at = std::find(node_.begin(), end, nodes[c]);
      auto k = static_cast<std::size_t>(at - node_.begin());
      if (at == end) {
        if (count_ == capacity)
          k = static_cast<std::size_t>(std::min_element(creep_state_.begin(), creep_state_.end()) - creep_state_.begin());
        else
          ++count_;
        node_[k] = nodes[c];
        creep_state_[k] = 0.0;
        tangential_state_[k].setZero();
        period_tangential_[k].setZero();
      }
      period_force_[k] = forces[c];
      if (tangential != nullptr) period_tangential_[k] = tangential[c];
    }
    // With q' = decay q + gain f: q'.C q' = decay^2 q.C q + gain f.C (2 decay q + gain f).
    state_form_ *= decay_ * decay_;
    for (int c = 0; c < count; ++c) {
      double sum = 0.0;
      Eigen::Vector2d along = Eigen::Vector2d::Zero();
      for (std::size_t k = 0; k < count_; ++k) {
        sum += elastic_.compliance(nodes[c], node_[k]) * (2.0 * creep_state_[k] + gain_ * period_force_[k]);
        if (tangential != nullptr)
          along += elastic_.tangential(nodes[c], node_[k]) * (2.0 * tangential_state_[k] + gain_ * period_tangential_[k]);
      }
      state_form_ += gain_ * forces[c] * sum;
      if (tangential != nullptr) state_form_ += gain_ * tangential[c].dot(along);
    }
    double max_state = 0.0;
    for (std::size_t k = 0; k < count_; ++k) {
      max_state = std::max(max_state, creep_state_[k] += gain_ * period_force_[k]);
      tangential_state_[k] += gain_ * period_tangential_[k];
    }
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      if (!(creep_state_[k] > 1e-6 * max_state) || !(creep_state_[k] > min_state)) continue;
      node_[kept] = node_[k];
      tangential_state_[kept] = tangential_state_[k];
      creep_state_[kept++] = creep_state_[k];
    }
    count_ = kept;
    state_form_ = count_ > 0 ? std::max(state_form_, 0.0) : 0.0;
  }
  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  /// Adopt the state of the same body with another period.
  void take_state(const StandardLinearSolid& other) noexcept {
    count_ = other.count_;
    std::copy_n(other.node_.begin(), count_, node_.begin());
    std::copy_n(other.creep_state_.begin(), count_, creep_state_.begin());
    std::copy_n(other.tangential_state_.begin(), count_, tangential_state_.begin());
    state_form_ = other.state_form_;
  }

  void reset() noexcept {
    count_ = 0;
    state_form_ = 0.0;
  }

  /// Elastic energy at the end of the last period, J; `compliance_work` is f.C f with the compliance C within the period [N m].
  [[nodiscard]] double energy(double compliance_work) const noexcept {
    return creep().energy(compliance_work / period_ratio_, state_form_);
  }

 private:
  static constexpr double min_state = 1e-12;  // N; far below perceptible forces

  Compliance elastic_;
  double decay_ = 0.0, gain_ = 0.0, period_ratio_ = 1.0, delayed_ratio_ = 0.0;
  std::size_t count_ = 0;
  std::array<std::int32_t, capacity> node_{};
  std::array<double, capacity> creep_state_{};                // q, N
  std::array<Eigen::Vector2d, capacity> tangential_state_{};  // same in the tangent planes, N
  double state_form_ = 0.0;                                   // q.C q, normal and tangential, N m
  std::array<double, capacity> period_force_{};               // forces of this period on the nodes with state, N
  std::array<Eigen::Vector2d, capacity> period_tangential_{};
};

}  // namespace palpate::deformable
