// Depth of a point in a tip and its derivatives.
#include <gtest/gtest.h>

#include <palpate/deformable/contact/tip_geometry.hpp>
#include <random>
#include <vector>

namespace {

using palpate::deformable::TipGeometry, palpate::math::Vector3;

TEST(TipGeometry, DepthIsTheNegativeDistanceAndItsDerivativesAreThoseOfDifferences) {
  const Vector3<> axis = Vector3<>(0.3, -0.2, 0.9).normalized();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (const TipGeometry& tip :
       {TipGeometry::sphere(5e-3), TipGeometry::capsule(3e-3, 6e-3, axis), TipGeometry::cylinder(5e-3, 1.5e-3, axis)})
    for (int round = 0; round < 300; ++round) {
      const Vector3<> y = 7e-3 * Vector3<>(uniform(random), uniform(random), uniform(random));
      const Vector3<> normal = Vector3<>(uniform(random), uniform(random), uniform(random)).normalized();
      const auto at = [&](const Vector3<>& place) { return tip.evaluate<double>(place, normal); };
      const auto here = at(y);
      EXPECT_NEAR(here.depth, -tip.distance(y), 1e-12);
      EXPECT_NEAR(here.away.norm(), 1.0, 1e-9);
      const double step = 1e-8;
      Vector3<> slope, bend;
      bool kink = false;
      for (int a = 0; a < 3; ++a) {
        const Vector3<> d = step * Vector3<>::Unit(a);
        const auto more = at(y + d), less = at(y - d);
        slope[a] = (tip.distance(y + d) - tip.distance(y - d)) / (2.0 * step);
        bend[a] = (more.away - less.away).dot(normal) / (2.0 * step);
        kink = kink || (more.away - less.away).norm() > 1e-3;  // the medial axis or a border of two regions lies between
      }
      if (kink) continue;
      EXPECT_LT((slope - here.away).norm(), 1e-5);
      const double curvature = 1.0 / std::max(tip.radius - here.depth, 1e-4);
      if ((bend - here.bend).norm() > 1e-3 * curvature + 1.0) {
        // a border of regions with different curvature passes through: differences from both sides disagree
        const Vector3<> d = 1e-6 * Vector3<>(1.0, 1.0, 1.0);
        EXPECT_GT((at(y + d).bend - at(y - d).bend).norm(), 1e-3 * curvature) << y.transpose();
      }
    }
}

TEST(TipGeometry, AnEdgeOfRadiusZeroIsTheLimitOfARoundedOne) {
  const TipGeometry sharp = TipGeometry::cylinder(5e-3, 1e-9, Vector3<>::UnitZ());
  EXPECT_NEAR(sharp.distance({4e-3, 0.0, 1e-3}), -1e-3, 1e-8);
  EXPECT_NEAR(sharp.distance({8e-3, 0.0, -4e-3}), 5e-3, 1e-8);
  EXPECT_NEAR(sharp.distance({6e-3, 0.0, 3e-3}), 1e-3, 1e-8);
}

TEST(TipGeometry, ARimIsAtMostAsLargeAsTheCylinder) {
  const TipGeometry round = TipGeometry::cylinder(5e-3, 1.0, Vector3<>::UnitZ());
  EXPECT_EQ(round.rim, 5e-3);
  EXPECT_NEAR(round.distance({0.0, 0.0, -2e-3}), 2e-3, 1e-12);
}

}  // namespace
