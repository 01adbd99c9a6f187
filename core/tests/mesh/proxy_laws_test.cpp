// Laws of a proxy that closed forms of one contact do not show: two contacts, two sides, a field, and reflex edges.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <palpate/mesh/force_shading.hpp>
#include <palpate/mesh/mesh_updater.hpp>
#include <random>
#include <vector>

#include "support/mesh_shapes.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::Contact;
using palpate::mesh::ForceShading;
using palpate::mesh::Proxy;
using palpate::mesh::Surface;
using shapes::Shape;
using shapes::World;

// Law: the second touch is the first: a tip that lifts off and comes down the same way feels the same force, to the last bit.
TEST(ProxyLaws, TheSecondTouchIsTheFirst) {
  for (const double radius : {0.0, 0.05}) {
    Surface s;
    s.damping = {5.0};
    s.static_friction = 0.5;
    s.dynamic_friction = 0.3;
    s.viscous = 0.2;
    const World world(shapes::box({1.0, 1.0, 0.5}, 3), s);
    Proxy proxy = world.proxy(radius);
    std::vector<Vector3<>> first;
    for (int touch = 0; touch < 3; ++touch)
      for (int k = 0; k < 40; ++k) {
        const double height = k < 5 || k > 34 ? 0.2 : -0.01 * (1.0 + std::sin(0.4 * k));
        const Contact& c = proxy.step({0.1 + 0.003 * k, 0.2 - 0.001 * k, 0.5 + radius + height});
        if (touch == 0) first.push_back(c.force);
        EXPECT_EQ(c.force, first[static_cast<std::size_t>(k)]) << touch << ' ' << k;
      }
  }
}

/// A bent open sheet with a ridge, a valley and borders, and the same sheet seen from behind.
Shape bent_sheet(bool behind) {
  Shape s = shapes::sheet(6, 0.3, [](double x, double y) { return 0.2 * std::fabs(x) - 0.15 * std::fabs(y - 0.1); });
  if (behind)
    for (auto& t : s.triangles) std::swap(t[1], t[2]);
  return s;
}

// Law: an open sheet has no inside: wound the other way round it gives the same forces, from either side and around its border.
TEST(ProxyLaws, AnOpenSheetHasTwoEqualSides) {
  for (const double side : {1.0, -1.0})
    for (const double mu : {0.0, 0.4}) {
      Surface s;
      s.static_friction = s.dynamic_friction = mu;
      const World one(bent_sheet(false), s, true), other(bent_sheet(true), s, true);
      Proxy a = one.proxy(0.0), b = other.proxy(0.0);
      int touched = 0;
      for (int k = 0; k < 1500; ++k) {
        const double x = 0.31 * std::sin(0.013 * k), y = 0.29 * std::cos(0.0071 * k);
        const double height = 0.2 * std::fabs(x) - 0.15 * std::fabs(y - 0.1);
        const Vector3<> tip(x, y, k % 200 < 10 ? side * 0.5 : height - side * 0.03 * (1.0 + std::sin(0.05 * k)));
        const Contact &c = a.step(tip), &d = b.step(tip);
        EXPECT_EQ(c.touching, d.touching) << k;
        EXPECT_LT((c.force - d.force).norm(), 1e-6) << k;
        touched += c.touching ? 1 : 0;
      }
      EXPECT_GT(touched, 100);
    }
}

