/// The Python face of the batch: cells as columns of numbers, their outcomes as rows.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>

#include <functional>
#include <map>
#include <palpate/math/machine_lanes.hpp>
#include <palpate/object/body_instance.hpp>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "batch.hpp"
#include "loop_setup.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

/// Columns that cells may have of their own, each with how many numbers it takes and where they go.
template <class Mechanism>
struct Columns {
  static constexpr int dof = Mechanism::dof;
  using Setup = LoopSetup<Mechanism>;
  struct Column {
    int width;
    std::function<void(Setup&, const double*)> set;
  };

  template <class Get>
  static Column one(Get get) {
    return {1, [get](Setup& s, const double* x) { get(s) = *x; }};
  }
  template <class Get>
  static Column three(Get get) {
    return {3, [get](Setup& s, const double* x) { get(s) = Eigen::Map<const palpate::math::Vector3<>>(x); }};
  }
  template <class Get>
  static Column joints(Get get) {
    return {dof, [get](Setup& s, const double* x) { get(s) = Eigen::Map<const palpate::math::Joints<dof>>(x); }};
  }

  static const std::map<std::string, Column>& all() {
    static const std::map<std::string, Column> columns = {
        {"stiffness", three([](Setup& s) -> auto& { return s.wall.stiffness; })},
        {"damping", three([](Setup& s) -> auto& { return s.wall.damping; })},
        {"wall_point", three([](Setup& s) -> auto& { return s.wall.point; })},
        {"gravity_compensation", three([](Setup& s) -> auto& { return s.gravity_compensation; })},
        {"start", joints([](Setup& s) -> auto& { return s.start; })},
        {"start_speed", joints([](Setup& s) -> auto& { return s.start_speed; })},
        {"delay", {1, [](Setup& s, const double* x) { s.delay = static_cast<int>(*x); }}},
        {"jitter", one([](Setup& s) -> auto& { return s.jitter; })},
        {"seed", {1, [](Setup& s, const double* x) { s.seed = static_cast<std::uint64_t>(*x); }}},
        {"arm_mass", one([](Setup& s) -> auto& { return s.human_arm.mass; })},
        {"arm_damping", one([](Setup& s) -> auto& { return s.human_arm.damping; })},
        {"arm_stiffness", one([](Setup& s) -> auto& { return s.human_arm.stiffness; })},
        {"tissue_stiffness", one([](Setup& s) -> auto& { return s.human_arm.tissue_stiffness; })},
        {"tissue_damping", one([](Setup& s) -> auto& { return s.human_arm.tissue_damping; })},
        {"arm_rest", three([](Setup& s) -> auto& { return s.human_arm.rest; })},
        {"encoder_step", joints([](Setup& s) -> auto& { return s.encoder.step; })},
        {"viscous", joints([](Setup& s) -> auto& { return s.friction.viscous; })},
        {"coulomb", joints([](Setup& s) -> auto& { return s.friction.coulomb; })},
        {"breakaway", joints([](Setup& s) -> auto& { return s.friction.breakaway; })},
    };
    return columns;
  }
};

/// Return the first part of a loop that does not run in lanes.
template <class Mechanism>
std::string reason_alone(const palpate::servo::SimulationSetup<Mechanism>& s) {
  if (s.fixed) return "a fixed tip";
  if (s.linear) return "a linear device";
  if (s.guard.active()) return "a guard";
  if (!s.object.template get_if<palpate::object::SpringWall>()) return "another object";
  if constexpr (Mechanism::dof <= 3)
    if (s.controller.template get_if<palpate::control::AdmittanceController<Mechanism>>()) return "the controller of an admittance display";
  return "another controller";
}

template <class Mechanism>
nb::object run_cells(const LoopSetup<Mechanism>& base, const Rows& reference, const Rows& operator_force,
                     const std::map<std::string, Rows>& columns, std::ptrdiff_t count, int threads, int lanes) {
  constexpr int width = palpate::servo::outcome_width<Mechanism::dof>;
  using Setup = LoopSetup<Mechanism>;
  check_signals(reference, operator_force);
  palpate::servo::SimulationSetup<Mechanism> rigid = base.complete();
  rigid.flexible.reset();  // with a mode the cells run one loop at a time
  if (!palpate::servo::runs_in_lanes(rigid))
    throw nb::value_error(
        ("a batch runs the nonlinear device, free to move, at a spring or wall, under a linear or a workspace controller, without a guard; "
         "this loop has " +
         reason_alone(rigid) + ": run it alone")
            .c_str());
  struct Own {
    const double* data;
    int width;
    const std::function<void(Setup&, const double*)>* set;
  };
  std::vector<Own> own;
  const auto& known = Columns<Mechanism>::all();
  for (const auto& [name, rows] : columns) {
    const auto found = known.find(name);
    if (found == known.end()) throw nb::value_error(("cells have no column " + name).c_str());
    if (rows.shape(0) != static_cast<std::size_t>(count) || rows.shape(1) != static_cast<std::size_t>(found->second.width))
      throw nb::value_error(("column " + name + " must be cells x " + std::to_string(found->second.width)).c_str());
    own.push_back({rows.data(), found->second.width, &found->second.set});
  }
  const auto cell = [&own](std::ptrdiff_t i, Setup& setup) {
    for (const Own& column : own) (*column.set)(setup, column.data + i * column.width);
    setup.object = palpate::object::SpringWall(setup.wall);
  };
  auto [rows, row] = new_array<double>({static_cast<std::size_t>(std::max<std::ptrdiff_t>(count, 0)), static_cast<std::size_t>(width)});
  {
    const nb::gil_scoped_release unlocked;
    const int ticks = static_cast<int>(reference.shape(0)) - 1;
    palpate::batch::run_cells<Mechanism>(base, cell, count, ticks, reference.data(), operator_force.data(), row, threads, lanes);
  }
  return nb::cast(rows);
}

}  // namespace

void bind_batch(nb::module_& m) {
  m.def(
      "max_lanes", [] { return palpate::math::with_widest_lanes([](auto lanes) -> int { return lanes(); }); },
      "Loops that run side by side in one thread on this machine.");
  const char* doc = "Runs cells of one base setup; returns a row of outcomes for each.";
  palpate::mechanism::Registry::for_each([&m, doc]<class Mechanism>() {
    m.def("run_cells", &run_cells<Mechanism>, "base"_a, "reference"_a, "operator_force"_a, "columns"_a, "count"_a, "threads"_a = 1,
          "lanes"_a = 0, doc);
  });
}
