#include <cstdio>
#include <palpate/palpate.hpp>

int main() {
  const palpate::Premium arm(palpate::phantom_premium_1_5a());
  palpate::Anchor wall{palpate::Anchor::Kind::half_space, palpate::Vector3<>::Zero(), palpate::Vector3<>::UnitZ()};
  palpate::VirtualCoupling surface(palpate::Vector3<>::Constant(800.0), palpate::Vector3<>::Zero(), {}, 1e-3);
  palpate::Servo<palpate::Premium> servo(palpate::Kinematics(arm), {}, wall, surface, palpate::StateSpace::negative_feedback(), {}, {0, 0, 0}, 0, {0, 0, 0});
  const auto& tick = servo.tick(arm.inverse({0.0, 0.0, -0.001}).q, {0, 0, 0});  // one millimetre inside the wall
  std::printf("torque %.6f %.6f %.6f N*m\n", tick.torque[0], tick.torque[1], tick.torque[2]);
}
