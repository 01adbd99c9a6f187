#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "support/states.hpp"

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::Slider;
using palpate::plant::ForceSegment;
using palpate::plant::HumanArm;
using palpate::plant::JointFriction;
using palpate::plant::PlantIntegrator;
using palpate::plant::PlantState;

// Law: without friction and forces the energy is constant.
TEST(PlantIntegrator, ConservesEnergyForTenSeconds) {
  const PlantIntegrator<Premium> motion(arm, JointFriction<3>{}, HumanArm{});
  PlantState<3> s;
  s.q = Joints<3>(0.2, 0.4, 0.6);
  s.qd = Joints<3>(1.0, -2.0, 1.5);
  const auto energy = [&] { return 0.5 * s.qd.dot(arm.mass_matrix(s.q) * s.qd) + arm.potential(s.q); };
  const double before = energy();
  for (int k = 0; k < 10000; ++k) motion.advance(s, Joints<3>::Zero(), ForceSegment<>{}, 1e-3, 4);
  EXPECT_LT(std::abs(energy() - before), 1e-9 * std::abs(before));
}

// Law: a slider with viscous friction under constant force has an exponential response.
TEST(PlantIntegrator, SliderFollowsItsClosedForm) {
  JointFriction<1> friction;
  friction.viscous[0] = 0.8;
  const PlantIntegrator<Slider> motion(Slider(0.06), friction, HumanArm{});
  PlantState<1> s;
  for (int k = 0; k < 500; ++k) motion.advance(s, Joints<1>(0.3), ForceSegment<>{}, 1e-3, 2);
  const double tau = 0.06 / 0.8;
  const double v = 0.3 / 0.8 * (1.0 - std::exp(-0.5 / tau));
  const double x = 0.3 / 0.8 * (0.5 - tau * (1.0 - std::exp(-0.5 / tau)));
  EXPECT_NEAR(s.qd[0], v, 1e-12);
  EXPECT_NEAR(s.q[0], x, 1e-12);
}

// Law: Coulomb friction stops a sliding mass after v^2 m / (2 f), and it stays exactly there.
TEST(PlantIntegrator, CoulombFrictionStopsAMassAtTheRightPlaceForEver) {
  JointFriction<1> friction;
  friction.coulomb[0] = friction.breakaway[0] = 0.04;
  const PlantIntegrator<Slider> motion(Slider(0.06), friction, HumanArm{});
  PlantState<1> s;
  s.qd[0] = 0.1;
  for (int k = 0; k < 1000; ++k) motion.advance(s, Joints<1>(0.0), ForceSegment<>{}, 1e-3, 2);
  EXPECT_EQ(s.qd[0], 0.0);
  EXPECT_NEAR(s.q[0], 0.01 * 0.06 / (2 * 0.04), 1e-10);
  const double stopped = s.q[0];
  for (int k = 0; k < 1000; ++k) motion.advance(s, Joints<1>(0.0399), ForceSegment<>{}, 1e-3, 2);
  EXPECT_EQ(s.q[0], stopped);  // a force below breakaway causes no creep and no chatter
  for (int k = 0; k < 100; ++k) motion.advance(s, Joints<1>(0.0401), ForceSegment<>{}, 1e-3, 2);
  EXPECT_GT(s.qd[0], 0.0);
}

// Law: joints whose friction exceeds the gravity torque do not move by one bit.
TEST(PlantIntegrator, StickingHoldsTheArmAgainstGravity) {
  JointFriction<3> friction = palpate::plant::phantom_premium_1_5a_friction();
  friction.coulomb = Joints<3>::Constant(0.02);
  friction.breakaway = Joints<3>::Constant(0.05);
  const PlantIntegrator<Premium> motion(arm, friction, HumanArm{});
  PlantState<3> s;
  s.q = Joints<3>(0.3, 0.5, 0.7);
  ASSERT_LT(arm.gravity(s.q).cwiseAbs().maxCoeff(), 0.05);
  ASSERT_GT(arm.gravity(s.q).cwiseAbs().maxCoeff(), 0.005);
  const Joints<3> before = s.q;
  for (int k = 0; k < 2000; ++k) motion.advance(s, Joints<3>::Zero(), ForceSegment<>{}, 1e-3, 1);
  EXPECT_EQ(s.q, before);
  EXPECT_EQ(s.qd, Joints<3>(Joints<3>::Zero()));
}

