// A tick on a body does not allocate. The allocation functions of this program count every call.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/compliance.hpp>
#include <palpate/mechanism/premium.hpp>
#include <palpate/object/body_instance.hpp>
#include <palpate/plant/device_catalog.hpp>
#include <palpate/servo/servo.hpp>

#include "support/allocations.hpp"
#include "support/mass_spring_cube.hpp"

namespace {

/// Flat square of nodes, 1 mm apart, with a compliance like a half-space's.
struct Square {
  static constexpr int side = 21;
  static constexpr double width = 1e-3;
  palpate::deformable::SurfaceNodes nodes;
  palpate::deformable::Compliance body;

  Square() {
    std::vector<palpate::math::Vector3<>> points;
    for (int i = 0; i < side * side; ++i) points.emplace_back(width * (i % side - 10), width * (i / side - 10), 0.0);
    const std::size_t n = points.size();
    std::vector<float> full(9 * n * n, 0.0F);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t a = 0; a < 3; ++a)
          full[(3 * i + a) * 3 * n + 3 * j + a] = static_cast<float>(1e-5 / ((points[i] - points[j]).norm() + 0.3 * width));
    nodes = palpate::deformable::SurfaceNodes(points, std::vector<palpate::math::Vector3<>>(n, palpate::math::Vector3<>::UnitZ()),
                                              std::vector<double>(n, width * width));
    body = palpate::deformable::Compliance(nodes, full.data(), true);
  }
};

TEST(BodyNoAllocation, InATickOfASlidingTip) {
  Square square;
  palpate::deformable::TipContact<palpate::deformable::Compliance> contact(square.nodes, square.body),
      rough(square.nodes, square.body, {0.5, 0.4});
  palpate::deformable::Tip tip;
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    tip.kind = kind;
    tip.radius = 4e-3;
    long pressed = 0;
    double friction = 0.0;
    int most = 0;
    const long before = allocations;
    for (int k = 0; k < 300; ++k) {
      const double top = kind == palpate::deformable::Tip::Kind::sphere ? tip.radius : 0.0;
      tip.center = {5e-3 * std::sin(0.1 * k), 4e-3 * std::cos(0.17 * k), top + 2e-3 * std::sin(0.5 * k)};
      const palpate::deformable::ContactResult& a = contact.step(tip);
      friction += rough.step(tip).friction.norm();
      pressed += a.touching ? 1 : 0;
      most = std::max(most, a.nodes);
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(pressed, 100);
    EXPECT_GT(friction, 0.0);
    EXPECT_LT(pressed, 290);
    EXPECT_GT(most, 15);
  }
}

// The arm moves its tip in and out of the body, with both tip kinds.
TEST(BodyNoAllocation, InAServoTickOnABody) {
  using palpate::mechanism::Premium, palpate::math::Joints, palpate::math::Vector3;
  const Square square;
  const auto body = std::make_shared<palpate::object::LinearBodyObject<palpate::deformable::Compliance>>(square.nodes, square.body);
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    palpate::servo::ServoSetup<Premium> setup{.mechanism = arm};
    setup.start = pose;
    palpate::object::BodyPlacement placement;
    placement.body = body;
    placement.tip = kind;
    placement.radius = 4e-3;
    placement.rotation = Eigen::AngleAxisd(0.1, Vector3<>::UnitX()).toRotationMatrix();
    const double top = kind == palpate::deformable::Tip::Kind::sphere ? 4e-3 : 0.0;
    placement.origin = arm.forward(pose) - placement.rotation * Vector3<>(0.0, 0.0, top - 1e-3);
    const auto contact_frames = std::make_shared<palpate::math::LatestValue<palpate::object::ContactFrame>>();
    auto& pressed = *contact_frames;
    placement.contact_frames = contact_frames;
    palpate::servo::Servo<Premium, palpate::object::BodyInstance> servo(setup, palpate::object::BodyInstance(placement));
    int touching = 0;
    const long before = allocations;
    for (int k = 0; k < 600; ++k) {
      const Joints<3> q = pose + 0.02 * Joints<3>(std::sin(0.15 * k), std::cos(0.1 * k) - 1.0, std::sin(0.25 * k));
      touching += servo.tick(q, Vector3<>::Zero()).touching ? 1 : 0;
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 100);
    EXPECT_LT(touching, 560);
    ASSERT_TRUE(pressed.acquire());
    EXPECT_EQ(pressed.value().tick, 599);
    EXPECT_EQ(pressed.value().count, servo.object().body().last().nodes);
  }
}

TEST(BodyNoAllocation, InATickOfAMassSpringModel) {
  const Cube cube(4);
  palpate::deformable::MassSpringModel model = cube.model(1e-3, 1.0, 1e-3);
  palpate::deformable::TipContact<palpate::deformable::MassSpringModel> contact(cube.nodes, model);
  palpate::deformable::Tip tip;
  tip.radius = 8e-3;
  int pressed = 0;
  const long before = allocations;
  for (int k = 0; k < 1000; ++k) {
    tip.center = {10e-3 + 3e-3 * std::sin(0.01 * k), 10e-3, 28e-3 - 2e-3 * std::sin(0.05 * k)};
    pressed += contact.step(tip).touching ? 1 : 0;
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(pressed, 100);
  EXPECT_LT(pressed, 900);
}

}  // namespace
