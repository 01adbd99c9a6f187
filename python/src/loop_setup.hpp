#pragma once

#include <memory>
#include <palpate/object/body_instance.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/servo/simulation.hpp>
#include <utility>

#include "python_parts.hpp"

/// A simulated loop as Python fills it in: wall parameters stay editable until the loop is built.
template <class Mechanism>
struct LoopSetup : palpate::servo::SimulationSetup<Mechanism> {
  palpate::object::SpringWallParameters wall;
  palpate::object::BodyPlacement placement;
  bool is_wall = true;
  std::shared_ptr<PythonFault> fault = std::make_shared<PythonFault>();

  void python_object(nanobind::object part) {
    this->object = PythonObject(std::move(part), fault);
    is_wall = false;
  }
  void python_controller(nanobind::object part) { this->controller = PythonController(std::move(part), fault); }

  /// Return the setup with its object.
  [[nodiscard]] palpate::servo::SimulationSetup<Mechanism> complete() const {
    palpate::servo::SimulationSetup<Mechanism> out = *this;
    if (is_wall) out.object = palpate::object::SpringWall(wall);
    if (placement.body) out.object = palpate::object::BodyInstance(placement);
    return out;
  }
};
