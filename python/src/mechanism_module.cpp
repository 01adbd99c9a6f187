/// Python bindings of the mechanisms, generated from the registry.
#include "mechanism_module.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <map>
#include <palpate/mechanism/flexible_mechanism.hpp>
#include <palpate/mechanism/registry.hpp>
#include <palpate/plant/device_catalog.hpp>
#include <palpate/plant/plant_integrator.hpp>
#include <string>
#include <vector>

#include "arrays.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using palpate::mechanism::JointKind;
using palpate::mechanism::ParameterField;
using palpate::mechanism::ParameterRange;
using palpate::mechanism::Registry;
using Values = std::map<std::string, std::vector<double>>;

/// One parameter of a mechanism as Python sees it.
struct ParameterInfo {
  std::string key, unit, range, description;
  int size;
  bool required;
  std::vector<double> default_value;
};

/// A mechanism of the registry as Python sees it.
struct MechanismInfo {
  std::string name, class_name;
  int dof;
  std::vector<std::string> joints;
  std::vector<double> working_pose;
  std::vector<ParameterInfo> parameters;
};

const char* text(ParameterRange range) {
  switch (range) {
    case ParameterRange::positive:
      return "positive";
    case ParameterRange::nonnegative:
      return "nonnegative";
    case ParameterRange::any:
      break;
  }
  return "any";
}

template <class Parameters>
std::vector<double> read(const ParameterField<Parameters>& field, const Parameters& parameters) {
  std::vector<double> values(static_cast<std::size_t>(field.size));
  field.read(parameters, values.data());
  return values;
}

template <class Mechanism>
MechanismInfo info() {
  MechanismInfo out{
      Mechanism::name, class_name<Mechanism>(), Mechanism::dof, {}, {Mechanism::working_pose.begin(), Mechanism::working_pose.end()}, {}};
  for (const JointKind kind : Mechanism::joints) out.joints.emplace_back(kind == JointKind::revolute ? "revolute" : "prismatic");
  for (const auto& field : Mechanism::parameters)
    out.parameters.push_back({field.key, field.unit, text(field.range), field.description, field.size, field.required,
                              read(field, typename Mechanism::Parameters{})});
  return out;
}

/// Return the parameters of a mechanism from a table by key; parameters without an entry keep their defaults.
template <class Mechanism>
typename Mechanism::Parameters parameters_of(const Values& values) {
  typename Mechanism::Parameters out;
  for (const auto& field : Mechanism::parameters) {
    const auto found = values.find(field.key);
    if (found == values.end()) {
      if (field.required) throw nb::value_error((std::string(field.key) + " is missing").c_str());
      continue;
    }
    if (found->second.size() != static_cast<std::size_t>(field.size))
      throw nb::value_error((std::string(field.key) + " needs " + std::to_string(field.size) + " values").c_str());
    field.assign(out, found->second.data());
  }
  for (const auto& [key, value] : values)
    if (std::none_of(Mechanism::parameters.begin(), Mechanism::parameters.end(), [&key](const auto& field) { return key == field.key; }))
      throw nb::value_error((std::string(Mechanism::name) + " has no parameter " + key).c_str());
  return out;
}

template <int rows, int columns>
using RowMajor = Eigen::Matrix<double, rows, columns, (columns > 1 ? Eigen::RowMajor : Eigen::ColMajor)>;

