// Contact of a rigid tip with an elastic half-space: Hertz, Sneddon, energy gradient; queries of the surface nodes.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/compliance.hpp>
#include <palpate/object/body_instance.hpp>
#include <random>
#include <type_traits>
#include <vector>

namespace {

using palpate::math::Vector3;

/// Surface of an elastic half-space, z up: mean displacement of square patches under uniform pressure on another, by Love's closed form at
/// the center for the patch itself and Boussinesq's point load elsewhere. Independent of finite elements.
struct HalfSpace {
  double modulus, width;  // E / (1 - nu^2), Pa; m
  palpate::deformable::SurfaceNodes nodes;
  std::vector<palpate::math::Vector3<>> points;

  HalfSpace(int side, double w, double e) : modulus(e), width(w) {
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) points.emplace_back(w * (i - 0.5 * (side - 1)), w * (j - 0.5 * (side - 1)), 0.0);
    nodes =
        palpate::deformable::SurfaceNodes(points, std::vector<palpate::math::Vector3<>>(points.size(), palpate::math::Vector3<>::UnitZ()),
                                          std::vector<double>(points.size(), w * w));
  }
  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const {
    // 1.1222 / w at the center of the own square; the mean over it is 0.9464 / w (Johnson 1985, eq. 3.25 ff.).
    if (i == j) return 2.9730 / (M_PI * modulus * width);
    return 1.0 / (M_PI * modulus * (points[static_cast<std::size_t>(i)] - points[static_cast<std::size_t>(j)]).norm());
  }
  [[nodiscard]] static double free_displacement(std::int32_t) { return 0.0; }
  static void advance(const std::int32_t*, const double*, int) {}
  static void reset() {}
};

// Hertz 1882: F = 4/3 E* sqrt(R) d^(3/2), contact radius sqrt(R d).
TEST(TipContact, SphereOnHalfSpaceMatchesHertz) {
  HalfSpace space(41, 0.5e-3, 20e3);
  palpate::deformable::TipContact<HalfSpace> contact(space.nodes, space);
  palpate::deformable::Tip tip;
  tip.radius = 20e-3;
  for (const double depth : {0.1e-3, 0.15e-3, 0.2e-3}) {
    tip.center = {0.1e-3, -0.2e-3, tip.radius - depth};
    const palpate::deformable::ContactResult& a = contact.step(tip);
    ASSERT_TRUE(a.solved);
    EXPECT_NEAR(a.force.z(), 4.0 / 3.0 * 20e3 * std::sqrt(tip.radius) * std::pow(depth, 1.5), 0.05 * a.force.z());
    EXPECT_NEAR(a.nodes * 0.25e-6, M_PI * tip.radius * depth, 0.2 * M_PI * tip.radius * depth);
    EXPECT_NEAR(a.energy, 0.4 * a.force.z() * depth, 0.05 * a.energy);
  }
  tip.center.z() = tip.radius + 1e-6;
  EXPECT_FALSE(contact.step(tip).touching);
  EXPECT_EQ(contact.last().force.norm(), 0.0);
}

// Sneddon 1946: a flat end of radius a has the stiffness 2 a E*, for any position between the nodes.
TEST(TipContact, FlatEndOnHalfSpaceMatchesSneddon) {
  HalfSpace space(41, 1e-3, 20e3);
  palpate::deformable::TipContact<HalfSpace> contact(space.nodes, space);
  palpate::deformable::Tip tip;
  tip.kind = palpate::deformable::Tip::Kind::flat;
  tip.radius = 5e-3;
  for (const double aside : {0.0, 0.2e-3, 0.35e-3, 0.5e-3}) {
    tip.center = {aside, 0.4 * aside, -1e-3};
    EXPECT_NEAR(contact.step(tip).force.z(), 2.0 * tip.radius * 20e3 * 1e-3, 0.04 * 0.2);
  }
}

