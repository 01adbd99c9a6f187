#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <palpate/control/any_controller.hpp>
#include <palpate/object/any_object.hpp>
#include <palpate/object/mesh_object.hpp>
#include <palpate/object/moving_frame.hpp>
#include <palpate/object/scene.hpp>
#include <vector>

#include "support/mesh_shapes.hpp"
#include "support/states.hpp"

namespace {

using palpate::control::AnyController;
using palpate::control::TickInput;
using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::TipKinematics;
using palpate::object::AnyObject;
using palpate::object::ContactResult;
using palpate::object::MeshModel;
using palpate::object::MeshObject;
using palpate::object::MovingFrame;
using palpate::object::Pose;
using palpate::object::Scene;
using palpate::object::SpringWall;
using palpate::object::TipState;
using palpate::servo::Servo;
using palpate::servo::ServoSetup;

const Joints<3> pose(0.0, 2.2305, 3.2776);

// Law: torque and tip force do the same work: tau = J^T (F_ref - F_object).
TEST(Servo, TurnsTipForceIntoTorqueByTheTransposedJacobian) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  const Vector3<> point = arm.forward(pose);
  Servo<Premium, SpringWall> servo(setup,
                                   SpringWall({.kind = SpringWall::Kind::point, .point = point, .stiffness = Vector3<>::Constant(500.0)}));
  const Joints<3> q = pose + Joints<3>(0.01, -0.02, 0.03);
  const Vector3<> reference(1.0, -2.0, 0.5);
  const auto& tick = servo.tick(q, reference);
  const Vector3<> force = 500.0 * (arm.forward(q) - point);
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

// Law: a wall never pulls, even if its damping force would on the way out.
TEST(Servo, AWallNeverPulls) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  Servo<Premium, SpringWall> servo(setup, SpringWall({.kind = SpringWall::Kind::half_space,
                                                      .point = arm.forward(pose),
                                                      .stiffness = Vector3<>::Constant(100.0),
                                                      .damping = Vector3<>::Constant(50.0)}));
  for (int k = 0; k < 400; ++k) {
    const Joints<3> q = pose + Joints<3>(0.0, 0.05 * std::sin(0.1 * k), 0.05 * std::cos(0.07 * k));
    const auto& tick = servo.tick(q, Vector3<>::Zero());
    EXPECT_LE(tick.object_force.z(), 0.0);
    EXPECT_TRUE(tick.touching || tick.object_force.isZero(0.0));
  }
}

// Law: the controller receives the limited force, and it agrees with the torque through J^T.
TEST(Servo, MotorLimitsScaleTheCommandAndTheTorqueAlike) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  setup.gravity_compensation = Vector3<>(0.0, 0.1, 0.0);
  setup.limits.peak_torque = Joints<3>(0.05, 0.05, 0.05);
  const SpringWall wall({.kind = SpringWall::Kind::half_space,
                         .point = arm.forward(pose) + Vector3<>(0.0, 0.0, 5e-3),
                         .normal = Vector3<>(0.0, 0.0, 1.0),
                         .stiffness = Vector3<>::Constant(1000.0)});
  Servo<Premium, SpringWall> servo(setup, wall);
  const auto& tick = servo.tick(pose, Vector3<>::Zero());
  EXPECT_TRUE(tick.saturated);
  EXPECT_NEAR(tick.torque.cwiseAbs().maxCoeff(), 0.05, 1e-15);
  EXPECT_LT((tick.torque - arm.jacobian(pose).transpose() * (tick.command + setup.gravity_compensation)).norm(), 1e-15);
}

// Law: the operator exerts the reference force, so the limits of the motors do not apply to it.
TEST(Servo, MotorLimitsLeaveTheOperatorsShareAlone) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  setup.limits.peak_torque = Joints<3>(0.05, 0.05, 0.05);
  Servo<Premium, SpringWall> servo(setup);
  const Vector3<> reference(3.0, -2.0, 1.0);
  const auto& tick = servo.tick(pose, reference);
  EXPECT_FALSE(tick.saturated);
  EXPECT_LT((tick.command - reference).norm(), 1e-15);
}

