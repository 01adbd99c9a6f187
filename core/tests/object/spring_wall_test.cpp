#include <gtest/gtest.h>

#include <palpate/object/spring_wall.hpp>

namespace {

using palpate::math::Vector3;
using palpate::object::SpringWall;

TEST(SpringWall, KindNoneIsNeverTouched) {
  SpringWall none;
  EXPECT_FALSE(none.step({{0.0, 0.0, -1.0}, 1000.0}).touching);
}

TEST(SpringWall, WallDeflectsAlongItsNormal) {
  const Vector3<> normal(0.0, 0.6, 0.8);
  SpringWall wall({.kind = SpringWall::Kind::half_space, .point = {0.0, 0.0, 0.1}, .normal = normal, .stiffness = Vector3<>::Ones()});
  EXPECT_FALSE(wall.step({{0.0, 0.0, 0.2}, 1000.0}).touching);
  const auto& c = wall.step({{5.0, 0.0, 0.0}, 1000.0});
  EXPECT_TRUE(c.touching);
  EXPECT_LT((c.deflection - Vector3<>(-0.08 * normal)).norm(), 1e-15);
  EXPECT_NEAR(c.depth, 0.08, 1e-15);
  EXPECT_NEAR(c.stiffness, 1.0, 1e-15);
}

TEST(SpringWall, PointDeflectsInAllDirections) {
  SpringWall point({.kind = SpringWall::Kind::point, .point = {1.0, 2.0, 3.0}});
  EXPECT_EQ(point.step({{1.5, 1.0, 3.0}, 1000.0}).deflection, Vector3<>(0.5, -1.0, 0.0));
}

}  // namespace
