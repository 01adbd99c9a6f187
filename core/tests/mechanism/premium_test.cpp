#include <gtest/gtest.h>

#include "support/states.hpp"

namespace {

using palpate::math::Joints;
using palpate::mechanism::Premium;
using palpate::mechanism::PremiumInverse;

// Advancing a cache by a small or a large displacement gives the cache at the sum.
TEST(Premium, AdvancedCacheEqualsTheCacheAtTheSum) {
  States states;
  for (const double size : {1e-9, 1e-3, palpate::math::max_small_rotation, 1.0}) {
    for (int n = 0; n < 200; ++n) {
      const Joints<3> q = states.draw(4.0);
      const Joints<3> dq = states.draw(size);
      const auto there = arm.advance(arm.kinematics(q), dq);
      const auto exact = arm.kinematics(Joints<3>(q + dq));
      EXPECT_LT((arm.forward(there) - arm.forward(exact)).norm(), 3e-16);
      if (!Premium::is_small(dq)) continue;
      EXPECT_EQ(arm.forward(arm.advance_small(arm.kinematics(q), dq)), arm.forward(there));
    }
  }
}

TEST(Premium, VelocityProductIsTheDerivativeOfTheVelocityAtConstantSpeeds) {
  const Joints<3> q(0.4, 2.0, 3.1), qd(1.5, -2.0, 3.0);
  const double h = 1e-6;
  const palpate::math::Vector3<> slope =
      (arm.velocity(arm.kinematics(Joints<3>(q + h * qd)), qd) - arm.velocity(arm.kinematics(Joints<3>(q - h * qd)), qd)) / (2 * h);
  EXPECT_LT((arm.velocity_product(arm.kinematics(q), qd) - slope).norm(), 1e-8);
}

// The size of the Jacobian without forming it is that of the Jacobian.
TEST(Premium, JacobianSizeIsThatOfTheJacobian) {
  States states;
  for (int n = 0; n < 200; ++n) {
    const auto at = arm.kinematics(states.draw(4.0));
    const auto fast = arm.jacobian_size(at);
    const auto exact = palpate::mechanism::jacobian_size<3>(arm.jacobian(at));
    EXPECT_NEAR(fast.volume, exact.volume, 1e-15 * exact.norm * exact.norm * exact.norm);
    EXPECT_NEAR(fast.norm, exact.norm, 1e-15 * exact.norm);
  }
}

// The inverse undoes forward on each of the four branches.
TEST(Premium, InverseFindsEveryBranch) {
  States states;
  int tried = 0;
  for (int n = 0; n < 300; ++n) {
    const palpate::math::Vector3<> p = arm.forward(states.draw(3.0));
    for (const bool behind : {false, true}) {
      for (const bool elbow_down : {false, true}) {
        const auto pose = arm.inverse(p, behind, elbow_down);
        ASSERT_EQ(pose.reach, PremiumInverse::Reach::reachable);
        EXPECT_LT((arm.forward(pose.q) - p).norm(), 1e-12);
        ++tried;
      }
    }
  }
  EXPECT_EQ(tried, 1200);
}

TEST(Premium, InverseSaysWhyAPointIsOutOfReach) {
  EXPECT_EQ(arm.inverse({1.0, 0.0, 0.0}).reach, PremiumInverse::Reach::too_far);
  EXPECT_EQ(arm.inverse({0.0, 0.17, -0.2}).reach, PremiumInverse::Reach::too_close);
  EXPECT_EQ(arm.inverse({0.0, 0.37, -0.215}).reach, PremiumInverse::Reach::on_yaw_axis);
  EXPECT_EQ(arm.inverse({std::nan(""), 0.0, 0.0}).reach, PremiumInverse::Reach::not_finite);
}

// Golden values computed by hand from the published parameters.
TEST(Premium, MassAndGravityAtTheZeroPose) {
  const Eigen::Matrix3d m = arm.mass_matrix(Joints<3>(Joints<3>::Zero()));
  EXPECT_NEAR(m(0, 0), 35.73e-4, 5e-7);
  EXPECT_NEAR(m(1, 1), 24.26e-4, 5e-7);
  EXPECT_NEAR(m(2, 2), 9.32e-4, 5e-7);
  EXPECT_NEAR(arm.gravity(Joints<3>(Joints<3>::Zero()))[1], -0.0163, 5e-5);
}

}  // namespace
