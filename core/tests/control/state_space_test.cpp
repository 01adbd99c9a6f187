#include <gtest/gtest.h>

#include <palpate/control/state_space.hpp>
#include <palpate/object/virtual_coupling.hpp>

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

}  // namespace