// Law: without friction the force on a flat field is the negative gradient of k(foot) depth^2 / 2.
TEST(ProxyLaws, AForceOnAContinuousFieldIsTheGradientOfItsEnergy) {
  const Shape shape = shapes::sheet(4, 0.5, [](double, double) { return 0.0; });
  Surface s;
  s.tangential = 0.0;
  s.field = palpate::mesh::FieldKind::continuous;
  s.stiffness.clear();
  for (const Vector3<>& v : shape.vertices) s.stiffness.push_back(1000.0 + 900.0 * std::sin(5.0 * v[0]) * std::cos(3.0 * v[1]));
  const World world(shape, s, true);
  const auto contact = [&](const Vector3<>& tip) {
    Proxy proxy = world.proxy(0.0);
    proxy.step({tip[0], tip[1], 0.1});
    return proxy.step(tip);
  };
  const auto energy = [&](const Vector3<>& tip) {
    const Contact c = contact(tip);
    return 0.5 * c.stiffness * c.depth * c.depth;
  };
  std::mt19937 random(3);
  std::uniform_real_distribution<double> at(-0.45, 0.45);
  const double h = 1e-6;
  for (int k = 0; k < 60; ++k) {
    const Vector3<> tip(at(random), at(random), -0.05);
    Vector3<> gradient;
    for (int a = 0; a < 3; ++a) gradient[a] = (energy(tip + h * Vector3<>::Unit(a)) - energy(tip - h * Vector3<>::Unit(a))) / (2.0 * h);
    EXPECT_LT((contact(tip).force + gradient).norm(), 1e-4 * gradient.norm()) << k;
  }
}

// Law: a surface without stiffness presses nothing on, so that no friction holds the tip.
TEST(ProxyLaws, ASurfaceWithoutStiffnessDoesNotHold) {
  Surface s;
  s.stiffness = {0.0};
  s.tangential = 500.0;
  s.static_friction = s.dynamic_friction = std::numeric_limits<double>::infinity();
  const World world(shapes::box({1.0, 1.0, 0.5}, 3), s);
  Proxy proxy = world.proxy(0.0);
  proxy.step({0.0, 0.0, 1.0});
  for (int k = 0; k < 20; ++k) EXPECT_LT(proxy.step({0.01 * k, 0.0, 0.4}).force.norm(), 1e-9) << k;
}

// Law: around a vertex without creases, closed or on a border, every face has the same shaded normal there.
TEST(ProxyLaws, TheShadedNormalOfAVertexIsOneForAllItsFaces) {
  const Shape dome = shapes::sheet(5, 0.5, [](double x, double y) { return 0.3 * x * x - 0.4 * y * y + 0.1 * x * y; });
  for (const bool open : {true, false}) {
    const Shape shape = open ? dome : shapes::ball(2, 1.0, 0.05);
    const World world(shape, {}, open);
    const ForceShading shading(world.mesh, 1.4);
    std::vector<Vector3<>> seen(shape.vertices.size(), Vector3<>::Zero());
    for (std::int32_t f = 0; f < world.mesh.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& face = world.mesh.face(f);
        Vector3<>& known = seen[static_cast<std::size_t>(face.vertex[k])];
        const Vector3<> normal = shading.normal_at(world.mesh, f, face.corner[k]);
        EXPECT_TRUE(known.isZero(0.0) || (normal - known).norm() < 1e-9) << f;
        known = normal;
      }
  }
}

/// A prism over a polygon with a notch of 14 degrees that is cut almost to its base.
Shape notched_prism() {
  const double outline[7][2] = {{-1, 0}, {1, 0}, {1, 1}, {0.1, 1}, {0, 0.2}, {-0.1, 1}, {-1, 1}};
  Shape s;
  for (const double z : {-1.0, 1.0})
    for (const auto& p : outline) s.vertices.emplace_back(p[0], p[1], z);
  for (const auto& t : {std::array{0, 1, 4}, std::array{1, 2, 3}, std::array{1, 3, 4}, std::array{4, 5, 6}, std::array{4, 6, 0}}) {
    s.triangles.push_back({t[0] + 7, t[1] + 7, t[2] + 7});
    s.triangles.push_back({t[0], t[2], t[1]});
  }
  for (int i = 0; i < 7; ++i) {
    const int j = (i + 1) % 7;
    s.triangles.push_back({i, j, j + 7});
    s.triangles.push_back({i, j + 7, i + 7});
  }
  return s;
}

