#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <palpate/mechanism/slider.hpp>
#include <palpate/object/moving_frame.hpp>
#include <palpate/servo/loop.hpp>

namespace {

using palpate::math::Vector3;
using palpate::mechanism::Slider;
using palpate::object::FrameMotion;
using palpate::object::MovingFrame;
using palpate::object::Pose;
using palpate::object::SpringWall;
using palpate::servo::Loop;
using palpate::servo::SimulationSetup;

// Law: a frame's motion is linear between its rows and rests outside of them.
TEST(FrameMotion, IsLinearBetweenItsRows) {
  const FrameMotion motion(Vector3<>(1.0, 2.0, 3.0),
                           {{0.5, Vector3<>::Zero(), Vector3<>::Zero()}, {1.5, Vector3<>(0.0, 0.0, 2.0), Vector3<>(0.2, -0.4, 0.6)}});
  const auto turned = [](double x, double y, double z) {
    return Eigen::Matrix3d(Eigen::AngleAxisd(z, Vector3<>::UnitZ()) * Eigen::AngleAxisd(y, Vector3<>::UnitY()) *
                           Eigen::AngleAxisd(x, Vector3<>::UnitX()));
  };
  for (const double t : {-1.0, 0.0, 0.5, 0.75, 1.0, 1.5, 9.0}) {
    const double part = std::clamp(t - 0.5, 0.0, 1.0);
    const Pose pose = motion.pose(t);
    EXPECT_LT((pose.origin - Vector3<>(1.0, 2.0, 3.0 + 2.0 * part)).norm(), 1e-14) << t;
    EXPECT_LT((pose.rotation - turned(0.2 * part, -0.4 * part, 0.6 * part)).norm(), 1e-14) << t;
  }
}

// Law: a loop with a wall that moves uniformly is the loop with the wall at rest, seen from a frame that moves with it.
TEST(MovingFrame, AUniformlyMovingWallIsAWallAtRestSeenFromAMovingFrame) {
  SimulationSetup<Slider> still;
  still.mechanism = Slider({.mass = 0.3});
  SimulationSetup<Slider> moving = still;
  const palpate::object::SpringWallParameters wall{.kind = SpringWall::Kind::half_space,
                                                   .point = Vector3<>(-1e-3, 0.0, 0.0),
                                                   .normal = Vector3<>::UnitX(),
                                                   .stiffness = Vector3<>::Constant(800.0),
                                                   .damping = Vector3<>::Constant(2.0)};
  const double speed = 0.05, start = -0.2;
  still.object = SpringWall(wall);
  still.start_speed[0] = start;
  const FrameMotion uniform(Vector3<>::Zero(),
                            {{0.0, Vector3<>::Zero(), Vector3<>::Zero()}, {10.0, Vector3<>(10.0 * speed, 0.0, 0.0), Vector3<>::Zero()}});
  moving.object = MovingFrame<SpringWall>(SpringWall(wall), uniform);
  moving.start_speed[0] = start + speed;
  Loop<Slider> a(still), b(moving);
  int touching = 0;
  for (int k = 0; k < 400; ++k) {
    const auto& rest = a.tick(Vector3<>::Zero());
    const auto& shifted = b.tick(Vector3<>::Zero());
    touching += rest.touching ? 1 : 0;
    EXPECT_NEAR(shifted.object_force[0], rest.object_force[0], 1e-9);
    EXPECT_NEAR(b.angles()[0] - speed * b.time(), a.angles()[0], 1e-12);
    ASSERT_TRUE(a.advance(Vector3<>::Zero(), Vector3<>::Zero()) && b.advance(Vector3<>::Zero(), Vector3<>::Zero()));
  }
  EXPECT_GT(touching, 10);
  EXPECT_LT(touching, 390);
}

}  // namespace
