// Proxy against closed-form solutions (plane, edge, corner, friction, damping, thin walls) and its
// invariances.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "support/mesh_shapes.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::Contact;
using palpate::mesh::Proxy;
using palpate::mesh::Surface;
using shapes::Shape;
using shapes::World;

Surface rough(double mu_static, double mu_dynamic) {
  Surface s;
  s.static_friction = mu_static;
  s.dynamic_friction = mu_dynamic;
  return s;
}

const Vector3<> half(1.0, 1.0, 0.5);  // the top of the box is z = 0.5

TEST(Proxy, ProjectsTheTipOntoAPlane) {
  for (const double radius : {0.0, 0.05}) {
    const World world(shapes::box(half, 7));
    Proxy proxy = world.proxy(radius);
    proxy.step({0.1, 0.0, 1.0});
    for (int k = 0; k < 400; ++k) {
      const Vector3<> tip(0.8 * std::sin(0.03 * k), 0.7 * std::cos(0.05 * k), 0.49 - 0.1 * std::sin(0.01 * k) * std::sin(0.01 * k));
      const Contact& c = proxy.step(tip);
      ASSERT_TRUE(c.touching);
      EXPECT_LT((c.position - Vector3<>(tip[0], tip[1], 0.5 + radius)).norm(), 1e-12) << k;
      EXPECT_LT((c.normal - Vector3<>::UnitZ()).norm(), 1e-12);
      EXPECT_NEAR(c.depth, 0.5 + radius - tip[2], 1e-12);
      EXPECT_LT((c.force - 1000.0 * c.depth * Vector3<>::UnitZ()).norm(), 1e-8);
    }
    EXPECT_FALSE(proxy.step({0.0, 0.0, 0.6}).touching);
  }
}

TEST(Proxy, SticksInsideTheFrictionConeAndLagsWhenSliding) {
  for (const double radius : {0.0, 0.05}) {
    const World world(shapes::box(half, 7), rough(0.5, 0.3));
    Proxy proxy = world.proxy(radius);
    const double depth = 0.1, top = 0.5 + radius;
    proxy.step({0.0, 0.0, 1.0});
    proxy.step({0.0, 0.0, top - depth});
    bool slid = false;
    for (int k = 1; k < 300; ++k) {
      const double x = 0.002 * k;
      const Contact& c = proxy.step({x, 0.0, top - depth});
      const double lag = x - c.position[0];
      if (x <= 0.5 * depth * (1.0 - 1e-9)) {
        EXPECT_NEAR(lag, x, 1e-12) << "sticks";
      } else if (x > 0.5 * depth * (1.0 + 1e-9)) {
        slid = true;
        EXPECT_NEAR(lag, 0.3 * depth, 1e-12) << "slides at x " << x;
        EXPECT_NEAR(c.force[0], -0.3 * c.force[2], 1e-9);
      }
    }
    EXPECT_TRUE(slid);
    // It rests and sticks again, up to the static cone in the opposite direction.
    double x = 0.598;
    const double held = proxy.step({x, 0.0, top - depth}).position[0];
    for (; x > held - 0.49 * depth; x -= 0.001) EXPECT_NEAR(proxy.step({x, 0.0, top - depth}).position[0], held, 1e-12);
  }
}

TEST(Proxy, LagScalesWithTheStiffnessRatio) {
  Surface s = rough(0.4, 0.4);
  s.stiffness = {2000.0};
  s.tangential = 500.0;
  const World world(shapes::box(half, 3), s);
  Proxy proxy = world.proxy();
  proxy.step({0.0, 0.0, 1.0});
  proxy.step({0.0, 0.0, 0.48});
  const Contact& c = proxy.step({0.3, 0.0, 0.48});
  EXPECT_NEAR(0.3 - c.position[0], 0.4 * 4.0 * 0.02, 1e-12);
  EXPECT_NEAR(c.force[0], -0.4 * 2000.0 * 0.02, 1e-9);
  s.tangential = 0.0;
  const World slippery(shapes::box(half, 3), s);
  Proxy free = slippery.proxy();
  free.step({0.0, 0.0, 1.0});
  free.step({0.0, 0.0, 0.48});
  EXPECT_NEAR(free.step({0.3, 0.0, 0.48}).position[0], 0.3, 1e-12) << "no tangential spring, no friction";
}

