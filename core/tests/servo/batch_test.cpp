#include "palpate/servo/batch.hpp"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <cmath>
#include <optional>
#include <vector>

#include "support/states.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::Slider;
using palpate::servo::BatchJob;
using palpate::servo::JobQueue;
using palpate::servo::SimulationSetup;

constexpr int ticks = 400;
constexpr int width = palpate::servo::outcome_width<1>;
/// Clang refuses arrays of packs wider than the registers that it compiles for.
constexpr int lanes = EIGEN_MAX_STATIC_ALIGN_BYTES >= 32 ? 4 : 2;

/// A slider at a spring, with its own delay, drive temperature and jitter. Every third one exceeds its critical stiffness by far.
SimulationSetup<Slider> cell(int i) {
  SimulationSetup<Slider> s;
  s.mechanism = Slider(0.06);
  s.friction.viscous[0] = 0.05;
  s.friction.coulomb[0] = s.friction.breakaway[0] = 1e-3;
  s.object = palpate::object::SpringWall({.kind = palpate::object::SpringWallKind::point,
                                          .point = {1e-3, 0.0, 0.0},
                                          .stiffness = {i % 3 == 1 ? 5e4 + 1e3 * i : 20.0 + i, 0.0, 0.0},
                                          .damping = {0.01, 0.0, 0.0}});
  s.delay = i % 4;
  s.limits.continuous_force = i % 3 == 1 ? 1e300 : 0.01 + 1e-3 * i;
  s.limits.thermal_time = 0.05;
  s.jitter = 0.8e-3;
  s.seed = static_cast<std::uint64_t>(i);
  return s;
}

struct JobScheduler {
  int count;
  std::vector<double> rows;
  int taken = 0;
  std::optional<BatchJob<Slider>> at_hand;

  static const BatchJob<Slider>* next(void* self) {
    auto& cells = *static_cast<JobScheduler*>(self);
    if (cells.taken == cells.count) return nullptr;
    const int i = cells.taken++;
    return &cells.at_hand.emplace(cell(i), cells.rows.data() + static_cast<std::ptrdiff_t>(width) * i);
  }
};

// Law: a loop in a lane equals the loop alone, bit for bit, whatever ran in the lane before and beside it.
TEST(Batch, ALaneTakesTheNextLoopAndForgetsTheLast) {
  const std::vector<double> nothing(3 * (ticks + 1), 0.0);
  for (const int count : {1, 3, 23}) {
    JobScheduler cells{count, std::vector<double>(static_cast<std::size_t>(width * count)), 0, {}};
    palpate::servo::simulate_side_by_side<Slider, palpate::control::StateSpace, lanes>({&JobScheduler::next, &cells}, ticks, nothing.data(),
                                                                                       nothing.data());
    int lost = 0;
    for (int i = 0; i < count; ++i) {
      std::vector<double> trace(static_cast<std::size_t>(palpate::servo::record_width<1>) * (ticks + 1));
      const auto alone = palpate::servo::simulate(cell(i), ticks, nothing.data(), nothing.data(), trace.data());
      const double* row = cells.rows.data() + static_cast<std::ptrdiff_t>(width) * i;
      EXPECT_EQ(row[0], alone.unstable_tick) << i;
      if (alone.unstable_tick >= 0) {
        ++lost;
        continue;
      }
      const double* last = trace.data() + static_cast<std::ptrdiff_t>(palpate::servo::record_width<1>) * ticks;
      EXPECT_EQ(row[width - 2], last[0]) << i;
      EXPECT_EQ(row[width - 1], last[1]) << i;
    }
    EXPECT_EQ(lost, (count + 1) / 3);
  }
}

// Law: a loop outside of lanes has the outcome of the same loop in a lane, bit for bit.
TEST(Batch, ASingleLoopHasTheOutcomeOfItsLane) {
  const std::vector<double> zeros(3 * (ticks + 1), 0.0);
  JobScheduler cells{23, std::vector<double>(static_cast<std::size_t>(width * 23)), 0, {}};
  palpate::servo::simulate_side_by_side<Slider, palpate::control::StateSpace, lanes>({&JobScheduler::next, &cells}, ticks, zeros.data(),
                                                                                     zeros.data());
  for (int i = 0; i < 23; ++i) {
    std::vector<double> row(width);
    palpate::servo::simulate_outcome(cell(i), ticks, zeros.data(), zeros.data(), row.data());
    for (int c = 0; c < width; ++c) {
      const double lane = cells.rows[static_cast<std::size_t>(width * i + c)], alone = row[static_cast<std::size_t>(c)];
      EXPECT_TRUE(lane == alone || (std::isnan(lane) && std::isnan(alone))) << i << " " << c;
    }
  }
}

// Law: the outcome has the excursion of the joints in the judged window, and of no tick before it.
TEST(Batch, TheOutcomeHasTheExcursionOfTheJudgedWindow) {
  constexpr int record = palpate::servo::record_width<3>;
  SimulationSetup<Premium> s;
  s.mechanism = arm;
  s.start = {0.0, 1.0, 1.0 + 1.42};  // 0.15 rad from the stretched arm
  s.start_speed = {0.3, -4.0, 4.0};
  s.object = palpate::object::SpringWall({.kind = palpate::object::SpringWallKind::point,
                                          .point = s.mechanism.forward(s.start),
                                          .stiffness = Vector3<>::Constant(300.0),
                                          .damping = Vector3<>::Constant(8.0)});
  const std::vector<double> zeros(3 * (ticks + 1), 0.0);
  std::vector<double> trace(static_cast<std::size_t>(record * (ticks + 1)));
  ASSERT_EQ(palpate::servo::simulate(s, ticks, zeros.data(), zeros.data(), trace.data()).unstable_tick, -1);
  const auto pose = [&](int k) { return Eigen::Map<const Eigen::Vector3d>(trace.data() + static_cast<std::ptrdiff_t>(record) * k); };
  const auto conditioning = [&](const Eigen::Vector3d& q) {
    const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3d>(s.mechanism.jacobian(s.mechanism.kinematics(q))).singularValues();
    return values[2] / values[0];
  };
  int singular = 0;
  for (int first = 0; first < ticks - 10; first += 39) {
    s.window_start = first;
    std::vector<double> row(palpate::servo::outcome_width<3>);
    palpate::servo::simulate_outcome(s, ticks, zeros.data(), zeros.data(), row.data());
    Eigen::Vector3d least = pose(first), greatest = pose(first);
    double worst = 1.0;
    for (int k = first; k <= ticks; ++k) {
      least = least.cwiseMin(pose(k));
      greatest = greatest.cwiseMax(pose(k));
      worst = std::min(worst, conditioning(pose(k)));
    }
    EXPECT_EQ(Eigen::Vector3d(row.data() + 15), least) << first;
    EXPECT_EQ(Eigen::Vector3d(row.data() + 18), greatest) << first;
    const double found = conditioning(Eigen::Vector3d(row.data() + 21));
    EXPECT_EQ(found < 0.01, worst < 0.01) << first << ": " << found << " " << worst;
    if (worst < 0.01) {
      EXPECT_NEAR(found, worst, 1e-3 * worst) << first;
    }
    EXPECT_EQ(Eigen::Vector3d(row.data() + 24), Eigen::Vector3d(pose(ticks))) << first;
    singular += worst < 0.01;
  }
  EXPECT_GT(singular, 0);
  EXPECT_LT(singular, 10);
}

}  // namespace
