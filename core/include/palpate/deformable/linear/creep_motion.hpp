#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/body_motion.hpp"
#include "palpate/deformable/linear/creep.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/deformable/linear/support_offset.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Creep law of a uniform standard linear solid over a `period` [s]: the instantaneous modulus is `instantaneous_ratio` times the long-term
/// modulus, and displacements approach their limit with the `retardation_time` [s] (see StandardLinearSolid).
[[nodiscard]] inline Creep creep_law(double instantaneous_ratio, double retardation_time, double period) {
  const double delayed = 1.0 - 1.0 / instantaneous_ratio, decay = std::exp(-period / retardation_time), gain = (1.0 - decay) * delayed;
  return {1.0 / instantaneous_ratio + gain, decay, gain, delayed};
}

/// Delayed forces q of the nodes of a standard linear solid: q' = decay q + gain f after each period. Those below 1e-6 of the largest are
/// dropped. Memory of n vectors, time in proportion to the nodes with a delayed force.
class DelayedForces {
 public:
  DelayedForces() = default;
  DelayedForces(std::size_t nodes, const Creep& creep) : creep_(creep), value_(nodes, Vector3<>::Zero()), listed_(nodes, false) {
    nodes_.reserve(nodes);
  }

  [[nodiscard]] const Creep& creep() const noexcept { return creep_; }
  [[nodiscard]] const std::vector<std::int32_t>& nodes() const noexcept { return nodes_; }
  [[nodiscard]] const Vector3<>& at(std::int32_t node) const noexcept { return value_[static_cast<std::size_t>(node)]; }

  void advance(const BodyMotion::Period& period) noexcept {
    for (const std::int32_t node : nodes_) value_[index(node)] *= creep_.decay;
    for (int k = 0; k < period.count; ++k) {
      const std::int32_t node = period.nodes[k];
      if (!listed_[index(node)]) {
        listed_[index(node)] = true;
        nodes_.push_back(node);  // within the reserved capacity
      }
      value_[index(node)] += creep_.gain * period.forces[k];
    }
    double largest = smallest_force * smallest_force;
    for (const std::int32_t node : nodes_) largest = std::max(largest, value_[index(node)].squaredNorm());
    for (std::size_t k = nodes_.size(); k-- > 0;) {
      const std::int32_t node = nodes_[k];
      if (value_[index(node)].squaredNorm() > 1e-12 * largest) continue;
      forget(node);
      nodes_[k] = nodes_.back();
      nodes_.pop_back();
    }
  }

  void clear() noexcept {
    for (const std::int32_t node : nodes_) forget(node);
    nodes_.clear();
  }

 private:
  static constexpr double smallest_force = 1e-6;  // N

  [[nodiscard]] static std::size_t index(std::int32_t node) noexcept { return static_cast<std::size_t>(node); }
  void forget(std::int32_t node) noexcept {
    value_[index(node)].setZero();
    listed_[index(node)] = false;
  }

  Creep creep_;
  std::vector<std::int32_t> nodes_;  // with a delayed force
  std::vector<Vector3<>> value_;     // by node, N
  std::vector<bool> listed_;         // by node
};

/// Memory of a massless body of a standard linear solid, in all directions. With the long-term compliance S:
///   free displacement = decay S q,   energy = (1 - delayed_ratio) f.S f / 2 + q.S q / (2 delayed_ratio).
/// Where supports have changed, q includes the delayed forces of the time before (SupportField).
class CreepMotion final : public BodyMotion {
 public:
  /// `compliance` is that of the period [m/N], S times the law's period_ratio; its blocks are shared.
  CreepMotion(FullCompliance compliance, const Creep& creep)
      : compliance_(std::move(compliance)), delayed_(static_cast<std::size_t>(compliance_.size()), creep) {}
  CreepMotion(const CreepMotion&) = default;

  [[nodiscard]] Vector3<> free_displacement(std::int32_t node) const noexcept override {
    Vector3<> sum = Vector3<>::Zero();
    for (const std::int32_t j : delayed_.nodes()) {
      const float* block = compliance_.block(node, j);
      const Vector3<>& q = delayed_.at(j);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) sum[a] += static_cast<double>(block[3 * a + b]) * q[b];
    }
    const Creep& c = delayed_.creep();
    sum *= c.decay / c.period_ratio;
    if (before_ != nullptr) sum += c.decay * before_->delayed_displacement(node);
    return sum;
  }

  [[nodiscard]] Vector3<> next_free(std::int32_t /*node*/, const Vector3<>& free, const Vector3<>& by_forces) const noexcept override {
    const Creep& c = delayed_.creep();
    return c.decay * (free + (c.gain / c.period_ratio) * by_forces);
  }

  double advance(const Period& period) noexcept override {
    const Creep& c = delayed_.creep();
    const double force_work = period.compliance_work / c.period_ratio;
    state_work_ = c.decay * c.decay * state_work_ + c.gain * (2.0 * period.free_work + c.gain * force_work);
    delayed_.advance(period);
    if (delayed_.nodes().empty() && (before_ == nullptr || !before_->field().remembers())) state_work_ = 0.0;
    return c.energy(force_work, std::max(state_work_, 0.0));
  }

  void reset() noexcept override {
    delayed_.clear();
    state_work_ = 0.0;
  }

  [[nodiscard]] std::unique_ptr<BodyMotion> clone_at_rest() const override {
    auto copy = std::make_unique<CreepMotion>(*this);
    copy->before_ = nullptr;
    copy->reset();
    return copy;
  }

  /// Let the supports' field hold the delayed forces of the time before their last change; it must outlive the motion.
  void set_supports(SupportOffset* supports) noexcept { before_ = supports; }
  [[nodiscard]] const DelayedForces& delayed() const noexcept { return delayed_; }
  /// q.S q with all delayed forces, N m.
  [[nodiscard]] double state_work() const noexcept { return state_work_; }
  void set_state_work(double value) noexcept { state_work_ = value; }

 private:
  FullCompliance compliance_;
  DelayedForces delayed_;
  SupportOffset* before_ = nullptr;
  double state_work_ = 0.0;  // q.S q, N m
};

}  // namespace palpate::deformable