TEST(Proxy, NeverSlidesWithInfiniteFriction) {
  const double infinity = std::numeric_limits<double>::infinity();
  Surface s = rough(infinity, infinity);
  s.tangential = 1000.0;
  const World world(shapes::box(half, 3), s);
  Proxy proxy = world.proxy();
  proxy.step({0.0, 0.0, 1.0});
  const Vector3<> at = proxy.step({0.0, 0.0, 0.4}).position;
  const Contact& c = proxy.step({0.7, -0.2, 0.3});
  EXPECT_LT((c.position - at).norm(), 1e-12);
  EXPECT_LT((c.force - Vector3<>(-700.0, 200.0, 200.0)).norm(), 1e-9);
}

TEST(Proxy, ViscousFrictionDecaysGeometrically) {
  // k_t lag = b v with v the change of the lag: the lag decays by 1 / (1 + k_t T / b) per tick.
  Surface s;
  s.viscous = 2.0;
  s.period = 1e-3;
  const World world(shapes::box(half, 3), s);
  for (const double radius : {0.0, 0.05}) {
    Proxy proxy = world.proxy(radius);
    proxy.step({0.0, 0.0, 1.0});
    proxy.step({0.0, 0.0, 0.4});
    double lag = 0.3;
    for (int k = 0; k < 10; ++k) {
      const Contact& c = proxy.step({0.3, 0.0, 0.4});
      lag *= 2.0 / (2.0 + 1000.0 * 1e-3);
      EXPECT_NEAR(0.3 - c.position[0], lag, 1e-9) << k;
    }
  }
}

TEST(Proxy, DampsAlongTheNormalAndNeverPulls) {
  Surface s;
  s.damping = {5.0};
  const World world(shapes::box(half, 3), s);
  Proxy proxy = world.proxy();
  proxy.step({0.0, 0.0, 1.0});
  proxy.step({0.0, 0.0, 0.49});
  EXPECT_NEAR(proxy.step({0.0, 0.0, 0.488}).force[2], 1000.0 * 0.012 + 5.0 * 2.0, 1e-9);
  EXPECT_EQ(proxy.step({0.0, 0.0, 0.499}).force[2], 0.0);
}

TEST(Proxy, RestsInConcaveEdgesAndCorners) {
  // Inverting the orientation makes the inside of the box free. Three faces meet in the corner (1,
  // 1, 0.5).
  Shape s = shapes::box(half, 4);
  for (auto& t : s.triangles) std::swap(t[0], t[1]);
  for (const double radius : {0.0, 0.04}) {
    const World world(s, {}, true);
    Proxy proxy = world.proxy(radius);
    // The free side of the inverted box is inside.
    proxy.step({0.0, 0.0, 0.0});
    const Vector3<> room = half - Vector3<>::Constant(radius);
    Contact c = proxy.step({0.3, 0.2, 0.7});
    EXPECT_LT((c.position - Vector3<>(0.3, 0.2, room[2])).norm(), 1e-12) << "one face";
    c = proxy.step({1.3, 0.2, 0.7});
    EXPECT_LT((c.position - Vector3<>(room[0], 0.2, room[2])).norm(), 1e-12) << "two faces";
    c = proxy.step({1.3, 1.2, 0.7});
    EXPECT_LT((c.position - room).norm(), 1e-12) << "three faces";
    EXPECT_NEAR(c.depth, (Vector3<>(1.3, 1.2, 0.7) - room).norm(), 1e-12);
    c = proxy.step({1.3, -0.4, 0.7});
    EXPECT_LT((c.position - Vector3<>(room[0], -0.4, room[2])).norm(), 1e-12) << "two faces again";
    EXPECT_FALSE(proxy.step({0.1, 0.1, 0.1}).touching);
  }
}

