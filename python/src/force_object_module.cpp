/// Python bindings of objects by formula: force laws and force fields.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <palpate/object/any_object.hpp>
#include <palpate/object/constant_field.hpp>
#include <palpate/object/force_law.hpp>
#include <palpate/object/gravity_well.hpp>
#include <palpate/object/textured_wall.hpp>
#include <palpate/object/vibration.hpp>
#include <palpate/object/virtual_mass.hpp>
#include <vector>

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using palpate::math::Vector3;
using palpate::object::AnyObject;
using Table = palpate::object::ForceLawTable;

/// Return the object of checked parameters.
template <class Object, class Parameters>
AnyObject checked(const Parameters& p, const char* fault) {
  if (fault != nullptr) throw nb::value_error(fault);
  return Object(p);
}

std::shared_ptr<const Table> table(const std::vector<double>& depth, const std::vector<double>& force) {
  if (const char* fault = Table::fault(depth, force)) throw nb::value_error(fault);
  return std::make_shared<const Table>(depth, force);
}

}  // namespace

void bind_force_objects(nb::module_& m) {
  nb::class_<AnyObject>(m, "ContactObject", "An object that a tip touches.");
  m.def(
      "force_law",
      [](const std::vector<double>& depth, const std::vector<double>& force, const Vector3<>& point, const Vector3<>& normal) {
        return AnyObject(palpate::object::ForceLaw(table(depth, force), point, normal));
      },
      "depth"_a, "force"_a, "point"_a, "normal"_a, "Plane with a table from depth, m, to force, N.");
  m.def(
      "force_law_values",
      [](const std::vector<double>& depth, const std::vector<double>& force, double at) {
        const Table::Point point = table(depth, force)->at(at);
        return nb::make_tuple(point.force, point.slope, point.energy);
      },
      "depth"_a, "force"_a, "at"_a, "Force, N, slope, N/m, and energy, J, of a table at a depth, m.");
  m.def(
      "constant_field", [](const Vector3<>& force) { return AnyObject(palpate::object::ConstantField(force)); }, "force"_a,
      "The same force on the tip everywhere, N.");
  m.def(
      "gravity_well",
      [](const Vector3<>& center, double stiffness, double radius, double cap) {
        const palpate::object::GravityWellParameters p{center, stiffness, radius, cap};
        return checked<palpate::object::GravityWell>(p, p.fault());
      },
      "center"_a, "stiffness"_a, "radius"_a, "cap"_a, "Capped spring to a center, without force beyond a radius.");
  m.def(
      "vibration",
      [](const Vector3<>& force, double frequency, double decay, bool at_contact, const Vector3<>& point, const Vector3<>& normal) {
        const palpate::object::VibrationParameters p{force, frequency, decay, at_contact, point, normal};
        return checked<palpate::object::Vibration>(p, p.fault());
      },
      "force"_a, "frequency"_a, "decay"_a, "at_contact"_a, "point"_a, "normal"_a, "Sinusoidal force on the tip, N, that may decay.");
  m.def(
      "virtual_mass",
      [](double mass, double stiffness, double damping, double period) {
        const palpate::object::VirtualMassParameters p{mass, stiffness, damping};
        return checked<palpate::object::VirtualMass>(p, p.fault(period));
      },
      "mass"_a, "stiffness"_a, "damping"_a, "period"_a, "Free mass on a spring and a damper.");
  m.def(
      "textured_wall",
      [](const Vector3<>& point, const Vector3<>& normal, const Vector3<>& across, double stiffness, double damping, double wavelength,
         double height, double lateral_force) {
        const palpate::object::TexturedWallParameters p{point, normal, across, stiffness, damping, wavelength, height, lateral_force};
        return checked<palpate::object::TexturedWall>(p, p.fault());
      },
      "point"_a, "normal"_a, "across"_a, "stiffness"_a, "damping"_a, "wavelength"_a, "height"_a, "lateral_force"_a,
      "Plane wall with a sinusoidal texture.");
}
