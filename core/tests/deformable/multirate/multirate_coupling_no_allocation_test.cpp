// Servo ticks on local models do not allocate, including model switches; model updates may.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>
#include <palpate/deformable/multirate/passive_model_switch.hpp>
#include <palpate/mechanism/premium.hpp>
#include <palpate/object/body_instance.hpp>
#include <palpate/object/multirate_object.hpp>
#include <palpate/plant/device_catalog.hpp>
#include <palpate/servo/servo.hpp>

#include "support/allocations.hpp"
#include "support/tet_block.hpp"

namespace {

TEST(HyperelasticNoAllocation, InATickOfTwoTips) {
  const TetBlock block(8, 6, 3, 8e3, 0.4);
  palpate::deformable::QuasiStaticSolver<palpate::deformable::NeoHookean, 2> solver(block.mesh, block.top(), {});
  auto models = std::make_unique<palpate::deformable::PassiveModelSwitch::ModelBuffer>();
  auto servo = std::make_unique<palpate::deformable::PassiveModelSwitch>();
  palpate::deformable::TipPair tips;
  tips.count = 2;
  long counted = 0, pressed = 0;
  for (int k = 0; k < 800; ++k) {
    for (std::size_t t = 0; t < 2; ++t)
      tips.tip[t].center = {0.012 + 0.016 * static_cast<double>(t) + 4e-3 * std::sin(0.01 * k), 0.015, 0.019 + 3e-3 * std::cos(0.02 * k)};
    if (k % 20 == 0) {
      solver.step(tips, models->write_slot());
      models->publish();
    }
    const long before = allocations;
    pressed += servo->step(*models, tips).nodes;
    counted += allocations - before;
  }
  EXPECT_EQ(counted, 0);
  EXPECT_GT(pressed, 400);
}

struct Solver {
  palpate::deformable::QuasiStaticSolver<palpate::deformable::NeoHookean, 2> solid;
  auto step(const palpate::deformable::TipPair& tips, palpate::deformable::LocalModel& to) { return solid.step(tips, to); }
  void reset() { solid.reset(); }
  void displacement(double* to) const { solid.displacement(to); }
  [[nodiscard]] palpate::math::Vector3<> normal_near(const palpate::math::Vector3<>& place) const { return solid.normal_near(place); }
  [[nodiscard]] std::unique_ptr<Solver> clone_at_rest() const { return std::make_unique<Solver>(*this); }
};

// The arm moves its tip in and out of the body, with both tip kinds; model updates are synchronous, outside the ticks.
TEST(HyperelasticNoAllocation, InAServoTick) {
  using palpate::mechanism::Premium, palpate::math::Joints, palpate::math::Vector3;
  const TetBlock block(8, 6, 3, 8e3, 0.4);
  const std::size_t nodes = block.top().point.size();
  std::vector<float> rest(9 * nodes * nodes);
  for (std::size_t k = 0; k < 3 * nodes; ++k) rest[(3 * nodes + 1) * k] = 1e-2F;
  const auto body = std::make_shared<palpate::object::MultirateObject<Solver>>(
      std::make_unique<Solver>(Solver{{block.mesh, block.top(), {}}}), 20,
      palpate::deformable::LocalModelSlip({0.5, 0.4}, {nodes, rest.data()}, 0.4));
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    palpate::servo::ServoSetup<Premium> setup{.mechanism = arm};
    setup.start = pose;
    palpate::object::BodyPlacement placement;
    placement.body = body;
    placement.tip = kind;
    placement.radius = 6e-3;
    const double top = kind == palpate::deformable::Tip::Kind::sphere ? 6e-3 : 0.0;
    placement.origin = arm.forward(pose) - Vector3<>(0.02, 0.015, 0.015 + top - 1e-3);
    const auto contact_frames = std::make_shared<palpate::math::LatestValue<palpate::object::ContactFrame>>();
    auto& pressed = *contact_frames;
    placement.contact_frames = contact_frames;
    const auto deformation_frames = std::make_shared<palpate::math::LatestValue<palpate::object::DeformationFrame>>();
    auto& observer = *deformation_frames;
    for (palpate::object::DeformationFrame& place : observer.slots()) place.displacement.resize(3 * block.mesh.points.size());
    placement.deformation_frames = deformation_frames;
    palpate::servo::Servo<Premium, palpate::object::BodyInstance> servo(setup, palpate::object::BodyInstance(placement));
    const auto swing = [](int k) { return Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k)); };
    EXPECT_TRUE(servo.tick(pose, Vector3<>::Zero()).touching);  // from the first tick on
    int touching = 0;
    long counted = 0;
    double friction = 0.0, deepest = 0.0;
    for (int k = 0; k < 1000; ++k) {
      const long before = allocations;
      touching += servo.tick(pose + 0.02 * swing(k), Vector3<>::Zero()).touching ? 1 : 0;
      counted += allocations - before;
      friction += servo.object().body().last().friction.norm();
      servo.update();
      if (observer.acquire())
        for (const double d : observer.value().displacement) deepest = std::max(deepest, std::abs(d));
    }
    EXPECT_EQ(counted, 0);
    EXPECT_GT(friction, 0.0);
    EXPECT_GT(touching, 200);
    EXPECT_LT(touching, 950);
    ASSERT_TRUE(pressed.acquire());
    EXPECT_EQ(pressed.value().count, servo.object().body().last().nodes);
    EXPECT_TRUE(servo.object().body().is_multirate());
    EXPECT_EQ(observer.value().step, 51);   // one before the first tick
    EXPECT_EQ(observer.value().tick, 981);  // a model update after ticks 1, 21, ... 981
    EXPECT_GT(deepest, 5e-4);
  }
}

}  // namespace
