#pragma once

/// Python bindings of the servo loop of any mechanism.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <chrono>
#include <memory>
#include <optional>
#include <palpate/control/admittance_controller.hpp>
#include <palpate/control/workspace_controller.hpp>
#include <palpate/object/body_instance.hpp>
#include <palpate/object/mesh_object.hpp>
#include <palpate/object/supported_body.hpp>
#include <palpate/servo/batch.hpp>
#include <palpate/servo/loop.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "body_in_loop.hpp"
#include "guard_binding.hpp"
#include "loop_setup.hpp"
#include "python_parts.hpp"
#include "slow_thread.hpp"
#include "solid_frames.hpp"
#include "support_nodes.hpp"
#include "surface_frames.hpp"
#include "touch_mesh.hpp"

namespace nb = nanobind;
using namespace nb::literals;

/// Run the loop of the moving device and time the servo's part of each period. If `paced`, model updates of a body run in a thread.
template <class Mechanism, class Plant>
void time_ticks(const LoopSetup<Mechanism>& setup, Plant plant, int ticks, const double* reference, const double* operator_force,
                bool paced, double* seconds) {
  using Time = std::chrono::steady_clock;
  const palpate::servo::SimulationSetup<Mechanism> loop = setup.complete();
  typename palpate::servo::Loop<Mechanism>::LoopServo servo(loop, loop.object, loop.controller, loop.guard);
  const palpate::actuation::TickSchedule<double> regular(setup.period, 0.0, 0);
  std::optional<SlowThread> slow;
  auto* body = servo.object().template get_if<palpate::object::BodyInstance>();
  if (paced && body != nullptr && body->body().is_multirate()) slow.emplace([body] { body->body().update_model(); });
  const Time::time_point first = Time::now();
  for (int k = 0; k < ticks; ++k) {
    if (paced)
      std::this_thread::sleep_until(first + std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(k * setup.period)));
    const palpate::math::Vector3<> push = Eigen::Map<const palpate::math::Vector3<>>(operator_force + 3 * k);
    const Time::time_point begin = Time::now();
    const auto& tick = palpate::servo::detail::tick_of(
        servo, plant, palpate::math::Vector3<>(Eigen::Map<const palpate::math::Vector3<>>(reference + 3 * k)), push);
    seconds[k] = std::chrono::duration<double>(Time::now() - begin).count();
    if (!slow) servo.update();
    plant.advance(tick.torque, {push, push}, regular);
  }
}

/// Bind friction and limits of joints. Mechanisms with the same number of joints share these types.
template <int dof>
void bind_joint_types(nb::module_& m, const std::string& prefix) {
  using JointFriction = palpate::plant::JointFriction<dof>;
  using Limits = palpate::actuation::DriveLimits<dof>;
  const std::string friction = prefix + "Friction";
  const std::string limits = prefix + "Limits";
  if (const nb::handle bound = nb::type<JointFriction>(); bound.is_valid()) {
    m.attr(friction.c_str()) = bound;
    m.attr(limits.c_str()) = nb::type<Limits>();
    return;
  }
  nb::class_<JointFriction>(m, friction.c_str())
      .def(nb::init<>())
      .def_rw("viscous", &JointFriction::viscous)
      .def_rw("coulomb", &JointFriction::coulomb)
      .def_rw("breakaway", &JointFriction::breakaway)
      .def_rw("stribeck_speed", &JointFriction::stribeck_speed);
  nb::class_<Limits>(m, limits.c_str())
      .def(nb::init<>())
      .def_rw("peak_force", &Limits::peak_force)
      .def_rw("continuous_force", &Limits::continuous_force)
      .def_rw("thermal_time", &Limits::thermal_time)
      .def_rw("peak_torque", &Limits::peak_torque);
}