// Law: friction and the damper of the arm never add energy.
TEST(PlantIntegrator, DissipationNeverAddsEnergy) {
  JointFriction<3> friction = palpate::plant::phantom_premium_1_5a_friction();
  friction.coulomb = Joints<3>::Constant(0.002);
  friction.breakaway = Joints<3>::Constant(0.003);
  const PlantIntegrator<Premium> motion(arm, friction, HumanArm{});
  PlantState<3> s;
  s.q = Joints<3>(0.2, 2.0, 3.0);
  s.qd = Joints<3>(5.0, -4.0, 3.0);
  double before = 0.5 * s.qd.dot(arm.mass_matrix(s.q) * s.qd) + arm.potential(s.q);
  for (int k = 0; k < 3000; ++k) {
    motion.advance(s, Joints<3>::Zero(), ForceSegment<>{}, 1e-3, 2);
    const double energy = 0.5 * s.qd.dot(arm.mass_matrix(s.q) * s.qd) + arm.potential(s.q);
    EXPECT_LE(energy, before + 1e-13);
    before = energy;
  }
}

// Law: a hand gripping rigidly adds its mass, damper and spring: a slider becomes one damped oscillator.
TEST(PlantIntegrator, RigidGripIsAMassDamperSpring) {
  HumanArm hand;
  hand.mass = 0.15;
  hand.damping = 4.5;
  hand.stiffness = 560.0;
  const PlantIntegrator<Slider> motion(Slider(0.06), JointFriction<1>{}, hand);
  PlantState<1> s;
  s.q[0] = 0.01;
  for (int k = 0; k < 100; ++k) motion.advance(s, Joints<1>(0.0), ForceSegment<>{}, 1e-3, 4);
  const double m = 0.21;
  const double decay = 4.5 / (2 * m);
  const double frequency = std::sqrt(560.0 / m - decay * decay);
  const double t = 0.1;
  const double x = 0.01 * std::exp(-decay * t) * (std::cos(frequency * t) + decay / frequency * std::sin(frequency * t));
  EXPECT_NEAR(s.q[0], x, 1e-10);
}

// Law: through very stiff tissue the grip is rigid.
TEST(PlantIntegrator, StiffTissueTendsToTheRigidGrip) {
  HumanArm rigid;
  rigid.mass = 0.15;
  rigid.damping = 4.5;
  rigid.stiffness = 560.0;
  HumanArm soft = rigid;
  soft.tissue = true;
  soft.tissue_stiffness = 1e7;
  soft.tissue_damping = 1e3;
  const PlantIntegrator<Slider> a(Slider(0.06), JointFriction<1>{}, rigid);
  const PlantIntegrator<Slider> b(Slider(0.06), JointFriction<1>{}, soft);
  PlantState<1> s;
  s.q[0] = 0.01;
  PlantState<1> t = s;
  t.hand_position[0] = 0.01;
  for (int k = 0; k < 100; ++k) {
    a.advance(s, Joints<1>(0.0), ForceSegment<>{}, 1e-3, 40);
    b.advance(t, Joints<1>(0.0), ForceSegment<>{}, 1e-3, 40);
  }
  EXPECT_NEAR(s.q[0], t.q[0], 1e-6);
}

// Law: Runge-Kutta of order 4: halving the step divides the error by sixteen.
TEST(PlantIntegrator, IsOfFourthOrder) {
  const PlantIntegrator<Premium> motion(arm, palpate::plant::phantom_premium_1_5a_friction(), HumanArm{});
  const auto end = [&](int substeps) {
    PlantState<3> s;
    s.q = Joints<3>(0.2, 2.0, 3.0);
    s.qd = Joints<3>(2.0, -3.0, 3.0);
    for (int k = 0; k < 20; ++k) motion.advance(s, Joints<3>(0.05, 0.02, 0.01), ForceSegment<>{}, 2e-2, substeps);
    return s.q;
  };
  const Joints<3> exact = end(256);
  const double ratio = (end(2) - exact).norm() / (end(4) - exact).norm();
  EXPECT_GT(ratio, 14.0);
  EXPECT_LT(ratio, 19.0);
}

