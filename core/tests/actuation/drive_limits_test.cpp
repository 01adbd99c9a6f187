#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <palpate/actuation/delay.hpp>
#include <palpate/actuation/drive_limits.hpp>
#include <palpate/actuation/encoder.hpp>

namespace {

using palpate::actuation::Delay;
using palpate::actuation::Drive;
using palpate::actuation::DriveLimits;
using palpate::actuation::Encoder;
using palpate::math::Joints;
using palpate::math::Vector3;

TEST(Encoder, ReadsWholeCounts) {
  Encoder<1> e;
  e.step[0] = 0.25;
  EXPECT_EQ(e.read(Joints<1>(0.37))[0], 0.25);
  EXPECT_EQ(e.read(Joints<1>(0.38))[0], 0.5);
  EXPECT_EQ(e.read(Joints<1>(-0.38))[0], -0.5);
  e.step[0] = 0.0;
  EXPECT_EQ(e.read(Joints<1>(0.38))[0], 0.38);
}

TEST(Drive, PeakKeepsTheDirection) {
  DriveLimits<3> limits;
  limits.peak_force = 8.5;
  Drive<3> drive(limits, 1e-3);
  EXPECT_EQ(drive.limit_force({3.0, 4.0, 0.0}), Vector3<>(3.0, 4.0, 0.0));
  const Vector3<> f = drive.limit_force({30.0, 40.0, 0.0});
  EXPECT_NEAR(f.norm(), 8.5, 1e-14);
  EXPECT_NEAR(f[0] / f[1], 0.75, 1e-14);
}

// Law: a drive gives its peak force for a short time and its continuous force indefinitely.
TEST(Drive, HeatBringsThePeakDownToTheContinuousForce) {
  DriveLimits<3> limits;
  limits.peak_force = 8.5;
  limits.continuous_force = 1.4;
  limits.thermal_time = 10.0;
  Drive<3> drive(limits, 1e-3);
  EXPECT_NEAR(drive.limit_force({8.5, 0.0, 0.0}).norm(), 8.5, 1e-12);
  double force = 0.0;
  double largest_step = 0.0;
  for (int k = 0; k < 100000; ++k) {
    const double next = drive.limit_force({8.5, 0.0, 0.0}).norm();
    if (k > 0) largest_step = std::max(largest_step, std::abs(next - force));
    force = next;
  }
  EXPECT_NEAR(force, 1.4, 0.01 * 1.4 + 1e-3);
  EXPECT_LT(largest_step, 0.3);  // no step that an operator perceives
  for (int k = 0; k < 100000; ++k) drive.limit_force({0.0, 0.0, 0.0});
  EXPECT_NEAR(drive.limit_force({8.5, 0.0, 0.0}).norm(), 8.5, 1e-3);  // cold again
}

TEST(Drive, TorquesStayWithinTheMotorsAndKeepTheirDirection) {
  DriveLimits<3> limits;
  limits.peak_torque = Joints<3>(0.1, 0.2, 0.3);
  const Drive<3> drive(limits, 1e-3);
  EXPECT_DOUBLE_EQ(drive.torque_scale(Joints<3>(1.0, -1.0, 0.2)), 0.1);
  EXPECT_DOUBLE_EQ(drive.torque_scale(Joints<3>(0.1, -0.2, 0.3)), 1.0);
}

TEST(Delay, GivesBackWhatWentInPeriodsAgo) {
  for (const int periods : {0, 1, 3, 17}) {
    Delay<double> delay(periods, -1.0);
    for (int k = 0; k < 200; ++k) EXPECT_EQ(delay.pass(k), k < periods ? -1.0 : k - periods);
  }
}

// Law: under a constant command the temperature rises exponentially to (applied / continuous)^2; the limit is the peak up to 0.9 of the
// admissible temperature and falls linearly to the continuous force at 1. A reset drive is cold.
TEST(Drive, TheTemperatureAndTheLimitFollowTheirLaw) {
  DriveLimits<1> limits;
  limits.peak_force = 4.0;
  limits.continuous_force = 2.0;
  limits.thermal_time = 0.5;
  const double period = 1e-3;
  Drive<1> drive(limits, period);
  for (const int round : {1, 2}) {
    EXPECT_EQ(drive.temperature(), 0.0) << round;
    double temperature = 0.0;
    int fading = 0;
    for (int k = 0; k < 2000; ++k) {
      const double share = std::clamp((1.0 - temperature) / 0.1, 0.0, 1.0), expected = 2.0 + 2.0 * share;
      ASSERT_NEAR(drive.force_limit(), expected, 1e-12) << k;
      ASSERT_NEAR(drive.limit_force({0.0, 100.0, 0.0})[1], expected, 1e-12) << k;
      temperature += (1.0 - std::exp(-period / 0.5)) * (expected * expected / 4.0 - temperature);
      ASSERT_NEAR(drive.temperature(), temperature, 1e-12) << k;
      if (expected == 4.0) {
        ASSERT_NEAR(temperature, 4.0 * (1.0 - std::exp(-period * (k + 1) / 0.5)), 1e-12);
      }
      fading += share < 1.0 ? 1 : 0;
    }
    EXPECT_GT(fading, 1000);
    drive.reset();
  }
}

TEST(Drive, OneLimitedJointLimitsAllTorques) {
  for (int joint = 0; joint < 3; ++joint) {
    DriveLimits<3> limits;
    limits.peak_torque[joint] = 0.1;
    const Drive<3> drive(limits, 1e-3);
    EXPECT_TRUE(drive.limits());
    EXPECT_NEAR(drive.torque_scale(Joints<3>(0.4, -0.4, 0.4)), 0.25, 1e-15);
    EXPECT_EQ(drive.torque_scale(Joints<3>(0.1, -0.1, 0.1)), 1.0);
  }
  EXPECT_FALSE(Drive<3>(DriveLimits<3>{}, 1e-3).limits());
}

}  // namespace
