// A tool that turns and opens: places of its tips, its forces in the rows of a loop, and its tips over a change of supports.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <palpate/object/body_instance.hpp>
#include <palpate/object/tool_motion.hpp>
#include <utility>
#include <vector>

#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

using palpate::object::BodyInstance, palpate::object::BodyPlacement, palpate::object::SignedDistanceBody, palpate::object::TipState,
    palpate::object::ToolMotion, palpate::object::ToolPose;

const std::vector<Vector3<>> open = {{-6e-3, 0.0, 0.0}, {6e-3, 1e-3, 0.5e-3}};
const std::vector<Vector3<>> closed = {{-3e-3, 0.0, 0.0}, {3e-3, 0.0, 0.0}};

std::array<Vector3<>, 2> placed(const ToolMotion& motion, double time) {
  std::array<Vector3<>, 2> centers;
  motion.place(motion.pose(time), centers.data());
  return centers;
}

// Law: angles and opening are linear between rows and rest outside; the rotations are about x, then y, then z of the device.
TEST(ToolMotion, TurnsTheTipsOfItsOpening) {
  const ToolMotion motion(open, closed, {{0.5, {Vector3<>::Zero(), 1.0}}, {1.5, {Vector3<>(0.2, -0.4, 0.6), 0.0}}});
  for (const double t : {-1.0, 0.5, 0.9, 1.5, 7.0}) {
    const double part = std::clamp(t - 0.5, 0.0, 1.0);
    const Eigen::Matrix3d turn(Eigen::AngleAxisd(0.6 * part, Vector3<>::UnitZ()) * Eigen::AngleAxisd(-0.4 * part, Vector3<>::UnitY()) *
                               Eigen::AngleAxisd(0.2 * part, Vector3<>::UnitX()));
    const auto centers = placed(motion, t);
    for (std::size_t k = 0; k < 2; ++k) EXPECT_LT((centers[k] - turn * ((1.0 - part) * open[k] + part * closed[k])).norm(), 1e-16) << t;
  }
}

TEST(ToolMotion, WithoutRowsOrClosedPointsRestsAtItsOpenPoints) {
  for (const auto& motion : {ToolMotion(open, {}, {}), ToolMotion(open, {}, {{0.0, {Vector3<>::Zero(), 0.0}}})}) {
    const auto centers = placed(motion, 3.0);
    for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(centers[k], open[k]);
  }
  EXPECT_TRUE(ToolMotion().empty());
}

std::shared_ptr<const SignedDistanceBody> body_of_a_tool() {
  const contact_bodies::SurfaceBody& body = half_space();
  const auto s = surface();
  palpate::object::SignedDistanceOptions options;
  options.contact_points = open;
  return std::make_shared<SignedDistanceBody>(
      std::make_shared<const SignedDistanceBody::Data>(body.nodes, s->compliance.data(), body.surface, options));
}

BodyPlacement placement_of(ToolMotion tool) {
  BodyPlacement placement;
  placement.body = body_of_a_tool();
  placement.rotation = Eigen::AngleAxisd(0.3, Vector3<>::UnitZ()).toRotationMatrix();
  placement.radius = radius;
  placement.tool = std::move(tool);
  return placement;
}

std::vector<double> row_of(BodyInstance& instance, double time) {
  instance.step({.position = Vector3<>(0.0, 0.0, radius - 1e-3), .rate = 1e3, .time = time});
  std::vector<double> row(static_cast<std::size_t>(instance.record_width()));
  instance.record(row.data());
  return row;
}

// Law: the forces of the tips in a row add up to the object's force, and their moments about the device's tip to that of the tool.
TEST(BodyInstance, RecordsTheForceOfEachTipOfATool) {
  BodyInstance instance(placement_of(ToolMotion(open, closed, {{0.0, {Vector3<>(0.05, 0.1, 0.2), 0.8}}})));
  instance.start(Vector3<>(0.0, 0.0, 2.0 * radius));
  std::vector<double> row;
  for (int k = 0; k < 20; ++k) row = row_of(instance, 1e-3 * k);
  ASSERT_EQ(row.size(), 17U);
  const Eigen::Map<const Vector3<>> first(row.data() + 11), second(row.data() + 14), moment(row.data() + 8);
  EXPECT_GT(first.norm(), 1e-3);
  EXPECT_GT(second.norm(), 1e-3);
  EXPECT_LT((first + second - instance.result().force).norm(), 1e-15);
  const auto centers = placed(instance.placement().tool, 0.0);
  EXPECT_LT((centers[0].cross(first) + centers[1].cross(second) - moment).norm(), 1e-12);  // normal forces pass through the centers
}

// Law: a pose that is set takes the place of the motion until the reset.
TEST(BodyInstance, KeepsThePoseThatIsSetUntilItIsReset) {
  const ToolPose turned{Vector3<>(0.0, 0.1, 0.3), 0.5};
  BodyInstance planned(placement_of(ToolMotion(open, closed, {{0.0, turned}})));
  BodyInstance live(placement_of(ToolMotion(open, closed, {{0.0, {}}, {1.0, {Vector3<>(0.3, 0.0, 0.0), 0.0}}})));
  ASSERT_TRUE(live.has_moving_tool());
  live.set_tool(turned);
  EXPECT_EQ(row_of(live, 0.5), row_of(planned, 0.0));
  live.reset();
  EXPECT_NE(row_of(live, 0.5), row_of(planned, 0.0));
}

TEST(BodyInstance, IgnoresAToolOfAnotherNumberOfTips) {
  BodyInstance instance(placement_of(ToolMotion({open.front()}, {}, {})));
  EXPECT_FALSE(instance.has_moving_tool());
  EXPECT_EQ(instance.record_width(), 17);
}

// Law: the tips of a tool stay where they are while the supports change.
TEST(SupportedBody, KeepsTheTipsOfAToolOverAChangeOfSupports) {
  palpate::object::SignedDistanceOptions options;
  options.contact_points = open;
  using Body = SupportedBody<SignedDistancePhase>;
  const SignedDistancePhase::Maker make(half_space().surface, options);
  Body changing(surface(), {{0, free()}, {20, held_beyond(8e-3)}}, make);
  Body held(surface(), {{0, held_beyond(8e-3)}}, make);
  ASSERT_EQ(changing.tool_tips(), 2);
  for (int k = 0; k < 60; ++k) {
    for (Body* body : {&changing, &held}) {
      body->place_tool(closed.data());
      body->step(sphere(k < 30 ? -1e-3 : 1e-3));  // beyond the change
    }
  }
  for (int t = 0; t < 2; ++t) {
    EXPECT_GT(held.tool_force(t).norm(), 1e-3);
    EXPECT_LT((changing.tool_force(t) - held.tool_force(t)).norm(), 1e-6 * held.tool_force(t).norm());
  }
}

}  // namespace
}  // namespace supported_bodies
