// Press the PHANToM Premium 1.5A into a wall: one servo tick per millisecond, from joint angles to joint torques.
#include <cstdio>
#include <palpate/palpate.hpp>

using palpate::math::Vector3;
using palpate::mechanism::Premium;
using palpate::object::SpringWall;
using palpate::object::SpringWallKind;

int main() {
  palpate::servo::ServoSetup<Premium> setup{.mechanism = Premium(palpate::plant::phantom_premium_1_5a())};
  setup.period = 1e-3;            // s
  setup.limits.peak_force = 8.5;  // N
  if (setup.fault() != nullptr) {
    std::printf("%s\n", setup.fault());
    return 1;
  }

  // A wall through the origin that faces the operator (+z).
  const SpringWall wall({.kind = SpringWallKind::half_space, .stiffness = Vector3<>::Constant(800.0)});  // N/m
  palpate::servo::Servo<Premium, SpringWall> servo(setup, wall);

  // A device driver would read the angles and write the torques.
  for (int i = 0; i <= 4; ++i) {
    const double z = 0.002 - 0.001 * i;  // m
    const auto& tick = servo.tick(setup.mechanism.inverse({0.0, 0.0, z}).q, Vector3<>::Zero());
    std::printf("z = %4.1f mm: force on the wall %6.3f N, torques %7.4f %7.4f %7.4f N*m\n", 1e3 * z, tick.object_force[2], tick.torque[0],
                tick.torque[1], tick.torque[2]);
  }
}
