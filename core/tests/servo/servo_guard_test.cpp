#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <palpate/guard/any_guard.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/servo/simulation.hpp>
#include <vector>

#include "support/states.hpp"

namespace {

using palpate::guard::AnyGuard;
using palpate::guard::EnergyBound;
using palpate::guard::HalfSample;
using palpate::guard::PassivityController;
using palpate::guard::VelocityEstimate;
using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::Slider;
using palpate::object::SpringWall;
using palpate::servo::Servo;
using palpate::servo::ServoSetup;

/// Result of a press on a wall.
struct Press {
  double swing = 0.0;         // half the range of the tip at the end, m
  double felt = 0.0;          // force over the stiffness times the mean depth at the end
  double jump = 0.0;          // largest change of the force from tick to tick, N
  double least_energy = 0.0;  // of the motors and the friction, J
};

/// Press the arm's z axis on a wall: 45 g, 0.35 N s/m, 0.04 N of dry friction, counts of 25 um, T = 1 ms, 1 N after an impact.
Press press(double stiffness, const AnyGuard<Slider>& guard, double impact = 0.1, double jitter = 0.0) {
  palpate::servo::SimulationSetup<Slider> setup;
  setup.mechanism = Slider(0.045);
  setup.friction.viscous = Joints<1>(0.35);
  setup.friction.coulomb = setup.friction.breakaway = Joints<1>(0.04);
  setup.encoder.step = Joints<1>(25e-6);
  setup.start = Joints<1>(0.0);
  setup.start_speed = Joints<1>(impact);
  setup.jitter = jitter;
  setup.object =
      SpringWall({.kind = SpringWall::Kind::half_space, .normal = Vector3<>(-1.0, 0.0, 0.0), .stiffness = Vector3<>::Constant(stiffness)});
  setup.guard = guard;
  constexpr int ticks = 1000, width = palpate::servo::record_width<1>;
  std::vector<double> none(3 * (ticks + 1), 0.0), push(3 * (ticks + 1), 0.0), rows(static_cast<std::size_t>(width) * (ticks + 1));
  for (int k = 0; k <= ticks; ++k) push[static_cast<std::size_t>(3 * k)] = 1.0;
  Press out;
  const auto outcome = palpate::servo::simulate(setup, ticks, none.data(), push.data(), rows.data());
  if (outcome.unstable_tick >= 0) {
    out.swing = std::numeric_limits<double>::infinity();
    return out;
  }
  const auto at = [&](int k, int column) { return rows[static_cast<std::size_t>(k * width + column)]; };
  double low = 1.0, high = -1.0, depth = 0.0, energy = 0.0;
  for (int k = 1; k <= ticks; ++k) {
    const double moved = at(k, 0) - at(k - 1, 0), longest = setup.period + jitter;
    energy += -at(k - 1, 8) * moved + 0.35 / longest * moved * moved + 0.04 * std::abs(moved);
    out.least_energy = std::min(out.least_energy, energy);
    out.jump = std::max(out.jump, std::abs(at(k, 5) - at(k - 1, 5)));
    if (k <= ticks - 250) continue;
    low = std::min(low, at(k, 0));
    high = std::max(high, at(k, 0));
    depth += at(k, 0) / 250.0;
    out.felt -= at(k, 5) / 250.0;
  }
  out.swing = 0.5 * (high - low);
  out.felt /= stiffness * depth;
  return out;
}

// Golden: a spring of 3.5 N/mm swings on this axis, whose limit by Colgate and Schenkel is 700 N/m. The capped passivity controller rests
// within 15 um up to 10 N/mm.
TEST(GuardedServo, TheCappedPassivityControllerRestsOnAStiffWall) {
  EXPECT_GT(press(3500.0, {}).swing, 1e-3);
  for (const double stiffness : {1000.0, 3500.0, 10000.0})
    for (const double impact : {0.02, 0.1, 0.3}) {
      const Press one = press(stiffness, PassivityController<Slider>(), impact);
      EXPECT_LE(one.swing, 15e-6) << stiffness << " N/m at " << impact << " m/s";
      EXPECT_GE(one.felt, 0.85) << stiffness << " N/m at " << impact << " m/s";
    }
}

// Law: with an energy bound the motors and the friction never deliver energy, whatever the wall, the impact and the lateness of ticks.
TEST(GuardedServo, TheEnergyBoundNeverDeliversMoreThanTheFriction) {
  for (const double jitter : {0.0, 0.9e-3})
    for (const double stiffness : {1000.0, 10000.0}) {
      const EnergyBound<Slider> bound({.damping = Joints<1>(0.35), .coulomb = Joints<1>(0.04), .lateness = jitter});
      const Press one = press(stiffness, bound, 0.1, jitter);
      EXPECT_GE(one.least_energy, -1e-15) << stiffness << " N/m, late by " << jitter;
      EXPECT_GT(one.felt, 0.01);
    }
  EXPECT_LT(press(3500.0, {}).least_energy, -1e-4);  // without the bound
}

// Law: the object sees the tip after half a period; so the force of a wall is zero as soon as the predicted tip is outside.
TEST(GuardedServo, HalfSampleHandsOverThePredictedTip) {
  ServoSetup<Slider> setup{.mechanism = Slider(0.045)};
  const SpringWall wall(
      {.kind = SpringWall::Kind::half_space, .normal = Vector3<>(-1.0, 0.0, 0.0), .stiffness = Vector3<>::Constant(1000.0)});
  Servo<Slider, SpringWall, palpate::control::StateSpace, HalfSample<Slider>> servo(setup, wall, {}, HalfSample<Slider>());
  const auto force = [&](double x) { return servo.tick(Joints<1>(x), Vector3<>::Zero()).object_force.x(); };
  EXPECT_DOUBLE_EQ(force(1e-3), 1.0);
  EXPECT_DOUBLE_EQ(force(2e-3), 2.5);
  EXPECT_DOUBLE_EQ(force(1e-3), 0.5);
  EXPECT_DOUBLE_EQ(force(0.2e-3), 0.0);  // inside, but 0.2 mm outside after half a period
  EXPECT_DOUBLE_EQ(servo.last().tip.x(), 0.2e-3);
}

TEST(GuardedServo, HalfSampleExtendsTheWallOfTheArmsAxis) {
  for (const VelocityEstimate velocity : {VelocityEstimate::backward, VelocityEstimate::observer}) {
    const Press one = press(10000.0, HalfSample<Slider>({.velocity = velocity}));
    EXPECT_LE(one.swing, 15e-6);
    EXPECT_GE(one.felt, 0.9);
  }
}

// Law: a guard that is chosen at run time, and no guard, give the same torques as one of fixed type, and as the plain servo, bit for bit.
TEST(GuardedServo, AGuardChosenAtRunTimeIsTheGuard) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = Joints<3>(0.0, 2.2305, 3.2776);
  setup.gravity_compensation = Vector3<>(0.0, 0.1, 0.0);
  setup.limits.peak_torque = Joints<3>::Constant(0.2);
  setup.delay = 1;
  const SpringWall spring({.kind = SpringWall::Kind::point, .point = arm.forward(setup.start), .stiffness = Vector3<>::Constant(2000.0)});
  using Law = palpate::control::StateSpace;
  const PassivityController<Premium> one;
  const EnergyBound<Premium> two({Joints<3>(0.05, 0.001, 0.01), Joints<3>(0.01, 0.0, 0.002), 0.0});
  Servo<Premium, SpringWall> plain(setup, spring);
  Servo<Premium, SpringWall, Law, AnyGuard<Premium>> none(setup, spring), any_one(setup, spring, {}, one), any_two(setup, spring, {}, two);
  Servo<Premium, SpringWall, Law, PassivityController<Premium>> fixed_one(setup, spring, {}, one);
  Servo<Premium, SpringWall, Law, EnergyBound<Premium>> fixed_two(setup, spring, {}, two);
  bool acted_one = false, acted_two = false;
  for (int k = 0; k < 200; ++k) {
    const Joints<3> q = setup.start + 0.01 * std::sin(0.05 * k) * Joints<3>(1.0, -0.7, 0.4) + 1e-3 * std::sin(1.0 * k) * Joints<3>::Ones();
    const Joints<3> torque = plain.tick(q, Vector3<>::Zero()).torque;
    EXPECT_EQ(none.tick(q, Vector3<>::Zero()).torque, torque);
    const Joints<3> first = any_one.tick(q, Vector3<>::Zero()).torque, second = any_two.tick(q, Vector3<>::Zero()).torque;
    EXPECT_EQ(fixed_one.tick(q, Vector3<>::Zero()).torque, first);
    EXPECT_EQ(fixed_two.tick(q, Vector3<>::Zero()).torque, second);
    acted_one = acted_one || first != torque;
    acted_two = acted_two || second != torque;
  }
  EXPECT_TRUE(acted_one);
  EXPECT_TRUE(acted_two);
  any_two.reset(setup.start);
  fixed_two = Servo<Premium, SpringWall, Law, EnergyBound<Premium>>(setup, spring, {}, two);
  for (int k = 0; k < 50; ++k) {
    const Joints<3> q = setup.start + 0.01 * std::sin(0.3 * k) * Joints<3>::Ones();
    EXPECT_EQ(any_two.tick(q, Vector3<>::Zero()).torque, fixed_two.tick(q, Vector3<>::Zero()).torque);
  }
}

