// Contact by the tip's signed distance: one energy, Hertz and Sneddon, closed paths, invariance, loss of contact.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <palpate/deformable/contact/signed_distance_contact.hpp>
#include <palpate/object/signed_distance_body.hpp>
#include <random>
#include <type_traits>

#include "support/contact_bodies.hpp"

namespace {

using contact_bodies::SurfaceBody;
using palpate::deformable::ContactResult, palpate::deformable::SignedDistanceContact, palpate::deformable::TipGeometry,
    palpate::math::Vector3;

SignedDistanceContact contact_of(const SurfaceBody& body) {
  return {body.nodes, body.compliance, body.patches};
}

/// Move the tip along a line and let the forces converge at its end.
ContactResult press(SignedDistanceContact& contact, const TipGeometry& tip, const Vector3<>& from, const Vector3<>& to, int steps) {
  for (int k = 0; k <= steps; ++k) contact.step(tip, from + (to - from) * k / steps);
  for (int k = 0; k < 6; ++k) contact.step(tip, to);
  return contact.last();
}

// Hertz 1882: F = 4/3 E* sqrt(R) d^(3/2), energy 2/5 F d. The contact radius is 1.4 to 2.8 cells.
TEST(SignedDistanceContact, SphereOnHalfSpaceMatchesHertz) {
  const SurfaceBody space = contact_bodies::half_space(16, 8e-3, 20e3);
  SignedDistanceContact contact = contact_of(space);
  const TipGeometry tip = TipGeometry::sphere(20e-3);
  for (const double depth : {0.1e-3, 0.2e-3, 0.4e-3})
    for (const double aside : {0.0, 0.3e-3, 0.5e-3}) {
      const Vector3<> over(aside, -0.6 * aside, tip.radius);
      const ContactResult a = press(contact, tip, over, over - depth * Vector3<>::UnitZ(), 20);
      ASSERT_TRUE(a.solved);
      const double hertz = 4.0 / 3.0 * 20e3 * std::sqrt(tip.radius) * std::pow(depth, 1.5);
      EXPECT_NEAR(a.force.z(), hertz, 0.05 * hertz) << depth << " " << aside;
      EXPECT_LT(a.force.head<2>().norm(), 0.03 * hertz);
      EXPECT_NEAR(a.energy, 0.4 * hertz * depth, 0.06 * a.energy);
      EXPECT_NEAR(a.deflection.z(), -0.6 * depth, 0.25 * depth);
    }
  contact.step(tip, {0.0, 0.0, tip.radius + 1e-6});
  contact.step(tip, {0.0, 0.0, tip.radius + 1e-6});
  EXPECT_FALSE(contact.last().touching);
  EXPECT_EQ(contact.last().force.norm(), 0.0);
}

// Sneddon 1946: a flat end of radius a has the stiffness 2 a E*.
TEST(SignedDistanceContact, FlatEndOnHalfSpaceMatchesSneddon) {
  const SurfaceBody space = contact_bodies::half_space(16, 8e-3, 20e3);
  SignedDistanceContact contact = contact_of(space);
  const TipGeometry tip = TipGeometry::cylinder(4e-3, 1e-3, Vector3<>::UnitZ());
  for (const double aside : {0.0, 0.2e-3, 0.5e-3}) {
    const ContactResult a = press(contact, tip, {aside, 0.4 * aside, 0.0}, {aside, 0.4 * aside, -0.2e-3}, 20);
    ASSERT_TRUE(a.solved);
    EXPECT_NEAR(a.force.z(), 2.0 * tip.radius * 20e3 * 0.2e-3, 0.06 * a.force.z()) << aside;
  }
}

// The force keeps to Sneddon's to 0.6 of the radius, and nodes that slide over the edge do not change it suddenly.
TEST(SignedDistanceContact, ADeepFlatEndSlidesWithoutSteps) {
  const SurfaceBody space = contact_bodies::half_space(16, 20e-3, 20e3);
  SignedDistanceContact contact = contact_of(space);
  const TipGeometry tip = TipGeometry::cylinder(5e-3, 2.5e-3, Vector3<>::UnitZ());
  const Vector3<> way = 2.5e-6 * Vector3<>(1.0, 0.37, 0.0).normalized();
  for (const double share : {0.2, 0.6, 1.0}) {
    const double depth = share * tip.radius, sneddon = 2.0 * tip.radius * 20e3 * depth;
    Vector3<> at(-2.5e-3, -1.3e-3, -depth);
    press(contact, tip, {at.x(), at.y(), 0.0}, at, 500);
    Vector3<> last = contact.last().force;
    for (int k = 0; k < 1200; ++k) {
      at += way;
      const ContactResult& a = contact.step(tip, at);
      ASSERT_TRUE(a.solved && a.touching);
      ASSERT_LT((a.force - last).norm(), 1e-3 * a.force.norm()) << share << " " << k;
      EXPECT_NEAR(a.force.z(), sneddon, (share < 0.8 ? 0.05 : 0.15) * sneddon) << share << " " << k;
      last = a.force;
    }
  }
}

// Central differences of the energy on a curved body and on a box, for all shapes of tips.
TEST(SignedDistanceContact, ForceIsTheNegativeGradientOfItsEnergy) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int jumps = 0;
  const Vector3<> axis = Vector3<>(0.1, 0.2, 1.0).normalized();
  for (const shapes::Shape& shape : {shapes::ball(3, 10e-3), shapes::box({8e-3, 8e-3, 8e-3}, 4)}) {
    const SurfaceBody body = contact_bodies::soft(shape, 1e4, 6e-3, 4e-3);
    for (const TipGeometry& tip :
         {TipGeometry::sphere(5e-3), TipGeometry::capsule(4e-3, 5e-3, axis), TipGeometry::cylinder(4e-3, 1e-3, axis)})
      for (int round = 0; round < 4; ++round) {
        SignedDistanceContact contact = contact_of(body);
        const Vector3<> aside(4e-3 * uniform(random), 4e-3 * uniform(random), 0.0);
        const double start = tip.shape == TipGeometry::Shape::cylinder ? 10e-3 : 10e-3 + tip.radius;
        const Vector3<> at = aside + Vector3<>(0.0, 0.0, start - 2.5e-3);
        press(contact, tip, at + 4e-3 * Vector3<>::UnitZ(), at, 60);
        for (int k = 0; k < 20; ++k) contact.step(tip, at);
        const ContactResult here = contact.last();
        ASSERT_TRUE(here.touching);
        Vector3<> slope;
        const double step = 2e-5;
        for (int a = 0; a < 3; ++a) {
          const auto energy = [&](double way) {
            for (int k = 0; k < 12; ++k) contact.step(tip, at + way * Vector3<>::Unit(a));
            EXPECT_LT(contact.iterations(), SignedDistanceContact::max_iterations);
            return contact.last().energy;
          };
          slope[a] = (energy(step) - energy(-step)) / (2.0 * step);
        }
        for (int k = 0; k < 12; ++k) contact.step(tip, at);
        const ContactResult again = contact.last();
        if ((again.force - here.force).norm() > 1e-3 * here.force.norm()) {  // a second minimum: a jump to it only loses energy
          EXPECT_LE(again.energy, here.energy);
          ++jumps;
          continue;
        }
        EXPECT_LT((slope + here.force).norm(), 3e-3 * here.force.norm()) << round;
      }
  }
  EXPECT_LE(jumps, 1);
}

