#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/linear/creep.hpp"

namespace palpate::deformable {

/// Creep of the contact's layer at each point, on a body of a standard linear solid. A point of stiffness k under a force f is compressed
/// by
///   period_ratio f / k + decay e   at the end of a period,   e' = decay e + gain f / k,
/// the law of the body itself (Creep). A point out of contact forgets its e as time passes, and the energy of all points falls with it.
class LayerCreep {
 public:
  LayerCreep() = default;
  LayerCreep(const PatchPoints& points, const Creep& creep)
      : creep_(creep),
        state_(points.size() > 0 ? points.end(points.size() - 1) / 16 + 1 : 0),
        time_(static_cast<std::size_t>(points.size())) {}

  [[nodiscard]] bool active() const noexcept { return !time_.empty(); }

  /// Compression e of the points as of the last write(), m.
  [[nodiscard]] const float* state() const noexcept { return state_.data()->value.data(); }
  [[nodiscard]] float* state() noexcept { return state_.data()->value.data(); }

  /// Factor of a node's state() that gives the compression at the end of this period without force.
  [[nodiscard]] float remaining(std::int32_t node) const noexcept {
    const std::int64_t passed = now_ - time_[static_cast<std::size_t>(node)];
    return static_cast<float>(passed == 1 ? creep_.decay : std::pow(creep_.decay, static_cast<double>(passed)));
  }
  /// Compression by a period's force, relative to the compression of the period in excess of the remaining one.
  [[nodiscard]] float gain() const noexcept { return static_cast<float>(creep_.period_gain()); }
  /// Energy of a point of the period's stiffness k [J] is k (series x^2 + delayed e^2) / 2, with the period's excess compression x.
  [[nodiscard]] float series() const noexcept { return static_cast<float>(creep_.period_series()); }
  [[nodiscard]] float delayed() const noexcept { return static_cast<float>(creep_.period_delayed()); }

  /// Energy of the delayed compression of all points, J.
  [[nodiscard]] double delayed_energy() const noexcept { return std::max(energy_, 0.0); }
  /// Add the change by a period's forces to it.
  void add_energy(double change) noexcept { energy_ += change; }

  void begin_period() noexcept {
    ++now_;
    energy_ *= creep_.decay * creep_.decay;
  }
  /// Mark a node's state as that of this period's end.
  void mark(std::int32_t node) noexcept { time_[static_cast<std::size_t>(node)] = now_; }

  /// Continue the layer `before` of the same body's points `points_before`; `node_after(i)` is the node i of `before`, or -1.
  template <class NodeAfter>
  void take_over(const LayerCreep& before, const PatchPoints& points, const PatchPoints& points_before, NodeAfter node_after) noexcept {
    if (!active()) return;
    now_ = before.now_;
    energy_ = before.energy_;
    for (std::int32_t i = 0; i < points_before.size(); ++i) {
      const std::int32_t node = node_after(i);
      if (node < 0) {
        energy_ -= before.energy_of(i, points_before);
        continue;
      }
      const float* from = before.state();
      std::copy(from + points_before.begin(i), from + points_before.end(i), state() + points.begin(node));
      time_[static_cast<std::size_t>(node)] = before.time_[static_cast<std::size_t>(i)];
    }
  }

  void reset() noexcept {
    state_.assign(state_.size(), detail::FloatLine());
    time_.assign(time_.size(), 0);
    now_ = 0;
    energy_ = 0.0;
  }

 private:
  /// Part of a node's points in delayed_energy(), J.
  [[nodiscard]] double energy_of(std::int32_t node, const PatchPoints& points) const noexcept {
    const float* const stiffness = points.coordinate(6);
    const auto left = static_cast<double>(remaining(node));
    double sum = 0.0;
    for (std::size_t q = points.begin(node); q < points.end(node); ++q)
      sum += static_cast<double>(stiffness[q]) * static_cast<double>(state()[q]) * static_cast<double>(state()[q]);
    return 0.5 * static_cast<double>(delayed()) * left * left * sum;
  }

  Creep creep_;
  std::vector<detail::FloatLine> state_;
  std::vector<std::int64_t> time_;  // by node: period of its state
  std::int64_t now_ = 0;
  double energy_ = 0.0;  // J
};

}  // namespace palpate::deformable
