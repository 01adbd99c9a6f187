#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <palpate/guard/passivity_controller.hpp>
#include <palpate/mechanism/premium.hpp>
#include <palpate/mechanism/slider.hpp>
#include <palpate/plant/device_catalog.hpp>

namespace {

using palpate::guard::PassivityController;
using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::mechanism::Slider;

constexpr double guard_mass = 0.06, guard_period = 1e-3;

/// Return the damping that the controller adds after the display has delivered `energy` [J] and the tip has then moved by `way` [m].
double added_damping(double energy, double way) {
  PassivityController<Slider> guard;
  guard.prepare({Slider(guard_mass), Joints<1>(0.0), guard_period, 0});
  const Vector3<> none = Vector3<>::Zero();
  guard.command(Joints<1>(0.0), none, none);
  guard.commit(Joints<1>(energy / 1e-4));
  guard.command(Joints<1>(1e-4), none, none);
  guard.commit(Joints<1>(0.0));
  EXPECT_NEAR(guard.energy(), -energy, 1e-18);
  const Vector3<> force = guard.command(Joints<1>(1e-4 + way), none, Vector3<>(way, 0.0, 0.0));
  return -force.x() * guard_period / way;
}

// Law: alpha = min(m/(2T), -E T/dx^2), and none while the display has absorbed energy (Hannaford & Ryu 2002).
TEST(PassivityController, TakesBackTheDeliveredEnergyWithinItsCap) {
  EXPECT_NEAR(added_damping(1e-6, 5e-4), 1e-6 * guard_period / 25e-8, 1e-12);
  EXPECT_NEAR(added_damping(1e-6, -5e-4), 1e-6 * guard_period / 25e-8, 1e-12);
  EXPECT_NEAR(added_damping(1e-3, 1e-4), guard_mass / (2.0 * guard_period), 1e-12);
  EXPECT_EQ(added_damping(-1e-3, 1e-4), 0.0);
}

// Law: the damping acts along the force and counts the inertia of the tip there, so it reduces the velocity by at most half.
TEST(PassivityController, DampsAlongTheForceWithTheInertiaOfThePose) {
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.1, 2.1, 3.2);
  PassivityController<Premium> guard;
  guard.prepare({arm, Joints<3>::Zero(), guard_period, 0});
  const Vector3<> none = Vector3<>::Zero(), force(0.3, -0.5, 0.8), moved(1e-5, 2e-5, 1e-5);
  guard.command(pose, none, none);
  guard.commit(Joints<3>(1.0, 1.0, 1.0));
  const Joints<3> next = pose + Joints<3>(0.1, 0.1, 0.1);
  const Vector3<> added = guard.command(next, force, moved) - force, along = force.normalized();
  ASSERT_LT(guard.energy(), -0.1);  // the cap acts
  EXPECT_LT(added.cross(along).norm(), 1e-12 * added.norm());
  const auto cache = arm.kinematics(next);
  const Joints<3> torque = arm.apply_jacobian_transpose(cache, added);
  const Vector3<> change = guard_period * (arm.jacobian(cache) * Joints<3>(arm.dynamics(cache).inverse() * torque));
  EXPECT_NEAR(change.dot(along), -0.5 * moved.dot(along) / guard_period, 1e-9 * moved.norm() / guard_period);
}

}  // namespace
