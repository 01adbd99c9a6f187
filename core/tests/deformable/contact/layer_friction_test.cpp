// Friction of a contact by signed distance: Cattaneo and Mindlin, the cone, closed paths, and the frame.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <palpate/deformable/contact/signed_distance_contact.hpp>
#include <palpate/deformable/linear/creep_motion.hpp>

#include "support/contact_bodies.hpp"
#include "support/tip_work.hpp"

namespace {

using contact_bodies::SurfaceBody, contact_bodies::TipWork;
using palpate::deformable::ContactResult, palpate::deformable::DryFriction, palpate::deformable::SignedDistanceContact,
    palpate::deformable::TipGeometry, palpate::math::Vector3;

// Mindlin 1949: T = mu N (1 - (1 - 16 a G d / (3 mu N (2 - nu)))^(3/2)) while the annulus slips, mu N beyond; back from there by half.
TEST(LayerFriction, SphereOnHalfSpaceMatchesMindlin) {
  const double modulus = 20e3, shear = 5e3, radius = 20e-3, depth = 0.3e-3, mu = 0.4;
  const SurfaceBody space = contact_bodies::half_space(16, 8e-3, modulus);
  SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{mu, mu});
  const TipGeometry tip = TipGeometry::sphere(radius);
  for (int k = 0; k <= 40; ++k) contact.step(tip, {0.0, 0.0, radius - depth * k / 40.0});
  const double full = 3.0 * 1.5 * mu * contact.last().force.z() / (16.0 * std::sqrt(radius * depth) * shear);  // displacement of full slip
  const auto share = [full](double way) { return way < full ? 1.0 - std::pow(1.0 - way / full, 1.5) : 1.0; };
  const auto at = [&](double way) {
    const ContactResult& a = contact.step(tip, {way, 0.0, radius - depth});
    EXPECT_LE(a.friction.norm(), mu * a.force.norm() * 1.02);
    return -a.friction.x() / (mu * a.force.z());
  };
  for (int k = 1; k <= 120; ++k) EXPECT_NEAR(at(1.2 * full * k / 120.0), share(1.2 * full * k / 120.0), 0.06) << k;
  EXPECT_TRUE(contact.last().sliding);
  for (int k = 1; k <= 60; ++k) EXPECT_NEAR(at(1.2 * full - full * k / 60.0), 1.0 - 2.0 * share(0.5 * full * k / 60.0), 0.08) << k;
}

// The static coefficient holds from the reversal on, whatever the speed there: points that come into contact do not slip.
TEST(LayerFriction, EveryNodeSticksWhenASlidingSphereTurnsBack) {
  const double radius = 20e-3, depth = 0.3e-3, full = 0.1e-3;  // m
  const SurfaceBody space = contact_bodies::half_space(16, 8e-3, 20e3);
  const TipGeometry tip = TipGeometry::sphere(radius);
  for (const double step : {1e-3, 3e-3, 1e-2, 3e-2}) {
    SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{0.4, 0.3});
    for (int k = 0; k <= 40; ++k) contact.step(tip, {0.0, 0.0, radius - depth * k / 40.0});
    for (int k = 1; k <= 200; ++k) contact.step(tip, {3.0 * full * k / 200.0, 0.0, radius - depth});
    EXPECT_TRUE(contact.last().sliding);
    for (int k = 1; k <= 10; ++k)
      EXPECT_FALSE(contact.step(tip, {(3.0 - step * k) * full, 0.0, radius - depth}).sliding) << step << " " << k;
  }
}

// Points come into contact and leave on the way; the stiffness that carries friction does not jump then.
TEST(LayerFriction, TheForceOnASlidingSphereDoesNotJump) {
  const double depth = 1e-3, radius = 6e-3;
  const SurfaceBody space = contact_bodies::half_space(6, 12e-3, 20e3);
  SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{0.8, 0.8});
  Vector3<> last = Vector3<>::Zero();
  double largest = 0.0;
  for (int k = 0; k < 1500; ++k) {
    const double x = -6e-3 + 8e-6 * k;
    const Vector3<> force = contact.step(TipGeometry::sphere(radius), {x, 0.3 * x, radius - depth * std::min(1.0, k / 200.0)}).force;
    if (k > 300) largest = std::max(largest, (force - last).norm() / force.norm());
    last = force;
  }
  EXPECT_TRUE(contact.last().sliding);
  EXPECT_LT(largest, 0.005);
}

