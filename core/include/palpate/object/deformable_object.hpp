#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_contact.hpp"
#include "palpate/math/latest_value.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::object {

/// Where a slow step left a body, for whoever draws it.
struct DeformationFrame {
  std::int64_t step = 0;             ///< how many there have been; 0: none yet
  std::int64_t tick = -1;            ///< of the servo, whose tip the step saw, from 0 on
  std::vector<double> displacement;  ///< of all points, 3 x point + axis, body's frame, m; as long as that from the beginning
};

/// A body of any kind as a servo loop meets it: stepped once a period by one tip, in the body's own frame.
///
/// A body whose state takes longer than a tick has slow steps besides, outside of the tick: `in_turn` with it in virtual time, always with
/// the same result, or `slow_step` over and over in a thread of its own.
class DeformableObject {
 public:
  DeformableObject() = default;
  DeformableObject(const DeformableObject&) = delete;
  DeformableObject& operator=(const DeformableObject&) = delete;
  DeformableObject(DeformableObject&&) = delete;
  DeformableObject& operator=(DeformableObject&&) = delete;
  virtual ~DeformableObject() = default;

  /// Goes on by one period; takes no memory, no lock, throws nothing.
  virtual const deformable::ContactResult& step(const deformable::Tip& tip) noexcept = 0;

  [[nodiscard]] virtual const deformable::ContactResult& last() const noexcept = 0;

  /// The pressed nodes of the last step, last().nodes of them.
  [[nodiscard]] virtual const std::int32_t* pressed() const noexcept = 0;

  /// Force of the tip on the k-th of them, N.
  [[nodiscard]] virtual Vector3<> load(int k) const noexcept = 0;

  /// Out of the body, unit: as in the last step, until that is more than 45 degrees off where the tip is pushed; while the tip is free, as
  /// the nearest node faces, or the tip if none is near.
  [[nodiscard]] virtual Vector3<> outward(const deformable::Tip& tip) const noexcept = 0;

  /// The same body at rest, with a state of its own: every loop steps its own.
  [[nodiscard]] virtual std::unique_ptr<DeformableObject> fresh() const = 0;

  /// Before the first tick, with the tip where it is.
  virtual void begin(const deformable::Tip& /*tip*/) {}

  /// After each tick, in virtual time.
  virtual void in_turn() {}

  /// Whether there are slow steps, and one of them.
  [[nodiscard]] virtual bool slow() const noexcept { return false; }
  virtual void slow_step() {}

  /// Tells `drawn`, of one loop at a time, after each of them; null: no more.
  virtual void watch(LatestValue<DeformationFrame>* /*drawn*/) noexcept {}
};

/// A body of one kind in a loop. The nodes outlive it; the kind is its own.
template <class Kind>
class LinearBodyObject final : public DeformableObject {
 public:
  LinearBodyObject(const deformable::SurfaceNodes& nodes, const Kind& kind, deformable::DryFriction friction = {})
      : nodes_(&nodes), kind_(kind), contact_(nodes, kind_, friction) {
    contact_.reset();
  }

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override { return contact_.step(tip); }
  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return contact_.last(); }
  [[nodiscard]] const std::int32_t* pressed() const noexcept override { return contact_.pressed(); }
  [[nodiscard]] Vector3<> load(int k) const noexcept override {
    const std::int32_t node = contact_.pressed()[k];
    return contact_.dragged(node) - contact_.forces()[k] * nodes_->normal(node);
  }
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override { return contact_.outward(tip); }
  [[nodiscard]] std::unique_ptr<DeformableObject> fresh() const override {
    return std::make_unique<LinearBodyObject>(*nodes_, kind_, contact_.friction());
  }

 private:
  const deformable::SurfaceNodes* nodes_;
  Kind kind_;
  deformable::TipContact<Kind> contact_;
};

/// What a tick pressed, for whoever draws the body: see BodyTouch.
struct ContactFrame {
  static constexpr int capacity = deformable::ContactLcp::capacity;
  std::int64_t tick = -1;  ///< which, from 0 on
  int count = 0;
  std::array<std::int32_t, capacity> node{};
  std::array<Vector3<>, capacity> force{};  ///< of the tip on it, body's frame, N
};

}  // namespace palpate::object