/// Closed path around a body whose surface lies at `surface(direction)` from its center. It begins and ends free.
struct Loop {
  double phase, turns, tilt, depth;
  template <class Surface>
  [[nodiscard]] Vector3<> at(double s, double radius, Surface surface) const {
    const double angle = phase + turns * 2.0 * M_PI * s, in = std::pow(std::sin(M_PI * s), 2);
    const Vector3<> direction = Vector3<>(std::cos(angle), std::sin(angle), tilt * std::sin(2.0 * M_PI * s + phase)).normalized();
    return (surface(direction) + 2.0 * radius - (radius + depth) * in) * direction;
  }
};

// The work around a closed path is zero, over a smooth body and over edges and corners, for spheres and capsules.
TEST(SignedDistanceContact, NoClosedPathGainsWork) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (const bool round_body : {true, false}) {
    const SurfaceBody body =
        contact_bodies::soft(round_body ? shapes::ball(4, 10e-3) : shapes::box({10e-3, 10e-3, 10e-3}, 5), 1e4, 6e-3, 4e-3);
    const auto surface = [round_body](const Vector3<>& d) { return round_body ? 10e-3 : 10e-3 / d.cwiseAbs().maxCoeff(); };
    for (const TipGeometry& tip : {TipGeometry::sphere(5e-3), TipGeometry::capsule(4e-3, 3e-3, Vector3<>::UnitZ())})
      for (int round = 0; round < 2; ++round) {
        SignedDistanceContact contact = contact_of(body);
        const Loop loop{6.0 * uniform(random), 0.5 + uniform(random), 0.4, 2e-3};
        double gained = 0.0, exchanged = 0.0, worst = 0.0, largest = 0.0;
        Vector3<> force = Vector3<>::Zero(), place = loop.at(0.0, tip.radius, surface);
        constexpr int ticks = 8000;
        for (int k = 1; k <= ticks; ++k) {
          const Vector3<> next = loop.at(static_cast<double>(k) / ticks, tip.radius, surface);
          const ContactResult& a = contact.step(tip, next);
          const double work = k > 1 ? 0.5 * (a.force + force).dot(next - place) : 0.0;
          gained += work;
          exchanged += std::abs(work);
          largest = std::max(largest, a.energy);
          worst = std::max(worst, std::abs(a.energy + gained));
          force = a.force;
          place = next;
          ASSERT_FALSE(a.lost);
        }
        ASSERT_GT(exchanged, 0.0);
        EXPECT_EQ(force.norm(), 0.0);
        EXPECT_LT(gained, 1e-5 * exchanged) << round;
        EXPECT_LT(worst, 1e-3 * largest) << round;
      }
  }
}

