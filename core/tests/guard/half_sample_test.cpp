#include <gtest/gtest.h>

#include <cmath>
#include <palpate/guard/half_sample.hpp>
#include <palpate/math/vector.hpp>
#include <palpate/mechanism/slider.hpp>

namespace {

using palpate::guard::AdaptiveWindow;
using palpate::guard::VelocityObserver;
using palpate::math::Vector3;

constexpr double period = 1e-3, count = 25e-6;

double counted(double x) {
  return std::nearbyint(x / count) * count;
}

/// Press a mass on a wall of 1 N/mm with the damping 0.7 m/T on an estimated velocity. Return the deflection over that of the stiffness.
double false_deflection(const Vector3<>& gains) {
  const double mass = 0.06, stiffness = 1000.0, damping = 0.7 * mass / period, push = 1.0;
  VelocityObserver observer(gains, period);
  double x = 0.0, v = 0.0, force = 0.0;
  for (int k = 0; k < 20'000; ++k) {
    const double velocity = observer.velocity(x, -force / mass);
    force = stiffness * x + damping * velocity;
    const double a = (push - force) / mass;
    x += period * (v + 0.5 * period * a);
    v += period * a;
  }
  return x * stiffness / push;
}

// Golden: a two-state observer does not know the hand's force. The wall is then softer by 1 + (B/m)(l1/l2 - T/2).
TEST(VelocityObserver, WithoutTheHandsForceGivesAFalseStiffness) {
  for (const auto& [rate, golden] : {std::pair{300.0, 5.35}, std::pair{1000.0, 2.16}}) {
    const double p = std::exp(-rate * period), l1 = 1.0 - p * p, l2 = (1.0 - p) * (1.0 - p) / period;
    EXPECT_NEAR(1.0 + 0.7 / period * (l1 / l2 - 0.5 * period), golden, 0.01 * golden);
    EXPECT_NEAR(false_deflection({l1, l2, 0.0}), golden, 0.01 * golden);
  }
}

TEST(VelocityObserver, WithTheHandsForceGivesTheTrueStiffness) {
  EXPECT_NEAR(false_deflection(VelocityObserver::gains(300.0, period)), 1.0, 1e-6);
  EXPECT_NEAR(false_deflection(VelocityObserver::gains(1000.0, period)), 1.0, 1e-6);
}

/// Return the rms error [mm/s] of an estimator on a motion in counts, over its second half.
template <class Estimator, class Position, class Velocity>
double rms_error(Estimator estimate, Position position, Velocity velocity, int samples = 20'000) {
  double sum = 0.0;
  for (int k = 0; k < samples; ++k) {
    const double t = k * period, error = estimate(k, counted(position(t))) - velocity(t);
    if (k >= samples / 2) sum += error * error;
  }
  return 1e3 * std::sqrt(sum / (samples - samples / 2));
}

struct Sine {
  double hertz, amplitude;
  [[nodiscard]] double rate() const { return 2.0 * M_PI * hertz; }
  double operator()(double t) const { return amplitude * std::sin(rate() * t); }
  [[nodiscard]] double speed(double t) const { return amplitude * rate() * std::cos(rate() * t); }
  [[nodiscard]] double acceleration(double t) const { return -amplitude * rate() * rate() * std::sin(rate() * t); }
};

// Golden: rms errors of velocities from counts of 25 um at 1 kHz, mm/s: a ramp of 3 mm/s, 1 Hz 0.5 mm, 1 Hz 20 mm, 5 Hz 5 mm. A deviation
// of exactly one count ends the window; where rounding decides, errors of fast motions differ by up to 7 %.
TEST(AdaptiveWindow, HasTheErrorsOfItsTable) {
  const auto ramp = [](double t) { return 3e-3 * t; };
  const auto window = [] { return [w = AdaptiveWindow(count, period)](int, double q) mutable { return w.velocity(q); }; };
  const auto backward = [] { return [w = AdaptiveWindow(0.0, period)](int, double q) mutable { return w.velocity(q); }; };
  const auto error = [&](auto make, const Sine& s) { return rms_error(make(), s, [&](double t) { return s.speed(t); }); };
  EXPECT_NEAR(rms_error(window(), ramp, [](double) { return 3e-3; }), 0.42, 0.04);
  EXPECT_NEAR(error(window, {1.0, 0.5e-3}), 0.61, 0.03);
  EXPECT_NEAR(error(window, {1.0, 20e-3}), 3.42, 0.17);
  EXPECT_NEAR(error(window, {5.0, 5e-3}), 9.52, 0.65);
  EXPECT_NEAR(rms_error(backward(), ramp, [](double) { return 3e-3; }), 8.12, 0.4);
  EXPECT_NEAR(error(backward, {1.0, 0.5e-3}), 6.71, 0.34);
  EXPECT_NEAR(error(backward, {1.0, 20e-3}), 9.47, 0.47);
  EXPECT_NEAR(error(backward, {5.0, 5e-3}), 11.0, 0.55);
}

// Law: without counts the window is a backward difference.
TEST(AdaptiveWindow, IsABackwardDifferenceWithoutCounts) {
  AdaptiveWindow window(0.0, period);
  double before = 0.0;
  for (int k = 1; k < 100; ++k) {
    const double q = std::sin(0.1 * k) + 0.01 * k * k;
    const double v = window.velocity(q);
    EXPECT_DOUBLE_EQ(v, k > 1 ? (q - before) / period : 0.0);
    before = q;
  }
}

// Law: two held forces bring a mass into the state in which it leaves the continuous wall, whatever the instant of the exit, so that the
// exit generates no energy (Gillespie & Cutkosky 1996).
TEST(HalfSample, LeavesAWallInTheStateOfTheContinuousOne) {
  constexpr double mass = 0.06, stiffness = 4000.0, speed = 0.2;
  for (const double depth : {1e-6, 3e-5, 9e-5, 1.5e-4}) {
    palpate::guard::HalfSample<palpate::mechanism::Slider> guard(
        {.velocity = palpate::guard::VelocityEstimate::observer, .horizon = 0.5, .observer = 1000.0, .deadbeat = true});
    guard.prepare({palpate::mechanism::Slider(mass), palpate::math::Joints<1>(0.0), period, 0});
    // Free motion outward, so that the observer knows the velocity; then a wall of this depth appears, with its surface at x = 0.
    double x = -depth - 200 * speed * period, v = speed, before = x;
    const Vector3<> normal(1.0, 0.0, 0.0);
    const auto tick = [&](double surface_depth, bool touching) {
      const palpate::math::Joints<1> q(x);
      guard.predict(q, 1.0 / period);
      palpate::object::ContactResult wall;
      wall.depth = surface_depth - 0.5 * period * v;
      wall.touching = touching;
      if (touching) {
        wall.normal = normal;
        wall.stiffness = stiffness;
      }
      guard.contact(wall);
      const double force = guard.command(q, Vector3<>::Zero(), Vector3<>(x - before, 0.0, 0.0)).x();
      guard.commit(palpate::math::Joints<1>(force));
      before = x;
      x += period * (v + 0.5 * period * force / mass);
      v += period * force / mass;
    };
    for (int k = 0; k < 200; ++k) tick(0.0, false);
    ASSERT_NEAR(x, -depth, 1e-12);
    tick(depth, true);
    tick(-x, false);
    const double rate = std::sqrt(stiffness / mass), out = std::hypot(speed, rate * depth);
    EXPECT_NEAR(v, out, 1e-7 * out);
    EXPECT_NEAR(x, out * (2.0 * period - std::atan2(rate * depth, speed) / rate), 1e-9);
  }
}

}  // namespace
