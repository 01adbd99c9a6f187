#include <gtest/gtest.h>

#include "states.hpp"

namespace {

using palpate::Anchor;
using palpate::Joints;
using palpate::Kinematics;
using palpate::Premium;
using palpate::Servo;
using palpate::ServoSetup;
using palpate::Vector3;

const Premium arm(palpate::phantom_premium_1_5a());
const Joints<3> pose(0.0, 2.2305, 3.2776);

// Law: torque and tip force do the same work: tau = J^T (F_ref - F_object).
TEST(Servo, TurnsTipForceIntoTorqueByTheTransposedJacobian) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.anchor.kind = Anchor::Kind::point;
  setup.anchor.point = arm.forward(pose);
  setup.stiffness.setConstant(500.0);
  setup.start = pose;
  Servo<Premium> servo(setup);
  const Joints<3> q = pose + Joints<3>(0.01, -0.02, 0.03);
  const Vector3<> reference(1.0, -2.0, 0.5);
  const auto& tick = servo.tick(q, reference);
  const Vector3<> force = 500.0 * (arm.forward(q) - setup.anchor.point);
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
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.anchor.kind = Anchor::Kind::half_space;
  setup.anchor.point = arm.forward(pose);
  setup.anchor.normal = Vector3<>::UnitZ();
  setup.stiffness.setConstant(100.0);
  setup.damping.setConstant(50.0);
  setup.start = pose;
  Servo<Premium> servo(setup);
  for (int k = 0; k < 400; ++k) {
    const Joints<3> q = pose + Joints<3>(0.0, 0.05 * std::sin(0.1 * k), 0.05 * std::cos(0.07 * k));
    const auto& tick = servo.tick(q, Vector3<>::Zero());
    EXPECT_LE(setup.anchor.normal.dot(tick.object_force), 0.0);
    EXPECT_TRUE(tick.touching || tick.object_force.isZero(0.0));
  }
}

// Law: what the motors cannot give is told to the controller: the command, the torque and J^T agree.
TEST(Servo, MotorLimitsScaleTheCommandAndTheTorqueAlike) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  setup.hold = Vector3<>(0.0, 0.1, 0.0);
  setup.limits.peak_torque = Joints<3>(0.05, 0.05, 0.05);
  Servo<Premium> servo(setup);
  const auto& tick = servo.tick(pose, Vector3<>(3.0, -2.0, 1.0));
  EXPECT_TRUE(tick.saturated);
  EXPECT_NEAR(tick.torque.cwiseAbs().maxCoeff(), 0.05, 1e-15);
  EXPECT_LT((tick.torque - arm.jacobian(pose).transpose() * (tick.command + setup.hold)).norm(), 1e-15);
}

// Law: a torque leaves the servo `delay` periods after it was computed; before that the device is held at rest.
TEST(Servo, DelayHoldsTheTorqueBack) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  setup.delay = 2;
  setup.hold = Vector3<>(0.0, 0.1, 0.0);
  Servo<Premium> servo(setup);
  const Joints<3> rest = arm.jacobian(pose).transpose() * setup.hold;
  const Vector3<> push(1.0, 0.0, 0.0);
  EXPECT_LT((servo.tick(pose, push).torque - rest).norm(), 1e-15);
  EXPECT_LT((servo.tick(pose, push).torque - rest).norm(), 1e-15);
  EXPECT_LT((servo.tick(pose, push).torque - rest - arm.jacobian(pose).transpose() * push).norm(), 1e-15);
}

}  // namespace