// Counts of three encoders move the tip by steps in three directions.
TEST(SignedDistanceContact, OneIterationIsTypicalUnderEncoderCounts) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(8, 10e-3), 1e4, 6e-3, 4e-3);
  const TipGeometry tip = TipGeometry::sphere(5e-3);
  SignedDistanceContact contact = contact_of(body);
  const double step = 4e-3 * tip.radius;
  Eigen::Matrix3d joints;
  joints << 0.9, 0.3, 0.1, -0.2, 1.0, 0.2, 0.1, -0.3, 0.8;
  const Eigen::Matrix3d angles = joints.inverse();
  constexpr int ticks = 2000;
  int more = 0;
  for (int k = 0; k < ticks; ++k) {
    const double s = 2.0 * M_PI * k / ticks;
    const Vector3<> way(3e-3 * std::sin(2.0 * s), 2e-3 * std::sin(3.0 * s), 15e-3 - 2e-3 * std::sin(0.5 * s));
    const ContactResult& a = contact.step(tip, joints * (angles * way / step).array().round().matrix() * step);
    ASSERT_TRUE(a.solved);
    if (contact.iterations() > 1) ++more;
  }
  EXPECT_LT(more, 0.35 * ticks);
}

// Ticks of a tip that moves by up to 5 % of its radius evaluate only the nodes that the tip may have reached. The force of a body without
// memory depends on the place alone.
TEST(SignedDistanceContact, AFastTipHasTheForceOfATipAtRest) {
  const SurfaceBody space = contact_bodies::half_space(24, 24e-3, 20e3);
  const TipGeometry tip = TipGeometry::sphere(4e-3);
  for (const double share : {0.01, 0.03, 0.049, 0.06}) {
    SignedDistanceContact fast = contact_of(space), resting = contact_of(space);
    const double step = share * tip.radius;
    double largest = 0.0, error = 0.0;
    for (int k = 0; k * step < 14e-3; ++k) {
      const double way = k * step;
      const Vector3<> at(-7e-3 + way, -2e-3 + 0.4 * way, tip.radius - 0.8e-3 * std::sin(M_PI * way / 14e-3));
      const Vector3<> force = fast.step(tip, at).force;
      ASSERT_TRUE(fast.last().solved) << share << " " << k;
      largest = std::max(largest, press(resting, tip, at, at, 0).force.norm());
      error = std::max(error, (force - resting.last().force).norm());
    }
    EXPECT_LT(error, 2e-3 * largest) << share;
  }
}