// Law: a proxy that begins near a reflex edge touches if and only if the tip is inside (Baerentzen and Aanaes 2005).
TEST(ProxyLaws, ATipBeginsInsideWhereTheClosedFormSaysSo) {
  const World world(notched_prism());
  std::mt19937 random(5);
  std::uniform_real_distribution<double> aside(-0.15, 0.15), along(0.02, 0.6), depth(-1.2, 1.2);
  int inside_count = 0;
  for (int k = 0; k < 3000; ++k) {
    const Vector3<> tip(aside(random), along(random), depth(random));
    const bool in_notch = tip[1] > 0.2 && std::fabs(tip[0]) < 0.1 * (tip[1] - 0.2) / 0.8;
    const bool inside = !in_notch && std::fabs(tip[2]) < 1.0;
    Proxy proxy = world.proxy(0.0);
    EXPECT_EQ(proxy.step(tip).touching, inside) << tip.transpose();
    inside_count += inside ? 1 : 0;
  }
  EXPECT_GT(inside_count, 1000);
  EXPECT_LT(inside_count, 2900);
}

// Law: a sphere has the stiffness of the point where it touches, also around an edge, where its center is beside the face.
TEST(ProxyLaws, ASphereHasTheStiffnessOfThePointThatItTouches) {
  const Shape shape = shapes::box({1.0, 1.0, 0.5}, 4);
  const auto stiffness = [](const Vector3<>& x) { return 1000.0 + 500.0 * x[0] + 200.0 * x[1]; };
  Surface s;
  s.stiffness.clear();
  for (const Vector3<>& v : shape.vertices) s.stiffness.push_back(stiffness(v));
  const World world(shape, s);
  const double radius = 0.2;
  for (double angle = 0.1; angle < 1.5; angle += 0.2) {
    Proxy proxy = world.proxy(radius);
    const Vector3<> edge(1.0, 0.1, 0.5), out(std::sin(angle), 0.0, std::cos(angle));
    proxy.step(edge + 0.5 * out);
    const Contact& c = proxy.step(edge + 0.05 * out);
    ASSERT_TRUE(c.touching);
    EXPECT_NEAR(c.stiffness, stiffness(edge), 1e-3) << angle;
    EXPECT_NEAR(c.force.norm(), stiffness(edge) * 0.15, 1e-3) << angle;
  }
}

// Law: friction holds a sphere at its place on a moving surface, also around an edge.
TEST(ProxyLaws, AMovingEdgeTakesASphereAlong) {
  Surface s;
  s.static_friction = s.dynamic_friction = std::numeric_limits<double>::infinity();
  s.tangential = 1000.0;
  const Shape shape = shapes::box({1.0, 1.0, 0.5}, 4);
  std::vector<std::int32_t> all;
  for (std::size_t v = 0; v < shape.vertices.size(); ++v) all.push_back(static_cast<std::int32_t>(v));
  for (const double angle : {0.0, 0.3, 0.8, 1.2}) {
    World world(shape, s);
    palpate::mesh::MeshUpdater updater(world.mesh);
    Proxy proxy = world.proxy(0.2);
    const Vector3<> edge(1.0, 0.1, 0.5), out(std::sin(angle), 0.0, std::cos(angle)), shift(0.03, -0.02, 0.01);
    proxy.step(edge + 0.5 * out);
    const Vector3<> before = proxy.step(edge + 0.15 * out).position;
    const auto attachment = proxy.attach();
    std::vector<Vector3<>> to;
    for (const Vector3<>& v : shape.vertices) to.emplace_back(v + shift);
    ASSERT_EQ(updater.move(world.mesh, world.tree, all.data(), to.data(), all.size()), palpate::mesh::TriangleMesh::none);
    proxy.reattach(attachment);
    EXPECT_LT((proxy.step(edge + 0.15 * out).position - before - shift).norm(), 1e-6) << angle;
  }
}

// Law: below the point where the shaded normals meet, a field keeps its gradient along the surface.
TEST(ProxyLaws, TheSlopeOfAFieldIsKeptBelowTheCenterOfCurvature) {
  const World world(shapes::ball(6, 1.0));
  const ForceShading shading(world.mesh, 1.0);
  for (std::int32_t f = 0; f < world.mesh.size(); f += 7) {
    const auto& face = world.mesh.face(f);
    const Vector3<> x = (face.corner[0] + face.corner[1] + face.corner[2]) / 3.0, along = (face.corner[1] - face.corner[0]).normalized();
    EXPECT_LT((shading.slope_at_depth(world.mesh, f, x, 0.0, along) - along).norm(), 1e-12);
    EXPECT_NEAR(shading.slope_at_depth(world.mesh, f, x, 0.5, along).norm(), 2.0, 0.1) << f;
    for (const double depth : {0.95, 1.0, 1.05}) EXPECT_EQ(shading.slope_at_depth(world.mesh, f, x, depth, along), along) << f;
  }
}

