#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/condensed_surface.hpp"
#include "palpate/deformable/linear/support_phase.hpp"
#include "palpate/math/latest_value.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/deformable_object.hpp"
#include "palpate/object/support_phases.hpp"

namespace palpate::object {

/// A deformable body whose supports and touched nodes change while a loop runs.
class BodyWithSupports : public DeformableObject {
 public:
  /// From step `step` on, the nodes that are held and touched.
  struct Change {
    std::int64_t step = 0;
    deformable::SupportNodes nodes;
  };

  /// Change the supports at the next step. Computes the update in the calling thread and allocates: call it outside the tick, in one thread
  /// at a time. Of several changes before a step the last one counts. Return false if the held nodes cannot be held together.
  virtual bool change_supports(deformable::SupportNodes nodes) = 0;

  /// Number of changes so far.
  [[nodiscard]] virtual std::int64_t changes() const noexcept = 0;

  /// Number of contact nodes of the last step.
  [[nodiscard]] virtual int contact_count() const noexcept = 0;

  /// Whether the force depends on more than the present tip, friction and supports: the body creeps or swings.
  [[nodiscard]] virtual bool has_memory() const noexcept = 0;

  /// Number of nodes of the body.
  [[nodiscard]] virtual std::size_t size() const noexcept = 0;

  /// Write the displacement of every node after the last step, 3 x node + axis, m. Outside the tick.
  virtual void displacement(double* out) noexcept = 0;

  virtual void reset() noexcept = 0;

  [[nodiscard]] BodyWithSupports* with_supports() noexcept final { return this; }
};

/// A linear body whose supports change at steps that are known, and on request. Friction, creep and vibration continue over a change.
///
/// Held nodes stay where they are when they are grasped, so a grasp at a displacement displaces the body until it is released
/// (SupportField). A grasp changes neither displacement nor energy. After a release a body without inertia is in its new equilibrium at
/// once, a standard linear solid creeps there, and modes swing about it; the energy of the constraint that they do not take is dissipated.
/// A node that becomes touched while the tip overlaps it is touched once the tip has been clear of it. So no change supplies energy. The
/// supports do not move, so they do no work.
///
/// A step that changes the supports does not allocate. It computes their forces, in a time in proportion to the held nodes times those in
/// contact or held before or with a delayed force, and times the modes.
template <class Phase>
class SupportedBody final : public BodyWithSupports {
 public:
  using Data = typename Phase::Data;
  using Maker = typename Phase::Maker;

  /// The changes are in ascending order of their steps; the first one is at step 0.
  SupportedBody(std::shared_ptr<const deformable::CondensedSurface> surface, const std::vector<Change>& changes, Maker make)
      : plan_(std::make_shared<Plan>(std::move(surface), std::move(make))) {
    auto phases = phases_of(changes);
    const auto yields_less = [this](const auto& phase) { return !phase->held().empty() && phase->yielding() < plan_->yielding; };
    if (usable_ && std::any_of(phases.begin(), phases.end(), yields_less)) phases = phases_of(changes);
    for (std::size_t k = 0; usable_ && k < phases.size(); ++k) {
      plan_->steps.push_back(changes[k].step);
      const auto known = static_cast<std::size_t>(std::find(phases.begin(), phases.end(), phases[k]) - phases.begin());
      plan_->phases.push_back(known < k ? plan_->phases[known] : plan_->make(phases[k]));
    }
    if (usable_) start();
  }

  /// Whether the nodes of every phase can be held together; otherwise the body has no phases and must not be stepped.
  [[nodiscard]] bool usable() const noexcept { return usable_; }

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override {
    if (next_ < scheduled_.size() && plan_->steps[next_] <= step_) change_to(*scheduled_[next_++]);
    if (requested_.acquire() && requested_.value()) {
      Phase& next = *requested_.value();
      change_to(next);
      std::swap(live_, requested_.value());  // the phase before is freed by the thread that requests the next change
    }
    ++step_;
    current_->step(tip);
    for (int k = 0; k < current_->contact_count(); ++k)
      contact_nodes_[static_cast<std::size_t>(k)] = current_->phase().touched()[static_cast<std::size_t>(current_->contact_node(k))];
    return current_->last();
  }

  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return current_->last(); }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept override { return contact_nodes_.data(); }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept override { return current_->node_force(k); }
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override { return current_->outward(tip); }
  [[nodiscard]] int contact_count() const noexcept override { return current_->contact_count(); }
  [[nodiscard]] int tool_tips() const noexcept override { return current_->tool_tips(); }
  void place_tool(const Vector3<>* centers) noexcept override { current_->place_tool(centers); }
  [[nodiscard]] Vector3<> tool_force(int tip) const noexcept override { return current_->tool_force(tip); }