// Law: plants with dry friction and an arm side by side compute the same as one.
TEST(PlantIntegrator, LanesEqualOneLoop) {
  using palpate::math::Pack;
  JointFriction<3> friction;
  friction.viscous.setConstant(0.01);
  friction.coulomb.setConstant(0.002);
  friction.breakaway.setConstant(0.003);
  HumanArm hand;
  hand.mass = 0.1;
  hand.damping = 3.0;
  const PlantIntegrator<Premium> one(arm, friction, hand);
  PlantIntegrator<Premium, Pack<2>> both;
  std::array<PlantState<3>, 2> s;
  PlantState<3, Pack<2>> lanes;
  States states;
  for (int lane = 0; lane < 2; ++lane) {
    auto& state = s[static_cast<std::size_t>(lane)];
    state.q = states.draw(4.0);
    state.qd = states.draw(0.5);
    both.set_lane(lane, one);
    lanes.set_lane(lane, state);
  }
  const Joints<3> torque = Joints<3>::Constant(0.01);
  for (int k = 0; k < 50; ++k) {
    for (auto& state : s) one.advance(state, torque, ForceSegment<>{}, 1e-3, 2);
    both.advance(lanes, Joints<3, Pack<2>>(torque.cast<Pack<2>>()), ForceSegment<Pack<2>>{}, 1e-3, 2);
  }
  for (int lane = 0; lane < 2; ++lane)
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(lanes.q[i][lane], s[static_cast<std::size_t>(lane)].q[i], 1e-13);
}

// Law: a force linear in time moves a free slider by its exact integrals, for any number of substeps.
TEST(PlantIntegrator, ARampOfForceIsExactForAnyNumberOfSubsteps) {
  const double mass = 0.06, t = 0.02;
  const PlantIntegrator<Slider> motion(Slider(mass), JointFriction<1>{}, HumanArm{});
  for (const auto& [begin, end] : {std::pair{0.0, 0.9}, std::pair{0.9, 0.0}, std::pair{0.4, -0.5}})
    for (const int substeps : {1, 2, 5}) {
      PlantState<1> s;
      motion.advance(s, Joints<1>(0.0), {Vector3<>(begin, 0.0, 0.0), Vector3<>(end, 0.0, 0.0)}, t, substeps);
      EXPECT_NEAR(s.qd[0], t * (begin + end) / (2.0 * mass), 1e-12);
      EXPECT_NEAR(s.q[0], t * t * (2.0 * begin + end) / (6.0 * mass), 1e-12);
    }
}

// Law: a force along any axis of the tip moves the arm as its torque J^T f does.
TEST(PlantIntegrator, AForceAlongEachAxisActsAsItsTorque) {
  const PlantIntegrator<Premium> motion(arm, JointFriction<3>{}, HumanArm{});
  for (int axis = 0; axis < 3; ++axis) {
    PlantState<3> s;
    s.q = Joints<3>(0.2, 2.0, 3.0);
    PlantState<3> t = s;
    const Vector3<> force = 0.5 * Vector3<>::Unit(axis);
    motion.advance(s, Joints<3>::Zero(), {force, force}, 1e-6, 1);
    motion.advance(t, arm.jacobian(t.q).transpose() * force, ForceSegment<>{}, 1e-6, 1);
    EXPECT_LT((s.qd - t.qd).norm(), 1e-6 * s.qd.norm()) << axis;
  }
}

// Law: breakaway friction holds without Coulomb friction, up to its torque and not beyond.
TEST(PlantIntegrator, BreakawayHoldsWithoutCoulombFriction) {
  JointFriction<1> friction;
  friction.breakaway[0] = 0.04;
  const PlantIntegrator<Slider> motion(Slider(0.06), friction, HumanArm{});
  PlantState<1> s;
  for (int k = 0; k < 100; ++k) motion.advance(s, Joints<1>(-0.0399), ForceSegment<>{}, 1e-3, 2);
  EXPECT_EQ(s.q[0], 0.0);
  for (int k = 0; k < 100; ++k) motion.advance(s, Joints<1>(-0.0401), ForceSegment<>{}, 1e-3, 2);
  EXPECT_LT(s.qd[0], 0.0);
}

// Law: the Stribeck curve is a Gaussian of the speed from breakaway down to Coulomb friction.
TEST(JointFriction, SlidingFollowsTheStribeckCurve) {
  JointFriction<1> friction;
  friction.coulomb[0] = 0.02;
  friction.breakaway[0] = 0.05;
  friction.stribeck_speed[0] = 0.3;
  for (const double speed : {0.0, 0.15, -0.15, 0.3, -0.6, 3.0})
    EXPECT_NEAR(friction.sliding(0, speed), 0.02 + 0.03 * std::exp(-speed * speed / 0.09), 1e-9) << speed;
}