// Law of Mindlin and Deresiewicz (1953): at the first swing of the depth the points that leave take their tractions with them, and
// afterwards nothing is lost. The finer the mesh, the more points come and go.
TEST(LayerFriction, ADepthThatVariesDrainsTheTractionInItsFirstSwingAlone) {
  const double radius = 8e-3, depth = 1e-3;
  for (const int cells : {8, 16}) {
    const SurfaceBody space = contact_bodies::half_space(cells, 16e-3, 20e3);
    for (const double amplitude : {0.02e-3, 0.1e-3, 0.3e-3, 0.6e-3}) {
      SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{0.8, 0.8});
      const auto lateral_at = [&](double x, double deep) {
        return contact.step(TipGeometry::sphere(radius), {x, 0.2 * x, radius - deep}).friction.head<2>().norm();
      };
      for (int k = 0; k <= 100; ++k) lateral_at(0.0, depth * k / 100.0);
      for (int k = 1; k <= 100; ++k) lateral_at(1e-6 * k, depth);
      const auto swing = [&] {
        double lateral = 0.0;
        for (int k = 1; k <= 200; ++k) lateral = lateral_at(0.1e-3, depth + amplitude * std::sin(2.0 * M_PI * k / 200.0));
        return lateral;
      };
      const double start = lateral_at(0.1e-3, depth), first = swing();
      EXPECT_GT(first, std::sqrt(1.0 - amplitude / depth) * 0.85 * start) << cells << " " << amplitude;
      for (int n = 2; n <= 50; ++n) ASSERT_NEAR(swing() / first, 1.0, 0.017) << cells << " " << amplitude << " " << n;
    }
  }
}

// However fast the depth swings: the tractions turn with the directions of the normal forces, and their turn takes no work.
TEST(LayerFriction, ADepthThatVariesKeepsTheStoredEnergyAndTheTraction) {
  const double radius = 5e-3, depth = 1.2e-3;
  const SurfaceBody body = contact_bodies::soft(shapes::box({10e-3, 10e-3, 10e-3}, 5), 1e4, 6e-3, 4e-3);
  for (const int ticks : {100, 400}) {
    SignedDistanceContact contact(body.nodes, body.compliance, body.patches, DryFriction{0.5, 0.5});
    const auto at = [&](double deep) { return contact.step(TipGeometry::sphere(radius), {0.3e-3, 0.2e-3, 10e-3 + radius - deep}); };
    for (int k = 0; k < 100; ++k) at(depth * k / 100.0);
    const auto swing = [&] {
      for (int k = 1; k < ticks; ++k) at(depth + 0.5e-3 * std::sin(2.0 * M_PI * k / ticks));
      return at(depth);
    };
    const ContactResult first = swing();
    EXPECT_GT(first.energy, 1e-5);
    EXPECT_GT(first.friction.norm(), 1e-3);
    for (int n = 2; n <= 100; ++n) {
      const ContactResult now = swing();
      ASSERT_NEAR(now.energy / first.energy, 1.0, 2e-4) << ticks << " " << n;
      ASSERT_LT((now.friction - first.friction).norm(), 3e-3 * first.friction.norm()) << ticks << " " << n;
    }
  }
}