TEST(SignedDistanceContact, DoesNotDependOnTheFrame) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3<>(0.3, -0.7, 0.4).normalized()).toRotationMatrix();
  const shapes::Shape ball = shapes::ball(3, 10e-3);
  const shapes::Shape turned = shapes::moved(ball, [&turn](const Vector3<>& v) { return Vector3<>(turn * v); });
  const auto give = [&ball](std::size_t i, std::size_t j) { return 6e-3 * std::exp(-(ball.vertices[i] - ball.vertices[j]).norm() / 4e-3); };
  const SurfaceBody one(ball, 1e4,
                        [&give](std::size_t i, std::size_t j) { return Eigen::Matrix3d(give(i, j) * Eigen::Matrix3d::Identity()); });
  const SurfaceBody two(turned, 1e4,
                        [&give](std::size_t i, std::size_t j) { return Eigen::Matrix3d(give(i, j) * Eigen::Matrix3d::Identity()); });
  SignedDistanceContact first = contact_of(one), second = contact_of(two);
  const TipGeometry tip = TipGeometry::capsule(4e-3, 3e-3, Vector3<>::UnitX());
  TipGeometry other = tip;
  other.axis = turn * tip.axis;
  double largest = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double s = k / 400.0;
    const Vector3<> at = (14.1e-3 - 3e-3 * std::sin(M_PI * s)) * Vector3<>(std::sin(s), 0.2 * s, std::cos(s)).normalized();
    const ContactResult& a = first.step(tip, at);
    const ContactResult& b = second.step(other, turn * at);
    largest = std::max(largest, a.force.norm());
    EXPECT_LT((turn * a.force - b.force).norm(), 1e-3 * largest + 1e-9);
  }
  EXPECT_GT(largest, 0.05);
}

// A thick body is pushed through: energy is lost and none gained, and the contact begins anew outside.
TEST(SignedDistanceContact, ReportsThatTheTipWasPushedThrough) {
  const SurfaceBody space = contact_bodies::half_space(16, 16e-3, 20e3);
  SignedDistanceContact contact = contact_of(space);
  const TipGeometry tip = TipGeometry::sphere(4e-3);
  double work = 0.0, lost_at = 0.0, force = 0.0, before = 0.0;
  const auto go = [&](double from, double to) {
    for (int k = 1; k <= 1500; ++k) {
      const double depth = from + (to - from) * k / 1500.0;
      const ContactResult& a = contact.step(tip, {0.2e-3, 0.3e-3, tip.radius - depth});
      work += 0.5 * (a.force.z() + force) * (to - from) / 1500.0;
      force = a.force.z();
      if (std::abs(depth - 2e-3) < 0.5 * std::abs(to - from) / 1500.0) before = force;
      if (a.lost && lost_at == 0.0) lost_at = depth;
      if (a.lost) {
        EXPECT_EQ(force, 0.0);
      }
      EXPECT_GE(force, -1e-9);
    }
  };
  go(-0.5e-3, 12e-3);
  const double first = before;
  EXPECT_GT(lost_at, tip.radius);
  EXPECT_LT(lost_at, 3.0 * tip.radius);
  EXPECT_TRUE(contact.last().lost);
  go(12e-3, -1e-3);
  EXPECT_GT(work, 0.0);
  EXPECT_FALSE(contact.last().lost);
  go(-1e-3, 3e-3);
  EXPECT_NEAR(before, first, 0.01 * first);
}

TEST(SignedDistanceContact, HasNoForceForATipThatBeginsInside) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(4, 10e-3), 1e4, 6e-3, 4e-3);
  for (const double radius : {1e-3, 5e-3}) {
    SignedDistanceContact contact = contact_of(body);
    for (const double height : {0.0, 2e-3, 5e-3}) {
      const ContactResult& a = contact.step(TipGeometry::sphere(radius), {0.0, 0.0, height});
      EXPECT_TRUE(a.lost) << radius << " " << height;
      EXPECT_EQ(a.force.norm(), 0.0);
      EXPECT_FALSE(a.touching);
    }
  }
}

using Tips = std::array<SignedDistanceContact::PlacedTip, 2>;

