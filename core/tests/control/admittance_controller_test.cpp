#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <palpate/control/admittance_controller.hpp>
#include <palpate/mechanism/premium.hpp>
#include <palpate/mechanism/slider.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/plant/device_catalog.hpp>
#include <palpate/servo/loop.hpp>
#include <vector>

namespace {
namespace admittance {

using palpate::control::AdmittanceController;
using palpate::control::VirtualTool;
using palpate::control::WorkspaceParameters;
using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::object::SpringWall;
using ArmSetup = palpate::servo::SimulationSetup<Premium>;

ArmSetup display(const VirtualTool& tool) {
  ArmSetup setup;
  setup.mechanism = Premium(palpate::plant::phantom_premium_1_5a());
  setup.start = Joints<3>(0.0, 2.2305, 3.2776);
  setup.period = 5e-4;
  setup.controller = AdmittanceController<Premium>(setup.mechanism, Joints<3>::Zero(), WorkspaceParameters{}, tool, setup.period);
  return setup;
}

struct Signals {
  std::vector<Vector3<>> tip, tool, measured, object_force;
};

Signals run(const ArmSetup& setup, int ticks, const Vector3<>& push) {
  palpate::servo::Loop<Premium> loop(setup);
  Signals out;
  double own[6];
  for (int k = 0; k < ticks; ++k) {
    const auto& tick = loop.tick(Vector3<>::Zero(), push);
    loop.servo().controller().record(own);
    out.tip.push_back(setup.mechanism.forward(loop.angles()));
    out.tool.emplace_back(own[0], own[1], own[2]);
    out.measured.emplace_back(own[3], own[4], own[5]);
    out.object_force.push_back(tick.object_force);
    if (!loop.advance(push, push)) ADD_FAILURE() << "diverged at " << k;
  }
  return out;
}

// Law: a free tool under a constant force has the speed F t/m, and the tip stays with it at every pose on the way.
TEST(AdmittanceController, AFreeToolAcceleratesByForceOverMass) {
  const double mass = 0.2;
  const Vector3<> push(0.3, -0.2, 0.4);
  const ArmSetup setup = display({mass, 0.0});
  const int ticks = 300;
  const Signals free = run(setup, ticks, push);
  for (int k = 0; k < ticks; ++k) {
    const Vector3<> expected = free.tool[0] + push * (0.5 * setup.period * setup.period * k * (k + 1) / mass);
    ASSERT_LT((free.tool[k] - expected).norm(), 1e-12);
    const double t = k * setup.period;
    ASSERT_LT((free.tip[k] - free.tip[0] - push * (0.5 * t * t / mass)).norm(), 2e-4 * (expected - free.tool[0]).norm() + 1e-9);
  }
}

// Law: the kinetic energy of a tool changes by the mean velocity times the held force, m (v'^2 - v^2)/2 = T (v + v')/2 . (F_h - F - b v').
TEST(AdmittanceController, TheEnergyOfAToolIsTheWorkOfTheForces) {
  const VirtualTool tool{0.15, 2.0};
  ArmSetup setup = display(tool);
  palpate::object::SpringWallParameters spring;
  spring.kind = SpringWall::Kind::half_space;
  spring.point = setup.mechanism.forward(setup.start) + Vector3<>(0.0, 0.0, 1e-3);
  spring.normal = Vector3<>(0.0, 0.0, -1.0);
  spring.stiffness = Vector3<>::Constant(800.0);
  setup.object = SpringWall(spring);
  const Vector3<> push(0.1, 0.0, 0.5);
  const Signals pressed = run(setup, 400, push);
  const double t = setup.period;
  int inside = 0;
  for (std::size_t k = 1; k + 1 < pressed.tool.size(); ++k) {
    const Vector3<> before = (pressed.tool[k] - pressed.tool[k - 1]) / t, after = (pressed.tool[k + 1] - pressed.tool[k]) / t;
    const bool touching = pressed.object_force[k].norm() > 0.0;
    inside += touching ? 1 : 0;
    // of the wall at the end of the period, as far as it does not pull
    Vector3<> wall = pressed.object_force[k];
    if (touching) wall[2] = std::max(wall[2] + 800.0 * t * after[2], 0.0);
    const double work = 0.5 * t * (before + after).dot(push - wall - tool.damping * after);
    ASSERT_NEAR(0.5 * tool.mass * (after.squaredNorm() - before.squaredNorm()), work, 1e-12);
  }
  EXPECT_GT(inside, 100);
}

// Law: at rest the wall's force is the operator's, and the tool is F/K deep, however stiff the wall is.
TEST(AdmittanceController, APressedToolRestsAtForceOverStiffness) {
  for (const double stiffness : {50.0, 5e5, 5e8}) {
    ArmSetup setup = display({0.15, 5.0});
    palpate::object::SpringWallParameters wall;
    wall.kind = SpringWall::Kind::half_space;
    wall.point = setup.mechanism.forward(setup.start);
    wall.normal = Vector3<>(0.0, 0.0, -1.0);
    wall.stiffness = Vector3<>::Constant(stiffness);
    setup.object = SpringWall(wall);
    const Signals pressed = run(setup, 4000, {0.0, 0.0, 1.0});
    EXPECT_NEAR(pressed.object_force.back()[2], 1.0, 1e-6) << stiffness;
    EXPECT_NEAR((pressed.tool.back() - wall.point)[2] * stiffness, 1.0, 1e-6) << stiffness;
    EXPECT_LT((pressed.tip.back() - pressed.tool.back()).norm(), 1e-8) << stiffness;
  }
}

// Law: the sensor of a rigid grip reads the operator's force with the inertial force of the arm: what accelerates the device alone.
TEST(AdmittanceController, TheSensorReadsTheForceThatAcceleratesTheDevice) {
  palpate::servo::SimulationSetup<palpate::mechanism::Slider> setup;
  setup.mechanism = palpate::mechanism::Slider(0.06);
  setup.period = 1e-3;
  setup.human_arm = {.mass = 0.14, .damping = 4.0, .stiffness = 300.0};
  setup.start_speed[0] = 0.1;
  palpate::servo::detail::MovingPlant<palpate::mechanism::Slider> plant(setup);
  const double motors = -0.4, push = 1.5;
  const double acceleration = (motors + push - 4.0 * 0.1) / (0.06 + 0.14);
  const Vector3<> sensed = plant.sensed_force(Joints<1>(motors), {push, 0.0, 0.0});
  EXPECT_NEAR(sensed[0], 0.06 * acceleration - motors, 1e-14);
}

// Law: at a limit of the drive the tool waits for the tip, and both rest where they should when the force ends.
TEST(AdmittanceController, TheToolWaitsForTheTipAtALimitOfTheDrive) {
  ArmSetup setup = display({0.02, 0.0});
  setup.limits.peak_force = 0.5;
  palpate::servo::Loop<Premium> loop(setup);
  double own[6], apart = 0.0;
  bool saturated = false;
  for (int k = 0; k < 400; ++k) {
    const Vector3<> push(0.0, 0.0, k < 60 ? 1.0 : k < 120 ? -1.0 : 0.0);
    saturated = loop.tick(Vector3<>::Zero(), push).saturated || saturated;
    loop.servo().controller().record(own);
    apart = std::max(apart, (setup.mechanism.forward(loop.angles()) - Vector3<>(own[0], own[1], own[2])).norm());
    ASSERT_TRUE(loop.advance(push, push));
  }
  EXPECT_TRUE(saturated);
  EXPECT_LT(apart, 1e-3);
}

}  // namespace admittance
}  // namespace