TEST(Proxy, SphereFollowsTheArcAroundAConvexEdge) {
  const World world(shapes::box(half, 4));
  const double radius = 0.2;
  Proxy proxy = world.proxy(radius);
  proxy.step({0.5, 0.0, 1.0});
  proxy.step({0.9, 0.0, 0.6});
  for (double angle = 0.1; angle < 1.5; angle += 0.1) {
    // The tip lies on the arc about the edge x = 1, z = 0.5, so the center lies on the same ray
    // from the edge.
    const Vector3<> out(std::sin(angle), 0.0, std::cos(angle));
    const Contact& c = proxy.step(Vector3<>(1.0, 0.0, 0.5) + 0.05 * out);
    ASSERT_TRUE(c.touching);
    EXPECT_LT((c.normal - out).norm(), 1e-6) << angle;
    EXPECT_LT((c.position - Vector3<>(1.0, 0.0, 0.5) - radius * out).norm(), 1e-7) << angle;
  }
}

TEST(Proxy, DoesNotTunnelThroughThinWalls) {
  for (const double radius : {0.0, 0.01}) {
    for (const bool open : {false, true}) {
      const World world(open ? shapes::sheet(5, 1.0, [](double, double) { return 0.0; }) : shapes::box({1.0, 1.0, 1e-5}, 5), {}, open);
      Proxy proxy = world.proxy(radius);
      proxy.step({0.11, 0.07, 0.5});
      const Contact& c = proxy.step({0.13, 0.05, -0.5});
      ASSERT_TRUE(c.touching);
      EXPECT_GT(c.position[2], 0.0 - 1e-15);
      EXPECT_NEAR(c.normal[2], 1.0, 1e-12);
      EXPECT_GT(c.force[2], 499.0);
      Proxy below = world.proxy(radius);
      below.step({0.11, 0.07, -0.5});
      EXPECT_NEAR(below.step({0.13, 0.05, 0.5}).normal[2], -1.0, 1e-12);
    }
  }
}

TEST(Proxy, LeavesASheetAroundItsBorder) {
  const World world(shapes::sheet(5, 1.0, [](double, double) { return 0.0; }), {}, true);
  for (const double radius : {0.0, 0.01}) {
    Proxy proxy = world.proxy(radius);
    proxy.step({0.9, 0.05, 0.1});
    EXPECT_TRUE(proxy.step({0.95, 0.05, -0.1}).touching);
    EXPECT_FALSE(proxy.step({1.1, 0.05, -0.1}).touching);
    EXPECT_FALSE(proxy.step({0.9, 0.05, -0.1}).touching) << "below the sheet, on its free side";
    EXPECT_TRUE(proxy.step({0.9, 0.05, 0.1}).touching) << "from below";
  }
}

TEST(Proxy, StartsOnTheNearestSurfacePointIfTheTipIsInside) {
  const World world(shapes::box(half, 4));
  Proxy point = world.proxy();
  EXPECT_LT((point.step({0.31, 0.21, 0.4}).position - Vector3<>(0.31, 0.21, 0.5)).norm(), 1e-12);
  Proxy sphere = world.proxy(0.1);
  EXPECT_LT((sphere.step({0.31, 0.21, 0.4}).position - Vector3<>(0.31, 0.21, 0.6)).norm(), 1e-9);
}

TEST(Proxy, KeepsTheLastContactIfTheTipIsNotFinite) {
  const World world(shapes::box(half, 4));
  for (const double radius : {0.0, 0.1}) {
    Proxy proxy = world.proxy(radius);
    proxy.step({0.0, 0.0, 2.0});
    const Contact before = proxy.step({0.2, 0.1, 0.4});
    for (const double invalid : {std::nan(""), HUGE_VAL}) {
      const Contact c = proxy.step({0.2, invalid, 0.4});
      EXPECT_EQ(c.position, before.position);
      EXPECT_EQ(c.force, before.force);
    }
    EXPECT_EQ(proxy.invalid_input_count(), 2);
    EXPECT_LT((proxy.step({0.3, 0.1, 0.4}).position - before.position - Vector3<>(0.1, 0.0, 0.0)).norm(), 1e-12) << "continues afterwards";
  }
}

