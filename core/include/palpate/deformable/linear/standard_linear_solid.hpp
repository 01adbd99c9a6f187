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

/// A body of one standard linear solid, without inertia: pressed in a step it is `instant` times as stiff as at last, and goes there with
/// the time `creep` [s] under a constant force. Poisson's ratio stays, so displacements are the elastic ones of (Lee 1955)
///   f / instant + q,   creep q' = (1 - 1 / instant) f - q,
/// exact over one period with the forces held. Nodes remember their q until it is a millionth of the largest.
/// With the elastic compliance C that is a spring of C / instant in line with one of (1 - 1 / instant) C that has a dashpot beside it
/// (Kelvin's form): springs hold f.C f / 2 instant + q.C q / 2 (1 - 1 / instant), dashpots take the rest.
class StandardLinearSolid {
 public:
  static constexpr std::size_t capacity = 512;  ///< nodes that are remembered; beyond it the least are forgotten

  StandardLinearSolid() = default;
  StandardLinearSolid(Compliance elastic, double instant, double creep, double period)
      : elastic_(std::move(elastic)),
        stays_(std::exp(-period / creep)),
        gains_((1.0 - stays_) * (1.0 - 1.0 / instant)),
        share_(1.0 / instant + gains_),
        late_(1.0 - 1.0 / instant) {}

  /// Of what yields besides: patches that lie under a tip in part.
  [[nodiscard]] Creep creep() const noexcept { return {share_, stays_, gains_, late_}; }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept { return share_ * elastic_.compliance(i, j); }

  [[nodiscard]] double at_rest(std::int32_t i) const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < count_; ++k) sum += elastic_.compliance(i, node_[k]) * crept_[k];
    return stays_ * sum;
  }

  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept { return share_ * elastic_.tangential(i, j); }

  [[nodiscard]] Eigen::Vector2d tangential_at_rest(std::int32_t i) const noexcept {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::size_t k = 0; k < count_; ++k) sum += elastic_.tangential(i, node_[k]) * across_[k];
    return stays_ * sum;
  }

  /// `nodes` rise; `across` are forces in their tangent planes, or none.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* across, int count) noexcept {
    for (std::size_t k = 0; k < count_; ++k) {
      crept_[k] *= stays_;
      across_[k] *= stays_;
      pressed_[k] = 0.0;
      dragged_[k].setZero();
    }
    for (int c = 0; c < count; ++c) {
      const auto end = node_.begin() + static_cast<std::ptrdiff_t>(count_);
      const auto at = std::find(node_.begin(), end, nodes[c]);
      auto k = static_cast<std::size_t>(at - node_.begin());
      if (at == end) {
        if (count_ == capacity)
          k = static_cast<std::size_t>(std::min_element(crept_.begin(), crept_.end()) - crept_.begin());
        else
          ++count_;
        node_[k] = nodes[c];
        crept_[k] = 0.0;
        across_[k].setZero();
        dragged_[k].setZero();
      }
      pressed_[k] = forces[c];
      if (across != nullptr) dragged_[k] = across[c];
    }
    // From q = stays q + gains f: q.C q = stays^2 q.C q + gains f.C (2 stays q + gains f).
    remembered_ *= stays_ * stays_;
    for (int c = 0; c < count; ++c) {
      double sum = 0.0;
      Eigen::Vector2d along = Eigen::Vector2d::Zero();
      for (std::size_t k = 0; k < count_; ++k) {
        sum += elastic_.compliance(nodes[c], node_[k]) * (2.0 * crept_[k] + gains_ * pressed_[k]);
        if (across != nullptr) along += elastic_.tangential(nodes[c], node_[k]) * (2.0 * across_[k] + gains_ * dragged_[k]);
      }
      remembered_ += gains_ * forces[c] * sum;
      if (across != nullptr) remembered_ += gains_ * across[c].dot(along);
    }
    double most = 0.0;
    for (std::size_t k = 0; k < count_; ++k) {
      most = std::max(most, crept_[k] += gains_ * pressed_[k]);
      across_[k] += gains_ * dragged_[k];
    }
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      if (!(crept_[k] > 1e-6 * most) || !(crept_[k] > least)) continue;
      node_[kept] = node_[k];
      across_[kept] = across_[k];
      crept_[kept++] = crept_[k];
    }
    count_ = kept;
    remembered_ = count_ > 0 ? std::max(remembered_, 0.0) : 0.0;
  }
  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  void reset() noexcept {
    count_ = 0;
    remembered_ = 0.0;
  }

  /// Energy in its springs at the end of the last period, J; `yielded` is f.C f with the compliance C within the period [N m].
  [[nodiscard]] double energy(double yielded) const noexcept { return creep().energy(yielded / share_, remembered_); }

 private:
  static constexpr double least = 1e-12;  // N: far below anything that is felt

  Compliance elastic_;
  double stays_ = 0.0, gains_ = 0.0, share_ = 1.0, late_ = 0.0;
  std::size_t count_ = 0;
  std::array<std::int32_t, capacity> node_{};
  std::array<double, capacity> crept_{};            // N
  std::array<Eigen::Vector2d, capacity> across_{};  // the same in the tangent plane, N
  double remembered_ = 0.0;                         // q.C q of all that was crept, in the tangent planes too, N m
  std::array<double, capacity> pressed_{};          // forces of the period on the nodes that are remembered, N
  std::array<Eigen::Vector2d, capacity> dragged_{};
};

}  // namespace palpate::deformable
