#include <gtest/gtest.h>

#include <palpate/object/moving_frame.hpp>
#include <palpate/object/scene.hpp>
#include <vector>

namespace {

using palpate::math::Vector3;
using palpate::object::AnyObject;
using palpate::object::MovingFrame;
using palpate::object::Pose;
using palpate::object::Scene;
using palpate::object::SpringWall;

SpringWall wall(double stiffness) {
  return SpringWall({.kind = SpringWall::Kind::half_space, .stiffness = Vector3<>::Constant(stiffness)});
}

// Law: a scene records the contact with each object; the forces of its objects add up to its own.
TEST(Scene, RecordsEachOfItsObjects) {
  Scene scene({AnyObject(wall(500.0)), AnyObject(MovingFrame<SpringWall>(wall(300.0), Pose{Vector3<>(0.0, 0.0, 2e-3)}))});
  std::vector<double> row(static_cast<std::size_t>(scene.record_width()));
  ASSERT_EQ(row.size(), 20U);
  for (const double z : {3e-3, 1e-3, -1e-3}) {
    const Vector3<> force = scene.step({Vector3<>(0.0, 0.0, z), 1000.0}).force;
    scene.record(row.data());
    EXPECT_EQ(Vector3<>(Vector3<>(row.data()) + Vector3<>(row.data() + 4)), force);
    EXPECT_EQ(row[3], z < 0.0);
    EXPECT_EQ(row[7], z < 2e-3);
    EXPECT_EQ(row[10], 2e-3);  // origin of the frame
  }
}

}  // namespace
