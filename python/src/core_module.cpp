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
#include "slow_thread.hpp"
#include "solid_frames.hpp"
#include "surface_frames.hpp"
#include "touch_mesh.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <int rows, int columns>
using RowMajor = Eigen::Matrix<double, rows, columns, (columns > 1 ? Eigen::RowMajor : Eigen::ColMajor)>;

template <class Mechanism>
void bind_mechanism(nb::class_<Mechanism>& cls) {
  constexpr int dof = Mechanism::dof;
  using Q = palpate::math::Joints<dof>;
  const auto joint = [](const Rows& a, std::size_t i) { return Q(Eigen::Map<const Q>(a.data() + i * dof)); };

  cls.def("forward", [joint](const Mechanism& self, const Rows& q) {
    auto [out, data] = new_array<double>({q.shape(0), 3});
    for (std::size_t i = 0; i < q.shape(0); ++i) Eigen::Map<palpate::math::Vector3<>>(data + 3 * i) = self.forward(joint(q, i));
    return out;
  });
  cls.def("jacobian", [joint](const Mechanism& self, const Rows& q) {
    auto [out, data] = new_array<double>({q.shape(0), 3, dof});
    for (std::size_t i = 0; i < q.shape(0); ++i) Eigen::Map<RowMajor<3, dof>>(data + 3 * dof * i) = self.jacobian(joint(q, i));
    return out;
  });
  cls.def("tip_hessian", [joint](const Mechanism& self, const Rows& q) {
    using Variable = palpate::math::Dual<dof>;
    auto [out, data] = new_array<double>({q.shape(0), 3, dof, dof});
    for (std::size_t i = 0; i < q.shape(0); ++i) {
      const Q at = joint(q, i);
      palpate::math::Joints<dof, Variable> variables;
      for (int k = 0; k < dof; ++k) variables[k] = Variable::variable(at[k], k);
      const palpate::math::TipJacobian<dof, Variable> j = self.jacobian(variables);
      double* hessian = data + 3 * dof * dof * i;
      for (int row = 0; row < 3; ++row)
        for (int a = 0; a < dof; ++a)
          for (int b = 0; b < dof; ++b) hessian[(row * dof + a) * dof + b] = j(row, a).gradient[b];
    }
    return out;
  });
  cls.def("mass_matrix", [joint](const Mechanism& self, const Rows& q) {
    auto [out, data] = new_array<double>({q.shape(0), dof, dof});
    for (std::size_t i = 0; i < q.shape(0); ++i) Eigen::Map<RowMajor<dof, dof>>(data + dof * dof * i) = self.mass_matrix(joint(q, i));
    return out;
  });
  cls.def("coriolis", [joint](const Mechanism& self, const Rows& q, const Rows& qd) {
    auto [out, data] = new_array<double>({q.shape(0), dof, dof});
    for (std::size_t i = 0; i < q.shape(0); ++i)
      Eigen::Map<RowMajor<dof, dof>>(data + dof * dof * i) = self.coriolis(joint(q, i), joint(qd, i));
    return out;
  });
  cls.def("gravity", [joint](const Mechanism& self, const Rows& q) {
    auto [out, data] = new_array<double>({q.shape(0), dof});
    for (std::size_t i = 0; i < q.shape(0); ++i) Eigen::Map<Q>(data + dof * i) = self.gravity(joint(q, i));
    return out;
  });
  cls.def("energy", [joint](const Mechanism& self, const Rows& q, const Rows& qd) {
    auto [out, data] = new_array<double>({q.shape(0)});
    for (std::size_t i = 0; i < q.shape(0); ++i) {
      const Q at = joint(q, i);
      const Q speed = joint(qd, i);
      data[i] = 0.5 * speed.dot(self.mass_matrix(at) * speed) + self.potential(at);
    }
    return out;
  });
  cls.def("acceleration", [joint](const Mechanism& self, const palpate::plant::JointFriction<dof>& friction, const Rows& q, const Rows& qd,
                                  const Rows& tau) {
    const palpate::plant::PlantIntegrator<Mechanism> motion(self, friction, palpate::plant::HumanArm{});
    auto [out, data] = new_array<double>({q.shape(0), dof});
    for (std::size_t i = 0; i < q.shape(0); ++i)
      Eigen::Map<Q>(data + dof * i) = motion.acceleration(joint(q, i), joint(qd, i), joint(tau, i));
    return out;
  });
  cls.def("linearization", [](const Mechanism& self, const Q& viscous, const Q& q, const Q& qd, const Q& tau) {
    using Variable = palpate::math::Dual<3 * dof>;
    palpate::math::Joints<dof, Variable> at, speed, torque;
    for (int k = 0; k < dof; ++k) {
      at[k] = Variable::variable(q[k], k);
      speed[k] = Variable::variable(qd[k], dof + k);
      torque[k] = Variable::variable(tau[k], 2 * dof + k) - viscous[k] * speed[k];
    }
    const palpate::math::Joints<dof, Variable> qdd = self.acceleration(at, speed, torque);
    Eigen::Matrix<double, dof, 3 * dof> d;
    for (int k = 0; k < dof; ++k) d.row(k) = qdd[k].gradient.transpose();
    return Eigen::MatrixXd(d);
  });
}

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
  if (paced && body != nullptr && body->object().is_multirate()) slow.emplace([body] { body->object().update_model(); });
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
            for (int k = 0; k <= ticks; ++k, clock.tick()) data[k] = clock.late();
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
          "watch", [](Setup& s, SurfaceFrames& f) { s.body.contact_observer = f.pressed(); }, "frames"_a, nb::keep_alive<1, 2>(),
          "Lets a thread draw the body that was put there.")
      .def(
          "watch", [](Setup& s, SolidFrames& f) { s.body.deformation_observer = f.box(); }, "frames"_a, nb::keep_alive<1, 2>(),
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

  using palpate::mechanism::PremiumParameters;
  nb::class_<PremiumParameters>(m, "PremiumParameters")
      .def(nb::init<>())
      .def_rw("l1", &PremiumParameters::l1)
      .def_rw("l2", &PremiumParameters::l2)
      .def_rw("l3", &PremiumParameters::l3)
      .def_rw("l5", &PremiumParameters::l5)
      .def_rw("l6", &PremiumParameters::l6)
      .def_rw("mass_a", &PremiumParameters::mass_a)
      .def_rw("mass_c", &PremiumParameters::mass_c)
      .def_rw("mass_be", &PremiumParameters::mass_be)
      .def_rw("mass_df", &PremiumParameters::mass_df)
      .def_rw("inertia_a", &PremiumParameters::inertia_a)
      .def_rw("inertia_c", &PremiumParameters::inertia_c)
      .def_rw("inertia_be", &PremiumParameters::inertia_be)
      .def_rw("inertia_df", &PremiumParameters::inertia_df)
      .def_rw("inertia_base", &PremiumParameters::inertia_base)
      .def_rw("rotor_inertia", &PremiumParameters::rotor_inertia)
      .def_rw("gravity", &PremiumParameters::gravity);

  m.def("phantom_premium_1_5a", &palpate::plant::phantom_premium_1_5a, "The C++ catalogue's entry.");

  bind_loop<palpate::mechanism::Premium>(m, "Premium");
  bind_loop<palpate::mechanism::Slider>(m, "Slider");

  nb::class_<palpate::mechanism::Premium> premium(m, "Premium");
  premium.def(nb::init<const PremiumParameters&>());
  bind_mechanism(premium);
  premium.def(
      "inverse",
      [](const palpate::mechanism::Premium& self, const palpate::math::Vector3<>& p, bool behind, bool elbow_down) {
        const auto pose = self.inverse(p, behind, elbow_down);
        return nb::make_tuple(static_cast<int>(pose.reach), pose.q);
      },
      "p"_a, "behind"_a, "elbow_down"_a);

  nb::class_<palpate::mechanism::Slider> slider(m, "Slider");
  slider.def(nb::init<double>(), "mass"_a);
  bind_mechanism(slider);

  bind_batch(m);
}
