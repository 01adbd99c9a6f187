#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
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
    EXPECT_LT(growth(sampled_wall(0.97 * critical, beta * m / T, 0.0, 0), 8000), 1.0) << beta;
    EXPECT_GT(growth(sampled_wall(1.03 * critical, beta * m / T, 0.0, 0), 8000), 1.0) << beta;
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

/// Rows of a run.
struct RecordedRun {
  static constexpr int width = palpate::servo::record_width<1>;
  palpate::servo::SimulationOutcome outcome;
  std::vector<double> rows;

  /// `push` is the operator's force at each sample, along x.
  RecordedRun(const SimulationSetup<Slider>& setup, const std::vector<double>& push) : rows(static_cast<std::size_t>(width) * push.size()) {
    std::vector<double> nothing(3 * push.size(), 0.0), force(nothing);
    for (std::size_t k = 0; k < push.size(); ++k) force[3 * k] = push[k];
    outcome = palpate::servo::simulate(setup, static_cast<int>(push.size()) - 1, nothing.data(), force.data(), rows.data());
  }
  [[nodiscard]] double at(int k, int column) const { return rows[static_cast<std::size_t>(k * width + column)]; }
};

// Law: a sampled plant is its recursion x' = A x + B (torque + J^T f - working torque), with motor torque and hand force of one sample.
TEST(Simulation, ASampledPlantIsItsRecursion) {
  const double T = 1e-3, m = 0.06;
  SimulationSetup<Slider> setup = sampled_wall(300.0, 0.5, 0.0, 1);
  setup.linear = true;
  setup.working_torque[0] = 0.3;
  setup.plant_a.resize(2, 2);
  setup.plant_a << 1.0, T, -1.0, 0.95;
  setup.plant_b.resize(2, 1);
  setup.plant_b << 0.5 * T * T / m, T / m;
  setup.plant_c.resize(1, 2);
  setup.plant_c << 1.0, 0.1 * T;
  std::vector<double> push(200);
  for (std::size_t k = 0; k < push.size(); ++k) push[k] = std::sin(0.07 * static_cast<double>(k)) + (k > 50 ? 0.5 : 0.0);
  const RecordedRun run(setup, push);
  ASSERT_EQ(run.outcome.rows, 200);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(2);
  double before = setup.start[0];
  for (int k = 0; k < 200; ++k) {
    const double q = setup.start[0] + (setup.plant_c * x)(0);
    ASSERT_NEAR(run.at(k, 0), q, 1e-12) << k;
    ASSERT_NEAR(run.at(k, 1), (q - before) / T, 1e-9) << k;
    before = q;
    x = (setup.plant_a * x + setup.plant_b.col(0) * (run.at(k, 8) + push[static_cast<std::size_t>(k)] - 0.3)).eval();
  }
}

// Law: late ticks do not change the motion: a mass under a force linear in time is on its cubic at the true time of each tick.
TEST(Simulation, AMassUnderARampIsOnItsCubicAtLateTicks) {
  const double T = 1e-3, m = 0.06, rate = 20.0;
  SimulationSetup<Slider> setup = sampled_wall(0.0, 0.0, 0.0, 0);
  setup.start[0] = 0.0;
  setup.jitter = 0.7e-3;
  setup.seed = 5;
  std::vector<double> push(101);
  for (std::size_t k = 0; k < push.size(); ++k) push[k] = rate * T * static_cast<double>(k);
  const RecordedRun run(setup, push);
  palpate::actuation::TickSchedule<double> clock(T, setup.jitter, setup.seed);
  const double begin = clock.lateness();
  for (int k = 0; k < 100; ++k, clock.tick()) {
    const double t = k * T + clock.lateness(), s = t - begin;
    ASSERT_NEAR(run.at(k, 0), rate / m * (begin * s * s / 2.0 + s * s * s / 6.0), 1e-12) << k;
    ASSERT_NEAR(run.at(k, 9), rate * t, 1e-12) << k;
  }
}

// Law: a loop diverges where a joint is too fast in either direction, and where its forces are too large to be used.
TEST(Simulation, DivergesInEitherDirectionAndByItsForces) {
  SimulationSetup<Slider> setup = sampled_wall(100.0, 0.0, 0.0, 0);
  const std::vector<double> push(11, 0.0);
  EXPECT_EQ(RecordedRun(setup, push).outcome.unstable_tick, -1);
  for (const double speed : {1.1e3, -1.1e3}) {
    setup.start_speed[0] = speed;
    EXPECT_EQ(RecordedRun(setup, push).outcome.unstable_tick, 0) << speed;
  }
  EXPECT_EQ(RecordedRun(sampled_wall(1e18, 0.0, 0.0, 0), push).outcome.unstable_tick, 0);
}

// Law: the operator's hand begins at the tip, with its tissue at rest.
TEST(Simulation, TheTissueOfAHandBeginsAtRest) {
  SimulationSetup<Slider> setup = sampled_wall(0.0, 0.0, 0.0, 0);
  setup.start[0] = 0.02;
  setup.human_arm.mass = 0.1;
  setup.human_arm.tissue = true;
  setup.human_arm.tissue_stiffness = 500.0;
  const RecordedRun run(setup, std::vector<double>(11, 0.0));
  for (int k = 0; k <= 10; ++k) {
    EXPECT_EQ(run.at(k, 9), 0.0) << k;
    EXPECT_EQ(run.at(k, 0), 0.02) << k;
  }
}

}  // namespace