  [[nodiscard]] std::unique_ptr<DeformableObject> clone_at_rest() const override {
    return std::unique_ptr<DeformableObject>(new SupportedBody(plan_));
  }

  void reset() noexcept override {
    for (const std::unique_ptr<Phase>& phase : scheduled_) phase->reset();
    current_ = scheduled_.front().get();
    requested_.acquire();  // a request before the reset is void
    step_ = changes_ = 0;
    next_ = 1;
  }

  bool change_supports(deformable::SupportNodes nodes) override {
    auto phase = std::make_shared<const deformable::SupportPhase>(plan_->surface, std::move(nodes), plan_->yielding);
    if (!phase->definite()) return false;
    requested_.write_slot() = std::make_unique<Phase>(plan_->make(std::move(phase)));
    requested_.publish();
    return true;
  }

  [[nodiscard]] std::int64_t changes() const noexcept override { return changes_; }
  [[nodiscard]] bool has_memory() const noexcept override { return current_->has_memory(); }
  [[nodiscard]] std::size_t size() const noexcept override { return plan_->surface->size(); }

  void displacement(double* out) noexcept override {
    gather(*current_);
    for (std::size_t i = 0; i < size(); ++i)
      Eigen::Map<Vector3<>>{out + 3 * i} = current_->field().displacement_under(static_cast<std::int32_t>(i), loads_);
  }

 private:
  static constexpr std::size_t capacity = 256;  // places of a contact

  struct Plan {
    Plan(std::shared_ptr<const deformable::CondensedSurface> of, Maker maker) : surface(std::move(of)), make(std::move(maker)) {}
    std::shared_ptr<const deformable::CondensedSurface> surface;
    Maker make;
    double yielding = 0.0;  // compliance of the supports, m/N
    std::vector<std::int64_t> steps;
    std::vector<std::shared_ptr<const Data>> phases;
  };

  explicit SupportedBody(std::shared_ptr<Plan> plan) : plan_(std::move(plan)) { start(); }

  /// Return the phase of each change; equal ones are one. Their supports yield as those before, and later ones as the phases need.
  [[nodiscard]] std::vector<std::shared_ptr<const deformable::SupportPhase>> phases_of(const std::vector<Change>& changes) {
    std::vector<std::shared_ptr<const deformable::SupportPhase>> phases;
    for (const Change& change : changes) {
      const auto same = std::find_if(changes.begin(), changes.end(), [&](const Change& c) { return c.nodes == change.nodes; });
      const auto known = static_cast<std::size_t>(same - changes.begin());
      phases.push_back(known < phases.size()
                           ? phases[known]
                           : std::make_shared<const deformable::SupportPhase>(plan_->surface, change.nodes, plan_->yielding));
      usable_ = usable_ && phases.back()->definite();
    }
    for (const auto& phase : phases) plan_->yielding = std::max(plan_->yielding, phase->yielding());
    return phases;
  }

  void start() {
    for (const auto& data : plan_->phases) scheduled_.push_back(std::make_unique<Phase>(data));
    loads_.nodes.reserve(capacity + 3 * size());  // contact; delayed forces of this phase and of those before; supports
    loads_.modes.resize(plan_->surface->modes());
    reset();
  }

  /// List the loads of a phase, supports included, by the nodes and modes of the body.
  void gather(Phase& phase) noexcept {
    loads_.nodes.clear();
    phase.append_loads(loads_);
    phase.field().append(loads_);
  }
  void change_to(Phase& next) noexcept {
    gather(*current_);
    next.reset();
    next.field().grasp(loads_);
    next.take_over(*current_);
    current_ = &next;
    ++changes_;
  }

  std::shared_ptr<Plan> plan_;
  bool usable_ = true;
  std::vector<std::unique_ptr<Phase>> scheduled_;
  std::unique_ptr<Phase> live_;  // in use, if the last change was requested
  Phase* current_ = nullptr;
  std::size_t next_ = 1;
  std::int64_t step_ = 0, changes_ = 0;
  LatestValue<std::unique_ptr<Phase>> requested_;
  std::array<std::int32_t, capacity> contact_nodes_{};
  deformable::BodyLoads loads_;
};

}  // namespace palpate::object
