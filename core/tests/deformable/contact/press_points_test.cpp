// Points of a node under a tip: the stiffness that fades with the depth, for Newton's method with friction.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <palpate/deformable/contact/press_points.hpp>
#include <random>

#include "support/contact_bodies.hpp"

namespace {

// Without fading it jumps by the stiffness of a point as the point comes into contact.
TEST(PressPoints, TheFadingStiffnessDoesNotJump) {
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
    return press_points<false, DoublePack>(middle, tip, at, nullptr, by);
  };
  double jump = 0.0;
  for (int k = 0; k < 10; ++k) {
    const double x = aside(random), y = aside(random);
    PressedPoints last = pressed({x, y, -radius - 0.2e-3}, fading), sudden;
    for (int i = 0; i * step < 0.8e-3; ++i) {
      const double depth = i * step - 0.2e-3;
      const Vector3<> at(x, y, -radius + depth);
      const PressedPoints now = pressed(at, fading), without = pressed(at, 0.0);
      ASSERT_LT(std::abs(now.stiffness - last.stiffness), 3.0 * step / fading * all);
      ASSERT_LE(now.stiffness, without.stiffness * (1.0 + 1e-12));
      ASSERT_EQ(now.force, without.force);
      ASSERT_EQ(now.energy, without.energy);
      jump = std::max(jump, std::abs(without.stiffness - sudden.stiffness));
      last = now;
      sudden = without;
    }
    ASSERT_GT(last.stiffness, 0.5 * all);
  }
  EXPECT_GT(jump, 0.02 * all);
}

}  // namespace
