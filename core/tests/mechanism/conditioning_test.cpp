#include "palpate/mechanism/conditioning.hpp"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <cmath>
#include <random>

namespace {

using palpate::mechanism::jacobian_size;
using palpate::mechanism::may_be_singular;
using palpate::mechanism::squared_conditioning;

/// Return s_min / s_max from a singular value decomposition.
template <class Matrix>
double exact(const Matrix& j) {
  const auto values = Eigen::JacobiSVD<Matrix>(j).singularValues();
  return values[values.size() - 1] / values[0];
}

// Law: near a singular pose the value is the squared ratio of the singular values, whatever the middle one is.
TEST(Conditioning, IsTheRatioOfTheSingularValuesNearSingularPoses) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> entry(-0.3, 0.3), fraction(0.0, 1.0);
  for (int n = 0; n < 2000; ++n) {
    const auto draw = [&] { return entry(random); };
    const Eigen::JacobiSVD<Eigen::Matrix3d> axes(Eigen::Matrix3d::NullaryExpr(draw), Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double ratio = std::pow(10.0, -2.0 - 3.0 * fraction(random)), middle = n % 3 == 0 ? 1.0 : 0.1 + 0.9 * fraction(random);
    const Eigen::Vector3d values = Eigen::Vector3d(1.0, middle, ratio) * 0.2;
    const Eigen::Matrix3d j = axes.matrixU() * values.asDiagonal() * axes.matrixV().transpose();
    EXPECT_NEAR(std::sqrt(squared_conditioning<3>(j)), ratio, 2.0 * ratio * ratio / middle) << n;
    EXPECT_TRUE(may_be_singular<3>(jacobian_size<3>(j))) << n;
  }
}

TEST(Conditioning, IsExactForTwoJoints) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> entry(-0.3, 0.3);
  for (int n = 0; n < 500; ++n) {
    const Eigen::Matrix<double, 3, 2> j = Eigen::Matrix<double, 3, 2>::NullaryExpr([&] { return entry(random); });
    EXPECT_NEAR(std::sqrt(squared_conditioning<2>(j)), exact(j), 1e-12);
    if (!may_be_singular<2>(jacobian_size<2>(j))) {
      EXPECT_GT(exact(j), 0.01);
    }
  }
}

// Law: a pose with a ratio below 0.01 is never passed over, and not every pose is evaluated.
TEST(Conditioning, OnlyPosesFarFromSingularOnesArePassedOver) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> entry(-0.3, 0.3);
  int passed = 0;
  for (int n = 0; n < 2000; ++n) {
    Eigen::Matrix3d j = Eigen::Matrix3d::NullaryExpr([&] { return entry(random); });
    j.col(2) *= std::pow(10.0, -3.0 * (n % 10) / 9.0);
    if (may_be_singular<3>(jacobian_size<3>(j))) continue;
    EXPECT_GT(exact(j), 0.01);
    ++passed;
  }
  EXPECT_GT(passed, 400);
}

// Law: zero at singular poses only, also without a motion of the tip.
TEST(Conditioning, IsZeroAtSingularPosesOnly) {
  using Matrix = Eigen::Matrix3d;
  EXPECT_EQ(squared_conditioning<3>(Matrix(Matrix::Zero())), 0.0);
  EXPECT_TRUE(may_be_singular<3>(jacobian_size<3>(Matrix(Matrix::Zero()))));
  EXPECT_EQ(squared_conditioning<3>(Matrix(Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal())), 0.0);
  EXPECT_GT(squared_conditioning<3>(Matrix(Matrix::Identity())), 0.1);
  EXPECT_EQ((squared_conditioning<1>(Eigen::Vector3d(Eigen::Vector3d::UnitX()))), 1.0);
}

}  // namespace
