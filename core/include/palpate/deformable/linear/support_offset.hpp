#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/support_field.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// SupportField as the contact by signed distance counts it: see FullCompliance about `sideways`. Its largest displacement is found in the
/// ticks after a grasp, some nodes in each.
class SupportOffset {
 public:
  /// `nodes` are the touched ones of the phase and must outlive this.
  SupportOffset(const SurfaceNodes& nodes, std::shared_ptr<const SupportPhase> phase, double sideways, const Creep& law = {})
      : nodes_(&nodes), field_(std::move(phase), law), sideways_(sideways) {}

  [[nodiscard]] SupportField& field() noexcept { return field_; }
  [[nodiscard]] const SupportField& field() const noexcept { return field_; }
  [[nodiscard]] bool active() const noexcept { return field_.active(); }
  [[nodiscard]] double energy() const noexcept { return field_.energy(); }

  /// Displacement of a touched node by the supports, m. It is constant.
  [[nodiscard]] Vector3<> displacement(std::int32_t node) noexcept { return counted(node, field_.displacement(node)); }
  /// The same by delayed forces of the time before the last change, m. It decays.
  [[nodiscard]] Vector3<> delayed_displacement(std::int32_t node) noexcept {
    return field_.remembers() ? counted(node, field_.delayed_displacement(node)) : Vector3<>(Vector3<>::Zero());
  }
  /// Sum of both, m.
  [[nodiscard]] Vector3<> present(std::int32_t node) noexcept { return displacement(node) + delayed_displacement(node); }
  /// Load of the body by a force of the contact on a node.
  [[nodiscard]] Vector3<> counted(std::int32_t node, const Vector3<>& force) const noexcept {
    if (sideways_ == 1.0) return force;
    const Vector3<>& n = nodes_->normal(node);
    return sideways_ * force + ((1.0 - sideways_) * n.dot(force)) * n;
  }
  /// Largest displacement found so far, m.
  [[nodiscard]] double largest() const noexcept { return largest_; }

  /// Look at some more nodes.
  void look_on() noexcept {
    if (!active()) return;
    const std::int32_t end = std::min(looked_at_ + nodes_per_tick, nodes_->size());
    for (; looked_at_ < end; ++looked_at_) largest_ = std::max(largest_, present(looked_at_).norm());
  }

  void end_period() noexcept { field_.advance(); }

  void release() noexcept {
    field_.release();
    start_over();
  }
  /// Call after a grasp.
  void start_over() noexcept {
    looked_at_ = 0;
    largest_ = 0.0;
  }

 private:
  static constexpr std::int32_t nodes_per_tick = 16;

  const SurfaceNodes* nodes_;
  SupportField field_;
  double sideways_ = 1.0, largest_ = 0.0;
  std::int32_t looked_at_ = 0;
};

}  // namespace palpate::deformable
