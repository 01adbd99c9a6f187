// Depth of a point in a tip and its derivatives.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <palpate/deformable/contact/tip_geometry.hpp>
#include <random>
#include <vector>

namespace {

using palpate::deformable::TipGeometry, palpate::math::Vector3;

TEST(TipGeometry, DerivativesOfTheDepthAreThoseOfDifferences) {
  const Vector3<> axis = Vector3<>(0.3, -0.2, 0.9).normalized();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (const TipGeometry& tip :
       {TipGeometry::sphere(5e-3), TipGeometry::capsule(3e-3, 6e-3, axis), TipGeometry::cylinder(5e-3, 2e-3, axis)}) {
    int checked = 0;
    for (int round = 0; round < 300; ++round) {
      const Vector3<> y = 7e-3 * Vector3<>(uniform(random), uniform(random), uniform(random));
      const Vector3<> normal = Vector3<>(uniform(random), uniform(random), uniform(random)).normalized();
      const auto at = [&](const Vector3<>& place) { return tip.evaluate<double>(place, normal); };
      const auto here = at(y);
      if (tip.shape == TipGeometry::Shape::cylinder && here.depth <= 0.0) continue;  // only points inside are pressed
      EXPECT_NEAR(here.away.norm(), 1.0, 1e-9);
      ++checked;
      const double step = 1e-8;
      Vector3<> slope, bend;
      for (int a = 0; a < 3; ++a) {
        const auto more = at(y + step * Vector3<>::Unit(a)), less = at(y - step * Vector3<>::Unit(a));
        slope[a] = (more.depth - less.depth) / (2.0 * step);
        bend[a] = (more.away - less.away).dot(normal) / (2.0 * step);
      }
      EXPECT_LT((slope + here.slope * here.away).norm(), 1e-5);
      const double curvature = 1.0 / std::max(tip.radius - here.depth, 1e-4);
      if ((bend - here.bend).norm() > 1e-3 * curvature + 1.0) {
        // a border of a capsule's regions passes through: differences from both sides disagree
        const Vector3<> d = 1e-6 * Vector3<>(1.0, 1.0, 1.0);
        EXPECT_GT((at(y + d).bend - at(y - d).bend).norm(), 1e-3 * curvature) << y.transpose();
      }
    }
    EXPECT_GT(checked, 50);
  }
}

TEST(TipGeometry, DepthIsTheNegativeDistanceAndPositiveJustInsideACylinder) {
  const Vector3<> axis = Vector3<>(0.3, -0.2, 0.9).normalized();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (const TipGeometry& tip :
       {TipGeometry::sphere(5e-3), TipGeometry::capsule(3e-3, 6e-3, axis), TipGeometry::cylinder(5e-3, 2e-3, axis)})
    for (int round = 0; round < 300; ++round) {
      const Vector3<> y = 7e-3 * Vector3<>(uniform(random), uniform(random), uniform(random));
      const double distance = tip.distance(y), depth = tip.evaluate<double>(y, axis).depth;
      if (tip.shape != TipGeometry::Shape::cylinder || distance >= 0.0) {
        EXPECT_NEAR(depth, -distance, 1e-12);
      } else {
        EXPECT_GT(depth, 0.0);
      }
    }
}

// Law: near the edge the second derivatives of half the squared depth do not depend on its size, and the least is above -0.11. The
// kink of the true distance has no bound.
TEST(TipGeometry, TheEdgeOfACylinderWeakensALayerByAtMostOneNinth) {
  const TipGeometry tip = TipGeometry::cylinder(5e-3, 2e-3, Vector3<>::UnitZ());
  for (const double size : {1e-6, 1e-5, 1e-4, 1e-3}) {
    double least = 0.0;
    for (int k = 1; k < 60; ++k) {
      const double end = size * k / 60.0, flank = size * (1.0 - 2.2 * k / 60.0), step = 1e-3 * size;
      const auto energy = [&](double f, double e) {
        const double depth = std::max(tip.evaluate<double>({tip.radius - f, 0.0, e}, Vector3<>::UnitZ()).depth, 0.0);
        return 0.5 * depth * depth;
      };
      const double mixed = (energy(flank + step, end + step) - energy(flank + step, end - step) - energy(flank - step, end + step) +
                            energy(flank - step, end - step)) /
                           4.0;
      Eigen::Matrix2d second;
      second << energy(flank + step, end) + energy(flank - step, end) - 2.0 * energy(flank, end), mixed, mixed,
          energy(flank, end + step) + energy(flank, end - step) - 2.0 * energy(flank, end);
      least = std::min(least, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(second / (step * step)).eigenvalues()[0]);
    }
    EXPECT_GT(least, -0.11) << size;
    EXPECT_LT(least, -0.08) << size;
  }
}

TEST(TipGeometry, AFlareIsAtMostAsLargeAsTheRadius) {
  const TipGeometry thin = TipGeometry::cylinder(1e-3, 5e-3, Vector3<>::UnitZ());
  EXPECT_EQ(thin.flare, 1e-3);
  EXPECT_LT(thin.distance({0.0, 2.2e-3, 0.2}), 0.0);
  EXPECT_GT(thin.distance({0.0, 2.4e-3, 0.2}), 0.0);
}

TEST(TipGeometry, TheDistanceFromACylinderIsThatFromItsEndOrAboutThatFromItsFlank) {
  const TipGeometry tip = TipGeometry::cylinder(5e-3, 1e-3, Vector3<>::UnitZ());
  EXPECT_NEAR(tip.distance({0.0, 0.0, -2e-3}), 2e-3, 1e-12);
  EXPECT_NEAR(tip.distance({4e-3, 0.0, 0.5e-3}), -0.5e-3, 1e-12);
  EXPECT_NEAR(tip.distance({8e-3, 0.0, -4e-3}), 4.4e-3, 0.05e-3);
  EXPECT_NEAR(tip.distance({tip.reach(), 0.0, 1.0}), 0.0, 1e-6);
  EXPECT_NEAR(tip.distance({5e-3 + TipGeometry::flare_slope * 1e-3 / std::sqrt(2.0), 0.0, 1e-3}), 0.0, 1e-12);
}

}  // namespace
