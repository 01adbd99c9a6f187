/// The Python face of the core: batches of states in, arrays out, the loop's runs without the interpreter's lock.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <chrono>
#include <optional>
#include <palpate/palpate.hpp>
#include <thread>
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "body_in_loop.hpp"
#include "mechanism_module.hpp"
#include "slow_thread.hpp"
#include "solid_frames.hpp"
#include "surface_frames.hpp"
#include "touch_mesh.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

/// Runs the nonlinear device's loop and times the servo's part of each period. If it is paced, a body's slow steps have a thread.
template <class Mechanism>
void time_ticks(const palpate::servo::SimulationSetup<Mechanism>& setup, int ticks, const double* reference, const double* operator_force,
                bool paced, double* seconds) {
  using Time = std::chrono::steady_clock;
  palpate::servo::detail::MovingPlant<Mechanism> plant(setup);
  palpate::servo::Servo<Mechanism> servo(setup);
  const palpate::actuation::TickSchedule<double> regular(setup.period, 0.0, 0);
  std::optional<SlowThread> slow;
  palpate::object::BodyInstance* body = servo.body();
  if (paced && body != nullptr && body->body().slow()) slow.emplace([body] { body->body().slow_step(); });
  const Time::time_point first = Time::now();
  for (int k = 0; k < ticks; ++k) {
    if (paced)
      std::this_thread::sleep_until(first + std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(k * setup.period)));
    const Time::time_point begin = Time::now();
    const auto& tick = palpate::servo::detail::tick_of(
        servo, plant, palpate::math::Vector3<>(Eigen::Map<const palpate::math::Vector3<>>(reference + 3 * k)));
    seconds[k] = std::chrono::duration<double>(Time::now() - begin).count();
    if (!slow) servo.in_turn();
    const palpate::math::Vector3<> push = Eigen::Map<const palpate::math::Vector3<>>(operator_force + 3 * k);
    plant.advance(tick.torque, {push, push}, regular);
  }
}

template <class Mechanism>
void bind_loop(nb::module_& m, const char* name) {
  constexpr int dof = Mechanism::dof;
  using Setup = palpate::servo::SimulationSetup<Mechanism>;
  using JointFriction = palpate::plant::JointFriction<dof>;
  using Limits = palpate::actuation::DriveLimits<dof>;
  const std::string prefix = name;

  nb::class_<JointFriction>(m, (prefix + "Friction").c_str())
      .def(nb::init<>())
      .def_rw("viscous", &JointFriction::viscous)
      .def_rw("coulomb", &JointFriction::coulomb)
      .def_rw("breakaway", &JointFriction::breakaway)
      .def_rw("stribeck_speed", &JointFriction::stribeck_speed);
  nb::class_<Limits>(m, (prefix + "Limits").c_str())
      .def(nb::init<>())
      .def_rw("peak_force", &Limits::peak_force)
      .def_rw("continuous_force", &Limits::continuous_force)
      .def_rw("thermal_time", &Limits::thermal_time)
      .def_rw("peak_torque", &Limits::peak_torque);
  nb::class_<Setup>(m, (prefix + "Setup").c_str())
      .def(nb::init<>())
      .def_rw("mechanism", &Setup::mechanism)
      .def_rw("friction", &Setup::friction)
      .def_rw("hand", &Setup::hand)
      .def_prop_rw(
          "encoder_step", [](const Setup& s) { return s.encoder.step; },
          [](Setup& s, const palpate::math::Joints<dof>& step) { s.encoder.step = step; })
      .def_rw("limits", &Setup::limits)
      .def_rw("delay", &Setup::delay)
      .def_rw("anchor", &Setup::anchor)
      .def_rw("stiffness", &Setup::stiffness)
      .def_rw("damping", &Setup::damping)
      .def_rw("difference", &Setup::difference)
      .def_rw("controller", &Setup::controller)
      .def_rw("hold", &Setup::hold)
      .def_rw("frozen_kinematics", &Setup::frozen_kinematics)
      .def_rw("held", &Setup::held)
      .def_rw("linear", &Setup::linear)
      .def_rw("plant_a", &Setup::plant_a)
      .def_rw("plant_b", &Setup::plant_b)
      .def_rw("plant_c", &Setup::plant_c)
      .def_rw("working_torque", &Setup::working_torque)
      .def_rw("start", &Setup::start)
      .def_rw("start_speed", &Setup::start_speed)
      .def_rw("period", &Setup::period)
      .def_rw("substeps", &Setup::substeps)
      .def_rw("record_every", &Setup::record_every)
      .def_rw("speed_limit", &Setup::speed_limit)
      .def_rw("jitter", &Setup::jitter)
      .def_rw("seed", &Setup::seed)
      .def(
          "lateness",
          [](const Setup& self, int ticks) {
            palpate::actuation::TickSchedule<double> clock(self.period, self.jitter, self.seed);
            auto [out, data] = new_array<double>({static_cast<std::size_t>(ticks) + 1});
            for (int k = 0; k <= ticks; ++k, clock.tick()) data[k] = clock.lateness();
            return out;
          },
          "ticks"_a, "How late each tick comes, 0 to `ticks`, s.")
      .def(
          "touch", [](Setup& s, const TouchedSurface& t) { s.touched = t.touched(); }, "surface"_a, nb::keep_alive<1, 2>(),
          "Puts a mesh in the anchor's place.")
      .def(
          "touch_body", [](Setup& s, const BodyPlacement& t) { s.body = t.placed; }, "body"_a, nb::keep_alive<1, 2>(),
          "Puts a body that yields in the anchor's place.")
      .def(
          "watch", [](Setup& s, SurfaceFrames& f) { s.body.watched = f.pressed(); }, "frames"_a, nb::keep_alive<1, 2>(),
          "Lets a thread draw the body that was put there.")
      .def(
          "watch", [](Setup& s, SolidFrames& f) { s.body.drawn = f.box(); }, "frames"_a, nb::keep_alive<1, 2>(),
          "Shows each slow step of the body that was put there.")
      .def(
          "time_ticks",
          [](const Setup& self, const Rows& reference, const Rows& operator_force, bool paced) {
            if (reference.shape(0) < 1 || reference.shape(1) != 3 || operator_force.shape(0) != reference.shape(0) ||
                operator_force.shape(1) != 3)
              throw nb::value_error("reference and operator_force must both be (ticks + 1) x 3");
            auto [seconds, data] = new_array<double>({reference.shape(0)});
            const nb::gil_scoped_release unlocked;
            time_ticks(self, static_cast<int>(reference.shape(0)), reference.data(), operator_force.data(), paced, data);
            return seconds;
          },
          "reference"_a, "operator_force"_a, "paced"_a,
          "How long each of the servo's ticks took, s, the clock's own time included; paced: one a period, as on a device.")
      .def(
          "run",
          [](const Setup& self, const Rows& reference, const Rows& operator_force) {
            if (reference.shape(0) < 1 || reference.shape(1) != 3 || operator_force.shape(0) != reference.shape(0) ||
                operator_force.shape(1) != 3)
              throw nb::value_error("reference and operator_force must both be (ticks + 1) x 3");
            const int ticks = static_cast<int>(reference.shape(0)) - 1;
            const int most = ticks / self.record_every + 1;
            auto [rows, data] =
                new_array<double>({static_cast<std::size_t>(most), static_cast<std::size_t>(palpate::servo::row_width(self))});
            palpate::servo::SimulationOutcome outcome;
            {
              const nb::gil_scoped_release unlocked;
              outcome = palpate::servo::simulate(self, ticks, reference.data(), operator_force.data(), data);
            }
            return nb::make_tuple(rows, outcome.rows, outcome.unstable_tick);
          },
          "reference"_a, "operator_force"_a, "Runs the loop; returns (rows, number of rows written, tick of divergence or -1).");
}

}  // namespace