// Central differences of the energy, for both tips, with a changing contact set.
TEST(TipContact, ForceIsTheGradientOfItsEnergy) {
  HalfSpace space(31, 1e-3, 20e3);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    palpate::deformable::TipContact<HalfSpace> contact(space.nodes, space);
    palpate::deformable::Tip tip;
    tip.kind = kind;
    tip.radius = 4e-3;
    for (int trial = 0; trial < 50; ++trial) {
      const double top = kind == palpate::deformable::Tip::Kind::sphere ? tip.radius : 0.0;
      const palpate::math::Vector3<> at(3e-3 * uniform(random), 3e-3 * uniform(random), top - 1e-3 * (1.2 + uniform(random)));
      tip.center = at;
      const palpate::math::Vector3<> force = contact.step(tip).force;
      palpate::math::Vector3<> slope;
      for (int a = 0; a < 3; ++a) {
        const double h = 1e-8;
        tip.center = at + h * palpate::math::Vector3<>::Unit(a);
        const double up = contact.step(tip).energy;
        tip.center = at - h * palpate::math::Vector3<>::Unit(a);
        slope[a] = (up - contact.step(tip).energy) / (2.0 * h);
      }
      EXPECT_LT((force + slope).norm(), 1e-4 * force.norm() + 1e-9);
    }
  }
}

// Penetration to four radii: the force increases with each step and is the energy gradient; the closed path down, sideways and up does no
// net work.
TEST(TipContact, ForceIsConservativeAtAnyDepth) {
  HalfSpace space(41, 1e-3, 20e3);
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    palpate::deformable::TipContact<HalfSpace> contact(space.nodes, space);
    palpate::deformable::Tip tip;
    tip.kind = kind;
    tip.radius = 3e-3;
    const double top = kind == palpate::deformable::Tip::Kind::sphere ? tip.radius : 0.0, down = 4.0 * tip.radius, step = 2e-5;
    tip.center = {0.2e-3, -0.3e-3, top};
    Vector3<> force = contact.step(tip).force;
    double work = 0.0, exchanged = 0.0;
    const auto go = [&](const Vector3<>& way) {
      tip.center += way;
      const palpate::deformable::ContactResult& a = contact.step(tip);
      const double part = -0.5 * (a.force + force).dot(way);
      work += part;
      exchanged += std::abs(part);
      force = a.force;
      return a;
    };
    for (int k = 1; k * step <= down; ++k) {
      const double before = force.z();
      const palpate::deformable::ContactResult a = go({0, 0, -step});
      ASSERT_TRUE(a.solved);
      ASSERT_TRUE(a.force.z() > before || k * step < 2e-4) << k * step;
      ASSERT_NEAR(work, a.energy, 2e-3 * a.energy + 1e-9) << k * step;
    }
    EXPECT_GT(force.z(), kind == palpate::deformable::Tip::Kind::sphere ? 2.0 * tip.radius * 20e3 * 3.0 * tip.radius
                                                                        : 0.95 * 2.0 * tip.radius * 20e3 * down);
    const Vector3<> deep = tip.center;
    for (int a = 0; a < 3; ++a) {
      const double h = 1e-7;
      tip.center = deep + h * Vector3<>::Unit(a);
      const double up = contact.step(tip).energy;
      tip.center = deep - h * Vector3<>::Unit(a);
      EXPECT_NEAR(force[a], -(up - contact.step(tip).energy) / (2.0 * h), 1e-4 * force.norm());
    }
    tip.center = deep;
    contact.step(tip);
    for (int k = 0; k < 250; ++k) {
      const palpate::deformable::ContactResult a = go({step, 0.4 * step, 0});
      ASSERT_TRUE(a.solved);
      ASSERT_NEAR(a.force.z(), force.z(), 0.1 * force.z());
      ASSERT_NEAR(work, a.energy, 3e-3 * a.energy) << k;
    }
    while (contact.last().touching) go({0, 0, step});
    EXPECT_LT(std::abs(work), 2e-3 * exchanged);
  }
}