// Law: at rest a hand and its tissue are two springs in series about the rest of the hand; a rigid grip is one.
TEST(PlantIntegrator, AHandAtRestIsItsSpringsAboutItsRest) {
  HumanArm hand;
  hand.mass = 0.15;
  hand.damping = 9.0;
  hand.stiffness = 560.0;
  hand.rest = Vector3<>(0.03, 0.0, 0.0);
  HumanArm soft = hand;
  soft.tissue = true;
  soft.tissue_stiffness = 500.0;
  soft.tissue_damping = 9.0;
  const PlantIntegrator<Slider> rigid(Slider(0.06), JointFriction<1>{}, hand), tissue(Slider(0.06), JointFriction<1>{}, soft);
  PlantState<1> s, t;
  for (int k = 0; k < 1500; ++k) {
    rigid.advance(s, Joints<1>(1.4), ForceSegment<>{}, 1e-3, 2);
    tissue.advance(t, Joints<1>(1.4), ForceSegment<>{}, 1e-3, 2);
  }
  EXPECT_NEAR(s.q[0], 0.03 + 1.4 / 560.0, 1e-9);
  EXPECT_NEAR(t.q[0], 0.03 + 1.4 / 560.0 + 1.4 / 500.0, 1e-9);
  EXPECT_NEAR(t.hand_position[0], 0.03 + 1.4 / 560.0, 1e-9);
}

// Law: two free masses with tissue between them: their momentum is constant, and they swing about each other with the reduced mass.
TEST(PlantIntegrator, TissueBetweenFreeMassesIsADampedOscillator) {
  const double tip = 0.06, mass = 0.15, k = 500.0, c = 0.8, reduced = tip * mass / (tip + mass);
  HumanArm hand;
  hand.mass = mass;
  hand.tissue = true;
  hand.tissue_stiffness = k;
  hand.tissue_damping = c;
  const PlantIntegrator<Slider> motion(Slider(tip), JointFriction<1>{}, hand);
  PlantState<1> s;
  s.q[0] = 0.01;
  for (int i = 0; i < 50; ++i) motion.advance(s, Joints<1>(0.0), ForceSegment<>{}, 1e-3, 8);
  const double decay = c / (2.0 * reduced), frequency = std::sqrt(k / reduced - decay * decay), t = 0.05;
  const double apart = 0.01 * std::exp(-decay * t) * (std::cos(frequency * t) + decay / frequency * std::sin(frequency * t));
  EXPECT_NEAR(s.q[0] - s.hand_position[0], apart, 1e-9);
  EXPECT_NEAR(tip * s.qd[0] + mass * s.hand_velocity[0], 0.0, 1e-12);
  EXPECT_NEAR(tip * s.q[0] + mass * s.hand_position[0], tip * 0.01, 1e-12);
}

// Law: one step is Nystrom's with the equations of motion at the exact poses, also where the joints turn by radians in it.
TEST(PlantIntegrator, AStepIsNystromsHoweverFarTheJointsTurn) {
  const PlantIntegrator<Premium> motion(arm, JointFriction<3>{}, HumanArm{});
  const Joints<3> torque(0.05, -0.02, 0.01);
  const double h = 1e-3;
  for (const double speed : {1.0, 100.0, 2500.0}) {
    PlantState<3> s;
    s.q = Joints<3>(0.2, 2.0, 3.0);
    s.qd = speed * Joints<3>(0.7, -1.0, 0.8);
    const auto a = [&torque](const Joints<3>& q, const Joints<3>& v) { return Joints<3>(arm.acceleration(q, v, torque)); };
    const Joints<3> q = s.q, v = s.qd, k1 = a(q, v), middle = q + 0.5 * h * v + 0.125 * h * h * k1;
    const Joints<3> k2 = a(middle, v + 0.5 * h * k1), k3 = a(middle, v + 0.5 * h * k2);
    const Joints<3> k4 = a(q + h * v + 0.5 * h * h * k3, v + h * k3);
    motion.advance(s, torque, ForceSegment<>{}, h, 1);
    EXPECT_LT((s.q - q - h * v - h * h / 6.0 * (k1 + k2 + k3)).norm(), 1e-11 * (1.0 + h * v.norm())) << speed;
    EXPECT_LT((s.qd - v - h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)).norm(), 1e-10 * v.norm()) << speed;
  }
}

