/// Python module of the core.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>

#include <palpate/mechanism/flexible_mechanism.hpp>
#include <palpate/mechanism/registry.hpp>
#include <palpate/plant/human_arm.hpp>

#include "loop_binding.hpp"
#include "mechanism_module.hpp"

namespace nb = nanobind;
using namespace nb::literals;

void bind_batch(nb::module_& m);
void bind_body(nb::module_& m);
void bind_force_objects(nb::module_& m);
void bind_front(nb::module_& m);
void bind_solid(nb::module_& m);
void bind_touch(nb::module_& m);

NB_MODULE(_core, m) {
  nb::set_leak_warnings(false);  // the cache of devices outlives the module
  m.doc() = "palpate's core: device dynamics and the servo loop.";

  bind_body(m);
  bind_front(m);
  bind_force_objects(m);
  bind_solid(m);
  bind_touch(m);

  bind_loop_parts(m);

  nb::class_<palpate::plant::HumanArm>(m, "HumanArm")
      .def(nb::init<>())
      .def_rw("mass", &palpate::plant::HumanArm::mass)
      .def_rw("damping", &palpate::plant::HumanArm::damping)
      .def_rw("stiffness", &palpate::plant::HumanArm::stiffness)
      .def_rw("tissue", &palpate::plant::HumanArm::tissue)
      .def_rw("tissue_stiffness", &palpate::plant::HumanArm::tissue_stiffness)
      .def_rw("tissue_damping", &palpate::plant::HumanArm::tissue_damping)
      .def_rw("rest", &palpate::plant::HumanArm::rest);

  using palpate::mechanism::FlexibleMode;
  nb::class_<FlexibleMode>(m, "FlexibleMode", "Lowest mode between motors and tip.")
      .def(
          "__init__",
          [](FlexibleMode* self, double frequency, double tip_share, double damping_ratio) {
            new (self) FlexibleMode{frequency, tip_share, damping_ratio};
          },
          "frequency"_a, "tip_share"_a, "damping_ratio"_a, "frequency: with motors and tip free, Hz.")
      .def_ro("frequency", &FlexibleMode::frequency)
      .def_ro("tip_share", &FlexibleMode::tip_share)
      .def_ro("damping_ratio", &FlexibleMode::damping_ratio)
      .def("fault", &FlexibleMode::fault, "period"_a, "Return the first thing that is wrong with a servo period, s; None if nothing is.");

  palpate::mechanism::Registry::for_each([&m]<class Mechanism>() { bind_loop<Mechanism>(m, class_name<Mechanism>().c_str()); });
  bind_mechanisms(m);
  bind_batch(m);
}
