#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <palpate/palpate.hpp>
#include <random>
#include <type_traits>

#include "../../../docs/how-to/examples/planar_arm.hpp"
#include "support/linear_solve.hpp"

namespace {

using palpate::math::Dual;
using palpate::math::Joints;
using palpate::math::Pack;
using palpate::math::Vector3;
using palpate::mechanism::FiveBar;
using palpate::mechanism::joint_variables;
using palpate::mechanism::JointMatrix;
using palpate::mechanism::MechanismDefaults;
using palpate::mechanism::PlanarArm;
using palpate::mechanism::Premium;
using palpate::mechanism::PremiumParameters;
using palpate::mechanism::Slider;
using palpate::mechanism::TipDevice;
using palpate::plant::ForceSegment;
using palpate::plant::HandCoupling;
using palpate::plant::HumanArm;
using palpate::plant::JointFriction;
using palpate::plant::PlantDynamics;
using palpate::plant::PlantIntegrator;
using palpate::plant::PlantState;

/// The PHANToM Premium as a mechanism author writes it, without any fast path.
class PlainPremium : public MechanismDefaults<PlainPremium, 3> {
 public:
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Joints<3, Scalar>& q) const {
    using std::cos, std::sin;
    const Scalar reach = p_.l1 * cos(q[1]) + p_.l2 * sin(q[2]);
    return {sin(q[0]) * reach, p_.l2 - p_.l2 * cos(q[2]) + p_.l1 * sin(q[1]), cos(q[0]) * reach - p_.l1};
  }
  template <class Scalar>
  [[nodiscard]] JointMatrix<3, Scalar> mass_matrix(const Joints<3, Scalar>& q) const {
    using std::cos, std::sin;
    const auto m = Premium(p_).inertia_parameters();
    JointMatrix<3, Scalar> out = JointMatrix<3, Scalar>::Constant(Scalar(0.0));
    out(0, 0) = m.level - m.upper * sin(q[1]) * sin(q[1]) + m.fore * sin(q[2]) * sin(q[2]) + 2.0 * m.both * cos(q[1]) * sin(q[2]);
    out(1, 1) = m.m22;
    out(2, 2) = m.m33;
    out(1, 2) = out(2, 1) = -m.both * sin(q[1] - q[2]);
    return out;
  }
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Joints<3, Scalar>& q) const {
    using std::cos, std::sin;
    const double n2 = p_.l1 * p_.mass_a + p_.l5 * p_.mass_be + 0.5 * p_.l1 * p_.mass_c;
    const double n3 = 0.5 * p_.l2 * p_.mass_a + p_.l3 * p_.mass_c - p_.l6 * p_.mass_df;
    return p_.gravity * (n2 * sin(q[1]) - n3 * cos(q[2]));
  }

 private:
  PremiumParameters p_ = palpate::plant::phantom_premium_1_5a();
};

/// A mechanism to check, with random states where it is defined.
template <class M>
struct RandomState {
  static M mechanism() {
    if constexpr (std::is_same_v<M, Premium>) return Premium(palpate::plant::phantom_premium_1_5a());
    return M();
  }

  Joints<M::dof> draw(double size) {
    Joints<M::dof> out;
    for (int i = 0; i < M::dof; ++i) out[i] = size * uniform_(engine_);
    return out;
  }
  Joints<M::dof> pose() {
    if constexpr (std::is_same_v<M, FiveBar>)
      return Joints<2>(0.7, 2.3) + draw(0.4);
    else
      return draw(4.0);
  }
  Vector3<> force() { return {uniform_(engine_), uniform_(engine_), uniform_(engine_)}; }

 private:
  std::mt19937_64 engine_{7};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
};

template <class M>
class MechanismLaw : public testing::Test {};
using Mechanisms = testing::Types<Premium, PlainPremium, Slider, FiveBar, TipDevice, PlanarArm>;
TYPED_TEST_SUITE(MechanismLaw, Mechanisms);

static_assert(palpate::mechanism::RegisteredMechanism<PlanarArm>);

TYPED_TEST(MechanismLaw, SatisfiesTheConcept) {
  static_assert(palpate::mechanism::Mechanism<TypeParam>);
}