// Law: a torque leaves the servo `delay` periods after it was computed; before that the device is held at rest.
TEST(Servo, DelayHoldsTheTorqueBack) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  setup.delay = 2;
  setup.gravity_compensation = Vector3<>(0.0, 0.1, 0.0);
  Servo<Premium, SpringWall> servo(setup);
  const Joints<3> rest = arm.jacobian(pose).transpose() * setup.gravity_compensation;
  const Vector3<> push(1.0, 0.0, 0.0);
  EXPECT_LT((servo.tick(pose, push).torque - rest).norm(), 1e-15);
  EXPECT_LT((servo.tick(pose, push).torque - rest).norm(), 1e-15);
  EXPECT_LT((servo.tick(pose, push).torque - rest - arm.jacobian(pose).transpose() * push).norm(), 1e-15);
}

// Law: on the flat top of a box, a frictionless mesh equals a wall of the same stiffness and never pulls; the object's
// force is that of the tip on it, opposite to the proxy's.
TEST(Servo, AFlatMeshIsAWall) {
  palpate::mesh::Surface surface;
  surface.stiffness = {700.0};
  surface.tangential = 0.0;
  shapes::Shape box = shapes::box(Vector3<>(0.1, 0.1, 0.1), 4);
  for (Vector3<>& v : box.vertices) v += arm.forward(pose) - Vector3<>(0.0, 0.0, 0.1);
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  Servo<Premium, SpringWall> on_wall(
      setup, SpringWall({.kind = SpringWall::Kind::half_space, .point = arm.forward(pose), .stiffness = Vector3<>::Constant(700.0)}));
  Servo<Premium, MeshObject> on_mesh(setup, MeshObject(MeshModel::make({box.vertices, box.triangles, false}, surface)));
  int pressed = 0;
  for (int k = 0; k < 400; ++k) {
    const Joints<3> q = pose + 0.05 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
    const auto& a = on_wall.tick(q, Vector3<>(0.0, 0.0, -1.0));
    const auto& b = on_mesh.tick(q, Vector3<>(0.0, 0.0, -1.0));
    EXPECT_EQ(a.touching, b.touching);
    EXPECT_LT((a.object_force - b.object_force).norm(), 1e-9);
    EXPECT_LT((a.torque - b.torque).norm(), 1e-9);
    EXPECT_EQ(b.object_force, Vector3<>(-on_mesh.object().proxy().contact().force));
    EXPECT_LE(b.object_force.z(), 0.0);
    pressed += b.touching ? 1 : 0;
  }
  EXPECT_GT(pressed, 100);
  EXPECT_LT(pressed, 300);
}

/// Wall with a quadratic force law: an object that the library does not know.
struct HertzWall {
  using Scalar = double;
  double stiffness = 1e6;  // N/m^2
  double height = 0.0;     // m
  ContactResult result{};

  const ContactResult& step(const TipState& tip) noexcept {
    const double depth = std::max(0.0, height - tip.position.z());
    result.touching = depth > 0.0;
    result.depth = depth;
    result.force = Vector3<>(0.0, 0.0, -stiffness * depth * depth);
    return result;
  }
};

/// Proportional-derivative position controller: a controller that the library does not know.
struct PositionControl {
  using Scalar = double;
  Vector3<> target = Vector3<>::Zero();
  double proportional = 0.0, derivative = 0.0;
  int told = 0;
  Vector3<> command(const TickInput& in) noexcept { return proportional * (target - in.tip) - derivative * in.velocity(); }
  void applied(const Vector3<>& /*force*/) noexcept { ++told; }
};

SpringWall wall_at(double z, double stiffness, double damping = 0.0) {
  return SpringWall({.kind = SpringWall::Kind::half_space,
                     .point = {0.0, 0.0, z},
                     .stiffness = Vector3<>::Constant(stiffness),
                     .damping = Vector3<>::Constant(damping)});
}

Joints<3> swing(int k) {
  return pose + 0.05 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
}