/// Bind the energy and the linearization of a mechanism, rigid or flexible.
template <class Mechanism>
void bind_motion(nb::class_<Mechanism>& cls) {
  constexpr int dof = Mechanism::dof;
  using Q = palpate::math::Joints<dof>;
  const auto joint = [](const Rows& a, std::size_t i) { return Q(Eigen::Map<const Q>(a.data() + i * dof)); };

  cls.def("energy", [joint](const Mechanism& self, const Rows& q, const Rows& qd) {
    auto [out, data] = new_array<double>({q.shape(0)});
    for (std::size_t i = 0; i < q.shape(0); ++i) {
      const Q at = joint(q, i);
      const Q speed = joint(qd, i);
      data[i] = 0.5 * speed.dot(self.mass_matrix(at) * speed) + self.potential(at);
    }
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

/// Bind a mechanism with its lowest flexible mode: states and torques of the motors, then of the tip's side.
template <class Mechanism>
void bind_flexible(nb::module_& m) {
  using Flexible = palpate::mechanism::FlexibleMechanism<Mechanism>;
  nb::class_<Flexible> cls(m, ("Flexible" + class_name<Mechanism>()).c_str());
  cls.def(nb::init<const Mechanism&, const palpate::mechanism::FlexibleMode&>(), "rigid"_a, "mode"_a);
  bind_motion<Flexible>(cls);
}

/// Bind one mechanism: construction from a parameter table, and its functions on rows of states.
template <class Mechanism>
void bind_mechanism(nb::module_& m) {
  constexpr int dof = Mechanism::dof;
  nb::class_<Mechanism> cls(m, class_name<Mechanism>().c_str());
  cls.def(
      "__init__", [](Mechanism* self, const Values& values) { new (self) Mechanism(parameters_of<Mechanism>(values)); }, "values"_a,
      "Create the mechanism from its parameters in SI units; see mechanisms().");
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
  cls.def("acceleration", [joint](const Mechanism& self, const palpate::plant::JointFriction<dof>& friction, const Rows& q, const Rows& qd,
                                  const Rows& tau) {
    const palpate::plant::PlantIntegrator<Mechanism> motion(self, friction, palpate::plant::HumanArm{});
    auto [out, data] = new_array<double>({q.shape(0), dof});
    for (std::size_t i = 0; i < q.shape(0); ++i)
      Eigen::Map<Q>(data + dof * i) = motion.acceleration(joint(q, i), joint(qd, i), joint(tau, i));
    return out;
  });
  bind_motion<Mechanism>(cls);
  cls.def(
      "inverse",
      [](const Mechanism& self, const palpate::math::Vector3<>& p, const Q& nearest_to) {
        const auto found = self.inverse_kinematics(p, nearest_to);
        auto [out, data] = new_array<double>({found.poses.size(), dof});
        for (std::size_t i = 0; i < found.poses.size(); ++i) Eigen::Map<Q>(data + dof * i) = found.poses[i];
        return nb::make_tuple(out, found.error);
      },
      "p"_a, "nearest_to"_a, "Return (poses with the tip at p, reason why there are none).");
}

}  // namespace

void bind_mechanisms(nb::module_& m) {
  nb::class_<ParameterInfo>(m, "ParameterInfo")
      .def_ro("key", &ParameterInfo::key)
      .def_ro("unit", &ParameterInfo::unit)
      .def_ro("range", &ParameterInfo::range)
      .def_ro("description", &ParameterInfo::description)
      .def_ro("size", &ParameterInfo::size)
      .def_ro("required", &ParameterInfo::required)
      .def_ro("default_value", &ParameterInfo::default_value);
  nb::class_<MechanismInfo>(m, "MechanismInfo")
      .def_ro("name", &MechanismInfo::name)
      .def_ro("class_name", &MechanismInfo::class_name)
      .def_ro("dof", &MechanismInfo::dof)
      .def_ro("joints", &MechanismInfo::joints)
      .def_ro("working_pose", &MechanismInfo::working_pose)
      .def_ro("parameters", &MechanismInfo::parameters);
  m.def(
      "mechanisms",
      [] {
        std::vector<MechanismInfo> out;
        Registry::for_each([&out]<class Mechanism>() { out.push_back(info<Mechanism>()); });
        return out;
      },
      "Return the mechanisms of the registry with their joints and parameters.");
  m.def(
      "phantom_premium_1_5a",
      [] {
        const auto parameters = palpate::plant::phantom_premium_1_5a();
        Values out;
        for (const auto& field : palpate::mechanism::Premium::parameters) out[field.key] = read(field, parameters);
        return out;
      },
      "Return the parameters of the C++ catalog entry by key.");
  Registry::for_each([&m]<class Mechanism>() {
    bind_mechanism<Mechanism>(m);
    bind_flexible<Mechanism>(m);
  });
}