TYPED_TEST(MechanismLaw, JacobianIsTheDerivativeOfForward) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 100; ++n) {
    const Joints<dof> q = sample.pose();
    const auto p = m.forward(joint_variables<dof, double>(q));
    const auto j = m.jacobian(q);
    for (int row = 0; row < 3; ++row) EXPECT_LT((p[row].gradient.transpose() - j.row(row)).norm(), 1e-13);
  }
}

TYPED_TEST(MechanismLaw, VelocityAndTorqueFollowTheJacobian) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 100; ++n) {
    const Joints<dof> q = sample.pose();
    const Joints<dof> qd = sample.draw(10.0);
    const Vector3<> f = sample.force();
    EXPECT_LT((m.velocity(m.kinematics(q), qd) - m.jacobian(q) * qd).norm(), 1e-14);
    EXPECT_LT((m.apply_jacobian_transpose(m.kinematics(q), f) - m.jacobian(q).transpose() * f).norm(), 1e-14);
  }
}

TYPED_TEST(MechanismLaw, GravityIsTheDerivativeOfThePotential) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 100; ++n) {
    const Joints<dof> q = sample.pose();
    EXPECT_LT((m.potential(joint_variables<dof, double>(q)).gradient - m.gravity(q)).norm(), 1e-15);
  }
}

// dM/dt - 2C is skew-symmetric: the mechanism is passive.
TYPED_TEST(MechanismLaw, MassRateLessTwiceCoriolisIsSkew) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 200; ++n) {
    const Joints<dof> q = sample.pose();
    const Joints<dof> qd = sample.draw(10.0);
    const auto mass = m.mass_matrix(joint_variables<dof, double>(q));
    JointMatrix<dof> rate;
    for (int i = 0; i < dof; ++i)
      for (int k = 0; k < dof; ++k) rate(i, k) = mass(i, k).gradient.dot(qd);
    const JointMatrix<dof> skew = rate - 2.0 * m.coriolis(q, qd);
    EXPECT_LT((skew + skew.transpose()).cwiseAbs().maxCoeff(), 1e-12 * rate.cwiseAbs().maxCoeff() + 1e-18);
  }
}

TYPED_TEST(MechanismLaw, AccelerationSolvesTheEquationsOfMotion) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 200; ++n) {
    const Joints<dof> q = sample.pose();
    const Joints<dof> qd = sample.draw(10.0);
    const Joints<dof> tau = sample.draw(1.0);
    const Joints<dof> inertial = m.mass_matrix(q) * m.acceleration(q, qd, tau);
    const Joints<dof> coriolis = m.coriolis(q, qd) * qd;
    EXPECT_LT((inertial + coriolis + m.gravity(q) - tau).norm(), 1e-12 * (1.0 + tau.norm() + coriolis.norm()));
  }
}

// A point mass at the tip adds m J^T J to the mass matrix and m J^T dJ/dt qd to the required torque, but no weight.
TYPED_TEST(MechanismLaw, TipMassAddsItsJacobianInertia) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  const double mass = 0.15;
  for (int n = 0; n < 100; ++n) {
    const Joints<dof> q = sample.pose();
    const Joints<dof> qd = sample.draw(3.0);
    const Joints<dof> torque = sample.draw(0.3);
    const auto j = m.jacobian(q);
    const auto moving = m.jacobian(joint_variables<dof, double>(q));
    Vector3<> jacobian_rate_qd = Vector3<>::Zero();
    for (int row = 0; row < 3; ++row)
      for (int i = 0; i < dof; ++i) jacobian_rate_qd[row] += moving(row, i).gradient.dot(qd) * qd[i];
    const JointMatrix<dof> inertia = m.mass_matrix(q) + mass * j.transpose() * j;
    const Joints<dof> bias = m.coriolis(q, qd) * qd + m.gravity(q) + mass * j.transpose() * jacobian_rate_qd;
    const auto dynamics = m.dynamics(m.kinematics(q), m.inertia_parameters(mass));
    const Joints<dof> qdd = dynamics.inverse() * dynamics.generalized_force(torque, qd);
    EXPECT_LT((inertia * qdd + bias - torque).norm(), 1e-11 * (1.0 + bias.norm()));
    EXPECT_LT((dynamics.inertia_torque(qdd) - inertia * qdd).norm(), 1e-11 * (1.0 + bias.norm()));
  }
}