void bind_batch(nb::module_& m);
void bind_body(nb::module_& m);
void bind_front(nb::module_& m);
void bind_solid(nb::module_& m);
void bind_touch(nb::module_& m);

NB_MODULE(_core, m) {
  nb::set_leak_warnings(false);  // the device cache outlives the module on purpose
  m.doc() = "palpate's core: device dynamics and the servo loop.";

  bind_body(m);
  bind_front(m);
  bind_solid(m);
  bind_touch(m);

  nb::class_<palpate::plant::HumanArm>(m, "Hand")
      .def(nb::init<>())
      .def_rw("mass", &palpate::plant::HumanArm::mass)
      .def_rw("damping", &palpate::plant::HumanArm::damping)
      .def_rw("stiffness", &palpate::plant::HumanArm::stiffness)
      .def_rw("tissue", &palpate::plant::HumanArm::tissue)
      .def_rw("tissue_stiffness", &palpate::plant::HumanArm::tissue_stiffness)
      .def_rw("tissue_damping", &palpate::plant::HumanArm::tissue_damping)
      .def_rw("rest", &palpate::plant::HumanArm::rest);

  nb::class_<palpate::object::SpringWall> anchor(m, "Anchor");
  nb::enum_<palpate::object::SpringWall::Kind>(anchor, "Kind")
      .value("none", palpate::object::SpringWall::Kind::none)
      .value("point", palpate::object::SpringWall::Kind::point)
      .value("half_space", palpate::object::SpringWall::Kind::half_space);
  anchor.def(nb::init<>())
      .def_rw("kind", &palpate::object::SpringWall::kind)
      .def_rw("point", &palpate::object::SpringWall::point)
      .def_rw("normal", &palpate::object::SpringWall::normal);

  nb::enum_<palpate::control::VirtualCoupling::Difference>(m, "Difference")
      .value("backward", palpate::control::VirtualCoupling::Difference::backward)
      .value("bilinear", palpate::control::VirtualCoupling::Difference::bilinear);

  nb::class_<palpate::control::StateSpace>(m, "StateSpace")
      .def(nb::init<>())
      .def(nb::init<const Eigen::MatrixXd&, const Eigen::MatrixXd&, const Eigen::MatrixXd&, const Eigen::MatrixXd&,
                    const Eigen::MatrixXd&>(),
           "a"_a, "b"_a, "c"_a, "d"_a, "antiwindup"_a)
      .def_prop_ro("order", &palpate::control::StateSpace::order)
      .def("output", &palpate::control::StateSpace::output)
      .def("advance", &palpate::control::StateSpace::advance);

  palpate::mechanism::Registry::for_each([&m]<class Mechanism>() { bind_loop<Mechanism>(m, class_name<Mechanism>().c_str()); });
  bind_mechanisms(m);
  bind_batch(m);
}
