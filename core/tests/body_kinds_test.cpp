// Bodies with inertia and with creep: against closed forms, and never giving out energy.
#include <gtest/gtest.h>

#include <cmath>
#include <palpate/body/modal.hpp>
#include <palpate/body/patch.hpp>
#include <palpate/body/relaxing.hpp>
#include <random>

namespace {

// One node with one mode and a compliance that is that mode's: a damped oscillator on a stop.
struct Oscillator {
  double frequency = 60.0, mass = 0.02;
  palpate::BodyNodes nodes{{{0, 0, 0}}, {{0, 0, 1}}, {1e-6}};

  [[nodiscard]] std::vector<float> full(double extra) const {
    const auto c = static_cast<float>(1.0 / (mass * frequency * frequency) + extra);
    return {c, 0, 0, 0, c, 0, 0, 0, c};
  }
  [[nodiscard]] palpate::Modal modal(double period, double alpha, double beta, double extra = 0.0) const {
    const std::vector<float> shapes{0, 0, static_cast<float>(1.0 / std::sqrt(mass))};
    return {nodes, full(extra).data(), shapes.data(), {frequency}, period, alpha, beta};
  }
};

// Under-, critically and over-damped: the step response of a mass on a spring and a damper, at any period.
TEST(Modal, StepResponseIsTheClosedForm) {
  const Oscillator o;
  for (const double ratio : {0.05, 1.0, 4.0}) {
    for (const double period : {1e-4, 1e-3, 2e-2}) {
      palpate::Modal modal = o.modal(period, 2.0 * ratio * o.frequency, 0.0);
      const std::int32_t node = 0;
      const double force = 0.5;
      for (int k = 1; k <= 100; ++k) {
        const double found = modal.at_rest(0) + modal.compliance(0, 0) * force, t = k * period, w = o.frequency;
        double expected = 0.0;
        if (ratio < 1.0) {
          const double n = w * std::sqrt(1.0 - ratio * ratio);
          expected = 1.0 - std::exp(-ratio * w * t) * (std::cos(n * t) + ratio * w / n * std::sin(n * t));
        } else if (ratio == 1.0) {
          expected = 1.0 - std::exp(-w * t) * (1.0 + w * t);
        } else {
          const double n = std::sqrt(ratio * ratio - 1.0), a = w * (ratio - n), b = w * (ratio + n);
          expected = 1.0 - (b * std::exp(-a * t) - a * std::exp(-b * t)) / (b - a);
        }
        expected *= force / (o.mass * w * w);
        ASSERT_NEAR(found, expected, 2e-6 * force / (o.mass * w * w));
        modal.advance(&node, &force, 1);
      }
    }
  }
}

// What the modes leave out is there at once; held for long, a force gives the deflection of the full compliance.
TEST(Modal, HeldForLongItIsTheFullCompliance) {
  const Oscillator o;
  const double extra = 3e-3, force = 0.2, period = 1e-3;
  palpate::Modal modal = o.modal(period, 40.0, 0.0, extra);
  const std::int32_t node = 0;
  EXPECT_NEAR(modal.compliance(0, 0), extra, 0.1 * extra);
  for (int k = 0; k < 2000; ++k) modal.advance(&node, &force, 1);
  EXPECT_NEAR(modal.at_rest(0) + modal.compliance(0, 0) * force, (extra + 1.0 / (o.mass * o.frequency * o.frequency)) * force, 1e-6);
}

// A tip that dances on the body: energy that went in at the tip covers what the body holds, at every tick.
TEST(Modal, HoldsNoMoreEnergyThanThePressingTipPutIn) {
  const Oscillator o;
  for (const auto& [extra, alpha] : {std::pair{0.0, 0.0}, std::pair{2e-3, 0.0}, std::pair{2e-3, 60.0}}) {
    palpate::Modal modal = o.modal(1e-3, alpha, 0.0, extra);
    palpate::BodyContact<palpate::Modal> contact(o.nodes, modal);
    palpate::BodyTip tip;
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    double in = 0.0, before = 0.0, depth = 0.0;
    int pressed = 0;
    for (int k = 0; k < 20000; ++k) {
      depth = 0.98 * depth + 4e-4 * normal(random);
      tip.centre = {0, 0, tip.radius - depth};
      const double rest = modal.at_rest(0);
      const palpate::BodyAnswer& a = contact.step(tip);
      const double now = a.touching ? depth : rest, f = a.force.z();
      in += f * (now - before);
      before = now;
      pressed += a.touching ? 1 : 0;
      ASSERT_LE(modal.energy() + 0.5 * extra * f * f, in + 1e-6 * (std::abs(in) + 1e-6)) << k;
    }
    EXPECT_GT(pressed, 300);
    EXPECT_LT(pressed, 19000);
  }
}

// Creep under a constant force and relaxation at a constant depth, by their exponentials.
TEST(Relaxing, CreepsAndRelaxesAsAStandardLinearSolid) {
  const Oscillator o;
  const double instant = 3.0, creep = 0.2, period = 1e-3, c = 1.0 / (o.mass * o.frequency * o.frequency);
  palpate::Relaxing body(palpate::Compliance(o.nodes, o.full(0.0).data()), instant, creep, period);
  const std::int32_t node = 0;
  const double force = 0.4;
  for (int k = 1; k <= 1000; ++k) {
    const double found = body.at_rest(0) + body.compliance(0, 0) * force;
    ASSERT_NEAR(found, c * force * (1.0 - (1.0 - 1.0 / instant) * std::exp(-k * period / creep)), 1e-6 * c);
    body.advance(&node, &force, 1);
  }
  // At a constant depth the force falls from instant to one, with the time creep / instant; a held force lags by half a period.
  body.reset();
  palpate::BodyContact<palpate::Relaxing> contact(o.nodes, body);
  palpate::BodyTip tip;
  const double depth = 1e-3;
  tip.centre = {0, 0, tip.radius - depth};
  for (int k = 0; k <= 1000; ++k) {
    const double t = (k + 0.5) * period;
    ASSERT_NEAR(contact.step(tip).force.z(), depth / c * (1.0 + (instant - 1.0) * std::exp(-t * instant / creep)), 0.02 * depth / c);
  }
}

// Random closed pressing: work in is never negative, and it is lost, not only stored.
TEST(Relaxing, GivesOutNoEnergyOverClosedPaths) {
  const Oscillator o;
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  double lost = 0.0;
  for (int path = 0; path < 10000; ++path) {
    palpate::Relaxing body(palpate::Compliance(o.nodes, o.full(0.0).data()), 3.0, 0.02, 1e-3);
    palpate::BodyContact<palpate::Relaxing> contact(o.nodes, body);
    palpate::BodyTip tip;
    const double a = 1e-3 * normal(random), b = 1e-3 * normal(random), c = 5e-4 * normal(random);
    double in = 0.0, most = 0.0, before = 0.0;
    const int ticks = 100;
    for (int k = 1; k <= ticks; ++k) {
      const double s = 2.0 * M_PI * k / ticks, depth = a * (1.0 - std::cos(s)) + b * std::sin(s) + c * std::sin(3.0 * s);
      tip.centre = {0, 0, tip.radius - depth};
      const double rest = body.at_rest(0);
      const palpate::BodyAnswer& answer = contact.step(tip);
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

}  // namespace
