// A controller of your own: it renders the object, damps the tip and filters the force.
#include <cstdio>
#include <palpate/palpate.hpp>

using palpate::math::Vector3;
using palpate::mechanism::TipDevice;
using palpate::object::SpringWall;
using palpate::object::SpringWallKind;

/// u = reference - object force - B v, through a low-pass filter of first order.
struct DampedDisplay {
  using Scalar = double;
  double damping = 2.0;  // N*s/m
  double share = 0.5;    // of the new value in the filtered one
  Vector3<> filtered = Vector3<>::Zero();

  Vector3<> command(const palpate::control::TickInput& in) noexcept {
    const Vector3<> wanted = in.reference - in.object_force - damping * in.velocity();
    filtered += share * (wanted - filtered);
    return filtered;
  }
  // Optional: applied(force) reports the force that the drive could give, for anti-windup.
  void reset() noexcept { filtered.setZero(); }
};
static_assert(palpate::control::Controller<DampedDisplay>);

int main() {
  palpate::servo::ServoSetup<TipDevice> setup{.start = Vector3<>(0.0, 0.0, 0.001)};
  const SpringWall wall({.kind = SpringWallKind::half_space, .stiffness = Vector3<>::Constant(1000.0)});
  palpate::servo::Servo<TipDevice, SpringWall, DampedDisplay> servo(setup, wall, DampedDisplay{});

  for (int k = 0; k <= 60; ++k) {
    const double z = k < 40 ? 0.001 - 5e-5 * k : -0.001;  // 50 mm/s into the wall, then at rest
    const auto& tick = servo.tick({0.0, 0.0, z}, Vector3<>::Zero());
    if (k % 10 == 0) std::printf("tick %2d: z = %5.2f mm, force of the motors %6.3f N\n", k, 1e3 * z, tick.torque[2]);
  }
}
