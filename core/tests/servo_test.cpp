#include <gtest/gtest.h>

#include "states.hpp"
#include "touch_shapes.hpp"

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::TipKinematics;
using palpate::object::SpringWall;
using palpate::servo::Servo;
using palpate::servo::ServoSetup;

const Joints<3> pose(0.0, 2.2305, 3.2776);

// Law: torque and tip force do the same work: tau = J^T (F_ref - F_object).
TEST(Servo, TurnsTipForceIntoTorqueByTheTransposedJacobian) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.anchor.kind = SpringWall::Kind::point;
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
  TipKinematics<Premium> exact(arm);
  TipKinematics<Premium> tangent(arm, pose, hold);
  const auto error = [&](double size) {
    const Joints<3> q = pose + size * Joints<3>(1.0, -0.5, 0.7);
    exact.update(q);
    tangent.update(q);
    return std::pair{(exact.tip() - tangent.tip()).norm(), (exact.torque(hold) - tangent.torque(hold)).norm()};
  };
  EXPECT_LT(error(0.0).first, 1e-16);
  EXPECT_NEAR(error(1e-2).first / error(1e-3).first, 100.0, 3.0);
  EXPECT_NEAR(error(1e-2).second / error(1e-3).second, 100.0, 3.0);
}

// Law: a wall never pulls, whatever its damper says on the way out.
TEST(Servo, AWallNeverPulls) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.anchor.kind = SpringWall::Kind::half_space;
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

// Law: on the flat top of a box a frictionless mesh answers as a wall of the same stiffness does, and never pulls; the object's
// force is that of the tip on it, opposite to the proxy's.
TEST(Servo, AFlatMeshIsAWall) {
  palpate::mesh::Surface surface;
  surface.stiffness = {700.0};
  surface.tangential = 0.0;
  shapes::Shape box = shapes::box(Vector3<>(0.1, 0.1, 0.1), 4);
  for (Vector3<>& v : box.vertices) v += arm.forward(pose) - Vector3<>(0.0, 0.0, 0.1);
  const shapes::World world(box, surface);
  ServoSetup<Premium> wall{.mechanism = arm};
  wall.anchor.kind = SpringWall::Kind::half_space;
  wall.anchor.point = arm.forward(pose);
  wall.stiffness.setConstant(700.0);
  wall.start = pose;
  ServoSetup<Premium> mesh = wall;
  mesh.touched = {&world.mesh, &world.tree, &world.field, 0.0};
  Servo<Premium> on_wall(wall), on_mesh(mesh);
  EXPECT_EQ(on_wall.contact(), nullptr);
  ASSERT_NE(on_mesh.contact(), nullptr);
  int pressed = 0;
  for (int k = 0; k < 400; ++k) {
    const Joints<3> q = pose + 0.05 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
    const auto& a = on_wall.tick(q, Vector3<>(0.0, 0.0, -1.0));
    const auto& b = on_mesh.tick(q, Vector3<>(0.0, 0.0, -1.0));
    EXPECT_EQ(a.touching, b.touching);
    EXPECT_LT((a.object_force - b.object_force).norm(), 1e-9);
    EXPECT_LT((a.torque - b.torque).norm(), 1e-9);
    EXPECT_EQ(b.object_force, Vector3<>(-on_mesh.contact()->force));
    EXPECT_LE(b.object_force.z(), 0.0);
    pressed += b.touching ? 1 : 0;
  }
  EXPECT_GT(pressed, 100);
  EXPECT_LT(pressed, 300);
}

}  // namespace