SignedDistanceContact two_tips_on(const SurfaceBody& body) {
  return {body.nodes, body.compliance, body.patches, {}, nullptr, 2};
}

// Betti 1872: a motion of one tip changes the force on the other as the other way round. The forces are the gradient of one energy.
TEST(SignedDistanceContact, TwoTipsAreReciprocal) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(4, 10e-3), 1e4, 6e-3, 8e-3);
  SignedDistanceContact contact = two_tips_on(body);
  const Vector3<> one = 13e-3 * Vector3<>(0.45, 0.1, 1.0).normalized(), two = 12.3e-3 * Vector3<>(-0.45, -0.1, 1.0).normalized();
  const auto settle = [&](const Vector3<>& a, const Vector3<>& b) {
    const Tips tips{{{TipGeometry::sphere(5e-3), a}, {TipGeometry::sphere(4e-3), b}}};
    for (int k = 0; k < 20; ++k) contact.step(tips.data());
  };
  for (int k = 0; k <= 60; ++k) settle(one * (1.4 - 0.4 * k / 60.0), two * (1.4 - 0.4 * k / 60.0));
  const double step = 2e-5;
  Eigen::Matrix3d on_two, on_one;
  Eigen::Matrix<double, 6, 1> slope;
  for (int a = 0; a < 6; ++a) {
    const Vector3<> first = a < 3 ? Vector3<>(step * Vector3<>::Unit(a)) : Vector3<>(Vector3<>::Zero());
    const Vector3<> second = a < 3 ? Vector3<>(Vector3<>::Zero()) : Vector3<>(step * Vector3<>::Unit(a - 3));
    settle(one + first, two + second);
    const double high = contact.last().energy;
    const Vector3<> far = contact.last(a < 3 ? 1 : 0).force;
    settle(one - first, two - second);
    slope[a] = (high - contact.last().energy) / (2.0 * step);
    (a < 3 ? on_two : on_one).col(a % 3) = (far - contact.last(a < 3 ? 1 : 0).force) / (2.0 * step);
  }
  settle(one, two);
  ASSERT_TRUE(contact.last(0).touching && contact.last(1).touching);
  EXPECT_LT((on_two - on_one.transpose()).norm(), 0.02 * on_two.norm());
  EXPECT_LT((slope.head<3>() + contact.last(0).force).norm(), 5e-3 * contact.last(0).force.norm());
  EXPECT_LT((slope.tail<3>() + contact.last(1).force).norm(), 5e-3 * contact.last(1).force.norm());
}

// Far apart each tip has the force of a tip alone, in any order; in one place both share it. Two layers are stiffer than one.
TEST(SignedDistanceContact, TwoTipsApartAndInOnePlace) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(4, 10e-3), 1e4, 6e-3, 1e-3);
  SignedDistanceContact alone = contact_of(body), both = two_tips_on(body), swapped = two_tips_on(body), same = two_tips_on(body);
  const TipGeometry tip = TipGeometry::sphere(5e-3);
  for (int k = 0; k <= 100; ++k) {
    const Vector3<> up(0.2e-3, 0.1e-3, 15e-3 - 2e-5 * k);
    const Tips apart{{{tip, up}, {tip, -up}}}, turned{{{tip, -up}, {tip, up}}}, here{{{tip, up}, {tip, up}}};
    const Vector3<> force = alone.step(tip, up).force;
    both.step(apart.data());
    swapped.step(turned.data());
    same.step(here.data());
    EXPECT_LT((both.last(0).force - force).norm(), 1e-3 * force.norm() + 1e-9);
    EXPECT_LT((both.last(1).force - swapped.last(0).force).norm(), 1e-3 * force.norm() + 1e-9);
    if (k < 20) continue;
    EXPECT_LT((same.last(0).force - same.last(1).force).norm(), 1e-3 * force.norm());
    EXPECT_GT(2.0 * same.last(0).force.norm(), force.norm());
    EXPECT_LT(2.0 * same.last(0).force.norm(), 1.7 * force.norm());
  }
}

