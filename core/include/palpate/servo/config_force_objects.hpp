#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "palpate/object/any_object.hpp"
#include "palpate/object/constant_field.hpp"
#include "palpate/object/force_law.hpp"
#include "palpate/object/gravity_well.hpp"
#include "palpate/object/textured_wall.hpp"
#include "palpate/object/vibration.hpp"
#include "palpate/object/virtual_mass.hpp"
#include "palpate/servo/config_reader.hpp"

namespace palpate::servo::detail {

using Section = ConfigReader::Section;

/// Return a unit vector of a section.
[[nodiscard]] inline Vector3<> read_direction(const Section& from, const char* key) {
  const Vector3<> out = from.vector(key);
  if (!(std::abs(out.norm() - 1.0) < 1e-6)) from.fail(key, "must have unit length");
  return out;
}

/// Return the object of checked parameters; an empty one if something is wrong.
template <class Object, class Parameters>
[[nodiscard]] object::AnyObject checked(const Section& from, const Parameters& p, const char* fault) {
  if (fault == nullptr) return Object(p);
  from.fail("kind", fault);
  return {};
}

[[nodiscard]] inline object::AnyObject read_force_law(ConfigReader& reader, const Section& from) {
  const Vector3<> point = from.vector("point"), normal = read_direction(from, "normal");
  const std::vector<double> depth = from.blob<double>("depth", -1, 1), force = from.blob<double>("force", -1, 1);
  if (!reader.ok()) return {};
  if (const char* fault = object::ForceLawTable::fault(depth, force)) {
    from.fail("depth", fault);
    return {};
  }
  return object::ForceLaw(std::make_shared<const object::ForceLawTable>(depth, force), point, normal);
}

[[nodiscard]] inline object::AnyObject read_gravity_well(const Section& from) {
  object::GravityWellParameters p;
  p.center = from.vector("center");
  p.stiffness = from.number("stiffness");
  p.radius = from.number("radius");
  p.cap = from.nonnegative_or_infinite("cap");
  return checked<object::GravityWell>(from, p, p.fault());
}

[[nodiscard]] inline object::AnyObject read_vibration(const Section& from) {
  object::VibrationParameters p;
  p.force = from.vector("force");
  p.frequency = from.number("frequency");
  p.decay = from.nonnegative_or_infinite("decay");
  p.at_contact = from.flag("at_contact");
  p.point = from.vector("point");
  p.normal = read_direction(from, "normal");
  return checked<object::Vibration>(from, p, p.fault());
}

[[nodiscard]] inline object::AnyObject read_virtual_mass(const Section& from) {
  object::VirtualMassParameters p;
  p.mass = from.number("mass");
  p.stiffness = from.number("stiffness");
  p.damping = from.number("damping");
  return checked<object::VirtualMass>(from, p, p.fault(from.positive("period")));
}

[[nodiscard]] inline object::AnyObject read_textured_wall(const Section& from) {
  object::TexturedWallParameters p;
  p.point = from.vector("point");
  p.normal = read_direction(from, "normal");
  p.across = read_direction(from, "across");
  p.stiffness = from.number("stiffness");
  p.damping = from.number("damping");
  p.wavelength = from.number("wavelength");
  p.height = from.number("height");
  p.lateral_force = from.number("lateral_force");
  return checked<object::TexturedWall>(from, p, p.fault());
}

}  // namespace palpate::servo::detail