// Law: a press supplies what the body stores, however fast; the mesh alone gives it a small lateral force. On many nodes, tractions that
// are not solved for in each tick oscillate.
TEST(LayerFriction, AStraightPressDoesNotOscillate) {
  const SurfaceBody space = contact_bodies::half_space(16, 16e-3, 20e3);
  const double depth = 1e-3;
  for (const double mu : {0.5, 2.0})
    for (const int ticks : {25, 50, 100, 150}) {
      SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{mu, mu});
      TipWork path{{0.5e-3, 0.3e-3, 1e-5}};
      double lateral = 0.0;
      for (int k = 0; k <= ticks; ++k) {
        const Vector3<> next(0.5e-3, 0.3e-3, -depth * k / ticks);
        const ContactResult& a = path.step(contact, TipGeometry::cylinder(6e-3, 1e-3, Vector3<>::UnitZ()), next);
        lateral = std::max(lateral, static_cast<double>(a.force.head<2>().norm()));
      }
      EXPECT_GE(contact.last().nodes, 40);
      EXPECT_LT(path.ahead, 3e-4 * path.work) << mu << " " << ticks;
      EXPECT_LT(lateral, 2e-3 * path.force.z()) << mu << " " << ticks;
    }
}

// The tractions of the points go over with the places, in whatever order these are.
TEST(LayerFriction, AContactThatContinuesAnotherHasItsForce) {
  const double radius = 8e-3, depth = 1e-3;
  const SurfaceBody space = contact_bodies::half_space(16, 16e-3, 20e3);
  SignedDistanceContact before(space.nodes, space.compliance, space.patches, DryFriction{0.5, 0.4});
  SignedDistanceContact after(space.nodes, space.compliance, space.patches, DryFriction{0.5, 0.4});
  const TipGeometry tip = TipGeometry::sphere(radius);
  for (int k = 0; k <= 400; ++k) before.step(tip, {6e-6 * k, 2e-6 * k, radius - depth * std::min(1.0, k / 100.0)});
  for (int k = 1; k <= 20; ++k) before.step(tip, {2.4e-3 - 2e-6 * k, 0.8e-3, radius - depth});
  after.take_over(before, [](std::int32_t node) { return node; });
  for (int k = 1; k <= 40; ++k) {
    const Vector3<> center(2.36e-3, 0.8e-3 + 2e-6 * k, radius - depth + 10e-6 * k);
    const ContactResult &one = before.step(tip, center), &other = after.step(tip, center);
    EXPECT_GT(one.friction.norm(), 1e-3);
    ASSERT_LT((one.friction - other.friction).norm(), 2e-3 * one.friction.norm()) << k;
    ASSERT_NEAR(one.energy, other.energy, 1e-3 * one.energy) << k;
  }
}

// From free to free friction takes work, whatever the path: over a smooth body and over edges, for all shapes of tips.
TEST(LayerFriction, NoClosedPathGainsWork) {
  for (const bool round_body : {true, false}) {
    const SurfaceBody body =
        contact_bodies::soft(round_body ? shapes::ball(3, 10e-3) : shapes::box({10e-3, 10e-3, 10e-3}, 4), 1e4, 6e-3, 4e-3);
    for (const TipGeometry& tip : {TipGeometry::sphere(5e-3), TipGeometry::capsule(4e-3, 3e-3, Vector3<>::UnitZ()),
                                   TipGeometry::cylinder(4e-3, 1e-3, Vector3<>::UnitZ())})
      for (const double mu : {0.3, 1.2}) {
        SignedDistanceContact contact(body.nodes, body.compliance, body.patches, DryFriction{mu, 0.7 * mu});
        const double above = 10e-3 + (tip.shape == TipGeometry::Shape::cylinder ? 0.0 : tip.radius);
        Vector3<> force = Vector3<>::Zero(), place = Vector3<>::Zero();
        double work = 0.0, exchanged = 0.0, behind = 0.0, largest = 0.0;
        constexpr int ticks = 4000;
        for (int k = 0; k <= ticks; ++k) {
          const double s = 2.0 * M_PI * k / ticks;
          const Vector3<> next(4e-3 * std::sin(3.0 * s), 3e-3 * std::sin(2.0 * s), above + 1e-3 - 3e-3 * std::pow(std::sin(0.5 * s), 2));
          const ContactResult& a = contact.step(tip, next);
          const double step = k > 0 ? -0.5 * (a.force + force).dot(next - place) : 0.0;
          work += step;
          exchanged += std::abs(step);
          largest = std::max(largest, a.energy);
          behind = std::max(behind, a.energy - work);
          force = a.force;
          place = next;
          for (int c = 0; c < a.nodes; ++c) {
            const Vector3<> normal = contact.normal_force(c);
            ASSERT_LE((contact.node_force(c) - normal).norm(), mu * normal.norm() * (1.0 + 1e-6) + 1e-12);
          }
        }
        EXPECT_EQ(force.norm(), 0.0);
        EXPECT_GT(work, 0.02 * exchanged);
        EXPECT_LT(behind, 2e-3 * largest);  // the body never stores more than the tip has worked
      }
  }
}