TEST(SignedDistanceContact, OnlyTheTipThatBeginsInsideIsLost) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(4, 10e-3), 1e4, 6e-3, 4e-3);
  SignedDistanceContact alone = contact_of(body), both = two_tips_on(body);
  for (int k = 0; k <= 100; ++k) {
    const Tips tips{{{TipGeometry::sphere(5e-3), {0.0, 0.0, 15e-3 - 2e-5 * k}}, {TipGeometry::sphere(2e-3), {1e-3, 0.0, -2e-3}}}};
    alone.step(tips[0].shape, tips[0].center);
    both.step(tips.data());
    EXPECT_FALSE(both.last(0).lost);
    EXPECT_TRUE(both.last(1).lost);
    EXPECT_EQ(both.last(1).force.norm(), 0.0);
    EXPECT_EQ(both.last(0).force, alone.last().force);
  }
  EXPECT_TRUE(both.last(0).touching);
}

// Two tips on closed paths about each other gain no work, on a box with edges.
TEST(SignedDistanceContact, NoClosedPathOfTwoTipsGainsWork) {
  const SurfaceBody body = contact_bodies::soft(shapes::box({10e-3, 10e-3, 10e-3}, 5), 1e4, 6e-3, 4e-3);
  SignedDistanceContact contact = two_tips_on(body);
  std::array<Vector3<>, 2> force{Vector3<>::Zero(), Vector3<>::Zero()}, place{Vector3<>::Zero(), Vector3<>::Zero()};
  double gained = 0.0, exchanged = 0.0;
  constexpr int ticks = 8000;
  for (int k = 0; k <= ticks; ++k) {
    const double s = 2.0 * M_PI * k / ticks, down = 3.5e-3 * std::pow(std::sin(0.5 * s), 2);
    const Tips tips{
        {{TipGeometry::sphere(5e-3), {3e-3 * std::cos(s), 9e-3 * std::sin(2.0 * s), 16e-3 - down}},
         {TipGeometry::capsule(4e-3, 3e-3, Vector3<>::UnitZ()), {-8e-3 * std::cos(2.0 * s), 3e-3 * std::cos(s), 15e-3 - down}}}};
    contact.step(tips.data());
    for (std::size_t t = 0; t < 2; ++t) {
      const ContactResult& a = contact.last(static_cast<int>(t));
      const double work = k > 0 ? 0.5 * (a.force + force[t]).dot(tips[t].center - place[t]) : 0.0;
      gained += work;
      exchanged += std::abs(work);
      force[t] = a.force;
      place[t] = tips[t].center;
    }
  }
  EXPECT_EQ(force[0].norm() + force[1].norm(), 0.0);
  EXPECT_GT(exchanged, 1e-5);
  EXPECT_LT(gained, 1e-5 * exchanged);
}

// A copy in a loop is at rest, and its force does not depend on the direction that the tip brings along.
TEST(SignedDistanceBody, IgnoresTheDirectionOfASphere) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(3, 10e-3), 1e4, 6e-3, 4e-3);
  const shapes::Shape ball = shapes::ball(3, 10e-3);
  std::vector<float> full;
  const auto n = static_cast<std::size_t>(body.nodes.size());
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t b = 0; b < 3; ++b)
          full.push_back(body.compliance.block(static_cast<std::int32_t>(i), static_cast<std::int32_t>(j))[3 * a + b]);
  palpate::object::SignedDistanceBody one(
      std::make_shared<const palpate::object::SignedDistanceBody::Data>(body.nodes, full.data(), body.surface));
  const auto copy = one.clone_at_rest();
  palpate::deformable::Tip tip;
  tip.radius = 5e-3;
  for (int k = 0; k < 100; ++k) {
    tip.center = {0.0, 1e-3, 15e-3 - 3e-5 * k};
    tip.outward = Vector3<>::UnitZ();
    const Vector3<> force = one.step(tip).force;
    tip.outward = Vector3<>::UnitX();
    EXPECT_EQ(copy->step(tip).force, force);
  }
  EXPECT_GT(one.last().nodes, 0);
  EXPECT_LT((one.outward(tip) - one.last().force.normalized()).norm(), 1e-6);
}

static_assert(!std::is_constructible_v<SignedDistanceContact, palpate::deformable::SurfaceNodes, const palpate::deformable::FullCompliance&,
                                       const palpate::deformable::ContactPatches&>);

}  // namespace