// A stuck joint has no acceleration; the others move as if its row and column of M were removed.
TYPED_TEST(MechanismLaw, StuckJointsHaveNoAcceleration) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 100; ++n) {
    const Joints<dof> q = sample.pose();
    const Joints<dof> force = sample.draw(0.3);
    for (int which = 0; which < (1 << dof); ++which) {
      std::array<bool, dof> stuck{};
      JointMatrix<dof> mass = m.mass_matrix(q);
      Joints<dof> f = force;
      for (int i = 0; i < dof; ++i) {
        stuck[static_cast<std::size_t>(i)] = ((which >> i) & 1) != 0;
        if (!stuck[static_cast<std::size_t>(i)]) continue;
        mass.row(i).setZero();
        mass.col(i).setZero();
        mass(i, i) = 1.0;
        f[i] = 0.0;
      }
      const Joints<dof> expected = linear_solve(mass, f);
      EXPECT_LT((m.dynamics(m.kinematics(q)).inverse(stuck) * force - expected).norm(), 1e-10 * (1.0 + expected.norm())) << which;
    }
  }
}

TYPED_TEST(MechanismLaw, InverseKinematicsReachesTheTip) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  RandomState<TypeParam> sample;
  for (int n = 0; n < 100; ++n) {
    const Joints<dof> q = sample.pose();
    const Vector3<> p = m.forward(q);
    const auto found = m.inverse_kinematics(p, q + sample.draw(0.05));
    ASSERT_FALSE(found.poses.empty()) << found.error;
    for (const Joints<dof>& pose : found.poses) EXPECT_LT((m.forward(pose) - p).norm(), 1e-9);
  }
}

/// Integrate one step without dry friction. PlantIntegrator chooses between all couplings, which takes long to compile for each mechanism.
template <HandCoupling coupling, class M, class Scalar>
void smooth_step(const PlantDynamics<M, Scalar>& plant, PlantState<M::dof, Scalar>& s, const Joints<M::dof, Scalar>& torque, double h) {
  using Dynamics = PlantDynamics<M, Scalar>;
  const Vector3<Scalar> zero = Vector3<Scalar>::Constant(0.0);
  const typename Dynamics::AppliedLoad load{torque, zero, zero};
  const typename Dynamics::NoDryFriction modes;
  const auto here = plant.template at<coupling>(plant.mechanism().kinematics(s.q));
  const auto first = plant.template acceleration<coupling>(here, s, load, Scalar(0.0), modes);
  plant.template step<coupling>(s, here, first, load, Scalar(0.0), h, modes);
}

// Without friction and external forces, the energy is conserved.
TYPED_TEST(MechanismLaw, FreeMotionConservesEnergy) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  const PlantDynamics<TypeParam, double> plant(m, JointFriction<dof>{}, HumanArm{});
  PlantState<dof> s;
  for (int i = 0; i < dof; ++i) s.qd[i] = i % 2 == 0 ? 1.0 : -2.0;
  s.q = std::is_same_v<TypeParam, FiveBar> ? Joints<dof>(Joints<dof>::LinSpaced(0.7, 2.3)) : Joints<dof>(Joints<dof>::Constant(0.4));
  const auto energy = [&] { return 0.5 * s.qd.dot(m.mass_matrix(s.q) * s.qd) + m.potential(s.q); };
  const double before = energy();
  const int periods = std::is_same_v<TypeParam, FiveBar> ? 30 : 200;  // the linkage falls to a singular pose later
  for (int k = 0; k < 4 * periods; ++k) smooth_step<HandCoupling::none>(plant, s, Joints<dof>(Joints<dof>::Zero()), 0.25e-3);
  EXPECT_LT(std::abs(energy() - before), 1e-9 * std::abs(before));
}