// Law: an object chosen at run time gives the same bits as the same object chosen at compile time, inline or behind a virtual call.
TEST(Servo, AnyObjectIsTheObject) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  const double z = arm.forward(pose).z();
  Servo<Premium, SpringWall> wall(setup, wall_at(z, 700.0, 2.0));
  Servo<Premium, AnyObject, AnyController> any_wall(setup, wall_at(z, 700.0, 2.0));
  Servo<Premium, HertzWall> hertz(setup, HertzWall{.height = z});
  Servo<Premium, AnyObject> any_hertz(setup, AnyObject(HertzWall{.height = z}));
  for (int k = 0; k < 300; ++k) {
    const Vector3<> reference(0.0, 0.0, -1.0);
    EXPECT_EQ(wall.tick(swing(k), reference).torque, any_wall.tick(swing(k), reference).torque);
    EXPECT_EQ(hertz.tick(swing(k), reference).torque, any_hertz.tick(swing(k), reference).torque);
  }
  EXPECT_NE(any_wall.object().get_if<SpringWall>(), nullptr);
  EXPECT_EQ(any_wall.object().get_if<HertzWall>(), nullptr);
  EXPECT_NE(any_hertz.object().get_if<HertzWall>(), nullptr);
}

// Law: a user's controller receives tip, velocity and forces of its tick, and every applied force.
TEST(Servo, RunsAUsersController) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  const PositionControl control{.target = arm.forward(pose), .proportional = 300.0, .derivative = 2.0};
  Servo<Premium, SpringWall, PositionControl> servo(setup, {}, control);
  Servo<Premium, AnyObject, AnyController> any(setup, {}, control);
  Vector3<> before = arm.forward(pose);
  for (int k = 0; k < 100; ++k) {
    const Vector3<> tip = arm.forward(swing(k));
    const auto& tick = servo.tick(swing(k), Vector3<>::Zero());
    EXPECT_LT((tick.command - (300.0 * (arm.forward(pose) - tip) - 2.0 * (tip - before) / 1e-3)).norm(), 1e-9);
    EXPECT_EQ(tick.torque, any.tick(swing(k), Vector3<>::Zero()).torque);
    before = tip;
  }
  EXPECT_EQ(servo.controller().told, 100);
}

// Law: forces of a scene's objects add; a scene of one object is that object.
TEST(Servo, ASceneAddsForces) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  const double z = arm.forward(pose).z();
  Scene two;
  two.add(wall_at(z, 300.0));
  two.add(wall_at(z, 400.0));
  Servo<Premium, Scene> scene(setup, two);
  Servo<Premium, SpringWall> sum(setup, wall_at(z, 700.0)), one(setup, wall_at(z, 300.0));
  Servo<Premium, Scene> alone(setup, Scene({AnyObject(wall_at(z, 300.0))}));
  for (int k = 0; k < 300; ++k) {
    EXPECT_LT((scene.tick(swing(k), Vector3<>::Zero()).object_force - sum.tick(swing(k), Vector3<>::Zero()).object_force).norm(), 1e-12);
    EXPECT_EQ(alone.tick(swing(k), Vector3<>::Zero()).torque, one.tick(swing(k), Vector3<>::Zero()).torque);
  }
}

// Law: an object in a rotated and shifted frame equals the rotated and shifted object; torque about the frame's origin is r x F.
TEST(Servo, AMovingFrameCarriesItsObject) {
  const Pose frame{{0.01, -0.02, 0.03}, Eigen::AngleAxisd(0.7, Vector3<>(1.0, 2.0, 0.5).normalized()).toRotationMatrix()};
  MovingFrame<SpringWall> moved(wall_at(0.0, 500.0, 1.0));
  SpringWall still({.kind = SpringWall::Kind::half_space,
                    .point = frame.origin,
                    .normal = frame.rotation * Vector3<>::UnitZ(),
                    .stiffness = Vector3<>::Constant(500.0),
                    .damping = Vector3<>::Constant(1.0)});
  moved.set_pose(frame);
  for (int k = 0; k < 200; ++k) {
    const TipState tip{Vector3<>(0.01 * std::sin(0.1 * k), 0.01 * std::cos(0.07 * k), 0.02 * std::sin(0.03 * k)), 1000.0};
    const ContactResult a = moved.step(tip), b = still.step(tip);
    EXPECT_EQ(a.touching, b.touching);
    EXPECT_LT((a.force - b.force).norm(), 1e-9);
    EXPECT_LT((moved.torque() - (tip.position - frame.origin).cross(b.force)).norm(), 1e-10);
  }
}

