// Geometry of one face: nearest point, exits, barycentric coordinates and the sweep of a sphere.
#include <gtest/gtest.h>

#include <cmath>
#include <palpate/mesh/triangle.hpp>
#include <random>

namespace {

using palpate::math::Vector3;
using palpate::mesh::Face, palpate::mesh::Feature, palpate::mesh::NearestPoint;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vector3<> point(double size) { return {number(-size, size), number(-size, size), number(-size, size)}; }
  Face face() {
    Face out{};
    out.vertex = {3, 5, 8};
    for (auto& corner : out.corner) corner = point(1.0);
    out.normal = (out.corner[1] - out.corner[0]).cross(out.corner[2] - out.corner[0]).normalized();
    return out;
  }

 private:
  std::mt19937 engine_;
};

// Law: p is the nearest point of a convex set if and only if no corner lies on the side of x: (x - p).(corner - p) <= 0.
TEST(Triangle, TheNearestPointHasNoCornerOnTheSideOfTheQuery) {
  Random random(1);
  int seen[7] = {};
  for (int k = 0; k < 5000; ++k) {
    const Face face = random.face();
    const Vector3<> x = random.point(2.0);
    const NearestPoint found = nearest_point(face, x);
    ++seen[static_cast<int>(found.feature)];
    for (const auto& corner : face.corner) ASSERT_LE((x - found.point).dot(corner - found.point), 1e-9) << k;
    const Vector3<> b = barycentric(face, found.point);
    Vector3<> back = Vector3<>::Zero();
    for (int i = 0; i < 3; ++i) back += b[i] * face.corner[static_cast<std::size_t>(i)];
    ASSERT_LT((back - found.point).norm(), 1e-6) << k;
    const int i = index_of(found.feature);
    if (is_corner(found.feature)) {
      ASSERT_EQ(found.point, face.corner[static_cast<std::size_t>(i)]);
    } else if (is_edge(found.feature)) {
      ASSERT_LT(b[(i + 2) % 3], 1e-6);
    }
    const Vector3<> outside = barycentric(face, x);
    ASSERT_GE(outside.minCoeff(), 0.0);
    ASSERT_NEAR(outside.sum(), 1.0, 1e-12);
  }
  for (const int count : seen) EXPECT_GT(count, 50);
}

// Law: a motion leaves the face where its point is on the edge, and not before; from an edge it leaves at once.
TEST(Triangle, AMotionLeavesThroughTheFirstEdge) {
  Random random(2);
  for (int k = 0; k < 2000; ++k) {
    const Face face = random.face();
    const double u = random.number(0.05, 0.6), v = random.number(0.05, 0.35);
    const Vector3<> e1 = face.corner[1] - face.corner[0], e2 = face.corner[2] - face.corner[0], x = face.corner[0] + u * e1 + v * e2;
    const Vector3<> motion = random.number(-2.0, 2.0) * e1 + random.number(-2.0, 2.0) * e2;
    const auto height = [&](int edge, const Vector3<>& at) {
      const Vector3<>& a = face.corner[static_cast<std::size_t>(edge)];
      return face.normal.cross(face.corner[static_cast<std::size_t>((edge + 1) % 3)] - a).dot(at - a);
    };
    const auto exit = first_exit(face, x, motion, [](int) { return false; });
    for (int i = 0; i < 3; ++i) ASSERT_GE(height(i, x + exit.fraction * motion), -1e-12) << k;
    if (exit.edge < 0) {
      ASSERT_EQ(exit.fraction, 1.0);
      continue;
    }
    ASSERT_NEAR(height(exit.edge, x + exit.fraction * motion), 0.0, 1e-12) << k;
    const auto at_once = first_exit(face, x, motion, [&exit](int i) { return i == exit.edge; });
    ASSERT_EQ(at_once.edge, exit.edge);
    ASSERT_EQ(at_once.fraction, 0.0);
  }
}

TEST(Triangle, TheInteriorIsSharedWithTheFaceItself) {
  Random random(3);
  const Face face = random.face();
  Face other = random.face();
  other.vertex = {5, 3, 9};  // shares the edge of the vertices 3 and 5
  EXPECT_TRUE(shares_feature(face, Feature::inside, face));
  EXPECT_FALSE(shares_feature(face, Feature::inside, other));
  EXPECT_TRUE(shares_feature(face, Feature::edge0, other));
  EXPECT_FALSE(shares_feature(face, Feature::edge1, other));
  EXPECT_TRUE(shares_feature(face, Feature::corner1, other));
  EXPECT_FALSE(shares_feature(face, Feature::corner2, other));
}

// Law: the sphere touches the face at the time of the hit and not before; without a hit it touches at no time of the motion.
TEST(Triangle, ASweptSphereStopsWhereItFirstTouches) {
  Random random(4);
  int hits = 0;
  for (int k = 0; k < 4000; ++k) {
    const Face face = random.face();
    const double radius = random.number(0.05, 0.5);
    const Vector3<> from = random.point(2.0);
    const Vector3<> motion = random.number(0.2, 2.0) * (face.corner[static_cast<std::size_t>(k % 3)] - from) + random.point(0.7);
    const auto distance = [&](double t) {
      const Vector3<> at = from + t * motion;
      return (at - nearest_point(face, at).point).norm();
    };
    if (distance(0.0) < radius) {
      const auto deep = sweep_sphere(face, from, motion, radius);
      ASSERT_TRUE(deep.hit && deep.time == 0.0) << k;
      continue;
    }
    const auto found = sweep_sphere(face, from, motion, radius);
    hits += found.hit ? 1 : 0;
    const double end = found.hit ? found.time : 1.0;
    ASSERT_LE(end, 1.0);
    for (int s = 0; s < 40; ++s) ASSERT_GE(distance(end * s / 40.0), radius * (1.0 - 1e-9)) << k;
    if (!found.hit) continue;
    ASSERT_NEAR(distance(end), radius, 1e-9) << k;
    ASSERT_LT((nearest_point(face, from + end * motion).point - found.point).norm(), 1e-6) << k;
    ASSERT_LT((from + end * motion - radius * found.normal - found.point).norm(), 1e-9) << k;
    ASSERT_LE(found.normal.dot(motion), 1e-9) << k;
    const Vector3<> touching = found.point + radius * found.normal;
    ASSERT_FALSE(sweep_sphere(face, touching, found.normal, radius).hit) << k;
    ASSERT_EQ(sweep_sphere(face, touching, -found.normal, radius).time, 0.0) << k;
  }
  EXPECT_GT(hits, 300);
}

}  // namespace
