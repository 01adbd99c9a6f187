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

/// Displacement of a body after a model update, for visualization.
struct DeformationFrame {
  std::int64_t step = 0;             ///< number of model updates so far; 0: none yet
  std::int64_t tick = -1;            ///< servo tick, from 0 on, whose tip the update used
  std::vector<double> displacement;  ///< of all points, 3 x point + axis, body frame, m; allocated beforehand
};

class BodyWithSupports;

/// A deformable body as a servo loop uses it: stepped once per period by one tip, in the body's own frame.
///
/// A body whose model takes longer than a tick updates it outside the tick: synchronously in virtual time (`step_synchronously`,
/// reproducible), or by calling `update_model` repeatedly in another thread.
class DeformableObject {
 public:
  DeformableObject() = default;
  DeformableObject(const DeformableObject&) = delete;
  DeformableObject& operator=(const DeformableObject&) = delete;
  DeformableObject(DeformableObject&&) = delete;
  DeformableObject& operator=(DeformableObject&&) = delete;
  virtual ~DeformableObject() = default;

  /// Advance by one period. Does not allocate, lock or throw.
  virtual const deformable::ContactResult& step(const deformable::Tip& tip) noexcept = 0;

  [[nodiscard]] virtual const deformable::ContactResult& last() const noexcept = 0;

  /// Contact nodes of the last step, last().nodes entries.
  [[nodiscard]] virtual const std::int32_t* contact_nodes() const noexcept = 0;

  /// Force of the tip on the k-th contact node, N.
  [[nodiscard]] virtual Vector3<> node_force(int k) const noexcept = 0;

  /// Outward unit normal of the contact: that of the last step, turned only as far as needed to stay within 45 degrees of the contact
  /// force. Free tip: normal of the nearest node, or `tip.outward` if none is near.
  [[nodiscard]] virtual Vector3<> outward(const deformable::Tip& tip) const noexcept = 0;

  /// Return a copy at rest with its own state; every loop steps its own copy.
  [[nodiscard]] virtual std::unique_ptr<DeformableObject> clone_at_rest() const = 0;

  /// Prepare for the first tick, with the tip at its start position.
  virtual void initialize(const deformable::Tip& /*tip*/) {}

  /// Call after each tick in virtual time.
  virtual void step_synchronously() {}

  /// Whether the model is updated outside the tick; update_model() performs one update.
  [[nodiscard]] virtual bool is_multirate() const noexcept { return false; }
  virtual void update_model() {}

  /// This body, if its supports can change while a loop runs (see supported_body.hpp); otherwise null.
  [[nodiscard]] virtual BodyWithSupports* with_supports() noexcept { return nullptr; }

  /// Number of tips of a tool that touches the body; 0: a single tip.
  [[nodiscard]] virtual int tool_tips() const noexcept { return 0; }

  /// Place the tips of the tool for the steps from now on: their centers less the position of the tool, body frame, m; tool_tips() entries.
  virtual void place_tool(const Vector3<>* /*centers*/) noexcept {}

  /// Force of the body on a tip of the tool at the last step, body frame, N.
  [[nodiscard]] virtual Vector3<> tool_force(int /*tip*/) const noexcept { return Vector3<>::Zero(); }

  /// Set the buffer that receives the deformation after each model update; null to stop. One loop at a time.
  virtual void set_observer(LatestValue<DeformationFrame>* /*observer*/) noexcept {}
};

/// A linear body model in a loop. `nodes` must outlive it; the model is copied.
template <class Model>
class LinearBodyObject final : public DeformableObject {
 public:
  LinearBodyObject(const deformable::SurfaceNodes& nodes, const Model& model, deformable::DryFriction friction = {})
      : nodes_(&nodes), model_(model), contact_(nodes, model_, friction) {
    contact_.reset();
  }
  LinearBodyObject(const deformable::SurfaceNodes&& nodes, const Model& model, deformable::DryFriction friction = {}) = delete;

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override { return contact_.step(tip); }
  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return contact_.last(); }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept override { return contact_.contact_nodes(); }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept override {
    const std::int32_t node = contact_.contact_nodes()[k];
    return contact_.tangential_force(node) - contact_.forces()[k] * nodes_->normal(node);
  }
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override { return contact_.outward(tip); }
  [[nodiscard]] std::unique_ptr<DeformableObject> clone_at_rest() const override {
    return std::make_unique<LinearBodyObject>(*nodes_, model_, contact_.friction());
  }

 private:
  const deformable::SurfaceNodes* nodes_;
  Model model_;
  deformable::TipContact<Model> contact_;
};

/// Contact nodes of a tick, for visualization.
struct ContactFrame {
  static constexpr int capacity = deformable::ContactLcp::capacity;
  std::int64_t tick = -1;  ///< from 0 on
  int count = 0;
  std::array<std::int32_t, capacity> node{};
  std::array<Vector3<>, capacity> force{};  ///< of the tip on each node, body frame, N
};

}  // namespace palpate::object
