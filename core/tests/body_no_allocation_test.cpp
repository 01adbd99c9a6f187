// A tick of a body takes no memory: this program's own allocation functions count every call.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <palpate/body/compliance.hpp>
#include <palpate/body/patch.hpp>
#include <palpate/body/touched.hpp>
#include <palpate/device/catalogue.hpp>
#include <palpate/device/premium.hpp>
#include <palpate/loop/servo.hpp>

#include "allocations.hpp"
#include "lattice_cube.hpp"

namespace {

/// A flat square of nodes, 1 mm apart, that gives way like a half-space.
struct Square {
  static constexpr int side = 21;
  static constexpr double width = 1e-3;
  palpate::BodyNodes nodes;
  palpate::Compliance body;

  Square() {
    std::vector<palpate::Vector3<>> points;
    for (int i = 0; i < side * side; ++i) points.emplace_back(width * (i % side - 10), width * (i / side - 10), 0.0);
    const std::size_t n = points.size();
    std::vector<float> full(9 * n * n, 0.0F);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t a = 0; a < 3; ++a)
          full[(3 * i + a) * 3 * n + 3 * j + a] = static_cast<float>(1e-5 / ((points[i] - points[j]).norm() + 0.3 * width));
    nodes =
        palpate::BodyNodes(points, std::vector<palpate::Vector3<>>(n, palpate::Vector3<>::UnitZ()), std::vector<double>(n, width * width));
    body = palpate::Compliance(nodes, full.data(), true);
  }
};

TEST(BodyNoAllocation, InATickOfASlidingTip) {
  Square square;
  palpate::BodyContact<palpate::Compliance> contact(square.nodes, square.body), rough(square.nodes, square.body, {0.5, 0.4});
  palpate::BodyTip tip;
  for (const auto kind : {palpate::BodyTip::Kind::sphere, palpate::BodyTip::Kind::flat}) {
    tip.kind = kind;
    tip.radius = 4e-3;
    long pressed = 0;
    double dragged = 0.0;
    int most = 0;
    const long before = allocations;
    for (int k = 0; k < 3000; ++k) {
      const double top = kind == palpate::BodyTip::Kind::sphere ? tip.radius : 0.0;
      tip.centre = {5e-3 * std::sin(0.01 * k), 4e-3 * std::cos(0.017 * k), top + 2e-3 * std::sin(0.05 * k)};
      const palpate::BodyAnswer& a = contact.step(tip);
      dragged += rough.step(tip).friction.norm();
      pressed += a.touching ? 1 : 0;
      most = std::max(most, a.nodes);
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(pressed, 1000);
    EXPECT_GT(dragged, 0.0);
    EXPECT_LT(pressed, 2900);
    EXPECT_GT(most, 15);
  }
}

// The arm swings its tip over the body, in and out of it, with either tip.
TEST(BodyNoAllocation, InAServoTickOnABody) {
  using palpate::Premium, palpate::Joints, palpate::Vector3;
  const Square square;
  const palpate::LoopBodyOf<palpate::Compliance> body(square.nodes, square.body);
  const Premium arm(palpate::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  for (const auto kind : {palpate::BodyTip::Kind::sphere, palpate::BodyTip::Kind::flat}) {
    palpate::ServoSetup<Premium> setup{.mechanism = arm};
    setup.start = pose;
    setup.body.body = &body;
    setup.body.tip = kind;
    setup.body.radius = 4e-3;
    setup.body.turn = Eigen::AngleAxisd(0.1, Vector3<>::UnitX()).toRotationMatrix();
    const double top = kind == palpate::BodyTip::Kind::sphere ? 4e-3 : 0.0;
    setup.body.origin = arm.forward(pose) - setup.body.turn * Vector3<>(0.0, 0.0, top - 1e-3);
    palpate::Latest<palpate::PressedNodes> pressed;
    setup.body.watched = &pressed;
    palpate::Servo<Premium> servo(setup);
    int touching = 0;
    const long before = allocations;
    for (int k = 0; k < 3000; ++k) {
      const Joints<3> q = pose + 0.02 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
      touching += servo.tick(q, Vector3<>::Zero()).touching ? 1 : 0;
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 500);
    EXPECT_LT(touching, 2800);
    ASSERT_TRUE(pressed.fetch());
    EXPECT_EQ(pressed.value().tick, 2999);
    EXPECT_EQ(pressed.value().count, servo.body()->answer().nodes);
  }
}

TEST(BodyNoAllocation, InATickOfALattice) {
  const Cube cube(4);
  palpate::Lattice lattice = cube.lattice(1e-3, 1.0, 1e-3);
  palpate::BodyContact<palpate::Lattice> contact(cube.nodes, lattice);
  palpate::BodyTip tip;
  tip.radius = 8e-3;
  int pressed = 0;
  const long before = allocations;
  for (int k = 0; k < 1000; ++k) {
    tip.centre = {10e-3 + 3e-3 * std::sin(0.01 * k), 10e-3, 28e-3 - 2e-3 * std::sin(0.05 * k)};
    pressed += contact.step(tip).touching ? 1 : 0;
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(pressed, 100);
  EXPECT_LT(pressed, 900);
}

}  // namespace