/// Bind the parameters of one object.
template <class Setup>
void bind_object(nb::class_<Setup>& cls) {
  cls.def_prop_rw(
         "wall", [](Setup& s) -> palpate::object::SpringWallParameters& { return s.wall; },
         [](Setup& s, const palpate::object::SpringWallParameters& p) {
           s.wall.kind = p.kind;
           s.wall.point = p.point;
           s.wall.normal = p.normal;
         },
         nb::rv_policy::reference_internal)
      .def_prop_rw(
          "stiffness", [](const Setup& s) { return s.wall.stiffness; },
          [](Setup& s, const palpate::math::Vector3<>& x) { s.wall.stiffness = x; })
      .def_prop_rw(
          "damping", [](const Setup& s) { return s.wall.damping; }, [](Setup& s, const palpate::math::Vector3<>& x) { s.wall.damping = x; })
      .def_prop_rw(
          "difference", [](const Setup& s) { return s.wall.difference; },
          [](Setup& s, palpate::object::CouplingDifference x) { s.wall.difference = x; })
      .def(
          "set_mesh", [](Setup& s, const TouchedSurface& t) { s.other = palpate::object::MeshObject(t.model(), t.radius); }, "surface"_a,
          "Use a mesh as the object.")
      .def(
          "set_object", [](Setup& s, const palpate::object::AnyObject& one) { s.other = one; }, "object"_a,
          "Use a force law, a field or a textured wall as the object.")
      .def(
          "set_body", [](Setup& s, const PlacedBody& t) { s.placement = t.placement; }, "body"_a, nb::keep_alive<1, 2>(),
          "Use a deformable body as the object.")
      .def(
          "set_motion",
          [](Setup& s, const palpate::math::Vector3<>& origin, const nb::ndarray<const double, nb::shape<-1, 7>, nb::c_contig>& rows) {
            std::vector<palpate::object::FrameMotion::Row> motion;
            for (const double* r = rows.data(); r != rows.data() + rows.size(); r += 7)
              motion.push_back({r[0], {r[1], r[2], r[3]}, {r[4], r[5], r[6]}});
            s.motion = palpate::object::FrameMotion(origin, std::move(motion));
          },
          "origin"_a, "rows"_a,
          "Attach the object to a frame with its origin at `origin`, m. Rows of increasing time, s; displacement (3), m; angles about x, "
          "then y, then z of the device, rad.");
}

