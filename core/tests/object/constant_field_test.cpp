#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <palpate/object/constant_field.hpp>
#include <palpate/object/gravity_well.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/object/textured_wall.hpp>
#include <palpate/object/vibration.hpp>
#include <palpate/object/virtual_mass.hpp>

namespace {

using palpate::math::Vector3;
using namespace palpate::object;

/// A closed path through a well and a wall, s from 0 to 1.
Vector3<> loop_path(double s) {
  const double a = 2.0 * 3.14159265358979323846 * s;
  return {4e-3 * std::sin(a), 3e-3 * std::cos(a), -2e-3 + 1.5e-3 * std::sin(3 * a)};
}

/// Work of the tip on an object along the closed path, by the trapezoidal rule, J.
double work_of(const std::function<Vector3<>(const Vector3<>&)>& force, int steps = 20000) {
  double work = 0.0;
  Vector3<> x = loop_path(0.0), f = force(x);
  for (int i = 1; i <= steps; ++i) {
    const Vector3<> next = loop_path(static_cast<double>(i) / steps), after = force(next);
    work += 0.5 * (f + after).dot(next - x);
    x = next;
    f = after;
  }
  return work;
}

TEST(ForceField, ConservativeFieldsDoNoWorkOnAClosedPath) {
  GravityWell well({.stiffness = 500.0, .radius = 1.0, .cap = 1.5});
  TexturedWall wall({.stiffness = 1000.0, .wavelength = 1e-3, .height = 0.1e-3});
  TexturedWall rough({.point = {0.0, 0.0, 1e-2}, .stiffness = 1000.0, .wavelength = 1e-3, .lateral_force = 0.3});  // contact lasts
  ConstantField constant({0.3, -1.0, 2.0});
  EXPECT_NEAR(work_of([&](const auto& x) { return Vector3<>(well.step({x, 1e3}).force); }), 0.0, 1e-9);
  EXPECT_NEAR(work_of([&](const auto& x) { return Vector3<>(wall.step({x, 1e3}).force); }), 0.0, 1e-9);
  EXPECT_NEAR(work_of([&](const auto& x) { return Vector3<>(rough.step({x, 1e3}).force); }), 0.0, 1e-9);
  EXPECT_NEAR(work_of([&](const auto& x) { return Vector3<>(constant.step({x, 1e3}).force); }), 0.0, 1e-12);
}

TEST(ForceField, AViscousFieldDissipatesTheIntegralOfItsDamping) {
  SpringWall viscous({.kind = SpringWallKind::point, .damping = Vector3<>(2.0, 3.0, 4.0)});
  const int steps = 20000;
  viscous.step({loop_path(0.0), steps * 1.0});
  double work = 0.0, expected = 0.0;
  for (int i = 1; i <= steps; ++i) {  // one second
    const Vector3<> before = loop_path((i - 1.0) / steps), x = loop_path(1.0 * i / steps), velocity = (x - before) * steps;
    work += viscous.step({x, steps * 1.0}).force.dot(x - before);
    expected += Vector3<>(2.0, 3.0, 4.0).dot(velocity.cwiseAbs2()) / steps;
  }
  EXPECT_GT(expected, 1e-3);
  EXPECT_NEAR(work, expected, 1e-12 * expected);
}

TEST(GravityWell, ForceIsCappedAndEndsAtTheRadius) {
  GravityWell well({.center = {1e-3, 0.0, 0.0}, .stiffness = 500.0, .radius = 10e-3, .cap = 2.0});
  EXPECT_NEAR(well.step({{3e-3, 0.0, 0.0}, 1e3}).force.x(), 1.0, 1e-12);
  EXPECT_NEAR(well.step({{9e-3, 0.0, 0.0}, 1e3}).force.x(), 2.0, 1e-12);
  EXPECT_TRUE(well.step({{12e-3, 0.0, 0.0}, 1e3}).force.isZero(0.0));
  for (const double d : {1e-3, 6e-3}) EXPECT_NEAR((well.energy(d + 1e-8) - well.energy(d - 1e-8)) / 2e-8, std::min(500.0 * d, 2.0), 1e-6);
  EXPECT_EQ(well.energy(1.0), well.energy(10e-3));
}

TEST(TexturedWall, ForceIsTheGradientOfItsEnergy) {
  TexturedWall wall({.normal = {0.0, 0.6, 0.8}, .stiffness = 2000.0, .wavelength = 2e-3, .height = 0.2e-3, .lateral_force = 0.5});
  const auto energy = [&](const Vector3<>& x) {
    double row[TexturedWall::columns];
    wall.step({x, 1e3});
    wall.record(row);
    return row[1];
  };
  const Vector3<> x(0.3e-3, -1e-3, -0.7e-3);
  const Vector3<> force = wall.step({x, 1e3}).force;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3<> h = 1e-8 * Vector3<>::Unit(axis);
    EXPECT_NEAR((energy(x + h) - energy(x - h)) / 2e-8, force[axis], 1e-5);
  }
  EXPECT_GT(std::abs(force.x()), 0.1);
}

TEST(TexturedWall, NeverPulls) {
  TexturedWall wall({.stiffness = 100.0, .damping = 50.0, .wavelength = 1e-3, .height = 1e-5});
  wall.step({{0.0, 0.0, -1e-3}, 1e3});
  EXPECT_TRUE(wall.step({{0.0, 0.0, -1e-4}, 1e3}).force.isZero(0.0));  // its damper would hold the tip back
}

TEST(Vibration, BeginsAnewAtEachContactAndDecays) {
  Vibration v({.force = {0.0, 0.0, 2.0}, .frequency = 100.0, .decay = 0.01, .at_contact = true});
  EXPECT_TRUE(v.step({{0.0, 0.0, 1e-3}, 1e3, 0.5}).force.isZero(0.0));
  EXPECT_TRUE(v.step({{0.0, 0.0, -1e-3}, 1e3, 0.6}).force.isZero(1e-12));
  EXPECT_NEAR(v.step({{0.0, 0.0, -1e-3}, 1e3, 0.6025}).force.z(), -2.0 * std::exp(-0.25), 1e-9);
  v.step({{0.0, 0.0, 1e-3}, 1e3, 0.7});
  v.step({{0.0, 0.0, -1e-3}, 1e3, 0.8});
  EXPECT_NEAR(v.step({{0.0, 0.0, -1e-3}, 1e3, 0.8025}).force.z(), -2.0 * std::exp(-0.25), 1e-9);
}

TEST(VirtualMass, FollowsTheTipAndKeepsItsMomentum) {
  const VirtualMassParameters p{.mass = 0.2, .stiffness = 500.0, .damping = 2.0};
  EXPECT_EQ(p.fault(1e-3), nullptr);
  EXPECT_NE(p.fault(0.1), nullptr);
  VirtualMass mass(p);
  mass.start(Vector3<>::Zero());
  Vector3<> impulse = Vector3<>::Zero();
  const double speed = 0.1;
  for (int i = 0; i < 4000; ++i) impulse += 1e-3 * mass.step({{speed * 1e-3 * i, 0.0, 0.0}, 1e3}).force;
  EXPECT_NEAR(mass.velocity().x(), speed, 1e-4);
  EXPECT_NEAR((impulse - p.mass * mass.velocity()).norm(), 0.0, 1e-12);  // force times time is the change of momentum
}

}  // namespace
