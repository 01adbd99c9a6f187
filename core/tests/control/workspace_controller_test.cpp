#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <palpate/control/workspace_controller.hpp>
#include <palpate/mechanism/premium.hpp>
#include <palpate/mechanism/tip_device.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/plant/device_catalog.hpp>
#include <palpate/servo/loop.hpp>

namespace {

using palpate::control::WorkspaceController;
using palpate::control::WorkspaceGains;
using palpate::control::WorkspaceParameters;
using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::TipDevice;

TEST(WorkspaceGains, AreThoseOfTheSampledDoubleIntegrator) {
  const WorkspaceGains fast(WorkspaceParameters{}, 5e-4);
  EXPECT_NEAR(fast.position, 36576.1408, 1e-3);
  EXPECT_NEAR(fast.velocity, 338.603612, 1e-5);
  EXPECT_NEAR(fast.observer[0], 0.700308, 1e-6);
  EXPECT_NEAR(fast.observer[1], 413.097182, 1e-5);
  EXPECT_NEAR(fast.observer[2], 4061.25719, 1e-4);
  EXPECT_NEAR(fast.reference_position, 55227.9116, 1e-3);
  EXPECT_NEAR(fast.reference_velocity, 456.205412, 1e-5);
  const WorkspaceGains slow(WorkspaceParameters{.bandwidth = 150.0}, 1e-3);
  EXPECT_NEAR(slow.position, 19681.476, 1e-3);
  EXPECT_NEAR(slow.velocity, 246.461244, 1e-5);
  EXPECT_NEAR(slow.observer[0], 0.835936216, 1e-8);
  EXPECT_NEAR(slow.observer[1], 357.080751, 1e-5);
  EXPECT_NEAR(slow.observer[2], 2631.31699, 1e-4);
}

template <class Mechanism>
palpate::servo::SimulationSetup<Mechanism> press(const Mechanism& mechanism, const Joints<3>& pose, double stiffness) {
  palpate::servo::SimulationSetup<Mechanism> setup;
  setup.mechanism = mechanism;
  setup.start = pose;
  setup.period = 5e-4;
  setup.limits.peak_force = 8.5;
  setup.object = palpate::object::SpringWall(
      {.kind = palpate::object::SpringWall::Kind::point, .point = mechanism.forward(pose), .stiffness = Vector3<>::Constant(stiffness)});
  setup.controller = WorkspaceController<Mechanism>(mechanism, Joints<3>::Zero(), WorkspaceParameters{}, setup.period);
  return setup;
}

// Law: a mass follows the reference model exactly, so the force has no overshoot and no steady error.
TEST(WorkspaceController, FollowsAStepWithoutOvershootOrSteadyError) {
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Vector3<> reference(1.0, -0.5, 0.7);
  const auto check = [&](auto setup) {
    palpate::servo::Loop loop(setup);
    double most = 0.0;
    for (int k = 0; k < 400; ++k) {
      most = std::max(most, loop.tick(reference).object_force.cwiseQuotient(reference).maxCoeff());
      ASSERT_TRUE(loop.advance(Vector3<>::Zero(), Vector3<>::Zero()));
    }
    EXPECT_LT(most, 1.002);
    EXPECT_LT((loop.servo().last().object_force - reference).norm(), 1e-4);
  };
  check(press(arm, Joints<3>(0.0, 2.2305, 3.2776), 1000.0));
  check(press(arm, Joints<3>(0.4, 0.3, 0.2), 3500.0));
  check(press(TipDevice({.mass = {0.05, 0.1, 0.3}}), Joints<3>(0.0, 0.0, 0.0), 300.0));
}

// Law: the reference model stays within the drive's limit, also after a reversal on the way, and a limit winds nothing up.
TEST(WorkspaceController, AReversalWithinANarrowLimitEndsWithoutOvershoot) {
  const TipDevice device({.mass = {0.1, 0.1, 0.1}});
  auto setup = press(device, Joints<3>(0.0, 0.0, 0.0), 100.0);
  setup.limits.peak_force = 2.0;
  palpate::servo::Loop loop(setup);
  double least = 0.0;
  for (int k = 0; k < 1500; ++k) {
    least = std::min(least, loop.tick({k < 60 ? 1.5 : -1.5, 0.0, 0.0}).object_force[0]);
    ASSERT_TRUE(loop.advance(Vector3<>::Zero(), Vector3<>::Zero()));
  }
  EXPECT_NEAR(loop.servo().last().object_force[0], -1.5, 1e-3);
  EXPECT_GT(least, -1.5 * 1.02);
}

// Law: the operator's mass is a weightless mass at the tip, as if the device were heavier.
TEST(WorkspaceController, TheOperatorsMassIsPartOfTheTip) {
  const TipDevice light({.mass = {0.1, 0.1, 0.1}}), heavy({.mass = {0.25, 0.25, 0.25}});
  auto setup = press(heavy, Joints<3>(0.0, 0.0, 0.0), 100.0);
  palpate::servo::Loop known(setup);
  setup.controller = WorkspaceController<TipDevice>(light, Joints<3>::Zero(), WorkspaceParameters{.operator_mass = 0.15}, setup.period);
  palpate::servo::Loop told(setup);
  for (int k = 0; k < 400; ++k) {
    const Vector3<> reference(k < 200 ? 6.0 : 1.0, 0.5, 0.0);
    ASSERT_NEAR((known.tick(reference).object_force - told.tick(reference).object_force).norm(), 0.0, 1e-9);
    ASSERT_TRUE(known.advance(Vector3<>::Zero(), Vector3<>::Zero()));
    ASSERT_TRUE(told.advance(Vector3<>::Zero(), Vector3<>::Zero()));
  }
  EXPECT_NE(WorkspaceParameters{.operator_mass = -0.1}.fault(), nullptr);
}

TEST(WorkspaceController, CommandsNothingAtASingularPose) {
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  WorkspaceController<Premium> controller(arm, Joints<3>::Zero(), WorkspaceParameters{}, 5e-4);
  const Joints<3> straight(0.0, 1.0, 1.0 + std::numbers::pi / 2);
  const palpate::object::ContactResult contact;
  const Vector3<> none = Vector3<>::Zero(), force = Vector3<>::Ones();
  EXPECT_EQ(controller.command({force, none, none, none, none, 2e3, 0.0, contact, straight.data(), none, 8.5}), none);
}

}  // namespace