// Several plants side by side compute the same as one. PlantIntegrator.LanesEqualOneLoop adds dry friction.
TYPED_TEST(MechanismLaw, LanesEqualOneLoop) {
  constexpr int dof = TypeParam::dof;
  const TypeParam m = RandomState<TypeParam>::mechanism();
  JointFriction<dof> friction;
  friction.viscous.setConstant(0.01);
  HumanArm arm;
  arm.mass = 0.1;
  arm.damping = 3.0;
  const PlantDynamics<TypeParam, double> one(m, friction, arm);
  PlantDynamics<TypeParam, Pack<2>> both;
  std::array<PlantState<dof>, 2> s;
  PlantState<dof, Pack<2>> lanes;
  RandomState<TypeParam> sample;
  for (int lane = 0; lane < 2; ++lane) {
    auto& state = s[static_cast<std::size_t>(lane)];
    state.q = sample.pose();
    state.qd = sample.draw(0.5);
    both.set_lane(lane, one);
    lanes.set_lane(lane, state);
  }
  const Joints<dof> torque = Joints<dof>::Constant(0.01);
  for (int k = 0; k < 50; ++k) {
    for (auto& state : s) smooth_step<HandCoupling::rigid>(one, state, torque, 1e-3);
    smooth_step<HandCoupling::rigid>(both, lanes, Joints<dof, Pack<2>>(torque.template cast<Pack<2>>()), 1e-3);
  }
  for (int lane = 0; lane < 2; ++lane)
    for (int i = 0; i < dof; ++i) EXPECT_NEAR(lanes.q[i][lane], s[static_cast<std::size_t>(lane)].q[i], 1e-13);
}

// The defaults give the results of the fast path.
TEST(MechanismDefaults, EqualTheFastPathOfThePremium) {
  const Premium fast = RandomState<Premium>::mechanism();
  const PlainPremium plain;
  RandomState<Premium> sample;
  for (int n = 0; n < 200; ++n) {
    const Joints<3> q = sample.pose();
    const Joints<3> qd = sample.draw(5.0);
    const Joints<3> tau = sample.draw(0.5);
    EXPECT_LT((plain.forward(q) - fast.forward(q)).norm(), 1e-15);
    EXPECT_LT((plain.jacobian(q) - fast.jacobian(q)).norm(), 1e-14);
    EXPECT_LT((plain.mass_matrix(q) - fast.mass_matrix(q)).norm(), 1e-16);
    EXPECT_LT((plain.coriolis(q, qd) - fast.coriolis(q, qd)).norm(), 1e-15);
    EXPECT_LT((plain.gravity(q) - fast.gravity(q)).norm(), 1e-15);
    const Joints<3> qdd = fast.acceleration(q, qd, tau);
    EXPECT_LT((plain.acceleration(q, qd, tau) - qdd).norm(), 1e-12 * (1.0 + qdd.norm()));
    using Variable = Dual<3>;  // linearization
    const Joints<3, Variable> speed = qd.cast<Variable>();
    const Joints<3, Variable> torque = tau.cast<Variable>();
    const auto exact = fast.acceleration(joint_variables<3, double>(q), speed, torque);
    const auto derived = plain.acceleration(joint_variables<3, double>(q), speed, torque);
    for (int i = 0; i < 3; ++i) EXPECT_LT((exact[i].gradient - derived[i].gradient).norm(), 1e-12 * (1.0 + exact[i].gradient.norm()));
  }
}

TEST(MechanismDefaults, SimulateThePremiumWithDryFrictionAndAnArm) {
  JointFriction<3> friction = palpate::plant::phantom_premium_1_5a_friction();
  friction.coulomb.setConstant(0.005);
  friction.breakaway.setConstant(0.008);
  HumanArm arm;
  arm.mass = 0.15;
  arm.damping = 4.5;
  arm.stiffness = 560.0;
  const PlantIntegrator<Premium> fast(RandomState<Premium>::mechanism(), friction, arm);
  const PlantIntegrator<PlainPremium> plain(PlainPremium{}, friction, arm);
  PlantState<3> s, t;
  s.q = t.q = Joints<3>(0.2, 0.4, 0.6);
  s.qd = t.qd = Joints<3>(0.3, -0.2, 0.1);
  for (int k = 0; k < 300; ++k) {
    fast.advance(s, Joints<3>(0.02, 0.01, -0.01), ForceSegment<>{}, 1e-3, 2);
    plain.advance(t, Joints<3>(0.02, 0.01, -0.01), ForceSegment<>{}, 1e-3, 2);
  }
  EXPECT_LT((s.q - t.q).norm(), 1e-11);
}

TEST(TipDevice, MapsPositionAndForceToItself) {
  const TipDevice device;
  const Vector3<> p(0.01, 0.02, -0.03);
  palpate::mechanism::TipKinematics<TipDevice> kinematics(device);
  kinematics.update(Joints<3>(p));
  EXPECT_EQ(kinematics.tip(), p);
  EXPECT_EQ(kinematics.torque(Vector3<>(1.0, 2.0, 3.0)), Vector3<>(1.0, 2.0, 3.0));
}

}  // namespace
