#include <gtest/gtest.h>

#include <vector>

#include "support/states.hpp"

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Slider;
using palpate::object::SpringWall;
using palpate::servo::SimulationSetup;

/// A mass in the sampled spring-damper: the loop of Gil, Sanchez, Hulin, Preusche & Hirzinger (2009).
SimulationSetup<Slider> sampled_wall(double stiffness, double damping, double viscous, int delay) {
  SimulationSetup<Slider> s;
  s.mechanism = Slider(0.06);
  s.friction.viscous[0] = viscous;
  s.object = SpringWall({.kind = SpringWall::Kind::point, .stiffness = {stiffness, 0.0, 0.0}, .damping = {damping, 0.0, 0.0}});
  s.delay = delay;
  s.controller = palpate::control::StateSpace();
  s.start[0] = 1e-3;
  return s;
}

/// Return the largest deflection in the last tenth of a run over that in the first.
double growth(const SimulationSetup<Slider>& setup, int ticks) {
  const std::vector<double> nothing(3 * (static_cast<std::size_t>(ticks) + 1), 0.0);
  std::vector<double> rows(palpate::servo::record_width<1> * (static_cast<std::size_t>(ticks) + 1));
  const auto outcome = palpate::servo::simulate(setup, ticks, nothing.data(), nothing.data(), rows.data());
  if (outcome.unstable_tick >= 0) return 1e300;
  double first = 0.0, last = 0.0;
  for (int k = 0; k <= ticks; ++k) {
    const double x = std::abs(rows[static_cast<std::size_t>(palpate::servo::record_width<1> * k)]);
    if (k < ticks / 10) first = std::max(first, x);
    if (k > 9 * ticks / 10) last = std::max(last, x);
  }
  return last / first;
}

// Law: without delay and damper the critical stiffness is K_c = (1 - a + ...)/beta0; with b = 0 it is 2 B/T (2 - beta)/(2 + beta).
TEST(Simulation, SamplingMakesASpringUnstablePastTheExactLimit) {
  const double m = 0.06, T = 1e-3;
  for (const double beta : {0.1, 0.4, 0.828}) {
    const double critical = 2.0 * beta * (2.0 - beta) / (2.0 + beta) * m / (T * T);
    EXPECT_LT(growth(sampled_wall(0.97 * critical, beta * m / T, 0.0, 0), 20000), 1.0) << beta;
    EXPECT_GT(growth(sampled_wall(1.03 * critical, beta * m / T, 0.0, 0), 20000), 1.0) << beta;
  }
}

// Law: the same setup gives the same bits.
TEST(Simulation, IsReproducibleBitForBit) {
  const auto setup = sampled_wall(500.0, 1.0, 0.05, 1);
  const std::vector<double> nothing(3 * 1001, 0.0);
  std::vector<double> a(static_cast<std::size_t>(palpate::servo::record_width<1>) * 1001), b = a;
  palpate::servo::simulate(setup, 1000, nothing.data(), nothing.data(), a.data());
  palpate::servo::simulate(setup, 1000, nothing.data(), nothing.data(), b.data());
  EXPECT_EQ(a, b);
}

TEST(Simulation, StopsWhereItDivergesAndRecordsNothingAfter) {
  const auto setup = sampled_wall(2e5, 0.0, 0.0, 3);
  const int ticks = 20000;
  const std::vector<double> nothing(3 * (static_cast<std::size_t>(ticks) + 1), 0.0);
  std::vector<double> rows(palpate::servo::record_width<1> * (static_cast<std::size_t>(ticks) + 1), 7.0);
  const auto outcome = palpate::servo::simulate(setup, ticks, nothing.data(), nothing.data(), rows.data());
  ASSERT_GT(outcome.unstable_tick, 0);
  ASSERT_EQ(outcome.rows, outcome.unstable_tick);
  for (std::size_t i = 0; i < static_cast<std::size_t>(outcome.rows * palpate::servo::record_width<1>); ++i)
    ASSERT_TRUE(std::isfinite(rows[i]));
  EXPECT_EQ(rows[static_cast<std::size_t>(outcome.rows * palpate::servo::record_width<1>)], 7.0);
}

}  // namespace
