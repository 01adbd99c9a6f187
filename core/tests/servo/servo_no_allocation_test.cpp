// Servo tick and plant do not allocate. The allocation functions of this program count every call.
#include <gtest/gtest.h>

#include <palpate/object/mesh_object.hpp>

#include "support/allocations.hpp"
#include "support/mesh_shapes.hpp"
#include "support/states.hpp"

namespace {

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;

TEST(NoAllocation, InATickAndAPeriodOfMotion) {
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  palpate::servo::ServoSetup<Premium> setup{.mechanism = arm};
  const palpate::object::SpringWall spring({.kind = palpate::object::SpringWall::Kind::point,
                                            .point = arm.forward(pose),
                                            .stiffness = Vector3<>::Constant(500.0),
                                            .damping = Vector3<>::Constant(1.0),
                                            .difference = palpate::object::CouplingDifference::bilinear});
  const int order = 15;
  const palpate::control::StateSpace controller(0.5 * Eigen::MatrixXd::Identity(order, order), 0.01 * Eigen::MatrixXd::Ones(order, 6),
                                                0.01 * Eigen::MatrixXd::Ones(3, order), 0.1 * Eigen::MatrixXd::Ones(3, 6),
                                                0.1 * Eigen::MatrixXd::Ones(order, 3));
  setup.limits.peak_force = 8.5;
  setup.limits.continuous_force = 1.4;
  setup.encoder.step = Joints<3>::Constant(1e-4);
  setup.gravity_compensation = Vector3<>(0.1, 0.1, 0.1);
  setup.delay = 2;
  setup.start = pose;
  palpate::servo::Servo<Premium, palpate::object::AnyObject, palpate::control::AnyController> servo(setup, spring, controller);
  palpate::plant::JointFriction<3> friction = palpate::plant::phantom_premium_1_5a_friction();
  friction.coulomb = friction.breakaway = Joints<3>::Constant(0.01);
  palpate::plant::HumanArm hand;
  hand.mass = 0.15;
  hand.damping = 4.5;
  hand.stiffness = 560.0;
  hand.tissue = true;
  hand.tissue_stiffness = 500.0;
  hand.tissue_damping = 0.5;
  const palpate::plant::PlantIntegrator<Premium> motion(arm, friction, hand);
  palpate::plant::PlantState<3> state;
  state.q = pose;
  state.hand_position = arm.forward(pose);

  const long before = allocations;
  for (int k = 0; k < 2000; ++k) {
    const auto& tick = servo.tick(state.q, Vector3<>(0.5, 0.2, -0.3));
    motion.advance(state, tick.torque, palpate::plant::ForceSegment<>{Vector3<>(0.1, 0.0, 0.0), Vector3<>(0.1, 0.1, 0.0)}, 1e-3, 2);
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(state.q.allFinite());
}

TEST(NoAllocation, InAPeriodOfMotionWithAFlexibleMode) {
  palpate::servo::SimulationSetup<Premium> setup;
  setup.mechanism = Premium(palpate::plant::phantom_premium_1_5a());
  setup.start = Joints<3>(0.0, 2.2305, 3.2776);
  setup.flexible = palpate::mechanism::FlexibleMode{120.0, 0.3, 0.01};
  setup.friction = palpate::plant::phantom_premium_1_5a_friction();
  setup.friction.coulomb = setup.friction.breakaway = Joints<3>::Constant(0.01);
  setup.human_arm.mass = 0.15;
  setup.human_arm.tissue = true;
  setup.human_arm.tissue_stiffness = 500.0;
  palpate::servo::detail::FlexiblePlant<Premium> plant(setup);
  const palpate::actuation::TickSchedule<double> regular(1e-3, 0.0, 0);
  const long before = allocations;
  for (int k = 0; k < 300; ++k) plant.advance(Joints<3>(0.01, 0.02, 0.02), {Vector3<>(0.1, 0.0, 0.0), Vector3<>(0.1, 0.1, 0.0)}, regular);
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(plant.tip().allFinite());
}

TEST(NoAllocation, InATickOfAControllerThatPositionsTheTipAndOfANormalizedOne) {
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  palpate::servo::ServoSetup<Premium> setup{.mechanism = arm};
  setup.limits.peak_force = 8.5;
  setup.limits.continuous_force = 1.4;
  setup.start = pose;
  const palpate::object::SpringWall wall(
      {.kind = palpate::object::SpringWall::Kind::half_space, .point = arm.forward(pose), .stiffness = Vector3<>::Constant(500.0)});
  palpate::control::StateSpace normalized;
  normalized.normalize(Vector3<>::Constant(1000.0));
  const palpate::control::WorkspaceController<Premium> workspace(arm, Joints<3>::Constant(1e-4), palpate::control::WorkspaceParameters{},
                                                                 1e-3);
  const palpate::control::AdmittanceController<Premium> display(arm, Joints<3>::Constant(1e-4), {}, {.mass = 0.1}, setup.period);
  for (const palpate::control::AnyController& controller : {palpate::control::AnyController(normalized), {workspace}, {display}}) {
    palpate::servo::Servo<Premium, palpate::object::AnyObject, palpate::control::AnyController> servo(setup, wall, controller);
    double commanded = 0.0;
    const long before = allocations;
    for (int k = 0; k < 1000; ++k) {
      const Joints<3> q = pose + 0.05 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
      commanded += servo.tick(q, Vector3<>(0.0, 0.0, -1.0)).command.norm();
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(commanded, 1.0);
  }
}

TEST(NoAllocation, InATickWithAGuard) {
  using palpate::guard::EnergyBound, palpate::guard::HalfSample, palpate::guard::PassivityController, palpate::guard::VelocityEstimate;
  using Guard = palpate::guard::AnyGuard<Premium>;
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  palpate::servo::ServoSetup<Premium> setup{.mechanism = arm};
  setup.encoder.step = Joints<3>::Constant(1e-4);
  setup.delay = 1;
  setup.start = pose;
  const palpate::object::SpringWall wall(
      {.kind = palpate::object::SpringWall::Kind::half_space, .point = arm.forward(pose), .stiffness = Vector3<>::Constant(500.0)});
  for (const Guard& guard : {Guard(PassivityController<Premium>()), Guard(EnergyBound<Premium>({.damping = Joints<3>::Constant(0.01)})),
                             Guard(HalfSample<Premium>({.velocity = VelocityEstimate::adaptive_window})),
                             Guard(HalfSample<Premium>({.velocity = VelocityEstimate::observer}))}) {
    palpate::servo::Servo<Premium, palpate::object::AnyObject, palpate::control::AnyController, Guard> servo(setup, wall, {}, guard);
    double commanded = 0.0;
    const long before = allocations;
    for (int k = 0; k < 1000; ++k) {
      const Joints<3> q = pose + 0.05 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
      commanded += servo.tick(q, Vector3<>::Zero()).command.norm();
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(commanded, 1.0);
  }
}

TEST(NoAllocation, InATickOnAMesh) {
  const Premium arm(palpate::plant::phantom_premium_1_5a());
  const Joints<3> pose(0.0, 2.2305, 3.2776);
  palpate::mesh::Surface surface;
  surface.static_friction = surface.dynamic_friction = 0.3;
  surface.field = palpate::mesh::FieldKind::continuous;
  shapes::Shape ball = shapes::ball(10, 0.05, 0.1);
  for (Vector3<>& v : ball.vertices) v += arm.forward(pose) - Vector3<>(0.0, 0.0, 0.05);
  surface.stiffness.assign(ball.triangles.size(), 1000.0);
  for (std::size_t i = 0; i < surface.stiffness.size(); i += 3) surface.stiffness[i] = 300.0;
  const auto model = palpate::object::MeshModel::make({ball.vertices, ball.triangles, false}, surface);
  for (const double radius : {0.0, 2e-3}) {
    palpate::servo::ServoSetup<Premium> setup{.mechanism = arm};
    setup.start = pose;
    palpate::servo::Servo<Premium, palpate::object::AnyObject> servo(setup, palpate::object::MeshObject(model, radius));
    int touching = 0;
    const long before = allocations;
    for (int k = 0; k < 2000; ++k) {
      const Joints<3> q = pose + 0.05 * Joints<3>(std::sin(0.03 * k), std::cos(0.02 * k) - 1.0, std::sin(0.05 * k));
      touching += servo.tick(q, Vector3<>::Zero()).touching ? 1 : 0;
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 200);
  }
}

}  // namespace
