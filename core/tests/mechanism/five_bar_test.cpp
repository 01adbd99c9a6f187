#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <palpate/mechanism/five_bar.hpp>
#include <string>

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::FiveBar;
using palpate::mechanism::FiveBarParameters;
using Pair = FiveBarParameters::Pair;

/// The Pantograph Mk-II, or the Haply 2diy, with inertias chosen for these tests.
FiveBar linkage(double base, double proximal, double distal) {
  FiveBarParameters p;
  p.base = base;
  p.proximal_length.setConstant(proximal);
  p.distal_length.setConstant(distal);
  p.proximal_inertia = Pair(4.0e-5, 4.5e-5);
  p.proximal_mass = Pair(0.02, 0.018);
  p.proximal_center = Pair(0.05, 0.05);
  p.distal_mass = Pair(0.020, 0.018);
  p.distal_center = Pair(0.45, 0.5) * distal;
  p.distal_inertia = Pair(1.2e-5, 1.0e-5) * (distal * distal) / (0.075 * 0.075);
  p.tip_mass = 0.01;
  return FiveBar(p);
}

struct Golden {
  double base, proximal, distal;
  Joints<2> q;
  Vector3<> tip;  // in the frame of the linkage
  std::array<double, 4> jacobian, mass;
  Joints<2> coriolis_qd, gravity;
};

// Values of an independent implementation, which agrees with a MuJoCo model of the same linkages.
TEST(FiveBar, AgreesWithAnIndependentModel) {
  const std::array<Golden, 4> golden = {{
      {0.025,
       0.063,
       0.075,
       {0.7, 2.09},
       {0.0031081790433996467 + 0.0125, 0.10052797819766468, 0.0},
       {-0.03844198000293435, -0.04987532844702957, 0.04979715658401227, -0.037506493531607406},
       {0.00018367661876385176, 3.211386015905969e-06, 3.211386015905969e-06, 0.00017862256633114154},
       {-4.7408725757759185e-05, 1.9708540597039483e-05},
       {0.026381034414839084, -0.017443072257020385}},
      {0.025,
       0.063,
       0.075,
       {1.0, 2.4},
       {-0.02394295328365245 + 0.0125, 0.10058459489409058, 0.0},
       {-0.04841630624600892, -0.0398988671634621, 0.03964122527447169, -0.048629862311608325},
       {0.00018248788738266643, 1.9807155765147916e-06, 1.9807155765147946e-06, 0.00018033392776800437},
       {-5.1264078891343764e-05, 1.315036460956064e-05},
       {0.019862170754010887, -0.023969682636409837}},
      {0.025,
       0.063,
       0.075,
       {0.3, 1.9},
       {0.025218561394088602 + 0.0125, 0.08496733468517767, 0.0},
       {-0.021138386679100472, -0.05627932609085733, 0.05885778153062912, -0.02966040799115545},
       {0.00018249928801786406, -1.4400071556691593e-05, -1.4400071556691598e-05, 0.00018237510436580978},
       {-4.632437269855313e-05, 2.164559441971089e-05},
       {0.032033599103272685, -0.012799668311926308}},
      {0.038,
       0.070,
       0.090,
       {0.7, 2.4},
       {0.02079398079433791 - 0.019, 0.10072930044319929, 0.0},
       {-0.04221776676525894, -0.04404330523534836, 0.05719798180268278, -0.05600602002981119},
       {0.0002215915660635, -3.564285157428222e-05, -3.564285157428222e-05, 0.00021686187730768166},
       {-5.875889977570631e-05, 1.590597350653979e-05},
       {0.028991631928912586, -0.026451497076461754}},
  }};
  for (const Golden& g : golden) {
    const FiveBar m = linkage(g.base, g.proximal, g.distal);
    EXPECT_LT((m.forward(g.q) - g.tip).norm(), 1e-16);
    const auto j = m.jacobian(g.q);
    const auto mass = m.mass_matrix(g.q);
    for (int row = 0; row < 2; ++row)
      for (int column = 0; column < 2; ++column) {
        EXPECT_NEAR(j(row, column), g.jacobian[static_cast<std::size_t>(2 * row + column)], 1e-15);
        EXPECT_NEAR(mass(row, column), g.mass[static_cast<std::size_t>(2 * row + column)], 1e-17);
      }
    const Joints<2> qd(0.3, -0.7);
    EXPECT_LT((m.coriolis(g.q, qd) * qd - g.coriolis_qd).norm(), 1e-16);
    EXPECT_LT((m.gravity(g.q) - g.gravity).norm(), 1e-15);
  }
}

TEST(FiveBar, ClosesTheLoop) {
  const FiveBar m = linkage(0.038, 0.07, 0.09);
  for (double a = 0.2; a < 1.4; a += 0.2)
    for (double b = 1.7; b < 3.0; b += 0.2) {
      const Vector3<> p = m.forward(Joints<2>(a, b));
      EXPECT_NEAR(std::hypot(p[0] - 0.019 - 0.07 * std::cos(a), p[1] - 0.07 * std::sin(a)), 0.09, 1e-15);
      EXPECT_NEAR(std::hypot(p[0] + 0.019 - 0.07 * std::cos(b), p[1] - 0.07 * std::sin(b)), 0.09, 1e-15);
      EXPECT_EQ(p[2], 0.0);
    }
}

TEST(FiveBar, PosesThatDoNotCloseTheLoopAreNotFinite) {
  const FiveBar m = linkage(0.1, 0.07, 0.05);
  EXPECT_FALSE(m.forward(Joints<2>(0.0, 3.1)).allFinite());
}

TEST(FiveBar, InverseExplainsUnreachablePositions) {
  const FiveBar m = linkage(0.038, 0.07, 0.09);
  const Joints<2> near(0.7, 2.4);
  EXPECT_EQ(m.inverse_kinematics({0.0, 0.1, 0.01}, near).error, "it is 10.0 mm away from the plane of the linkage");
  EXPECT_EQ(m.inverse_kinematics({0.019, 0.2, 0.0}, near).error, "200.0 mm from motor 1, and its links reach from 20.0 to 160.0 mm");
  EXPECT_FALSE(m.inverse_kinematics({0.0, 0.1, 0.0}, near).poses.empty());
}

}  // namespace
