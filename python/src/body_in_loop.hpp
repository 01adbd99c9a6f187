#pragma once

#include <nanobind/nanobind.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <palpate/object/body_instance.hpp>

/// Interface of the deformable bodies of Python to a servo loop.
struct BodyInLoop {
  BodyInLoop() = default;
  BodyInLoop(const BodyInLoop&) = delete;
  BodyInLoop& operator=(const BodyInLoop&) = delete;
  BodyInLoop(BodyInLoop&&) = delete;
  BodyInLoop& operator=(BodyInLoop&&) = delete;
  virtual ~BodyInLoop() = default;

  /// Return a copy at rest that refers to the same nodes.
  [[nodiscard]] virtual std::unique_ptr<palpate::object::DeformableObject> in_loop() const = 0;
};

/// A body, its pose and the tip that touches it. The axis of a flat tip is the body's z axis. The Python body must outlive it.
struct PlacedBody {
  palpate::object::BodyPlacement placement;
  std::size_t tips = 0;

  PlacedBody(const BodyInLoop& kind, const palpate::math::Vector3<>& origin, const Eigen::Matrix3d& rotation, double radius, bool flat) {
    placement.body = kind.in_loop();
    placement.origin = origin;
    placement.rotation = rotation;
    placement.tip = flat ? palpate::deformable::Tip::Kind::flat : palpate::deformable::Tip::Kind::sphere;
    placement.radius = radius;
    tips = static_cast<std::size_t>(placement.body->tool_tips());
  }

  /// Move the tips of the body's tool.
  void set_tool(const palpate::object::ToolMotion& tool) {
    if (tool.tips() != tips) throw nanobind::value_error("the motion and the body have different numbers of contact points");
    placement.tool = tool;
  }
};
