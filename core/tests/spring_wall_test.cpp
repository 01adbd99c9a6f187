#include <gtest/gtest.h>

#include <palpate/object/spring_wall.hpp>

namespace {

using palpate::math::Vector3;
using palpate::object::SpringWall;

TEST(SpringWall, KindNoneIsNeverTouched) {
  EXPECT_FALSE(SpringWall{}.contact({0.0, 0.0, -1.0}).touching);
}

TEST(SpringWall, WallDeflectsAlongItsNormal) {
  SpringWall wall;
  wall.kind = SpringWall::Kind::half_space;
  wall.point = Vector3<>(0.0, 0.0, 0.1);
  wall.normal = Vector3<>(0.0, 0.6, 0.8);
  EXPECT_FALSE(wall.contact({0.0, 0.0, 0.2}).touching);
  const auto c = wall.contact({5.0, 0.0, 0.0});
  EXPECT_TRUE(c.touching);
  EXPECT_LT((c.deflection - Vector3<>(-0.08 * wall.normal)).norm(), 1e-15);
}

TEST(SpringWall, PointDeflectsInAllDirections) {
  SpringWall point;
  point.kind = SpringWall::Kind::point;
  point.point = Vector3<>(1.0, 2.0, 3.0);
  EXPECT_EQ(point.contact({1.5, 1.0, 3.0}).deflection, Vector3<>(0.5, -1.0, 0.0));
}

}  // namespace
