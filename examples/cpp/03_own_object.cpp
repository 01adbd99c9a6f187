// An object of your own: a magnet that attracts the tip, stronger when nearer.
#include <cmath>
#include <cstdio>
#include <palpate/palpate.hpp>

using palpate::math::Vector3;
using palpate::mechanism::TipDevice;

/// The tip is pulled to the origin by strength |x| exp(-|x| / range). A ContactResult holds the opposite force: of the tip on the object.
struct Magnet {
  using Scalar = double;
  double strength = 200.0;  // N/m
  double range = 0.01;      // m
  palpate::object::ContactResult result{};

  const palpate::object::ContactResult& step(const palpate::object::TipState& tip) noexcept {
    const double distance = tip.position.norm();
    result.force = strength * std::exp(-distance / range) * tip.position;
    result.touching = distance < 0.05;
    return result;
  }
};
static_assert(palpate::object::ContactObject<Magnet>);

int main() {
  palpate::servo::Servo<TipDevice, Magnet> servo({.start = Vector3<>(0.04, 0.0, 0.0)}, Magnet{});
  for (int i = 0; i <= 4; ++i) {
    const auto& tick = servo.tick({0.04 - 0.01 * i, 0.0, 0.0}, Vector3<>::Zero());
    std::printf("x = %4.1f mm: force of the motors %7.4f N\n", 1e3 * tick.tip[0], tick.torque[0]);
  }

  // Several objects at once: their forces add.
  palpate::object::Scene scene;
  scene.add(Magnet{});
  scene.add(palpate::object::SpringWall(
      {.kind = palpate::object::SpringWallKind::half_space, .stiffness = Vector3<>::Constant(500.0)}));  // below z = 0
  const auto& both = scene.step({Vector3<>(0.01, 0.0, -0.001), 1000.0});
  std::printf("magnet and wall: %.4f %.4f %.4f N\n", both.force[0], both.force[1], both.force[2]);
}
