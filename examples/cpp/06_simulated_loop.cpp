// Step a simulated loop sample by sample: arm, servo, wall and an operator who pushes.
#include <cstdio>
#include <palpate/palpate.hpp>

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::object::SpringWall;
using palpate::object::SpringWallKind;

int main() {
  palpate::servo::SimulationSetup<Premium> setup;
  setup.mechanism = Premium(palpate::plant::phantom_premium_1_5a());
  setup.start = setup.mechanism.inverse({0.0, 0.0, 0.001}).q;
  setup.period = 1e-3;  // s
  setup.gravity_compensation = Vector3<>::Zero();
  setup.friction = palpate::plant::phantom_premium_1_5a_friction();
  setup.human_arm = {.mass = 0.15, .damping = 4.5, .stiffness = 200.0, .rest = Vector3<>(0.0, 0.0, 0.001)};
  setup.object = SpringWall({.kind = SpringWallKind::half_space,
                             .stiffness = Vector3<>::Constant(1000.0),  // N/m
                             .damping = Vector3<>::Constant(2.0)});     // N*s/m

  palpate::servo::Loop<Premium> loop(setup);
  const Vector3<> push(0.0, 0.0, -2.0);  // N
  for (int k = 0; k <= 1000; ++k) {
    const auto& tick = loop.tick(Vector3<>::Zero());
    if (k % 200 == 0)
      std::printf("t = %.3f s: tip at z = %7.4f mm, force on the wall %6.3f N\n", loop.time(), 1e3 * tick.tip[2], tick.object_force[2]);
    // Between the tick and the next sample the program may change the object: *loop.servo().object().get_if<SpringWall>() = ...
    if (!loop.advance(push, push)) {
      std::printf("diverged\n");
      return 1;
    }
  }
}