// Contacts keep a reference to the nodes: temporaries are rejected.
using palpate::deformable::Compliance, palpate::deformable::SurfaceNodes;
static_assert(std::is_constructible_v<palpate::deformable::TipContact<Compliance>, const SurfaceNodes&, Compliance&>);
static_assert(!std::is_constructible_v<palpate::deformable::TipContact<Compliance>, SurfaceNodes, Compliance&>);
static_assert(!std::is_constructible_v<palpate::deformable::TipContact<Compliance>, const SurfaceNodes, Compliance&>);
static_assert(!std::is_constructible_v<palpate::deformable::TipContact<Compliance>, SurfaceNodes&, Compliance>);
static_assert(std::is_constructible_v<palpate::object::LinearBodyObject<Compliance>, const SurfaceNodes&, Compliance>);
static_assert(!std::is_constructible_v<palpate::object::LinearBodyObject<Compliance>, SurfaceNodes, Compliance>);

// Nodes on the far side of a thin plate are not returned.
TEST(SurfaceNodes, QueryIgnoresTheFarSide) {
  const std::vector<palpate::math::Vector3<>> points{{0, 0, 0}, {0, 0, -1e-3}};
  const std::vector<palpate::math::Vector3<>> normals{palpate::math::Vector3<>::UnitZ(), -palpate::math::Vector3<>::UnitZ()};
  const palpate::deformable::SurfaceNodes nodes(points, normals, {1e-6, 1e-6});
  palpate::deformable::Tip tip;
  tip.center = {0, 0, 4e-3};
  int found = 0;
  nodes.query_tip(tip, [&](std::int32_t node, double depth) {
    EXPECT_EQ(node, 0);
    EXPECT_NEAR(depth, 1e-3, 1e-15);
    ++found;
  });
  EXPECT_EQ(found, 1);
  tip.center.x() = std::nan("");
  nodes.query_tip(tip, [&](std::int32_t, double) { FAIL(); });
}