// Law: what a node's traction lacks in one tick is made up in the next. So the work of a closed path does not depend on its steps. A
// tip that sticks has always worked as much as the body stores, to 5e-4 of the largest energy where it moves fast.
TEST(LayerFriction, SmallStepsDoTheWorkOfLargeOnes) {
  const SurfaceBody body = contact_bodies::soft(shapes::ball(3, 10e-3), 1e4, 6e-3, 4e-3);
  const auto work_of = [&body](double mu, int ticks, double ahead) {
    SignedDistanceContact contact(body.nodes, body.compliance, body.patches, DryFriction{mu, mu});
    TipWork path{{0.0, 0.0, 15.2e-3}};
    for (const Vector3<>& to : {Vector3<>(0.0, 0.0, 14e-3), Vector3<>(0.5e-3, 0.0, 14e-3), Vector3<>(0.3e-3, 0.4e-3, 13.8e-3),
                                Vector3<>(-0.4e-3, 0.0, 14e-3), Vector3<>(0.0, 0.0, 14e-3), Vector3<>(0.0, 0.0, 15.2e-3)}) {
      const Vector3<> from = path.place;
      for (int k = 1; k <= ticks; ++k) path.step(contact, TipGeometry::sphere(5e-3), from + (to - from) * k / ticks);
    }
    EXPECT_LT(path.ahead, ahead);
    return path.work;
  };
  const double small = work_of(0.3, 5000, 1e-9);
  EXPECT_NEAR(small / work_of(0.3, 1000, 1e-8), 1.0, 2e-4);
  EXPECT_NEAR(small / work_of(0.3, 100, 1e-8), 1.0, 2e-3);
  work_of(50.0, 5000, 1e-9);
  work_of(50.0, 100, 1e-8);
}

TEST(LayerFriction, DoesNotDependOnTheFrameNorOnTheOrderOfTheNodes) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3<>(0.3, -0.7, 0.4).normalized()).toRotationMatrix();
  const shapes::Shape ball = shapes::ball(3, 10e-3);
  shapes::Shape other = shapes::moved(ball, [&turn](const Vector3<>& v) { return Vector3<>(turn * v); });
  const auto last = static_cast<std::int32_t>(other.vertices.size()) - 1;
  std::reverse(other.vertices.begin(), other.vertices.end());
  for (auto& t : other.triangles)
    for (auto& v : t) v = last - v;
  const auto body_of = [](const shapes::Shape& shape) {
    return SurfaceBody(shape, 1e4, [&shape](std::size_t i, std::size_t j) {
      return Eigen::Matrix3d(6e-3 * std::exp(-(shape.vertices[i] - shape.vertices[j]).norm() / 4e-3) * Eigen::Matrix3d::Identity());
    });
  };
  const SurfaceBody one = body_of(ball), two = body_of(other);
  SignedDistanceContact first(one.nodes, one.compliance, one.patches, DryFriction{0.5, 0.4}),
      second(two.nodes, two.compliance, two.patches, DryFriction{0.5, 0.4});
  double largest = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double s = k / 400.0;
    const Vector3<> at = (15.1e-3 - 3e-3 * std::sin(M_PI * s)) * Vector3<>(std::sin(s), 0.2 * s, std::cos(s)).normalized();
    const ContactResult& a = first.step(TipGeometry::sphere(5e-3), at);
    const ContactResult& b = second.step(TipGeometry::sphere(5e-3), turn * at);
    largest = std::max(largest, a.force.norm());
    EXPECT_LT((turn * a.force - b.force).norm(), 2e-3 * largest + 1e-9);
  }
  EXPECT_GT(largest, 0.05);
}

