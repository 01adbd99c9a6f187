#include "palpate/deformable/contact/traction_turn.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

using palpate::deformable::TractionTurn;
using palpate::math::Vector3;

namespace traction_turn {

inline Vector3<> any(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return {normal(random), normal(random), normal(random)};
}
inline Vector3<> across(const Vector3<>& v, const Vector3<>& d) {
  return v - v.dot(d) * d;
}

}  // namespace traction_turn

using traction_turn::across, traction_turn::any;

TEST(TractionTurn, IsTheRotationFromOneDirectionToTheOther) {
  std::mt19937 random(1);
  for (int n = 0; n < 100; ++n) {
    const Vector3<> before = any(random).normalized(), now = any(random).normalized(), traction = across(any(random), before);
    if ((before + now).squaredNorm() < 0.1) continue;
    const Vector3<> axis = before.cross(now),
                    turned = Eigen::AngleAxisd(std::atan2(axis.norm(), before.dot(now)), axis.normalized()) * traction;
    EXPECT_LT((TractionTurn(before, now).carried(traction) - turned).norm(), 1e-12 * traction.norm());
  }
}

// Way and turn halved, the error falls to an eighth.
TEST(TractionTurn, TheEnergyChangesByTheWorkOfTheMeanTractionToThirdOrder) {
  std::mt19937 random(2);
  for (int n = 0; n < 20; ++n) {
    const Vector3<> before = any(random).normalized(), tilt = across(any(random), before), way = any(random);
    const Vector3<> first = across(any(random), before);
    const auto error = [&](double part) {
      const TractionTurn turn(before, (before + part * tilt).normalized());
      const Vector3<> last = turn.carried(first) - turn.slip(part * way);  // stiffness 1
      return std::abs(0.5 * (last.squaredNorm() - first.squaredNorm()) + 0.5 * (first + last).dot(part * way));
    };
    EXPECT_LT(error(5e-4), 0.2 * error(1e-3) + 1e-14) << n;
    EXPECT_GT(error(1e-3), 0.0);
  }
}

TEST(TractionTurn, ProjectsWhereTheDirectionReverses) {
  const Vector3<> d = Vector3<>::UnitZ(), v(1.0, 2.0, 3.0);
  const TractionTurn turn(d, -d);
  EXPECT_EQ(turn.carried(v), Vector3<>(1.0, 2.0, 0.0));
  EXPECT_EQ(turn.slip(v), Vector3<>(1.0, 2.0, 0.0));
}