// Law: after reset() a loop repeats itself bit for bit.
TEST(Servo, ResetForgetsEverything) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  setup.delay = 3;
  setup.limits.peak_force = 5.0;
  setup.limits.continuous_force = 1.0;
  setup.limits.thermal_time = 0.05;
  setup.gravity_compensation = Vector3<>(0.0, 0.1, 0.0);
  const palpate::control::StateSpace integrator(Eigen::Matrix3d::Identity(), Eigen::MatrixXd::Constant(3, 6, 0.1),
                                                Eigen::Matrix3d::Identity(), Eigen::MatrixXd::Zero(3, 6), Eigen::Matrix3d::Zero());
  Servo<Premium, AnyObject, AnyController> servo(setup, wall_at(arm.forward(pose).z(), 700.0, 2.0), integrator);
  std::vector<Joints<3>> first;
  for (int run = 0; run < 2; ++run) {
    for (int k = 0; k < 200; ++k) {
      const Joints<3> torque = servo.tick(swing(k), Vector3<>(1.0, -2.0, 0.5)).torque;
      if (run == 0) first.push_back(torque);
      EXPECT_EQ(torque, first[static_cast<std::size_t>(k)]);
    }
    servo.reset(pose);
  }
}

// Law: with the true time since the last tick, a damper's force does not depend on the tick times.
TEST(Servo, ALateTickDampsWithTheTrueVelocity) {
  ServoSetup<Premium> setup{.mechanism = arm};
  setup.start = pose;
  const SpringWall damper({.kind = SpringWall::Kind::point, .damping = Vector3<>::Constant(2.0)});
  Servo<Premium, SpringWall> servo(setup, damper);
  servo.tick(pose, Vector3<>::Zero());
  const Joints<3> later = pose + Joints<3>(0.01, 0.0, 0.0);
  const Vector3<> velocity = (arm.forward(later) - arm.forward(pose)) / 15e-3;
  EXPECT_LT((servo.tick(later, Vector3<>::Zero(), 15e-3).object_force - 2.0 * velocity).norm(), 1e-9);
}

// Law: fault() names each invalid parameter.
TEST(Servo, ASetupNamesItsFault) {
  ServoSetup<Premium> setup{.mechanism = arm};
  EXPECT_EQ(setup.fault(), nullptr);
  setup.period = 0.0;
  EXPECT_NE(setup.fault(), nullptr);
  setup.period = 1e-3;
  setup.delay = 65;
  EXPECT_NE(setup.fault(), nullptr);
}

struct GuardedLoop {
  static constexpr double stiffness = 500.0;
  ServoSetup<Premium> setup{.mechanism = arm, .start = pose};
  Servo<Premium, SpringWall> servo = loop({});
  Servo<Premium, SpringWall> loop(const palpate::servo::FaultLimits& faults) {
    setup.faults = faults;
    setup.limits.peak_force = 8.5;
    setup.limits.continuous_force = 1.4;
    setup.limits.thermal_time = 6.0;
    return Servo<Premium, SpringWall>(
        setup, SpringWall({.kind = SpringWall::Kind::point, .point = arm.forward(pose), .stiffness = Vector3<>::Constant(stiffness)}));
  }
};

const Joints<3> pressed = pose + Joints<3>(0.002, -0.003, 0.004);
const double nan_value = std::numeric_limits<double>::quiet_NaN();

// Law: without a valid sample the torque of the last one fades linearly to zero within the fade time; with valid ones it returns in 8
// ticks.
TEST(Servo, FadesTheTorqueWhileSamplesAreInvalid) {
  GuardedLoop loop;
  for (const double bad : {nan_value, std::numeric_limits<double>::infinity(), -1e300, 1e154}) {
    auto servo = loop.loop({.fade = 10e-3});
    const Joints<3> torque = servo.tick(pressed, Vector3<>::Zero()).torque;
    for (int k = 1; k <= 20; ++k) {
      const auto& tick = servo.tick(Joints<3>(0.0, bad, 0.0), Vector3<>::Zero());
      EXPECT_TRUE(tick.fault);
      EXPECT_LT((tick.torque - std::max(0.0, 1.0 - 0.1 * k) * torque).norm(), 1e-15);
      EXPECT_EQ(servo.faults(), k);
    }
    for (int k = 1; k <= 8; ++k) {
      const auto& tick = servo.tick(pressed, Vector3<>::Zero());
      EXPECT_FALSE(tick.fault);
      EXPECT_LT((tick.torque - k / 8.0 * torque).norm(), 1e-15);
    }
    EXPECT_EQ(servo.faults(), 20);
    EXPECT_EQ(servo.tick(pressed, Vector3<>(bad, 0.0, 0.0)).fault, true);
  }
}

