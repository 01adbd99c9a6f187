#include <gtest/gtest.h>

#include "states.hpp"

namespace {

using palpate::Anchor;
using palpate::Drive;
using palpate::Encoder;
using palpate::Joints;
using palpate::Kinematics;
using palpate::Premium;
using palpate::Servo;
using palpate::StateSpace;
using palpate::Vector3;
using palpate::VirtualCoupling;

const Premium arm(palpate::phantom_premium_1_5a());
const Joints<3> pose(0.0, 2.2305, 3.2776);

// Law: torque and tip force do the same work: tau = J^T (F_ref - F_object).
TEST(Servo, TurnsTipForceIntoTorqueByTheTransposedJacobian) {
  Anchor spring;
  spring.kind = Anchor::Kind::point;
  spring.point = arm.forward(pose);
  Servo<Premium> servo(Kinematics<Premium>(arm), Encoder<3>{}, spring,
                       VirtualCoupling(Vector3<>::Constant(500.0), Vector3<>::Zero(), VirtualCoupling::Difference::backward, 1e-3), StateSpace::negative_feedback(),
                       Drive<3>{}, Vector3<>::Zero(), 0, pose);
  const Joints<3> q = pose + Joints<3>(0.01, -0.02, 0.03);
  const Vector3<> reference(1.0, -2.0, 0.5);
  const auto& tick = servo.tick(q, reference);
  const Vector3<> force = 500.0 * (arm.forward(q) - spring.point);
  EXPECT_LT((tick.object_force - force).norm(), 1e-12);
  EXPECT_LT((tick.torque - arm.jacobian(q).transpose() * (reference - force)).norm(), 1e-13);
  EXPECT_TRUE(tick.touching);
  EXPECT_FALSE(tick.saturated);
}

// Law: frozen kinematics are the tangent of the exact ones: the difference is of second order.
TEST(Servo, FrozenKinematicsAreTheTangent) {
  const Vector3<> hold(0.1, 0.3, -0.2);
  Kinematics<Premium> exact(arm);
  Kinematics<Premium> tangent(arm, pose, hold);
  const auto error = [&](double size) {
    const Joints<3> q = pose + size * Joints<3>(1.0, -0.5, 0.7);
    exact.look(q);
    tangent.look(q);
    return std::pair{(exact.tip() - tangent.tip()).norm(),
                     (exact.torque(Vector3<>::Zero(), hold) - tangent.torque(Vector3<>::Zero(), hold)).norm()};
  };
  EXPECT_LT(error(0.0).first, 1e-16);
  EXPECT_NEAR(error(1e-2).first / error(1e-3).first, 100.0, 3.0);
  EXPECT_NEAR(error(1e-2).second / error(1e-3).second, 100.0, 3.0);
}

// Law: a wall never pulls, whatever its damper says on the way out.
TEST(Servo, AWallNeverPulls) {
  Anchor wall;
  wall.kind = Anchor::Kind::half_space;
  wall.point = arm.forward(pose);
  wall.normal = Vector3<>::UnitZ();
  Servo<Premium> servo(Kinematics<Premium>(arm), Encoder<3>{}, wall,
                       VirtualCoupling(Vector3<>::Constant(100.0), Vector3<>::Constant(50.0), VirtualCoupling::Difference::backward, 1e-3),
                       StateSpace::negative_feedback(), Drive<3>{}, Vector3<>::Zero(), 0, pose);
  for (int k = 0; k < 400; ++k) {
    const Joints<3> q = pose + Joints<3>(0.0, 0.05 * std::sin(0.1 * k), 0.05 * std::cos(0.07 * k));
    const auto& tick = servo.tick(q, Vector3<>::Zero());
    EXPECT_LE(wall.normal.dot(tick.object_force), 0.0);
    EXPECT_TRUE(tick.touching || tick.object_force.isZero(0.0));
  }
}

}  // namespace
