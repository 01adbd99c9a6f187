#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <palpate/math/sincos.hpp>
#include <random>

namespace {

double units_in_last_place(double a, double b) {
  const double ulp = std::nextafter(std::abs(b), std::numeric_limits<double>::infinity()) - std::abs(b);
  return std::abs(a - b) / ulp;
}

TEST(Sincos, AgreesWithTheLongDoubleLibrary) {
  std::mt19937_64 engine(1);
  for (const double range : {1e-6, 1.0, 10.0, 1e3, 1e5}) {
    std::uniform_real_distribution<double> angle(-range, range);
    const double allowed = range > 1e3 ? 2.0 : 1.0;  // units in the last place
    for (int i = 0; i < 100000; ++i) {
      const double x = angle(engine);
      const auto [s, c] = palpate::sincos(x);
      EXPECT_LE(units_in_last_place(s, static_cast<double>(sinl(x))), allowed) << x;
      EXPECT_LE(units_in_last_place(c, static_cast<double>(cosl(x))), allowed) << x;
    }
  }
}

TEST(Sincos, IsExactAtZeroAndOddAndEven) {
  EXPECT_EQ(palpate::sincos(0.0).sine, 0.0);
  EXPECT_EQ(palpate::sincos(0.0).cosine, 1.0);
  for (double x = 0.01; x < 20.0; x += 0.37) {
    EXPECT_EQ(palpate::sincos(-x).sine, -palpate::sincos(x).sine);
    EXPECT_EQ(palpate::sincos(-x).cosine, palpate::sincos(x).cosine);
  }
}

TEST(Sincos, PassesHugeAndNonFiniteAnglesToTheLibrary) {
  EXPECT_EQ(palpate::sincos(1e9).sine, std::sin(1e9));
  EXPECT_TRUE(std::isnan(palpate::sincos(std::numeric_limits<double>::infinity()).sine));
  EXPECT_TRUE(std::isnan(palpate::sincos(std::nan("")).cosine));
}

}  // namespace