// Law: a proxy that is at the cone to rounding does not slide, and one beyond it does.
TEST(ProxyLaws, RoundingIsNoSliding) {
  Surface s;
  s.static_friction = s.dynamic_friction = 0.5;
  const World world(shapes::box({1.0, 1.0, 0.5}, 3), s);
  for (const double radius : {0.0, 0.05}) {
    Proxy proxy = world.proxy(radius);
    const double depth = 0.1, height = 0.5 + radius - depth;
    proxy.step({0.0, 0.0, 1.0});
    proxy.step({0.0, 0.0, height});
    const double x = proxy.step({0.5 * depth * (1.0 + 1e-10), 0.0, height}).position[0];
    EXPECT_LT(x, 1e-10);
    EXPECT_FALSE(proxy.sliding()) << radius;
    proxy.step({0.5 * depth + 1e-3, 0.0, height});
    EXPECT_TRUE(proxy.sliding()) << radius;
  }
}

// Law: a valley holds a sliding proxy by viscous friction in the same way, however many vertices it passes.
TEST(ProxyLaws, ViscousFrictionInAValleyDoesNotDependOnItsVertices) {
  Surface s;
  s.viscous = 2.0;
  std::vector<Vector3<>> first;
  for (const int cells : {1, 5}) {
    Shape box = shapes::box({1.0, 1.0, 0.5}, cells);
    for (auto& t : box.triangles) std::swap(t[0], t[1]);  // the inside is free
    const World world(box, s, true);
    Proxy proxy = world.proxy(0.0);
    proxy.step({0.0, 0.1, 0.0});
    proxy.step({1.3, 0.1, 0.7});
    for (std::size_t k = 0; k < 8; ++k) {
      const Vector3<> position = proxy.step({1.3, 0.85, 0.7}).position;
      if (cells == 1) first.push_back(position);
      EXPECT_LT((position - first[k]).norm(), 1e-12) << k;
    }
  }
  EXPECT_LT(first.front()[1], 0.4);
  EXPECT_GT(first.back()[1], 0.7);
}

// Law: a point leaves an open sheet at its corner, as at its border.
TEST(ProxyLaws, APointLeavesASheetAtItsCorner) {
  const World world(shapes::sheet(5, 1.0, [](double, double) { return 0.0; }), {}, true);
  Proxy proxy = world.proxy(0.0);
  proxy.step({0.9, 0.9, 0.1});
  EXPECT_TRUE(proxy.step({0.9, 0.9, -0.1}).touching);
  EXPECT_FALSE(proxy.step({1.1, 1.1, -0.1}).touching);
}

/// A valley along y with walls z = |x| slope, open upwards, with vertices along its bottom.
Shape valley(double slope) {
  return shapes::sheet(4, 1.0, [slope](double x, double) { return slope * std::fabs(x); });
}

// Law: a point at the bottom of a notch sharper than 90 degrees stays on the wall that its tip enters, with the tip in front of the other
// wall.
TEST(ProxyLaws, APointAtTheBottomOfASharpNotchStaysOnTheWallThatItsTipEnters) {
  const double slope = 5.0;
  const World world(valley(slope), {}, true);
  for (const double side : {1.0, -1.0})
    for (const double under : {0.01, 0.05}) {
      Proxy proxy = world.proxy();
      proxy.step({0.0, 0.1, 1.0});
      ASSERT_LT((proxy.step({0.0, 0.1, -0.1}).position - Vector3<>(0.0, 0.1, 0.0)).norm(), 1e-12);
      const Vector3<> wall = Vector3<>(side, 0.0, slope).normalized(), out = Vector3<>(-side * slope, 0.0, 1.0).normalized();
      const Vector3<> foot = Vector3<>(0.0, 0.1, 0.0) + 0.5 * wall;
      const Contact& c = proxy.step(foot - under * out);
      EXPECT_TRUE(c.touching) << side;
      EXPECT_LT((c.position - foot).norm(), 1e-12) << side;
    }
}