// Law: one invalid sample leaves no trace: later ticks equal those of a loop that held its tip meanwhile, with the true elapsed time.
TEST(Servo, AnInvalidSampleLeavesObjectAndControllerAlone) {
  GuardedLoop loop;
  auto faulty = loop.loop({.fade = 10e-3});
  auto clean = loop.loop({.fade = 10e-3});
  const Joints<3> step(1e-4, 2e-4, -1e-4);
  for (int k = 0; k < 50; ++k) {
    const Joints<3> q = pressed + k * step;
    if (k == 20) {
      EXPECT_TRUE(faulty.tick(Joints<3>::Constant(nan_value), Vector3<>::Zero()).fault);
      continue;
    }
    const double elapsed = k == 21 ? 2 * loop.setup.period : loop.setup.period;
    const Joints<3> torque = clean.tick(q, Vector3<>::Zero(), elapsed).torque;
    const auto& tick = faulty.tick(q, Vector3<>::Zero());
    EXPECT_EQ(tick.torque, torque) << k;
    EXPECT_EQ(tick.object_force, clean.last().object_force) << k;
  }
}

// Law: a joint cannot move farther than its largest speed allows since the last valid sample.
TEST(Servo, RefusesAJumpThatNoJointCanMake) {
  GuardedLoop loop;
  auto servo = loop.loop({.speed = 20.0, .fade = 10e-3});
  servo.tick(pressed, Vector3<>::Zero());
  EXPECT_FALSE(servo.tick(pressed + Joints<3>::Constant(0.019), Vector3<>::Zero()).fault);
  EXPECT_TRUE(servo.tick(pressed + Joints<3>::Constant(0.040), Vector3<>::Zero()).fault);
  EXPECT_FALSE(servo.tick(pressed + Joints<3>::Constant(0.040), Vector3<>::Zero()).fault);  // in two periods
}

/// A controller whose force and state are not finite in one tick.
struct BreaksOnce {
  using Scalar = double;
  int at = 0;
  double memory = 0.0;
  Vector3<> command(const TickInput& in) noexcept {
    if (--at == 0) memory = nan_value;
    memory += in.reference[0];
    return Vector3<>(memory, 0.0, 0.0);
  }
  void reset() noexcept { memory = 0.0; }
};

// Law: a force that is not finite never reaches a torque, and does not stay in a controller.
TEST(Servo, AForceThatIsNotFiniteIsAFaultOfOneTick) {
  ServoSetup<Premium> setup{.mechanism = arm, .start = pose};
  Servo<Premium, SpringWall, BreaksOnce> servo(
      setup, SpringWall({.kind = SpringWall::Kind::point, .point = arm.forward(pose), .stiffness = Vector3<>::Constant(500.0)}),
      BreaksOnce{.at = 10});
  for (int k = 1; k <= 30; ++k) {
    const auto& tick = servo.tick(pose, Vector3<>(1.0, 0.0, 0.0));
    EXPECT_EQ(tick.fault, k == 10);
    EXPECT_TRUE(tick.torque.allFinite());
    EXPECT_LT(tick.torque.norm(), 20.0);
  }
  EXPECT_EQ(servo.faults(), 1);
}

/// An object of constant force that keeps the time of each tick, and where it started.
struct TickClock {
  using Scalar = double;
  std::vector<double> times;
  std::vector<double> starts;
  ContactResult result;
  const ContactResult& step(const TipState& tip) noexcept {
    times.push_back(tip.time);
    result.force = Vector3<>(0.1, 0.2, -0.3);
    result.touching = true;
    return result;
  }
  void start(const Vector3<>& tip) noexcept { starts.push_back(tip.z()); }
};

