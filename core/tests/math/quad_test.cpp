// Quad: each lane is a plain double, and sums have one order.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <palpate/math/quad.hpp>
#include <random>

namespace {

using palpate::math::Quad;

TEST(Quad, LanesAreDoubles) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 100; ++trial) {
    double a[4], b[4];
    for (int i = 0; i < 4; ++i) {
      a[i] = normal(random);
      b[i] = normal(random);
    }
    const Quad x(a[0], a[1], a[2], a[3]), y(b[0], b[1], b[2], b[3]);
    const Quad sum = x + y, difference = x - y, product = x * y, quotient = x / y, scaled = 0.3 * x, less = select(x < y, x, y);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(sum[i], a[i] + b[i]);
      EXPECT_EQ(difference[i], a[i] - b[i]);
      EXPECT_EQ(product[i], a[i] * b[i]);
      EXPECT_EQ(quotient[i], a[i] / b[i]);
      EXPECT_EQ(scaled[i], 0.3 * a[i]);
      EXPECT_EQ(less[i], std::min(a[i], b[i]));
      EXPECT_EQ((-x)[i], -a[i]);
    }
    const Quad turned = x.rotated();
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(turned[i], a[(i + 1) % 3]);
    EXPECT_EQ(turned[3], a[3]);
    const Quad sums = Quad::sums_of(x, y, sum, product);
    EXPECT_EQ(sums[0], (a[0] + a[1]) + (a[2] + a[3]));
    EXPECT_EQ(sums[1], (b[0] + b[1]) + (b[2] + b[3]));
    EXPECT_EQ(sums[2], (sum[0] + sum[1]) + (sum[2] + sum[3]));
    EXPECT_EQ(sums[3], (product[0] + product[1]) + (product[2] + product[3]));
  }
}

TEST(Quad, InverseRootsAreThoseOfSinglePrecision) {
  const Quad x[2] = {{1e-12, 0.3, 1.0, 7.0}, {1e3, 2e-5, 4.0, 1e-20}};
  Quad roots[2];
  Quad::single_inverse_roots(x, roots);
  for (std::size_t q = 0; q < 2; ++q)
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(roots[q][i], static_cast<double>(1.0F / std::sqrt(static_cast<float>(x[q][i]))));
}

}  // namespace