template <class Mechanism>
void bind_loop(nb::module_& m, const char* name) {
  constexpr int dof = Mechanism::dof;
  using Setup = LoopSetup<Mechanism>;
  const std::string prefix = name;

  bind_joint_types<dof>(m, prefix);
  nb::class_<Setup> setup(m, (prefix + "Setup").c_str());
  bind_object(setup);
  bind_guards<Mechanism>(setup);
  if constexpr (dof <= 3) {
    setup.def(
        "set_workspace_controller",
        [](Setup& s, const Mechanism& mechanism, const palpate::math::Joints<dof>& friction,
           const palpate::control::WorkspaceParameters& parameters) {
          require_valid(parameters);
          s.controller = palpate::control::WorkspaceController<Mechanism>(mechanism, friction, parameters, s.period);
        },
        "mechanism"_a, "friction"_a, "parameters"_a,
        "Use a workspace controller that knows this mechanism and viscous friction; set the period before.");
    setup.def(
        "set_admittance_controller",
        [](Setup& s, const Mechanism& mechanism, const palpate::math::Joints<dof>& friction,
           const palpate::control::WorkspaceParameters& parameters, double mass, double damping) {
          const palpate::control::VirtualTool tool{mass, damping};
          require_valid(parameters);
          require_valid(tool);
          s.controller = palpate::control::AdmittanceController<Mechanism>(mechanism, friction, parameters, tool, s.period);
        },
        "mechanism"_a, "friction"_a, "parameters"_a, "mass"_a, "damping"_a,
        "Use an admittance display with a tool of this mass, kg, and damping, N s/m; set the period before.");
  }
  setup.def(nb::init<>())
      .def_rw("mechanism", &Setup::mechanism)
      .def_rw("friction", &Setup::friction)
      .def_rw("human_arm", &Setup::human_arm)
      .def_rw("flexible", &Setup::flexible, nb::arg().none())
      .def_prop_rw(
          "encoder_step", [](const Setup& s) { return s.encoder.step; },
          [](Setup& s, const palpate::math::Joints<dof>& step) { s.encoder.step = step; })
      .def_rw("limits", &Setup::limits)
      .def_rw("delay", &Setup::delay)
      .def_prop_rw(
          "controller", [](const Setup& s) { return *s.controller.template get_if<palpate::control::StateSpace>(); },
          [](Setup& s, const palpate::control::StateSpace& c) { s.controller = c; })
      .def_rw("gravity_compensation", &Setup::gravity_compensation)
      .def_rw("frozen_kinematics", &Setup::frozen_kinematics)
      .def_rw("fixed", &Setup::fixed)
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
      .def_rw("window_start", &Setup::window_start)
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
          "ticks"_a, "Return the lateness of ticks 0 to `ticks`, s.")
      .def(
          "add_object", [](Setup& s, const ObjectSetup& one) { s.scene.push_back(one); }, "object"_a, nb::keep_alive<1, 2>(),
          "Add an object to the scene, which then replaces the single object of the setup.")
      .def(
          "set_python_object", [](Setup& s, nb::object part) { s.python_object(std::move(part)); }, "object"_a,
          "Use an object written in Python: a callable from TipSignals to a force, N, or an object with `step`.")
      .def(
          "set_python_controller", [](Setup& s, nb::object part) { s.python_controller(std::move(part)); }, "controller"_a,
          "Use a controller written in Python: a callable from TickSignals to a force, N, or an object with `command`.")
      .def(
          "set_observer", [](Setup& s, SurfaceFrames& f) { s.placement.contact_frames = f.pressed(); }, "frames"_a, nb::keep_alive<1, 2>(),
          "Compute the displacement of the body's surface in a thread.")
      .def(
          "set_observer", [](Setup& s, SolidFrames& f) { s.placement.deformation_frames = f.box(); }, "frames"_a, nb::keep_alive<1, 2>(),
          "Publish each model update of the body.")
      .def(
          "time_ticks",
          [](const Setup& self, const Rows& reference, const Rows& operator_force, bool paced) {
            check_signals(reference, operator_force);
            auto [seconds, data] = new_array<double>({reference.shape(0)});
            const nb::gil_scoped_release unlocked;
            const auto time = [&, data = data](auto plant) {
              time_ticks(self, std::move(plant), static_cast<int>(reference.shape(0)), reference.data(), operator_force.data(), paced,
                         data);
            };
            if (self.is_flexible())
              time(palpate::servo::detail::FlexiblePlant<Mechanism>(self));
            else
              time(palpate::servo::detail::MovingPlant<Mechanism>(self));
            return seconds;
          },
          "reference"_a, "operator_force"_a, "paced"_a,
          "Return the duration of each servo tick, s, including the clock's own. paced: one tick each period, as on a device.")
      .def(
          "outcome",
          [](const Setup& self, const Rows& reference, const Rows& operator_force) {
            check_signals(reference, operator_force);
            if (self.fixed || self.linear) throw nb::value_error("an outcome needs the nonlinear device, free to move");
            const palpate::servo::SimulationSetup<Mechanism> loop = self.complete();
            auto [row, data] = new_array<double>({static_cast<std::size_t>(palpate::servo::outcome_width<dof>)});
            {
              const nb::gil_scoped_release unlocked;
              palpate::servo::simulate_outcome(loop, static_cast<int>(reference.shape(0)) - 1, reference.data(), operator_force.data(),
                                               data);
            }
            self.fault->raise();
            return row;
          },
          "reference"_a, "operator_force"_a, "Run the loop with any object and controller; return its outcome as a batch does.")
      .def(
          "run",
          [](const Setup& self, const Rows& reference, const Rows& operator_force) {
            check_signals(reference, operator_force);
            const int ticks = static_cast<int>(reference.shape(0)) - 1;
            const int most = ticks / self.record_every + 1;
            const palpate::servo::SimulationSetup<Mechanism> loop = self.complete();
            auto [rows, data] =
                new_array<double>({static_cast<std::size_t>(most), static_cast<std::size_t>(palpate::servo::row_width(loop))});
            palpate::servo::SimulationOutcome outcome;
            {
              const nb::gil_scoped_release unlocked;
              outcome = palpate::servo::simulate(loop, ticks, reference.data(), operator_force.data(), data);
            }
            self.fault->raise();
            return nb::make_tuple(rows, outcome.rows, outcome.unstable_tick);
          },
          "reference"_a, "operator_force"_a, "Run the loop. Return (rows, number of rows written, tick of divergence or -1).");

  using SteppedLoop = palpate::servo::Loop<Mechanism>;
  struct Stepped {
    std::shared_ptr<PythonFault> fault;
    SteppedLoop loop;
  };
  nb::class_<Stepped>(m, (prefix + "Loop").c_str())
      .def(
          "__init__",
          [](Stepped* self, const Setup& setup) {
            new (self) Stepped{setup.fault, SteppedLoop(setup.complete())};
            self->fault->raise();
          },
          "setup"_a, nb::keep_alive<1, 2>())
      .def(
          "reset",
          [](Stepped& self) {
            self.loop.reset();
            self.fault->raise();
          },
          "Return to the first sample.")
      .def(
          "tick",
          [](Stepped& self, const palpate::math::Vector3<>& reference, const palpate::math::Vector3<>& operator_force) {
            self.loop.tick(reference, operator_force);
            self.fault->raise();
            auto [row, data] = new_array<double>({static_cast<std::size_t>(palpate::servo::row_width(self.loop.setup()))});
            self.loop.record(operator_force, data);
            return row;
          },
          "reference"_a, "operator_force"_a, "Run the servo's tick at this sample; return its row, as `run` records it.")
      .def(
          "advance",
          [](Stepped& self, const palpate::math::Vector3<>& begin, const palpate::math::Vector3<>& end) {
            const bool goes_on = self.loop.advance(begin, end);
            self.fault->raise();
            return goes_on;
          },
          "begin"_a, "end"_a,
          "Move the plant by one period under the operator's force, N, linear from `begin` to `end`; false once the loop has diverged.")
      .def(
          "change_supports",
          [](Stepped& self, const nb::ndarray<const std::uint8_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>& roles) {
            auto* instance = self.loop.servo().object().template get_if<palpate::object::BodyInstance>();
            palpate::object::BodyWithSupports* const body = instance == nullptr ? nullptr : instance->body().with_supports();
            if (body == nullptr || roles.shape(0) != body->size()) throw nb::value_error("the supports of the object do not change");
            if (!body->change_supports(support_nodes(roles.data(), roles.shape(0))))
              throw nb::value_error("the compliance of the held nodes is singular to rounding; hold fewer nodes");
          },
          "roles"_a, "Change the supports of the body at the next tick; roles of its nodes as in SupportedBody.")
      .def(
          "move_tool",
          [](Stepped& self, const palpate::math::Vector3<>& angles, double opening) {
            auto* instance = self.loop.servo().object().template get_if<palpate::object::BodyInstance>();
            if (instance == nullptr || !instance->has_moving_tool()) throw nb::value_error("the object has no tool that moves");
            instance->set_tool({angles, opening});
          },
          "angles"_a, "opening"_a, "Turn, open or close the tool from the next tick on, in place of its motion; see ToolMotion.")
      .def_prop_ro("angles", [](const Stepped& self) { return self.loop.angles(); })
      .def_prop_ro("speeds", [](const Stepped& self) { return self.loop.speeds(); })
      .def_prop_ro("time", [](const Stepped& self) { return self.loop.time(); })
      .def_prop_ro("count", [](const Stepped& self) { return self.loop.count(); })
      .def_prop_ro("diverged", [](const Stepped& self) { return self.loop.diverged(); });
}

