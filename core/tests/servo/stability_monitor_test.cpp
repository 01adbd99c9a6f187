// Outcomes of loops from given signals.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <palpate/mechanism/slider.hpp>
#include <palpate/servo/stability_monitor.hpp>
#include <random>

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Slider;

/// A plant and a servo whose signals are given.
struct Given {
  static constexpr int dof = 1;
  struct Tick {
    Vector3<> object_force = Vector3<>::Zero(), command = Vector3<>::Zero();
    bool touching = false, saturated = false;
  };
  Vector3<> position = Vector3<>::Zero();
  Joints<1> q = Joints<1>(0.0), qd = Joints<1>(0.0);
  Tick tick;

  [[nodiscard]] const Tick& last() const { return tick; }
  [[nodiscard]] const Vector3<>& tip() const { return position; }
  [[nodiscard]] const Joints<1>& angles() const { return q; }
  [[nodiscard]] const Joints<1>& speeds() const { return qd; }
  [[nodiscard]] static palpate::mechanism::JacobianSize<double> jacobian_size() { return {1.0, 1.0}; }
  [[nodiscard]] static palpate::math::TipJacobian<1> jacobian() { return {1.0, 0.0, 0.0}; }
};

using Monitor = palpate::servo::detail::StabilityMonitor<Slider, double>;

// Law: oscillations, contacts and fractions of a run are those of its signals in the windows that outcome_width describes.
TEST(StabilityMonitor, MeasuresItsWindows) {
  const palpate::actuation::TickSchedule<double> clock(1e-3, 0.0, 0);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (const int from : {0, 30}) {
    const int ticks = from + 100, fifth = 20;
    Monitor monitor(ticks, from);
    Given given;
    monitor.set_lane(0, given.q, given.position, given.position);
    Vector3<> last = given.position, before = last;
    double early = 0.0, prior = 0.0, late = 0.0, touched = 0.0, late_touched = 0.0, contacts = 0.0;
    bool was = false;
    for (int k = 0; k <= ticks; ++k) {
      for (double& x : given.position) x = uniform(random) * (1.0 + 0.05 * k);
      given.q[0] = given.position[0];
      given.tick.touching = uniform(random) > 0.0;
      monitor.observe(k, given, given, clock);
      const double size = (given.position - 2.0 * last + before).norm();
      before = last;
      last = given.position;
      if (k > from + fifth && k <= from + 2 * fifth) early = std::max(early, size);
      if (k > ticks - 2 * fifth && k <= ticks - fifth) prior = std::max(prior, size);
      touched += given.tick.touching ? 1.0 : 0.0;
      if (k > ticks - fifth) {
        late = std::max(late, size);
        late_touched += given.tick.touching ? 1.0 : 0.0;
        contacts += given.tick.touching && !was ? 1.0 : 0.0;
      }
      was = given.tick.touching;
    }
    std::array<double, palpate::servo::outcome_width<1>> row{};
    monitor.write(0, -1.0, row.data());
    const std::array<double, 3> oscillations{early, prior, late};
    for (std::size_t i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(row[1 + i], oscillations[i]) << from;
    EXPECT_DOUBLE_EQ(row[10], touched / (ticks + 1.0));
    EXPECT_DOUBLE_EQ(row[12], late_touched / fifth);
    EXPECT_EQ(row[14], contacts);
    monitor.write(0, 60.0, row.data());  // of a loop that diverges at tick 60, its ticks count
    EXPECT_DOUBLE_EQ(row[10], touched / 60.0);
    monitor.write(0, 0.0, row.data());
    EXPECT_TRUE(std::isfinite(row[10]));
  }
}

// Law: a tip of constant velocity does not oscillate, however late the ticks are.
TEST(StabilityMonitor, ConstantVelocityIsNoOscillationAtLateTicks) {
  palpate::actuation::TickSchedule<double> clock(1e-3, 0.8e-3, 3);
  Monitor monitor(100, 0);
  Given given;
  monitor.set_lane(0, given.q, given.position, given.position);
  for (int k = 0; k <= 100; ++k, clock.tick()) {
    given.position = (k * 1e-3 + clock.lateness()) * Vector3<>(1.0, -2.0, 0.5);
    monitor.observe(k, given, given, clock);
  }
  std::array<double, palpate::servo::outcome_width<1>> row{};
  monitor.write(0, -1.0, row.data());
  for (std::size_t i = 1; i < 4; ++i) EXPECT_LT(row[i], 1e-14) << i;
}

}  // namespace
