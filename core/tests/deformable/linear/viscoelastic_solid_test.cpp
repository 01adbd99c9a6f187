// Standard linear solid: closed forms and passivity.
#include <gtest/gtest.h>

#include <cmath>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/viscoelastic_solid.hpp>
#include <random>
#include <vector>

#include "support/linear_solve.hpp"
#include "support/modal_bodies.hpp"
#include "support/rounds.hpp"

namespace {

// Energy by the Maxwell form (long-term spring parallel to a spring and dashpot in series). The loss per tick is that of the dashpots, in
// closed form, plus that of the force step.
TEST(StandardLinearSolid, LossIsThatOfDashpotsAndForceSteps) {
  const Nine nine;
  const double instantaneous_ratio = 3.0, retardation_time = 0.05, period = 1e-3, late = 1.0 - 1.0 / instantaneous_ratio,
               stays = std::exp(-period / retardation_time);
  palpate::deformable::StandardLinearSolid body(palpate::deformable::Compliance(nine.at, nine.full.data()), instantaneous_ratio,
                                                retardation_time, period);
  const Eigen::MatrixXd c = nine.whole(), stiffness = linear_solve(c, Eigen::MatrixXd::Identity(Nine::nodes, Nine::nodes));
  Eigen::VectorXd q = Eigen::VectorXd::Zero(Nine::nodes), place = q, before = q;
  double held = 0.0, most = 0.0, lost = 0.0;
  dance(nine.at, body, 3000, [&](const Eigen::VectorXd& f, const palpate::deformable::ContactResult& a) {
    const Eigen::VectorXd behind = late * f - q;
    q += (1.0 - stays) * behind;
    const Eigen::VectorXd now = c * (f / instantaneous_ratio + q), spring = now - c * q / late;
    most = std::max(most, a.energy);
    ASSERT_NEAR(a.energy, 0.5 * now.dot(stiffness * now) + 0.5 * (instantaneous_ratio - 1.0) * spring.dot(stiffness * spring), 2e-5 * most);
    const double dashpots = 0.5 * (1.0 - stays * stays) / late * behind.dot(c * behind);
    const double step = 0.5 / instantaneous_ratio * (f - before).dot(c * (f - before));
    ASSERT_NEAR(f.dot(now - place) - (a.energy - held), dashpots + step, 2e-5 * most);
    lost += dashpots;
    held = a.energy;
    place = now;
    before = f;
  });
  EXPECT_GT(lost, 0.5 * most);
}

/// Slide over a body with friction; the forces of all ticks.
template <class Model>
std::vector<palpate::math::Vector3<>> slide(const Nine& nine, Model model, palpate::deformable::DryFriction friction) {
  palpate::deformable::TipContact<Model> contact(nine.at, model, friction);
  palpate::deformable::Tip tip;
  tip.radius = 5e-3;
  std::vector<palpate::math::Vector3<>> forces;
  for (int k = 0; k < 50; ++k) {
    tip.center = {4e-5 * k, 0.0, tip.radius - 1e-4};
    forces.push_back(contact.step(tip).force);
  }
  return forces;
}

// A model that was built without tangential compliance has no friction, in place of a read past its data.
TEST(StandardLinearSolid, WithoutTangentialComplianceThereIsNoFriction) {
  const Nine nine;
  const auto expect_none = [&nine](const auto& model) {
    const auto rough = slide(nine, model, {0.5, 0.4}), smooth = slide(nine, model, {});
    EXPECT_EQ(rough, smooth);
    EXPECT_GT(smooth.back().z(), 0.0);
  };
  const palpate::deformable::Compliance elastic(nine.at, nine.full.data());
  expect_none(elastic);
  expect_none(palpate::deformable::StandardLinearSolid(elastic, 3.0, 0.05, 1e-3));
  expect_none(palpate::deformable::Modal(nine.at, nine.full.data(), nine.waves.data(), nine.frequencies, 1e-3, 1.0, 0.0));
}

// After a step held for long, the energy is that of the long-term spring; after release it decays to zero.
TEST(StandardLinearSolid, StoresTheEnergyOfTheLongTermSpring) {
  const Oscillator o;
  const double instantaneous_ratio = 3.0, c = 1.0 / (o.mass * o.frequency * o.frequency), depth = 1e-3;
  palpate::deformable::StandardLinearSolid body(palpate::deformable::Compliance(o.nodes, o.full(0.0).data()), instantaneous_ratio, 0.02,
                                                1e-5);
  palpate::deformable::TipContact<palpate::deformable::StandardLinearSolid> contact(o.nodes, body);
  palpate::deformable::Tip tip;
  tip.center = {0, 0, tip.radius - depth};
  EXPECT_NEAR(contact.step(tip).energy, 0.5 * instantaneous_ratio * depth * depth / c, 4e-3 * depth * depth / c);
  for (int k = 0; k < 20000; ++k) contact.step(tip);
  EXPECT_NEAR(contact.last().energy, 0.5 * depth * depth / c, 1e-6 * depth * depth / c);
  tip.center.z() += 2.0 * depth;
  const double left = contact.step(tip).energy;  // series spring of the Kelvin form released
  EXPECT_NEAR(left, 0.5 * (1.0 - 1.0 / instantaneous_ratio) * depth * depth / c, 1e-3 * depth * depth / c);
  for (int k = 0; k < 20000; ++k) contact.step(tip);
  EXPECT_LT(contact.last().energy, 1e-8 * left);
}

// Creep under constant force and relaxation at constant depth: exponentials.
TEST(StandardLinearSolid, CreepsAndRelaxesExponentially) {
  const Oscillator o;
  const double instantaneous_ratio = 3.0, retardation_time = 0.2, period = 1e-3, c = 1.0 / (o.mass * o.frequency * o.frequency);
  palpate::deformable::StandardLinearSolid body(palpate::deformable::Compliance(o.nodes, o.full(0.0).data()), instantaneous_ratio,
                                                retardation_time, period);
  const std::int32_t node = 0;
  const double force = 0.4;
  for (int k = 1; k <= 1000; ++k) {
    const double found = body.free_displacement(0) + body.compliance(0, 0) * force;
    ASSERT_NEAR(found, c * force * (1.0 - (1.0 - 1.0 / instantaneous_ratio) * std::exp(-k * period / retardation_time)), 1e-6 * c);
    body.advance(&node, &force, 1);
  }
  // At constant depth the force ratio decays from instantaneous_ratio to one with the time retardation_time / instantaneous_ratio; the held
  // force lags by half a period.
  body.reset();
  palpate::deformable::TipContact<palpate::deformable::StandardLinearSolid> contact(o.nodes, body);
  palpate::deformable::Tip tip;
  const double depth = 1e-3;
  tip.center = {0, 0, tip.radius - depth};
  for (int k = 0; k <= 1000; ++k) {
    const double t = (k + 0.5) * period;
    ASSERT_NEAR(contact.step(tip).force.z(),
                depth / c * (1.0 + (instantaneous_ratio - 1.0) * std::exp(-t * instantaneous_ratio / retardation_time)), 0.02 * depth / c);
  }
}

// Random closed paths: the work is nonnegative and energy is dissipated.
TEST(StandardLinearSolid, IsPassiveOverClosedPaths) {
  const Oscillator o;
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  double lost = 0.0;
  for (int path = 0; path < 1000 * rounds(); ++path) {
    palpate::deformable::StandardLinearSolid body(palpate::deformable::Compliance(o.nodes, o.full(0.0).data()), 3.0, 0.02, 1e-3);
    palpate::deformable::TipContact<palpate::deformable::StandardLinearSolid> contact(o.nodes, body);
    palpate::deformable::Tip tip;
    const double a = 1e-3 * normal(random), b = 1e-3 * normal(random), c = 5e-4 * normal(random);
    double in = 0.0, most = 0.0, before = 0.0;
    const int ticks = 100;
    for (int k = 1; k <= ticks; ++k) {
      const double s = 2.0 * M_PI * k / ticks, depth = a * (1.0 - std::cos(s)) + b * std::sin(s) + c * std::sin(3.0 * s);
      tip.center = {0, 0, tip.radius - depth};
      const double rest = body.free_displacement(0);
      const palpate::deformable::ContactResult& answer = contact.step(tip);
      const double now = answer.touching ? depth : rest;
      in += answer.force.z() * (now - before);
      before = now;
      most = std::max(most, in);
    }
    ASSERT_GE(in, -1e-12 * (1.0 + most));
    lost += in;
  }
  EXPECT_GT(lost, 0.0);
}

// Law: the deflection at a held depth is that depth, however much of it has become creep.
TEST(StandardLinearSolid, TheDeflectionIsThatOfTheTipWhileTheBodyCreeps) {
  const Oscillator o;
  palpate::deformable::StandardLinearSolid body(palpate::deformable::Compliance(o.nodes, o.full(0.0).data()), 3.0, 0.02, 1e-3);
  palpate::deformable::TipContact<palpate::deformable::StandardLinearSolid> contact(o.nodes, body);
  palpate::deformable::Tip tip;
  tip.center = {0, 0, tip.radius - 1e-3};
  for (int k = 0; k < 100; ++k) ASSERT_NEAR(contact.step(tip).deflection.z(), -1e-3, 1e-12) << k;
  EXPECT_GT(body.free_displacement(0), 0.5e-3);
}

// Law: a patch that loses contact keeps the creep of the whole patch only: its next force does not depend on how far the tip has left it.
TEST(StandardLinearSolid, APatchForgetsTheCreepOfItsCoverageWhereItLosesContact) {
  using palpate::math::Vector3;
  const palpate::deformable::SurfaceNodes nodes({{0, 0, 0}, {3e-3, 0, -0.5e-3}}, {{0, 0, 1}, {0, 0, 1}}, {1e-6, 1e-6});
  std::vector<float> full(36, 0.0F);
  for (std::size_t k = 0; k < 6; ++k) full[7 * k] = 1e-3F;
  const auto force_after = [&](double lifted) {
    palpate::deformable::StandardLinearSolid body(palpate::deformable::Compliance(nodes, full.data()), 1.2, 0.02, 1e-3);
    palpate::deformable::TipContact<palpate::deformable::StandardLinearSolid> contact(nodes, body);
    palpate::deformable::Tip tip;
    tip.kind = palpate::deformable::Tip::Kind::flat;
    tip.radius = 3e-3;  // its edge crosses the second patch
    tip.center = {0, 0, -1e-3};
    for (int k = 0; k < 100; ++k) contact.step(tip);
    EXPECT_EQ(contact.last().nodes, 2);
    EXPECT_LT(contact.forces()[1], 0.4 * contact.forces()[0]);
    tip.center.z() = -1e-3 + lifted;
    EXPECT_EQ(contact.step(tip).nodes, 1);
    tip.center.z() = -1e-3;
    EXPECT_EQ(contact.step(tip).nodes, 2);
    return contact.forces()[1];
  };
  EXPECT_NEAR(force_after(0.45e-3), force_after(0.6e-3), 1e-9);
}

}  // namespace
