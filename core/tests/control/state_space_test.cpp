#include <gtest/gtest.h>

#include <palpate/control/state_space.hpp>
#include <palpate/object/virtual_coupling.hpp>
#include <vector>

namespace {

using palpate::control::StateSpace;
using palpate::math::Vector3;
using palpate::object::VirtualCoupling;

TEST(StateSpace, WithoutStatesIsAGain) {
  Eigen::MatrixXd d(3, 6);
  d << Eigen::Matrix3d::Identity() * 2.0, -Eigen::Matrix3d::Identity();
  StateSpace gain(Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 6), Eigen::MatrixXd(3, 0), d, Eigen::MatrixXd(0, 3));
  EXPECT_EQ(gain.output({1.0, 2.0, 3.0}, {1.0, 1.0, 1.0}), Vector3<>(1.0, 3.0, 5.0));
}

// Law: with anti-windup, an integrator stops at the limit of the drive.
TEST(StateSpace, AntiwindupHoldsAnIntegrator) {
  const Eigen::MatrixXd eye = Eigen::MatrixXd::Identity(3, 3);
  Eigen::MatrixXd b(3, 6);
  b << 0.1 * eye, -0.1 * eye;
  StateSpace wound(eye, b, eye, Eigen::MatrixXd::Zero(3, 6), Eigen::MatrixXd::Zero(3, 3));
  StateSpace held(eye, b, eye, Eigen::MatrixXd::Zero(3, 6), 0.5 * eye);
  for (int k = 0; k < 1000; ++k) {
    for (StateSpace* c : {&wound, &held}) {
      const Vector3<> u = c->output({1.0, 0.0, 0.0}, Vector3<>::Zero());
      c->applied(u.cwiseMin(2.0));
    }
  }
  EXPECT_NEAR(wound.state()[0], 100.0, 1e-9);
  EXPECT_NEAR(held.state()[0], 2.2, 1e-9);  // input 0.1 balances 0.5 times the excess over 2
}

TEST(VirtualCoupling, SpringAndBackwardDifference) {
  VirtualCoupling c({100.0, 200.0, 300.0}, {1.0, 0.0, 2.0}, VirtualCoupling::Difference::backward);
  EXPECT_TRUE(c.force({0.0, 0.0, 0.0}, 1000.0).isZero());
  const Vector3<> f = c.force({1e-3, 1e-3, 1e-3}, 1000.0);
  EXPECT_NEAR(f[0], 0.1 + 1.0, 1e-12);
  EXPECT_NEAR(f[1], 0.2, 1e-12);
  EXPECT_NEAR(f[2], 0.3 + 2.0, 1e-12);
}

// Law: the bilinear rule is the trapezoidal rule: T (v_k + v_{k-1}) / 2 adds up to the displacement.
TEST(VirtualCoupling, BilinearRateAddsUpToTheDisplacement) {
  VirtualCoupling c(Vector3<>::Zero(), Vector3<>::Ones(), VirtualCoupling::Difference::bilinear);
  double sum = 0.0, before = 0.0, x = 0.0;
  for (int k = 0; k < 200; ++k) {
    x = std::sin(0.05 * k);
    const double v = c.force({x, 0.0, 0.0}, 1000.0)[0];
    sum += 0.5e-3 * (v + before);
    before = v;
  }
  EXPECT_NEAR(sum, x, 1e-12);
}

// Law: after a reset the same signals give the same commands, with state, anti-windup and the stiffness of the last contact forgotten.
TEST(StateSpace, AResetControllerStartsAgain) {
  const Eigen::MatrixXd eye = Eigen::MatrixXd::Identity(3, 3);
  Eigen::MatrixXd b(3, 6);
  b << 0.1 * eye, -0.1 * eye;
  StateSpace law(0.9 * eye, b, eye, Eigen::MatrixXd::Zero(3, 6), 0.5 * eye);
  law.normalize({1000.0, 1000.0, 1000.0});
  const Vector3<> reference(0.0, 0.0, -1.0), none = Vector3<>::Zero();
  std::vector<Vector3<>> first;
  for (int k = 0; k < 8; ++k) {
    palpate::object::ContactResult contact;  // the tip touches a surface from the third tick on
    if (k % 4 >= 2) {
      contact.normal = Vector3<>::UnitZ();
      contact.stiffness = 200.0;
      contact.depth = 1e-3;
      contact.force = {0.0, 0.0, -0.2};
    }
    const Vector3<> u = law.command({reference, contact.force, none, none, none, 1e3, 0.0, contact, none.data(), none, 0.0});
    law.applied(u.cwiseMax(-0.05));
    if (k < 4) {
      first.push_back(u);
    } else {
      EXPECT_EQ(u, first[static_cast<std::size_t>(k - 4)]) << k;
    }
    if (k == 3) {
      EXPECT_GT(law.state().norm(), 0.0);
      law.reset();
      EXPECT_EQ(law.state().norm(), 0.0);
    }
  }
  EXPECT_NE(first[3], first[2]);
}

// Matrices whose first 18 numbers are those of u = reference - object, behind a state.
TEST(StateSpace, AStateIsNotMistakenForAGain) {
  Eigen::MatrixXd c(3, 1), d(3, 6);
  c << 1, 0, 0;
  d << 0, 0, -1, 0, 0, 7, 1, 0, 0, -1, 0, 8, 0, 1, 0, 0, -1, 9;
  StateSpace law(Eigen::MatrixXd::Zero(1, 1), Eigen::MatrixXd::Zero(1, 6), c, d, Eigen::MatrixXd::Zero(1, 3));
  EXPECT_EQ(law.output({1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}), d * (Eigen::VectorXd(6) << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0).finished());
}

}  // namespace
