#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>

#include "palpate/body/nodes.hpp"
#include "palpate/body/patch.hpp"
#include "palpate/body/unilateral.hpp"
#include "palpate/math/latest.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// A body of any kind as a servo loop meets it: stepped once a period by one tip, in the body's own frame.
class LoopBody {
 public:
  LoopBody() = default;
  LoopBody(const LoopBody&) = delete;
  LoopBody& operator=(const LoopBody&) = delete;
  LoopBody(LoopBody&&) = delete;
  LoopBody& operator=(LoopBody&&) = delete;
  virtual ~LoopBody() = default;

  /// Goes on by one period; takes no memory, no lock, throws nothing.
  virtual const BodyAnswer& step(const BodyTip& tip) noexcept = 0;

  [[nodiscard]] virtual const BodyAnswer& last() const noexcept = 0;

  /// The pressed nodes of the last step and the forces on them along their inward normals [N], last().nodes of each.
  [[nodiscard]] virtual const std::int32_t* pressed() const noexcept = 0;
  [[nodiscard]] virtual const double* forces() const noexcept = 0;

  /// What the tip drags a pressed node of the last step with [N]; nothing without friction.
  [[nodiscard]] virtual Vector3<> dragged(std::int32_t node) const noexcept = 0;

  [[nodiscard]] virtual const BodyNodes& nodes() const noexcept = 0;

  /// The same body at rest, with a state of its own: every loop steps its own.
  [[nodiscard]] virtual std::unique_ptr<LoopBody> fresh() const = 0;
};

/// A body of one kind in a loop. The nodes outlive it; the kind is its own.
template <class Kind>
class LoopBodyOf final : public LoopBody {
 public:
  LoopBodyOf(const BodyNodes& nodes, const Kind& kind, DryFriction friction = {})
      : nodes_(&nodes), kind_(kind), contact_(nodes, kind_, friction) {
    contact_.reset();
  }

  const BodyAnswer& step(const BodyTip& tip) noexcept override { return contact_.step(tip); }
  [[nodiscard]] const BodyAnswer& last() const noexcept override { return contact_.last(); }
  [[nodiscard]] const std::int32_t* pressed() const noexcept override { return contact_.pressed(); }
  [[nodiscard]] const double* forces() const noexcept override { return contact_.forces(); }
  [[nodiscard]] Vector3<> dragged(std::int32_t node) const noexcept override { return contact_.dragged(node); }
  [[nodiscard]] const BodyNodes& nodes() const noexcept override { return *nodes_; }
  [[nodiscard]] std::unique_ptr<LoopBody> fresh() const override {
    return std::make_unique<LoopBodyOf>(*nodes_, kind_, contact_.friction());
  }

 private:
  const BodyNodes* nodes_;
  Kind kind_;
  BodyContact<Kind> contact_;
};

/// What a tick pressed, for whoever draws the body: see BodyTouch.
struct PressedNodes {
  static constexpr int capacity = Unilateral::capacity;
  std::int64_t tick = -1;  ///< which, from 0 on
  int count = 0;
  std::array<std::int32_t, capacity> node{};
  std::array<Vector3<>, capacity> force{};  ///< of the tip on it, body's frame, N
};

/// A body in the tip's way: which, where it lies in the device's frame, and the tip that meets it. Plain data.
struct TouchedBody {
  const LoopBody* body = nullptr;                      ///< null: none is there; the caller's, and outlives the servo
  Vector3<> origin = Vector3<>::Zero();                ///< of the body's frame, m
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  ///< from the body's frame to the device's
  BodyTip::Kind tip = BodyTip::Kind::sphere;
  double radius = 5e-3;                 ///< of the tip, m
  Vector3<> axis = Vector3<>::UnitZ();  ///< of a flat end, unit, out of the body, in the body's frame

  Latest<PressedNodes>* watched = nullptr;  ///< told of every tick, if given; of one loop at a time

  [[nodiscard]] explicit operator bool() const noexcept { return body != nullptr; }
};

/// One tip on one body in a loop: from the tip's place in the device's frame to the force on it.
class BodyTouch {
 public:
  explicit BodyTouch(const TouchedBody& t) : body_(t.body->fresh()), watched_(t.watched), origin_(t.origin), turn_(t.turn) {
    tip_.kind = t.tip;
    tip_.radius = t.radius;
    tip_.outward = t.axis;
  }

  /// Goes on by one period with the tip's centre at `place` [m, device's frame]; returns the force of the tip on the body [N].
  Vector3<> step(const Vector3<>& place) noexcept {
    tip_.centre = turn_.transpose() * (place - origin_);
    if (tip_.kind == BodyTip::Kind::sphere) face();
    const BodyAnswer& answer = body_->step(tip_);
    if (watched_ != nullptr) tell(answer.nodes);
    return -(turn_ * answer.force);
  }

  [[nodiscard]] const BodyAnswer& answer() const noexcept { return body_->last(); }
  [[nodiscard]] const LoopBody& body() const noexcept { return *body_; }

  /// Mean displacement of the pressed patch [m], device's frame.
  [[nodiscard]] Vector3<> deflection() const noexcept { return turn_ * body_->last().deflection; }

 private:
  /// A sphere faces where the nodes that it presses face; while it is free, where the nearest one does.
  void face() noexcept {
    const BodyNodes& nodes = body_->nodes();
    Vector3<> outward = Vector3<>::Zero();
    for (int k = 0; k < body_->last().nodes; ++k) outward += body_->forces()[k] * nodes.normal(body_->pressed()[k]);
    const double length = outward.norm();
    if (length > 0.0) {
      tip_.outward = outward / length;
      return;
    }
    const std::int32_t node = nodes.nearest(tip_.centre, 2.0 * tip_.radius);
    if (node >= 0) tip_.outward = nodes.normal(node);
  }

  void tell(int count) noexcept {
    PressedNodes& next = watched_->next();
    next.tick = tick_++;
    next.count = std::min(count, PressedNodes::capacity);
    std::copy_n(body_->pressed(), next.count, next.node.begin());
    for (int k = 0; k < next.count; ++k) {
      const std::int32_t node = body_->pressed()[k];
      next.force[static_cast<std::size_t>(k)] = body_->dragged(node) - body_->forces()[k] * body_->nodes().normal(node);
    }
    watched_->publish();
  }

  std::unique_ptr<LoopBody> body_;
  Latest<PressedNodes>* watched_;
  std::int64_t tick_ = 0;
  Vector3<> origin_;
  Eigen::Matrix3d turn_;
  BodyTip tip_;
};

}  // namespace palpate
