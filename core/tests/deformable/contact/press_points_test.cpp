// Points of a node under a tip: the stiffness that carries friction.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <palpate/deformable/contact/press_points.hpp>
#include <random>

#include "support/contact_bodies.hpp"

namespace {

// The whole stiffness jumps by that of a point as the point comes into contact.
TEST(PressPoints, TheStiffnessThatCarriesFrictionDoesNotJump) {
  using palpate::deformable::NearNodes, palpate::deformable::PressedPoints, palpate::deformable::TipGeometry, palpate::math::Vector3;
  using palpate::deformable::press_points, palpate::deformable::detail::DoublePack;
  const contact_bodies::SurfaceBody body = contact_bodies::half_space(4, 8e-3, 20e3);
  const double radius = 5e-3, fading = 3e-3 * radius;
  NearNodes::Tip tip;
  tip.shape = TipGeometry::sphere(radius);
  tip.points = &body.patches.round;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> aside(-1e-3, 1e-3);
  const std::int32_t middle = body.nodes.nearest(Vector3<>::Zero());
  const double all = body.patches.round.stiffness(middle), step = 1e-3 * fading;
  const auto pressed = [&tip, middle](const Vector3<>& at, double by) {
    return press_points<false, DoublePack>(middle, tip, at, nullptr, {.fading = by, .excess = by});
  };
  double jump = 0.0;
  for (int k = 0; k < 10; ++k) {
    const double x = aside(random), y = aside(random);
    PressedPoints last = pressed({x, y, -radius - 0.2e-3}, fading);
    for (int i = 0; i * step < 0.8e-3; ++i) {
      const double depth = i * step - 0.2e-3;
      const Vector3<> at(x, y, -radius + depth);
      const PressedPoints now = pressed(at, fading), without = pressed(at, 0.0);
      ASSERT_LT(std::abs(now.grip.stiffness - last.grip.stiffness), 3.0 * step / fading * all);
      ASSERT_LE(now.grip.stiffness, now.stiffness);
      ASSERT_NEAR(press_points<false>(middle, tip, at, nullptr, {.fading = fading, .excess = fading}).grip.stiffness, now.grip.stiffness,
                  1e-3 * all);
      ASSERT_EQ(now.force, without.force);
      ASSERT_EQ(now.energy, without.energy);
      ASSERT_EQ(now.stiffness, without.stiffness);
      ASSERT_EQ(without.grip.stiffness, 0.0);
      jump = std::max(jump, std::abs(now.stiffness - last.stiffness));
      last = now;
    }
    ASSERT_GT(last.grip.stiffness, 0.5 * all);
  }
  EXPECT_GT(jump, 0.02 * all);
}

}  // namespace
