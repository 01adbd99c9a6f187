#include <gtest/gtest.h>

#include <cmath>

#include "support/states.hpp"

namespace {

using palpate::math::Dual;
using palpate::math::Joints;
using palpate::mechanism::FlexibleMechanism;
using palpate::mechanism::FlexibleMode;
using palpate::mechanism::Premium;
using palpate::plant::ForceSegment;
using palpate::plant::HumanArm;
using palpate::plant::JointFriction;
using palpate::plant::PlantIntegrator;
using palpate::plant::PlantState;
using FlexibleArm = FlexibleMechanism<Premium>;
using State = PlantState<6>;

/// Both sides at `theta`, the tip's side ahead by `stretch`.
State state_of(const Joints<3>& theta, const Joints<3>& stretch, const Joints<3>& speed = Joints<3>::Zero()) {
  State s;
  s.q = FlexibleArm::joined(theta, Joints<3>(theta + stretch));
  s.qd = FlexibleArm::joined(speed, speed);
  return s;
}

double energy_of(const FlexibleArm& flexible, const State& s) {
  return 0.5 * s.qd.dot(flexible.mass_matrix(s.q) * s.qd) + flexible.potential(s.q);
}

/// Largest change of the energy over 0.3 s without friction and forces, relative to that of the motion.
double energy_drift(const FlexibleMode& mode, int substeps) {
  const FlexibleArm flexible(arm, mode);
  const PlantIntegrator<FlexibleArm> motion(flexible, JointFriction<6>{}, HumanArm{});
  State s = state_of({0.2, 2.0, 3.0}, {0.01, -0.02, 0.015}, {3.0, -2.0, 1.5});
  const double before = energy_of(flexible, s), motion_energy = before - energy_of(flexible, state_of({0.2, 2.0, 3.0}, {0.0, 0.0, 0.0}));
  double drift = 0.0;
  for (int k = 0; k < 300; ++k) {
    motion.advance(s, Joints<6>::Zero(), ForceSegment<>{}, 1e-3, substeps);
    drift = std::max(drift, std::abs(energy_of(flexible, s) - before));
  }
  return drift / motion_energy;
}

// Law: the equations of motion are those of Lagrange, from the mass matrix and the potential, at any stretch and speed.
TEST(FlexibleMechanism, MovesByTheEquationsOfLagrange) {
  const FlexibleArm flexible(arm, FlexibleMode{80.0, 0.3, 0.0});
  States states;
  for (int i = 0; i < 200; ++i) {
    const Joints<6> q = FlexibleArm::joined(states.draw(3.0), Joints<3>(states.draw(3.0)));
    const Joints<6> qd = FlexibleArm::joined(states.draw(5.0), states.draw(5.0));
    const Joints<6> torque = FlexibleArm::joined(states.draw(0.3), states.draw(0.3));
    const auto variables = palpate::mechanism::joint_variables<6, double>(q);
    const palpate::mechanism::ChristoffelDynamics<6, double> exact(flexible.mass_matrix(variables), flexible.potential(variables));
    const Joints<6> expected = exact.inverse() * exact.generalized_force(torque, qd);
    EXPECT_LT((flexible.acceleration(q, qd, torque) - expected).norm(), 1e-11 * expected.norm());
  }
}

// Law: without damping the energy is constant; the error of the integration falls with the fourth power of its step at least.
TEST(FlexibleMechanism, ConservesEnergyWithoutDamping) {
  const FlexibleMode mode{120.0, 0.3, 0.0};
  const int steps = mode.substeps(1e-3, 1);
  const double coarse = energy_drift(mode, steps), fine = energy_drift(mode, 2 * steps);
  EXPECT_LT(coarse, 3e-4);
  EXPECT_LT(fine, coarse / 16.0);
  EXPECT_LT(energy_drift(mode, 8 * steps), 16e-8);
}

// Law: the damper and friction only take energy, and a stretched device comes to rest.
TEST(FlexibleMechanism, DampingNeverAddsEnergy) {
  const FlexibleArm flexible(arm, FlexibleMode{60.0, 0.6, 0.1});
  JointFriction<6> friction;
  friction.viscous.head<3>().setConstant(1e-3);
  friction.coulomb.head<3>().setConstant(2e-3);
  friction.breakaway.head<3>().setConstant(3e-3);
  const PlantIntegrator<FlexibleArm> motion(flexible, friction, HumanArm{});
  State s = state_of({0.2, 2.0, 3.0}, {0.01, -0.02, 0.015}, {3.0, -2.0, 1.5});
  double before = energy_of(flexible, s);
  for (int k = 0; k < 400; ++k) {
    motion.advance(s, Joints<6>::Zero(), ForceSegment<>{}, 1e-3, 8);
    const double energy = energy_of(flexible, s);
    EXPECT_LE(energy, before + 1e-12);
    before = energy;
  }
}

// Law: with motors and tip free, every direction vibrates with the frequency and the damping ratio of the mode, at every pose.
TEST(FlexibleMechanism, VibratesWithTheFrequencyOfTheMode) {
  auto weightless = palpate::plant::phantom_premium_1_5a();
  weightless.gravity = 0.0;
  const FlexibleMode mode{90.0, 0.35, 0.02};
  const FlexibleArm flexible(Premium(weightless), mode);
  const PlantIntegrator<FlexibleArm> motion(flexible, JointFriction<6>{}, HumanArm{});
  States states;
  for (int pose = 0; pose < 5; ++pose) {
    const Joints<3> theta = Joints<3>(0.0, 2.2305, 3.2776) + states.draw(0.4), stretch = states.draw(1e-5);
    const double ratio = mode.damping_ratio, root = std::sqrt(1.0 - ratio * ratio);
    for (const double cycles : {5.0, 5.25}) {  // where the amplitude and where the phase has its full effect
      State s = state_of(theta - mode.tip_share * stretch, stretch);
      const double turn = 2.0 * M_PI * cycles, end = turn / (mode.rate() * root);
      motion.advance(s, Joints<6>::Zero(), ForceSegment<>{}, end, mode.substeps(end, 1));
      const Joints<3> left = FlexibleArm::tip(s.q) - FlexibleArm::motors(s.q);
      const double share = std::exp(-turn * ratio / root) * (std::cos(turn) + ratio / root * std::sin(turn));
      EXPECT_LT((left - share * stretch).norm(), 2e-4 * stretch.norm());
    }
  }
}

// Law: the stiffer the mode, the nearer is the rigid device, with the square of the frequency.
TEST(FlexibleMechanism, TendsToTheRigidDevice) {
  const auto moved = [](double frequency) {
    const FlexibleMode mode{frequency, 0.4, 0.5};
    const PlantIntegrator<FlexibleArm> motion(FlexibleArm(arm, mode), JointFriction<6>{}, HumanArm{});
    State s = state_of({0.1, 2.2, 3.2}, {0.0, 0.0, 0.0});
    for (int k = 0; k < 100; ++k)
      motion.advance(s, FlexibleArm::joined(Joints<3>(0.02, -0.01, 0.015), Joints<3>(0.0, 0.0, 0.0)), ForceSegment<>{}, 1e-3,
                     mode.substeps(1e-3, 4));
    return s;
  };
  const PlantIntegrator<Premium> rigid(arm, JointFriction<3>{}, HumanArm{});
  PlantState<3> s;
  s.q = Joints<3>(0.1, 2.2, 3.2);
  for (int k = 0; k < 100; ++k) rigid.advance(s, Joints<3>(0.02, -0.01, 0.015), ForceSegment<>{}, 1e-3, 4);
  double before = 0.0;
  for (const double frequency : {100.0, 200.0, 400.0}) {
    const State flexible = moved(frequency);
    const double away = (FlexibleArm::tip(flexible.q) - s.q).norm();
    if (before > 0.0) {
      EXPECT_NEAR(before / away, 4.0, 0.01);
    }
    before = away;
  }
  EXPECT_LT(before, 1e-5);
}

// Law: behind motors at rest the tip starts where its weight holds the spring.
TEST(FlexibleMechanism, StartsAtRest) {
  const FlexibleArm flexible(arm, FlexibleMode{30.0, 0.6, 0.0});
  const Joints<6> q = flexible.at_rest(Joints<3>(0.1, 2.2, 3.2));
  const Joints<6> torque = FlexibleArm::joined(arm.gravity(Joints<3>(0.1, 2.2, 3.2)), Joints<3>(0.0, 0.0, 0.0));
  const Joints<6> rest = flexible.acceleration(q, Joints<6>(Joints<6>::Zero()), torque);
  EXPECT_GT(FlexibleArm::tip(q)[1], 0.0);
  EXPECT_NE(FlexibleArm::tip(q), FlexibleArm::motors(q));
  EXPECT_LT(FlexibleArm::tip(rest).norm(), 1e-8);
}

// Law: a mode that is none, or that no step resolves, has a fault.
TEST(FlexibleMode, RefusesWhatIsNoMode) {
  EXPECT_EQ(FlexibleMode({100.0, 0.3, 0.0}).fault(1e-3), nullptr);
  for (const FlexibleMode& bad : {FlexibleMode{0.0, 0.3, 0.0}, FlexibleMode{1e9, 0.3, 0.0}, FlexibleMode{100.0, 1.0, 0.0},
                                  FlexibleMode{100.0, 0.3, 1.0}, FlexibleMode{100.0, 0.3, -0.1}})
    EXPECT_NE(bad.fault(1e-3), nullptr);
  EXPECT_EQ(FlexibleMode({100.0, 0.25, 0.0}).substeps(1e-3, 2), 8);
  EXPECT_EQ(FlexibleMode({1000.0, 0.25, 0.0}).substeps(1e-3, 2), 32);
}

}  // namespace