// Law: the bound scales torque and command alike, and leaves the gravity compensation alone; the command is what the motors deliver.
TEST(GuardedServo, TheBoundLeavesTheGravityCompensationAlone) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = Joints<3>(0.0, 2.2305, 3.2776);
  setup.gravity_compensation = Vector3<>(0.02, 0.1, -0.05);
  const SpringWall spring({.kind = SpringWall::Kind::point, .point = arm.forward(setup.start), .stiffness = Vector3<>::Constant(5000.0)});
  const EnergyBound<Premium> bound({Joints<3>(0.05, 0.001, 0.01), Joints<3>(0.01, 0.001, 0.002), 0.0});
  Servo<Premium, SpringWall, palpate::control::StateSpace, EnergyBound<Premium>> servo(setup, spring, {}, bound);
  int reduced = 0;
  for (int k = 0; k < 200; ++k) {
    const Joints<3> q = setup.start + 0.01 * std::sin(0.1 * k) * Joints<3>(1.0, -0.7, 0.4);
    const auto& tick = servo.tick(q, Vector3<>::Zero());
    EXPECT_LT((tick.torque - arm.jacobian(q).transpose() * (tick.command + setup.gravity_compensation)).norm(), 1e-14);
    EXPECT_LT(tick.command.cross(tick.object_force).norm(), 1e-12);
    reduced += (tick.command + tick.object_force).norm() > 1e-9 ? 1 : 0;
  }
  EXPECT_GT(reduced, 50);
  const auto& lost = servo.tick(Joints<3>::Constant(std::numeric_limits<double>::quiet_NaN()), Vector3<>::Zero());
  EXPECT_TRUE(lost.fault);
  EXPECT_FALSE(servo.tick(setup.start, Vector3<>::Zero()).fault);
}

}  // namespace
