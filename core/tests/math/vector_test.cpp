// Products of small matrices and vectors.
#include <gtest/gtest.h>

#include <palpate/math/vector.hpp>

namespace {

using palpate::math::product;
using palpate::math::transposed_product;

/// Terms that cancel: the order of the sum decides the result.
TEST(Product, SumsPairwise) {
  const Eigen::Matrix3d a = (Eigen::Matrix3d() << 1.0, 1e16, -1e16, 0.5, 2.0, 3.0, -1.0, 0.0, 4.0).finished();
  const Eigen::Vector3d ones = Eigen::Vector3d::Ones();
  EXPECT_EQ(product(a, ones), Eigen::Vector3d(1.0, 5.5, 3.0));
  EXPECT_EQ(transposed_product(Eigen::Matrix3d(a.transpose()), ones), product(a, ones));
}

TEST(Product, IsThatOfRectangularMatrices) {
  const Eigen::Matrix<double, 3, 2> a = (Eigen::Matrix<double, 3, 2>() << 1, 2, 3, 4, 5, 6).finished();
  EXPECT_EQ(product(a, Eigen::Vector2d(10, 1)), Eigen::Vector3d(12, 34, 56));
  EXPECT_EQ(transposed_product(a, Eigen::Vector3d(100, 10, 1)), Eigen::Vector2d(135, 246));
}

}  // namespace