// A sphere circles a ball and leaves contact repeatedly. The force points outward everywhere with constant magnitude: the contact normal
// follows the tip. The body frame is rotated and translated.
TEST(BodyInstance, ContactNormalFollowsASphereAroundABall) {
  const int n = 1000;
  std::vector<Vector3<>> points, normals;
  for (int i = 0; i < n; ++i) {  // Fibonacci lattice
    const double z = 1.0 - (2.0 * i + 1.0) / n, r = std::sqrt(1.0 - z * z), turn = 2.399963229728653 * i;
    normals.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
    points.push_back(0.015 * normals.back());
  }
  std::vector<float> full(9 * static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 0.0F);
  for (std::size_t k = 0; k < 3 * static_cast<std::size_t>(n); ++k) full[k * 3 * static_cast<std::size_t>(n) + k] = 1e-3F;
  const palpate::deformable::SurfaceNodes nodes(points, normals, std::vector<double>(points.size(), 4.0 * 3.14159 * 2.25e-4 / n));
  const auto body = std::make_shared<palpate::object::LinearBodyObject<palpate::deformable::Compliance>>(
      nodes, palpate::deformable::Compliance(nodes, full.data()));
  palpate::object::BodyPlacement touched;
  touched.body = body;
  touched.origin = {0.3, -0.2, 0.1};
  touched.rotation = Eigen::AngleAxisd(1.1, Vector3<>(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  touched.radius = 8e-3;
  palpate::object::BodyInstance touch(touched);
  double first = 0.0;
  int apart = 0;
  for (int k = 0; k < 4000; ++k) {
    const double angle = 2e-3 * k;
    const Vector3<> way = touched.rotation * Vector3<>(std::sin(angle), 0.2, std::cos(angle)).normalized();
    const double lift = k % 500 < 100 ? 2e-3 : -1e-3;
    const Vector3<> force = touch.step({touched.origin + (0.023 + lift) * way, 1000.0}).force;
    if (lift > 0.0) {
      EXPECT_FALSE(touch.body().last().touching);
      ++apart;
      continue;
    }
    ASSERT_TRUE(touch.body().last().touching && touch.body().last().solved);
    EXPECT_LT(force.normalized().dot(way), -0.995);
    EXPECT_LT(touch.result().deflection.normalized().dot(way), -0.98);
    if (first == 0.0) first = force.norm();
    EXPECT_NEAR(force.norm(), first, 0.25 * first);
  }
  EXPECT_EQ(apart, 800);
  // A new instance starts at rest, independent of earlier ones.
  const palpate::object::BodyInstance again(touched);
  EXPECT_EQ(again.body().last().nodes, 0);
}

/// Nodes on a line that turn about its middle and yield alone: a force on one side raises the other.
struct Seesaw {
  palpate::deformable::SurfaceNodes nodes;
  std::vector<Vector3<>> points;

  Seesaw() {
    for (int i = -10; i <= 10; ++i) points.emplace_back(1e-3 * i, 0.0, 0.0);
    nodes = palpate::deformable::SurfaceNodes(points, std::vector<Vector3<>>(points.size(), Vector3<>::UnitZ()),
                                              std::vector<double>(points.size(), 1e-6));
  }
  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const {
    return (i == j ? 1e-3 : 0.0) + 1e2 * points[static_cast<std::size_t>(i)].x() * points[static_cast<std::size_t>(j)].x();
  }
  [[nodiscard]] static double free_displacement(std::int32_t) { return 0.0; }
  static void advance(const std::int32_t*, const double*, int) {}
  static void reset() {}
};

// Law: no node is in the tip, neither those that it presses nor those that the pressed ones raise.
TEST(TipContact, NodesThatTheForcesRaiseTouchToo) {
  Seesaw body;
  palpate::deformable::TipContact<Seesaw> contact(body.nodes, body);
  palpate::deformable::Tip tip;
  tip.radius = 30e-3;
  int raised = 0;
  for (int k = 1; k <= 60; ++k) {
    tip.center = {3e-3, 0.0, tip.radius - 1e-5 * k};
    const palpate::deformable::ContactResult& a = contact.step(tip);
    ASSERT_TRUE(a.solved);
    const double most = 1e-5 * k;
    for (std::int32_t i = 0; i < body.nodes.size(); ++i) {
      const double x = body.points[static_cast<std::size_t>(i)].x() - tip.center.x();
      const double depth = std::sqrt(tip.radius * tip.radius - x * x) - tip.center.z();
      double moved = 0.0;
      for (int c = 0; c < a.nodes; ++c) {
        moved += contact.forces()[c] * body.compliance(i, contact.contact_nodes()[c]);
        raised += contact.contact_nodes()[c] == i && depth < -0.3 * most ? 1 : 0;
      }
      ASSERT_GE(moved - depth, -1e-6 * most) << k << ' ' << i;
    }
  }
  EXPECT_GT(raised, 0);
}

// Law: the direction of a contact is kept within 45 degrees of its force, and turned to 45 degrees beyond.
TEST(TipContact, TheDirectionFollowsTheForceBeyond45Degrees) {
  HalfSpace space(15, 1e-3, 20e3);
  for (const double degrees : {0.0, 30.0, 44.0, 50.0, 60.0}) {
    palpate::deformable::TipContact<HalfSpace> contact(space.nodes, space);
    palpate::deformable::Tip tip;
    tip.center = {0.0, 0.0, tip.radius - 5e-4};
    const double angle = degrees * M_PI / 180.0;
    tip.outward = {std::sin(angle), 0.0, std::cos(angle)};
    ASSERT_TRUE(contact.step(tip).touching) << degrees;
    const double kept = std::min(angle, 0.25 * M_PI);
    EXPECT_LT((contact.outward(tip) - Vector3<>(std::sin(kept), 0.0, std::cos(kept))).norm(), 1e-9) << degrees;
  }
}

}  // namespace
