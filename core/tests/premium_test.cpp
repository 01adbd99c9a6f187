#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>

#include "states.hpp"

namespace {

using palpate::math::Dual;
using palpate::math::Joints;
using palpate::mechanism::Premium;
using palpate::mechanism::PremiumInverse;

template <class Scalar = Dual<3>>
Joints<3, Scalar> variables(const Joints<3>& q) {
  Joints<3, Scalar> v;
  for (int i = 0; i < 3; ++i) v[i] = Scalar::variable(q[i], i);
  return v;
}

// Law: the Jacobian is the derivative of the tip's position.
TEST(Premium, JacobianIsTheDerivativeOfForward) {
  States states;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = states.draw(4.0);
    const auto p = arm.forward(variables(q));
    const auto j = arm.jacobian(q);
    for (int row = 0; row < 3; ++row) EXPECT_LT((p[row].gradient.transpose() - j.row(row)).norm(), 1e-15);
  }
}

// Law: torque and tip force do the same work, tau . qd = f . (J qd), so tau = J^T f.
TEST(Premium, TorqueOfATipForceIsTheTransposedJacobian) {
  States states;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = states.draw(4.0);
    const palpate::math::Vector3<> f = states.draw(10.0);
    EXPECT_LT((arm.apply_jacobian_transpose(arm.kinematics(q), f) - arm.jacobian(q).transpose() * f).norm(), 1e-14);
  }
}

// Law: the tip's velocity is J qd.
TEST(Premium, VelocityIsTheJacobianTimesTheSpeeds) {
  States states;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = states.draw(4.0);
    const Joints<3> qd = states.draw(10.0);
    EXPECT_LT((arm.velocity(arm.kinematics(q), qd) - arm.jacobian(q) * qd).norm(), 1e-14);
  }
}

// Law: a point mass at the tip adds m J^T J to the inertia and m J^T dJ/dt qd to the torques needed, but no weight.
TEST(Premium, AMassAtTheTipMovesWithIt) {
  States states;
  const double mass = 0.15;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = states.draw(4.0);
    const Joints<3> qd = states.draw(10.0);
    const Joints<3> torque = states.draw(0.3);
    const auto j = arm.jacobian(q);
    const auto moving = arm.jacobian(variables(q));
    palpate::math::Vector3<> turning = palpate::math::Vector3<>::Zero();
    for (int row = 0; row < 3; ++row) {
      for (int i = 0; i < 3; ++i) turning[row] += moving(row, i).gradient.dot(qd) * qd[i];
    }
    const Eigen::Matrix3d inertia = arm.mass_matrix(q) + mass * j.transpose() * j;
    const Joints<3> needed = arm.coriolis(q, qd) * qd + arm.gravity(q) + mass * j.transpose() * turning;
    const auto there = arm.dynamics(arm.kinematics(q), arm.inertia_parameters(mass));
    const Joints<3> found = there.inverse() * there.generalized_force(torque, qd);
    EXPECT_LT((inertia * found + needed - torque).norm(), 1e-12 * (1.0 + needed.norm()));
    EXPECT_LT((there.inertia_torque(found) - inertia * found).norm(), 1e-12 * (1.0 + needed.norm()));
  }
}

// A stuck joint has no acceleration; the others move as if it were fixed (its row and column of M are removed).
TEST(Premium, StuckJointsHaveNoAcceleration) {
  States states;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = states.draw(4.0);
    const Joints<3> force = states.draw(0.3);
    for (int which = 0; which < 8; ++which) {
      const std::array<bool, 3> stuck = {(which & 1) != 0, (which & 2) != 0, (which & 4) != 0};
      Eigen::Matrix3d m = arm.mass_matrix(q);
      Joints<3> f = force;
      for (int i = 0; i < 3; ++i) {
        if (!stuck[static_cast<std::size_t>(i)]) continue;
        m.row(i).setZero();
        m.col(i).setZero();
        m(i, i) = 1.0;
        f[i] = 0.0;
      }
      const Joints<3> wanted = m.ldlt().solve(f);
      EXPECT_LT((arm.dynamics(arm.kinematics(q)).inverse(stuck) * force - wanted).norm(), 1e-10 * (1.0 + wanted.norm())) << which;
    }
  }
}

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

// Law: gravity is the derivative of the potential energy.
TEST(Premium, GravityIsTheDerivativeOfThePotential) {
  States states;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = states.draw(4.0);
    EXPECT_LT((arm.potential(variables(q)).gradient - arm.gravity(q)).norm(), 1e-16);
  }
}

// Law: dM/dt - 2C is skew-symmetric, so the Coriolis terms do no work.
TEST(Premium, MassRateLessTwiceCoriolisIsSkew) {
  States states;
  for (int n = 0; n < 1000; ++n) {
    const Joints<3> q = states.draw(4.0);
    const Joints<3> qd = states.draw(10.0);
    const auto m = arm.mass_matrix(variables(q));
    Eigen::Matrix3d rate;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) rate(i, k) = m(i, k).gradient.dot(qd);
    const Eigen::Matrix3d skew = rate - 2.0 * arm.coriolis(q, qd);
    EXPECT_LT((skew + skew.transpose()).cwiseAbs().maxCoeff(), 1e-12 * rate.cwiseAbs().maxCoeff() + 1e-18);
  }
}

// Law: M qdd + C qd + N = tau; the closed-form acceleration solves it.
TEST(Premium, AccelerationSolvesTheEquationOfMotion) {
  States states;
  for (int n = 0; n < 1000; ++n) {
    const Joints<3> q = states.draw(4.0);
    const Joints<3> qd = states.draw(10.0);
    const Joints<3> tau = states.draw(1.0);
    const Joints<3> qdd = arm.acceleration(q, qd, tau);
    const Joints<3> left = arm.mass_matrix(q) * qdd + arm.coriolis(q, qd) * qd + arm.gravity(q);
    EXPECT_LT((left - tau).norm(), 1e-12 * (1.0 + tau.norm() + (arm.coriolis(q, qd) * qd).norm()));
  }
}

// Law: inverse undoes forward, on each of the four branches.
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
