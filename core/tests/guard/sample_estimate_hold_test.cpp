#include <gtest/gtest.h>

#include <cmath>
#include <palpate/guard/sample_estimate_hold.hpp>
#include <palpate/math/vector.hpp>
#include <palpate/mechanism/slider.hpp>

namespace {

using Hold = palpate::guard::SampleEstimateHold<palpate::mechanism::Slider>;
using palpate::math::Joints;
using palpate::math::Vector3;

Vector3<> held(Hold& guard, double force) {
  return guard.command(Joints<1>(0.0), Vector3<>(force, 0.0, 0.0), Vector3<>::Zero());
}

// Law: without correction, a spring K is held like a spring and a damper of K T/2 by backward difference.
TEST(SampleEstimateHold, OnASpringIsADamperOfHalfAPeriod) {
  constexpr double stiffness = 3000.0, period = 1e-3;
  Hold guard({0.0});
  double before = 0.0;
  for (int k = 1; k < 100; ++k) {
    const double depth = 1e-3 * (2.0 + std::sin(0.05 * k)), velocity = (depth - before) / period;
    EXPECT_NEAR(held(guard, stiffness * depth).x(), stiffness * depth + 0.5 * stiffness * period * velocity, 1e-9);
    before = depth;
  }
}

// Law: with the whole correction, the impulse up to a sample is that of the trapezoids of the sampled forces; beyond it, of the estimate.
TEST(SampleEstimateHold, WithCorrectionHasTheImpulseOfTheSampledForce) {
  Hold guard({1.0});
  double impulse = 0.0, trapezoids = 0.0, before = 0.0;
  for (int k = 1; k < 200; ++k) {
    const double force = 2.0 + std::sin(0.1 * k) + 0.3 * std::cos(0.37 * k);
    trapezoids += 0.5 * (force + before);
    impulse += held(guard, force).x();
    EXPECT_NEAR(impulse, trapezoids + 1.5 * force - 0.5 * before, 1e-9);
    before = force;
  }
}

// Law: outside an object nothing pulls, and the force never reverses.
TEST(SampleEstimateHold, NeverPulls) {
  for (const double correction : {0.0, 1.0}) {
    Hold guard({correction});
    held(guard, 5.0);
    EXPECT_GE(held(guard, 0.5).x(), 0.0);
    EXPECT_EQ(held(guard, 0.0).x(), 0.0);
    EXPECT_EQ(held(guard, 0.0).x(), 0.0);
  }
}

}  // namespace