// Law: dry friction opposes the motion from its begin on, and the motion is exact through its reversal: v' = (F -+ f) / m.
TEST(PlantIntegrator, DryFrictionIsExactThroughBreakawayAndReversal) {
  const double mass = 0.06, dry = 0.04, force = 0.1, period = 1e-3;
  JointFriction<1> friction;
  friction.coulomb[0] = friction.breakaway[0] = dry;
  const PlantIntegrator<Slider> motion(Slider(mass), friction, HumanArm{});
  for (const double sign : {1.0, -1.0})
    for (const double start : {0.0, 1e-3}) {  // at rest; against the force, with its end in the middle of a substep
      PlantState<1> s;
      s.qd[0] = -sign * start;
      for (int k = 0; k < 3; ++k) motion.advance(s, Joints<1>(sign * force), ForceSegment<>{}, period, 2);
      const double stops = start * mass / (force + dry), left = 3.0 * period - stops, forth = (force - dry) / mass;
      EXPECT_NEAR(s.qd[0], sign * forth * left, 1e-12) << start;
      EXPECT_NEAR(s.q[0], sign * (0.5 * forth * left * left - 0.5 * start * stops), 1e-14) << start;
    }
}

// Law: through viscous and dry friction the reversal is at the root of the closed form: v' = (F + f - b v) / m, then (F - f - b v) / m.
TEST(PlantIntegrator, TheReversalThroughViscousFrictionIsAtItsClosedForm) {
  const double mass = 0.06, dry = 0.04, b = 0.8, force = 0.1, period = 1e-3, tau = mass / b;
  JointFriction<1> friction;
  friction.viscous[0] = b;
  friction.coulomb[0] = friction.breakaway[0] = dry;
  const PlantIntegrator<Slider> motion(Slider(mass), friction, HumanArm{});
  for (const double start : {4e-4, 1e-3, 1.9e-3}) {
    PlantState<1> s;
    s.qd[0] = -start;
    motion.advance(s, Joints<1>(force), ForceSegment<>{}, period, 1);
    const double back = (force + dry) / b, forth = (force - dry) / b, left = period - tau * std::log1p(start / back);
    EXPECT_NEAR(s.qd[0], forth * -std::expm1(-left / tau), 1e-12) << start;
  }
}

// Law: Coulomb's law at rest: a joint that friction can hold rests, any other accelerates against its breakaway torque.
template <class Mechanism>
void expect_coulombs_law(const Mechanism& mechanism, double angle, double strength) {
  using Angles = Joints<Mechanism::dof>;
  States states;
  int moved = 0, held = 0;
  for (int k = 0; k < 8000; ++k) {
    const Joints<3> size = states.draw(1.0), drawn = states.draw(strength), pose = states.draw(angle);
    JointFriction<Mechanism::dof> friction;
    Angles torque, q;
    for (int i = 0; i < Mechanism::dof; ++i) {
      friction.coulomb[i] = friction.breakaway[i] = strength * std::pow(10.0, size[i] - 1.0);
      torque[i] = drawn[i];
      q[i] = pose[i];
    }
    const Angles a = PlantIntegrator<Mechanism>(mechanism, friction, HumanArm{}).acceleration(q, Angles::Zero(), torque);
    const Angles kept = torque - mechanism.gravity(q) - mechanism.mass_matrix(q) * a;  // by friction
    for (int i = 0; i < Mechanism::dof; ++i) {
      if (a[i] == 0.0) {
        ASSERT_LE(std::abs(kept[i]), friction.breakaway[i] * (1.0 + 1e-9)) << k;
      } else {
        ASSERT_NEAR(kept[i], std::copysign(friction.breakaway[i], a[i]), 1e-9 * strength) << k;
      }
      ++(a[i] == 0.0 ? held : moved);
    }
  }
  EXPECT_GT(std::min(held, moved), 1000);
}
TEST(PlantIntegrator, PremiumsJointsAtRestObeyCoulombsLaw) {
  expect_coulombs_law(arm, 2.0, 0.15);
}
TEST(PlantIntegrator, FiveBarsJointsAtRestObeyCoulombsLaw) {
  expect_coulombs_law(palpate::mechanism::FiveBar(), 0.5, 0.15);
}

}  // namespace
