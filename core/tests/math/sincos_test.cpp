#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <palpate/math/exponential.hpp>
#include <palpate/math/sincos.hpp>
#include <random>

namespace {

double units_in_last_place(double a, double b) {
  const double ulp = std::nextafter(std::abs(b), std::numeric_limits<double>::infinity()) - std::abs(b);
  return std::abs(a - b) / ulp;
}

TEST(Sincos, AgreesWithLongDouble) {
  std::mt19937_64 engine(1);
  for (const double range : {1e-6, 1.0, 10.0, 1e3, 1e5}) {
    std::uniform_real_distribution<double> angle(-range, range);
    const double allowed = range > 1e3 ? 2.0 : 1.0;  // ulp
    for (int i = 0; i < 100000; ++i) {
      const double x = angle(engine);
      const auto [s, c] = palpate::math::sincos(x);
      EXPECT_LE(units_in_last_place(s, static_cast<double>(sinl(x))), allowed) << x;
      EXPECT_LE(units_in_last_place(c, static_cast<double>(cosl(x))), allowed) << x;
    }
  }
}

TEST(Sincos, IsExactAtZeroAndSymmetric) {
  EXPECT_EQ(palpate::math::sincos(0.0).sine, 0.0);
  EXPECT_EQ(palpate::math::sincos(0.0).cosine, 1.0);
  for (double x = 0.01; x < 20.0; x += 0.37) {
    EXPECT_EQ(palpate::math::sincos(-x).sine, -palpate::math::sincos(x).sine);
    EXPECT_EQ(palpate::math::sincos(-x).cosine, palpate::math::sincos(x).cosine);
  }
}

TEST(Sincos, RotatesByAMediumAngle) {
  std::mt19937_64 engine(2);
  std::uniform_real_distribution<double> angle(-4.0, 4.0),
      rotation(-palpate::math::max_medium_rotation, palpate::math::max_medium_rotation);
  for (int i = 0; i < 100000; ++i) {
    const double x = angle(engine), t = rotation(engine);
    const auto [s, c] = palpate::math::rotate_medium(palpate::math::sincos(x), t);
    EXPECT_NEAR(s, static_cast<double>(sinl(static_cast<long double>(x) + t)), 3e-16);
    EXPECT_NEAR(c, static_cast<double>(cosl(static_cast<long double>(x) + t)), 3e-16);
  }
}

TEST(Exponential, AgreesWithLongDoubleInScalarsAndLanes) {
  using palpate::math::decaying_exponential;
  for (double x = 0.0; x > -699.0; x -= 8.3e-3) {
    const double result = decaying_exponential(x);
    EXPECT_LE(std::abs(result / static_cast<double>(expl(x)) - 1.0), 2.5 * 2.3e-16) << x;
    palpate::math::Pack<2> two = x;
    two.set(1, 0.3 * x);
    EXPECT_EQ(decaying_exponential(two)[0], result);
    EXPECT_EQ(decaying_exponential(two)[1], decaying_exponential(0.3 * x));
  }
  EXPECT_EQ(decaying_exponential(0.0), 1.0);
  EXPECT_EQ(decaying_exponential(-1e9), 0.0);
  EXPECT_TRUE(std::isnan(decaying_exponential(std::nan(""))));
}

TEST(Sincos, UsesTheLibraryForHugeAndNonFiniteAngles) {
  EXPECT_EQ(palpate::math::sincos(1e9).sine, std::sin(1e9));
  EXPECT_TRUE(std::isnan(palpate::math::sincos(std::numeric_limits<double>::infinity()).sine));
  EXPECT_TRUE(std::isnan(palpate::math::sincos(std::nan("")).cosine));
}

}  // namespace
