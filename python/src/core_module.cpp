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
#include "loop_binding.hpp"

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

  bind_loop_parts(m);

  nb::class_<palpate::plant::HumanArm>(m, "Hand")
      .def(nb::init<>())
      .def_rw("mass", &palpate::plant::HumanArm::mass)
      .def_rw("damping", &palpate::plant::HumanArm::damping)
      .def_rw("stiffness", &palpate::plant::HumanArm::stiffness)
      .def_rw("tissue", &palpate::plant::HumanArm::tissue)
      .def_rw("tissue_stiffness", &palpate::plant::HumanArm::tissue_stiffness)
      .def_rw("tissue_damping", &palpate::plant::HumanArm::tissue_damping)
      .def_rw("rest", &palpate::plant::HumanArm::rest);

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
