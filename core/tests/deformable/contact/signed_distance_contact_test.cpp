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
  const TipGeometry tip = TipGeometry::cylinder(4e-3, 0.25e-3, Vector3<>::UnitZ());
  for (const double aside : {0.0, 0.2e-3, 0.5e-3}) {
    const ContactResult a = press(contact, tip, {aside, 0.4 * aside, 0.0}, {aside, 0.4 * aside, -0.2e-3}, 20);
    ASSERT_TRUE(a.solved);
    EXPECT_NEAR(a.force.z(), 2.0 * tip.radius * 20e3 * 0.2e-3, 0.06 * a.force.z()) << aside;
  }
}

// Central differences of the energy on a curved body and on a box, for all shapes of tips.
TEST(SignedDistanceContact, ForceIsTheNegativeGradientOfItsEnergy) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int alternating = 0;
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
        bool settled = true;
        const double step = 2e-5;
        for (int a = 0; a < 3; ++a) {
          const auto energy = [&](double way) {
            for (int k = 0; k < 12; ++k) contact.step(tip, at + way * Vector3<>::Unit(a));
            settled = settled && contact.iterations() < SignedDistanceContact::max_iterations;
            return contact.last().energy;
          };
          slope[a] = (energy(step) - energy(-step)) / (2.0 * step);
        }
        if (!settled) {  // where the nearest part of a rod changes from its end to its side, the directions may alternate
          EXPECT_EQ(tip.shape, TipGeometry::Shape::cylinder);
          ++alternating;
          continue;
        }
        EXPECT_LT((slope + here.force).norm(), 3e-3 * here.force.norm()) << round;
      }
  }
  EXPECT_LE(alternating, 2);  // of 8 with a rod
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
      std::make_shared<const palpate::object::SignedDistanceBody::Data>(body.nodes, full.data(), body.surface, 1.0));
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
