#include <cstdio>
#include <palpate/palpate.hpp>

int main() {
  palpate::servo::ServoSetup<palpate::mechanism::Premium> setup{.mechanism =
                                                                    palpate::mechanism::Premium(palpate::plant::phantom_premium_1_5a())};
  // A wall of 800 N/m through the origin, facing the operator.
  const palpate::object::SpringWall wall(
      {.kind = palpate::object::SpringWall::Kind::half_space, .stiffness = palpate::math::Vector3<>::Constant(800.0)});
  palpate::servo::Servo<palpate::mechanism::Premium, palpate::object::SpringWall> servo(setup, wall);

  const auto inside = setup.mechanism.inverse({0.0, 0.0, -0.001}).q;  // one millimeter
  const auto& tick = servo.tick(inside, palpate::math::Vector3<>::Zero());
  std::printf("torque %.6f %.6f %.6f N*m\n", tick.torque[0], tick.torque[1], tick.torque[2]);
}