// Law: a point of a creeping layer stores the energy of its Kelvin element, and its compression without force decays by one law however
// long it is not evaluated.
TEST(LayerCreep, APointIsAKelvinElement) {
  const SurfaceBody space = contact_bodies::half_space(2, 4e-3, 20e3);
  const palpate::deformable::Creep law = palpate::deformable::creep_law(3.0, 0.02, 1e-3);
  const palpate::deformable::ContactPatches patches(space.surface, law);
  palpate::deformable::LayerCreep layer(patches.round, law);
  const double stiffness = 700.0, force = 0.3, delayed_force = 0.2;  // long-term; N
  const double excess = law.period_ratio * force / stiffness, state = delayed_force / stiffness;
  const double found = 0.5 * stiffness / law.period_ratio *
                       (static_cast<double>(layer.series()) * excess * excess + static_cast<double>(layer.delayed()) * state * state);
  EXPECT_NEAR(found, law.energy(force * force / stiffness, delayed_force * delayed_force / stiffness), 1e-6 * found);
  layer.mark(0);
  for (int passed = 1; passed <= 5; ++passed) {
    layer.begin_period();
    EXPECT_NEAR(static_cast<double>(layer.remaining(0)), std::exp(-passed * 1e-3 / 0.02), 1e-6) << passed;
  }
}

// Law: full sliding lasts until every node sticks, also through a reversal in which some nodes slip back at once.
TEST(LayerFriction, FullSlidingLastsUntilEveryNodeSticks) {
  const SurfaceBody space = contact_bodies::half_space(16, 8e-3, 20e3);
  SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{0.5, 0.4});
  const double radius = 20e-3, depth = 0.3e-3;
  const auto slides = [&](double way) { return contact.step(TipGeometry::sphere(radius), {way, 0.0, radius - depth}).sliding; };
  for (int k = 0; k <= 20; ++k) contact.step(TipGeometry::sphere(radius), {0.0, 0.0, radius - depth * k / 20.0});
  EXPECT_FALSE(slides(0.1e-3));  // partial slip from rest
  for (int k = 1; k <= 10; ++k) slides(0.1e-3 * k);
  EXPECT_TRUE(slides(1.1e-3));
  EXPECT_TRUE(slides(1.0e-3));  // the rim slips back, the center sticks
  for (int k = 0; k < 10; ++k) slides(1.0e-3);
  EXPECT_FALSE(slides(1.0e-3));  // every node sticks
}

// Law: a layer that is unloaded carries less in shear: while the tip lifts without slip, the body never stores more than the tip has
// worked.
TEST(LayerFriction, LiftingATipThatSticksAddsNoEnergy) {
  const SurfaceBody space = contact_bodies::half_space(8, 6e-3, 20e3);
  SignedDistanceContact contact(space.nodes, space.compliance, space.patches, DryFriction{50.0, 50.0});
  const double radius = 10e-3, depth = 1e-3, way = 0.1e-3;
  TipWork path{{0.0, 0.0, radius}};
  const auto move = [&](const Vector3<>& to) {
    for (int k = 1; k <= 200; ++k) path.step(contact, TipGeometry::sphere(radius), path.place + (to - path.place) / (201 - k));
  };
  move({0.0, 0.0, radius - depth});
  move({way, 0.0, radius - depth});
  EXPECT_GT(-path.force.x(), 0.05 * path.force.z());
  move({way, 0.0, radius});
  EXPECT_LT(path.ahead, 3e-3 * path.largest);  // residual of the sweeps
}

}  // namespace