// Law: a point follows the bottom of a sharp notch past its vertices, also while the tip is beyond one wall rather than below the bottom.
TEST(ProxyLaws, APointFollowsTheBottomOfASharpNotchPastItsVertices) {
  const World world(valley(5.0), {}, true);
  for (const double aside : {0.1, -0.1})
    for (const double end : {0.7, -0.7}) {
      Proxy proxy = world.proxy();
      proxy.step({0.0, 0.1, 1.0});
      proxy.step({0.0, 0.1, -0.1});
      proxy.step({aside, 0.1, -0.03});
      const Contact& c = proxy.step({aside, end, -0.03});
      EXPECT_TRUE(c.touching) << aside << ' ' << end;
      EXPECT_LT((c.position - Vector3<>(0.0, end, 0.0)).norm(), 1e-12) << aside << ' ' << end;
    }
}

// Law: force shading does not slow the motion along a ridge, where the shaded normal does not change: the proxy follows the tip exactly.
TEST(ProxyLaws, AShadedProxyFollowsTheTipAlongARidge) {
  Surface s;
  s.shading = 1.4;
  const World world(valley(-0.5), s, true);
  Proxy proxy = world.proxy();
  proxy.step({0.2, -0.6, 0.5});
  for (int k = 0; k < 5; ++k) proxy.step({0.2, -0.6, -0.2});
  for (const double y : {-0.3, -0.1, 0.2, 0.6}) {
    const Contact& c = proxy.step({0.2, y, -0.2});
    EXPECT_GT(std::fabs(c.normal[0]), 0.05);
    EXPECT_NEAR(c.position[1], y, 1e-13);
  }
}

// Law: below a shaded ball a field changes faster with the tip than with the surface. Around the ball at one depth, the work of a sphere
// across its normal is -depth^2 / 2 times the change of the stiffness.
TEST(ProxyLaws, TheWorkOfASphereAroundAShadedFieldIsTheChangeOfItsEnergy) {
  const Shape shape = shapes::ball(8, 1.0);
  Surface s;
  s.tangential = 0.0;
  s.field = palpate::mesh::FieldKind::continuous;
  s.shading = 1.0;
  for (const Vector3<>& v : shape.vertices) s.stiffness.push_back(1000.0 + 300.0 * v[2]);
  s.stiffness.erase(s.stiffness.begin());  // the default
  const World world(shape, s);
  Proxy proxy = world.proxy(0.5);
  Vector3<> last_tip(0.0, 0.0, 2.0), last_force = Vector3<>::Zero();
  proxy.step(last_tip);
  double work = 0.0, from = 0.0;
  for (double angle = 0.4; angle < 2.7; angle += 0.005) {
    const Vector3<> tip = 1.2 * Vector3<>(std::sin(angle), 0.1, std::cos(angle)).normalized();  // the center is at 1.5
    const Contact& c = proxy.step(tip);
    const Vector3<> force = c.force - c.force.dot(c.normal) * c.normal;
    if (from == 0.0)
      from = c.stiffness;
    else
      work += 0.5 * (force + last_force).dot(tip - last_tip);
    last_force = force;
    last_tip = tip;
  }
  const double change = -0.5 * 0.3 * 0.3 * (proxy.contact().stiffness - from);
  EXPECT_NEAR(work, change, 0.1 * change);
}