// Law: tick k is at k periods, whatever came before it: samples that were refused, and a force that was not finite.
TEST(Servo, TheTimeOfATickCountsEveryTick) {
  ServoSetup<Premium> setup{.mechanism = arm, .start = pose};
  Servo<Premium, TickClock, BreaksOnce> servo(setup, TickClock{}, BreaksOnce{.at = 10});
  EXPECT_EQ(servo.object().starts.size(), 1u);
  std::vector<double> expected;
  for (int k = 0; k < 30; ++k) {
    const bool refused = k == 4 || k == 20;
    const auto& tick = servo.tick(refused ? Joints<3>(Joints<3>::Constant(nan_value)) : pressed, Vector3<>::Zero());
    if (!refused) expected.push_back(k * setup.period);
    EXPECT_EQ(tick.fault, refused || k == 10) << k;
    if (k == 10) {  // the tenth valid sample: what it computed is void, and the object begins anew at the tip
      EXPECT_TRUE(tick.object_force.isZero(0.0));
      EXPECT_FALSE(tick.touching);
      ASSERT_EQ(servo.object().starts.size(), 2u);
      EXPECT_NEAR(servo.object().starts.back(), arm.forward(pressed).z(), 1e-15);
    }
  }
  ASSERT_EQ(servo.object().times.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(servo.object().times[i], expected[i], 1e-15);
}

// Law: the torque is that of the command and the gravity compensation, also while it fades and returns.
TEST(Servo, CommandAndTorqueAgreeWhileTheyFade) {
  ServoSetup<Premium> setup{.mechanism = arm, .start = pose};
  setup.gravity_compensation = Vector3<>(0.0, 0.4, -0.1);
  Servo<Premium, SpringWall> servo(
      setup, SpringWall({.kind = SpringWall::Kind::point, .point = arm.forward(pose), .stiffness = Vector3<>::Constant(500.0)}));
  for (int k = 0; k < 40; ++k) {
    const bool refused = k > 3 && k < 25;
    const auto& tick = servo.tick(refused ? Joints<3>(Joints<3>::Constant(nan_value)) : pressed, Vector3<>::Zero());
    EXPECT_LT((tick.torque - arm.jacobian(pressed).transpose() * (tick.command + setup.gravity_compensation)).norm(), 1e-14) << k;
  }
}

/// Controller of constant force that keeps the last applied one.
struct Pusher {
  using Scalar = double;
  Vector3<> last = Vector3<>::Zero();
  Vector3<> command(const TickInput& /*in*/) noexcept { return {5.0, 0.0, 0.0}; }
  void applied(const Vector3<>& force) noexcept { last = force; }
};

// Law: a controller receives the force that the drive delivers, not the one that it asked for.
TEST(Servo, AControllerReceivesTheForceAfterTheLimits) {
  ServoSetup<Premium> setup{.mechanism = arm, .start = pose};
  setup.limits.peak_force = 2.0;
  Servo<Premium, SpringWall, Pusher> servo(setup, {}, {});
  const auto& tick = servo.tick(pose, Vector3<>::Zero());
  EXPECT_TRUE(tick.saturated);
  EXPECT_NEAR(servo.controller().last.norm(), 2.0, 1e-12);
  EXPECT_EQ(servo.controller().last, tick.command);
}

// Law: the drive limits the torque that holds the device before the first computed one.
TEST(Servo, TheDriveLimitsTheTorqueBeforeTheFirstTick) {
  ServoSetup<Premium> setup{.mechanism = arm, .start = pose};
  setup.delay = 2;
  setup.gravity_compensation = Vector3<>(0.0, 3.0, 0.0);
  setup.limits.peak_torque = Joints<3>::Constant(0.05);
  Servo<Premium, SpringWall> servo(setup);
  EXPECT_NEAR(servo.tick(pose, Vector3<>::Zero()).torque.cwiseAbs().maxCoeff(), 0.05, 1e-12);
}

// Law: after a reset the first sample is anywhere, and no faults are counted.
TEST(Servo, AResetForgetsTheLastSampleAndTheFaults) {
  GuardedLoop loop;
  auto servo = loop.loop({.speed = 20.0, .fade = 10e-3});
  servo.tick(pressed, Vector3<>::Zero());
  EXPECT_TRUE(servo.tick(pressed + Joints<3>::Constant(0.5), Vector3<>::Zero()).fault);
  EXPECT_EQ(servo.faults(), 1);
  servo.reset(pose);
  EXPECT_EQ(servo.faults(), 0);
  EXPECT_FALSE(servo.tick(pressed + Joints<3>::Constant(0.5), Vector3<>::Zero()).fault);
}

}  // namespace
