// Which samples a servo accepts, and which share of the torque remains.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <palpate/servo/fault_guard.hpp>

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using Guard = palpate::servo::FaultGuard<1>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
const Vector3<> still = Vector3<>::Zero();

// Law: a joint may move by the largest speed times the time since the last valid sample; a repeated sample counts as one period.
TEST(FaultGuard, AJointMovesNoFasterThanTheLargestSpeed) {
  Guard guard({.speed = 2.0, .fade = 10e-3}, 1e-3);
  const auto accept = [&guard](double angle, double elapsed) { return guard.accept(Joints<1>(angle), still, elapsed); };
  EXPECT_TRUE(accept(5.0, 1e-3));  // the first sample is anywhere
  EXPECT_TRUE(accept(5.0099, 5e-3));
  EXPECT_EQ(guard.elapsed(), 5e-3);
  EXPECT_FALSE(accept(5.0150, 2e-3));
  EXPECT_TRUE(accept(5.0150, 1e-3));  // 5.1 mrad in 3 ms
  EXPECT_EQ(guard.elapsed(), 3e-3);
  EXPECT_TRUE(accept(5.0169, 0.0));
  EXPECT_FALSE(accept(5.0190, nan));
  EXPECT_TRUE(accept(5.0190, 1e-3));
  guard.reset();
  EXPECT_TRUE(accept(-7.0, 1e-3));
}

TEST(FaultGuard, ValuesThatAreNotFiniteOrTooLargeAreRefused) {
  for (const double bad : {nan, std::numeric_limits<double>::infinity(), 1.1e6, -1.1e6}) {
    Guard guard;
    EXPECT_FALSE(guard.accept(Joints<1>(bad), still, 1e-3)) << bad;
    for (int axis = 0; axis < 3; ++axis) {
      Vector3<> reference = still;
      reference[axis] = bad;
      EXPECT_FALSE(guard.accept(Joints<1>(0.0), reference, 1e-3)) << bad;
    }
    EXPECT_TRUE(guard.accept(Joints<1>(1e6), Vector3<>(-1e6, 0.0, 1e6), 1e-3));
    EXPECT_FALSE(Guard::usable({0.0, 1e6 * bad, 0.0}));
  }
  EXPECT_TRUE(Guard::usable({1e12, 0.0, -1e12}));
}

// Law: the share falls to zero within the fade time and rises to one within eight samples, by no more than that.
TEST(FaultGuard, TheShareFallsWithinTheFadeTimeAndRisesWithinEightSamples) {
  Guard guard({.speed = 1.0, .fade = 20e-3}, 1e-3);
  for (int k = 1; k <= 25; ++k) EXPECT_NEAR(guard.fall(), std::max(0.0, 1.0 - k / 20.0), 1e-12);
  EXPECT_EQ(guard.faults(), 25);
  for (int k = 1; k <= 10; ++k) {
    EXPECT_FALSE(k == 8 && guard.full());
    EXPECT_NEAR(guard.rise(), std::min(1.0, k / 8.0), 1e-12);
  }
  EXPECT_TRUE(guard.full());
  EXPECT_EQ(Guard({.speed = 1.0, .fade = 0.0}, 1e-3).fall(), 0.0);
}

}  // namespace