// Law: a shaded sphere that two faces hold has the mean of their shaded normals, weighted by the penetrations of the tip.
TEST(ProxyLaws, AShadedSphereHasTheMeanNormalOfItsFacesWeightedByPenetration) {
  const double slope = 0.4, radius = 0.3, y = 0.1;
  Surface s;
  s.shading = 1.4;
  const World world(valley(slope), s, true);
  const Vector3<> center(0.0, y, radius * std::sqrt(1.0 + slope * slope));
  for (const double aside : {-5e-4, -2e-4, 0.0, 5e-4}) {
    Proxy proxy = world.proxy(radius);
    proxy.step({0.0, y, 1.0});
    proxy.step({0.0, y, 0.1});
    const Vector3<> tip(aside, y, 0.1);
    const Contact& c = proxy.step(tip);
    ASSERT_LT((c.position - center).norm(), 1e-12);
    Vector3<> mean = Vector3<>::Zero();
    for (const double side : {-1.0, 1.0}) {
      const Vector3<> normal = Vector3<>(-side * slope, 0.0, 1.0).normalized(), foot = center - radius * normal;
      for (std::int32_t f = 0; f < world.mesh.size(); ++f) {
        if ((palpate::mesh::nearest_point(world.mesh.face(f), foot).point - foot).norm() > 1e-9) continue;
        mean += normal.dot(center - tip) * world.field.shading().normal_at(world.mesh, f, foot);
        break;
      }
    }
    EXPECT_LT((c.normal - mean.normalized()).norm(), 1e-9) << aside;
  }
}

/// Nearest point to `to` of the cone of motions that three unit normals admit: the nearest of all that are admissible.
Vector3<> nearest_in_cone(const std::array<Vector3<>, 3>& normal, const Vector3<>& to) {
  Vector3<> best = Vector3<>::Zero();
  const auto consider = [&](const Vector3<>& x) {
    for (const Vector3<>& n : normal)
      if (n.dot(x) < -1e-12) return;
    if ((x - to).norm() < (best - to).norm()) best = x;
  };
  consider(to);
  for (std::size_t i = 0; i < 3; ++i) {
    consider(to - normal[i].dot(to) * normal[i]);
    const Vector3<> line = normal[i].cross(normal[(i + 1) % 3]).normalized();
    consider(to.dot(line) * line);
  }
  return best;
}

// Law: the normal of a sphere that friction holds in a corner of three faces points from its tip to the nearest point that they admit.
TEST(ProxyLaws, TheNormalOfASphereInACornerPointsToTheNearestAdmissiblePoint) {
  Surface s;
  s.static_friction = s.dynamic_friction = 0.1;
  std::mt19937 random(4);
  std::normal_distribution<double> gauss;
  int seen = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::array<Vector3<>, 3> normal;
    Shape shape;
    Vector3<> sum = Vector3<>::Zero();
    for (Vector3<>& n : normal) {
      n = Vector3<>(gauss(random), gauss(random), 0.3 * std::fabs(gauss(random)) + 0.05).normalized();
      sum += n;
      const Vector3<> e = n.unitOrthogonal(), g = n.cross(e);
      const auto v = static_cast<std::int32_t>(shape.vertices.size());
      for (const double turn : {0.0, 2.0, 4.0}) shape.vertices.emplace_back(-n + 0.5 * std::cos(turn) * e + 0.5 * std::sin(turn) * g);
      shape.triangles.push_back({v, v + 1, v + 2});
    }
    if (std::fabs(normal[0].dot(normal[1].cross(normal[2]))) < 0.2) continue;
    if (std::min({sum.dot(normal[0]), sum.dot(normal[1]), sum.dot(normal[2])}) < 0.2) continue;
    const World world(shape, s, true);
    Proxy proxy = world.proxy(1.0);
    proxy.step(0.2 * sum);
    proxy.step(Vector3<>::Zero());
    if (proxy.step(-0.2 * sum).position.norm() > 1e-9) continue;
    for (int k = 0; k < 300; ++k) {
      const Vector3<> tip(gauss(random), gauss(random), gauss(random)), goal = nearest_in_cone(normal, tip);
      if (!(goal.norm() < 0.09 * (goal - tip).norm())) continue;  // friction does not hold it
      const Contact& c = proxy.step(tip);
      ASSERT_LT(c.position.norm(), 1e-9);
      ASSERT_LT((c.normal - (goal - tip).normalized()).norm(), 1e-6) << trial << ' ' << k;
      ++seen;
    }
  }
  EXPECT_GT(seen, 500);
}

}  // namespace