/// Return the tip position on a path in and out of the bumpy ball.
Vector3<> path(int k) {
  const double a = 0.3 + 0.02 * k, b = 0.2 + 0.013 * k;
  return (0.47 + 0.05 * std::sin(0.11 * k)) * Vector3<>(std::cos(a), std::sin(a), 0.8 * std::sin(b)).normalized();
}

/// Return the largest deviation, relative to size 1, between contacts on a mesh and on a
/// transformed copy.
template <class Change>
double difference(double radius, double scale, const Shape& other, Change change, double friction) {
  const Surface s = rough(friction, 0.6 * friction);
  const World one(shapes::ball(20, 0.5, 0.1), s), two(other, s);
  Proxy p = one.proxy(radius), q = two.proxy(radius * scale);
  double max_difference = 0.0;
  for (int k = 0; k < 3000; ++k) {
    const Contact a = p.step(path(k)), b = q.step(change(path(k)));
    if (a.touching != b.touching) return 1e9;
    max_difference = std::max(max_difference, (change(a.position) - b.position).norm() / scale);
    max_difference = std::max(max_difference, std::fabs(a.depth * scale - b.depth) / scale);
  }
  return max_difference;
}

struct Variant {
  double radius, friction, tolerance;
};
const Variant runs[] = {{0.0, 0.0, 1e-9}, {0.0, 0.5, 1e-9}, {0.02, 0.0, 1e-9}, {0.02, 0.5, 1e-9}};

TEST(Proxy, DoesNotDependOnTheUnit) {
  for (const Variant& run : runs)
    for (const double scale : {1e-3, 1e3}) {
      const auto change = [scale](const Vector3<>& x) { return Vector3<>(scale * x); };
      const Shape other = shapes::moved(shapes::ball(20, 0.5, 0.1), change);
      EXPECT_LT(difference(run.radius, scale, other, change, run.friction), run.tolerance) << run.radius << " " << run.friction;
    }
}

TEST(Proxy, DoesNotDependOnTheOrientation) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3<>(1, 2, 3).normalized()).toRotationMatrix();
  const auto change = [&turn](const Vector3<>& x) { return Vector3<>(turn * x); };
  const Shape other = shapes::moved(shapes::ball(20, 0.5, 0.1), change);
  for (const Variant& run : runs)
    EXPECT_LT(difference(run.radius, 1.0, other, change, run.friction), run.tolerance) << run.radius << " " << run.friction;
}

TEST(Proxy, DoesNotDependOnTheNumbering) {
  const Shape s = shapes::ball(20, 0.5, 0.1);
  std::mt19937_64 random(7);
  std::vector<std::int32_t> number(s.vertices.size());
  for (std::size_t i = 0; i < number.size(); ++i) number[i] = static_cast<std::int32_t>(i);
  std::shuffle(number.begin(), number.end(), random);
  Shape shuffled = s;
  for (std::size_t i = 0; i < number.size(); ++i) shuffled.vertices[static_cast<std::size_t>(number[i])] = s.vertices[i];
  for (auto& t : shuffled.triangles) {
    for (auto& v : t) v = number[static_cast<std::size_t>(v)];
    std::rotate(t.begin(), t.begin() + static_cast<std::ptrdiff_t>(random() % 3), t.end());
  }
  std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random);
  const auto same = [](const Vector3<>& x) { return x; };
  for (const Variant& run : runs)
    EXPECT_LT(difference(run.radius, 1.0, shuffled, same, run.friction), run.tolerance) << run.radius << " " << run.friction;
}

}  // namespace
