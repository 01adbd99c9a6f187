#pragma once

#include <memory>
#include <optional>
#include <palpate/object/body_instance.hpp>
#include <palpate/object/moving_frame.hpp>
#include <palpate/object/scene.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/servo/simulation.hpp>
#include <utility>
#include <vector>

#include "python_parts.hpp"

/// One object as Python fills it in: its parameters stay editable until the loop is built.
struct ObjectSetup {
  palpate::object::SpringWallParameters wall;
  palpate::object::BodyPlacement placement;
  std::optional<palpate::object::AnyObject> other;  // a mesh, or an object written in Python
  palpate::object::FrameMotion motion;

  [[nodiscard]] palpate::object::AnyObject build() const {
    palpate::object::AnyObject still = other.value_or(palpate::object::SpringWall(wall));
    if (placement.body) still = palpate::object::BodyInstance(placement);
    if (motion.empty()) return still;
    return palpate::object::MovingFrame<palpate::object::AnyObject>(std::move(still), motion);
  }
};

/// A simulated loop as Python fills it in, with one object or several.
template <class Mechanism>
struct LoopSetup : palpate::servo::SimulationSetup<Mechanism>, ObjectSetup {
  std::vector<ObjectSetup> scene;  // the objects if there are several
  std::shared_ptr<PythonFault> fault = std::make_shared<PythonFault>();

  void python_object(nanobind::object part) { other = palpate::object::AnyObject(PythonObject(std::move(part), fault)); }
  void python_controller(nanobind::object part) { this->controller = PythonController(std::move(part), fault); }

  /// Return the setup with its object.
  [[nodiscard]] palpate::servo::SimulationSetup<Mechanism> complete() const {
    palpate::servo::SimulationSetup<Mechanism> out = *this;
    out.object = build();
    if (scene.empty()) return out;
    palpate::object::Scene objects;
    for (const ObjectSetup& one : scene) objects.add(one.build());
    out.object = std::move(objects);
    return out;
  }
};