/// The types that loops of every mechanism share.
inline void bind_loop_parts(nb::module_& m) {
  using palpate::object::SpringWallKind, palpate::object::SpringWallParameters, palpate::control::StateSpace;
  nb::class_<SpringWallParameters> wall(m, "SpringWallParameters");
  nb::enum_<SpringWallKind>(wall, "Kind")
      .value("none", SpringWallKind::none)
      .value("point", SpringWallKind::point)
      .value("half_space", SpringWallKind::half_space);
  wall.def(nb::init<>())
      .def_rw("kind", &SpringWallParameters::kind)
      .def_rw("point", &SpringWallParameters::point)
      .def_rw("normal", &SpringWallParameters::normal);

  nb::class_<ObjectSetup> object(m, "ObjectSetup", "One object of a scene.");
  object.def(nb::init<>());
  bind_object(object);

  nb::enum_<palpate::object::CouplingDifference>(m, "CouplingDifference")
      .value("backward", palpate::object::CouplingDifference::backward)
      .value("bilinear", palpate::object::CouplingDifference::bilinear);

  nb::class_<StateSpace>(m, "StateSpace")
      .def(nb::init<>())
      .def(nb::init<const Eigen::MatrixXd&, const Eigen::MatrixXd&, const Eigen::MatrixXd&, const Eigen::MatrixXd&,
                    const Eigen::MatrixXd&>(),
           "a"_a, "b"_a, "c"_a, "d"_a, "antiwindup"_a)
      .def("normalize", &StateSpace::normalize, "design_stiffness"_a,
           "Scale reference and object force of each tick to an object of this stiffness per axis, N/m.")
      .def_prop_ro("order", &StateSpace::order)
      .def("output", &StateSpace::output)
      .def("advance", &StateSpace::applied);

  using palpate::control::WorkspaceGains, palpate::control::WorkspaceParameters;
  nb::class_<WorkspaceParameters>(m, "WorkspaceParameters")
      .def(nb::init<>())
      .def_rw("bandwidth", &WorkspaceParameters::bandwidth)
      .def_rw("damping", &WorkspaceParameters::damping)
      .def_rw("observer", &WorkspaceParameters::observer)
      .def_rw("disturbance", &WorkspaceParameters::disturbance)
      .def_rw("reference", &WorkspaceParameters::reference)
      .def_rw("reference_damping", &WorkspaceParameters::reference_damping)
      .def_rw("share", &WorkspaceParameters::share)
      .def_rw("stiffness", &WorkspaceParameters::stiffness)
      .def_rw("normal_only", &WorkspaceParameters::normal_only)
      .def_rw("operator_mass", &WorkspaceParameters::operator_mass)
      .def("fault", &WorkspaceParameters::fault, "Return the first thing that is wrong; None if nothing is.");
  nb::class_<WorkspaceGains>(m, "WorkspaceGains", "Gains of a workspace controller for one axis.")
      .def(nb::init<const WorkspaceParameters&, double>(), "parameters"_a, "period"_a)
      .def_ro("position", &WorkspaceGains::position)
      .def_ro("velocity", &WorkspaceGains::velocity)
      .def_ro("observer", &WorkspaceGains::observer)
      .def_ro("reference_position", &WorkspaceGains::reference_position)
      .def_ro("reference_velocity", &WorkspaceGains::reference_velocity);

  bind_guard_parts(m);
  nb::class_<TickSignals>(m, "TickSignals", "Signals of one servo tick: SI units, device frame.")
      .def_ro("time", &TickSignals::time, "Since the first tick, s.")
      .def_ro("reference", &TickSignals::reference, "Force that the object should feel (3,), N.")
      .def_ro("object_force", &TickSignals::object_force, "Force of the tip on the object (3,), N.")
      .def_ro("deflection", &TickSignals::deflection, "Displacement of the touched surface (3,), m.")
      .def_ro("normal", &TickSignals::normal, "Outward normal of the touched surface (3,); zero: no contact, or no surface.")
      .def_ro("depth", &TickSignals::depth, "Penetration along the normal, m; negative: outside.")
      .def_ro("stiffness", &TickSignals::stiffness, "Of the object along the normal, N/m; zero: not known.")
      .def_ro("tip", &TickSignals::tip, "Measured tip position (3,), m.")
      .def_ro("velocity", &TickSignals::velocity, "Tip velocity by backward difference (3,), m/s.");
  nb::class_<TipSignals>(m, "TipSignals", "The tip at one sample: SI units, device frame.")
      .def_ro("time", &TipSignals::time, "Since the first sample, s.")
      .def_ro("position", &TipSignals::position, "(3,), m.")
      .def_ro("velocity", &TipSignals::velocity, "By backward difference (3,), m/s.");
  using palpate::object::ContactResult;
  nb::class_<ContactResult>(m, "ContactResult", "Contact of the tip with an object at one sample.")
      .def(
          "__init__",
          [](ContactResult* self, const palpate::math::Vector3<>& force, const palpate::math::Vector3<>& deflection,
             const palpate::math::Vector3<>& normal, double depth, double stiffness, std::optional<bool> touching) {
            new (self) ContactResult{force, deflection, normal, depth, stiffness, touching.value_or(!force.isZero(0.0))};
          },
          "force"_a, "deflection"_a = palpate::math::Vector3<>(palpate::math::Vector3<>::Zero()),
          "normal"_a = palpate::math::Vector3<>(palpate::math::Vector3<>::Zero()), "depth"_a = 0.0, "stiffness"_a = 0.0,
          "touching"_a = nb::none(), "force: of the tip on the object, N. Without `touching` the tip touches if the force is not zero.")
      .def_rw("force", &ContactResult::force)
      .def_rw("deflection", &ContactResult::deflection)
      .def_rw("normal", &ContactResult::normal)
      .def_rw("depth", &ContactResult::depth)
      .def_rw("stiffness", &ContactResult::stiffness)
      .def_rw("touching", &ContactResult::touching);
}
