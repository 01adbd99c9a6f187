// A mechanism of your own from three functions: tip position, mass matrix, potential energy. All else has defaults.
// palpate/mechanism/five_bar.hpp is an example with a closed loop.
#include <cstdio>
#include <palpate/math/sincos.hpp>
#include <palpate/mechanism/mechanism.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/servo/servo.hpp>

using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::JointMatrix;

/// A turntable (angle about z, rad) that carries a slide (m) along its radius.
class PolarArm : public palpate::mechanism::MechanismDefaults<PolarArm, 2> {
 public:
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Joints<2, Scalar>& q) const {
    const auto [sine, cosine] = palpate::math::sincos(q[0]);
    return {q[1] * cosine, q[1] * sine, Scalar(0.0)};
  }
  template <class Scalar>
  [[nodiscard]] JointMatrix<2, Scalar> mass_matrix(const Joints<2, Scalar>& q) const {
    JointMatrix<2, Scalar> m;
    m(0, 0) = 1e-4 + slide_mass * q[1] * q[1];  // kg*m^2
    m(1, 1) = Scalar(slide_mass);               // kg
    m(0, 1) = m(1, 0) = Scalar(0.0);
    return m;
  }
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Joints<2, Scalar>& /*q*/) const {
    return Scalar(0.0);  // horizontal, J
  }

 private:
  static constexpr double slide_mass = 0.08;  // kg
};
static_assert(palpate::mechanism::Mechanism<PolarArm>);

int main() {
  using palpate::object::SpringWall;
  const SpringWall spring(
      {.kind = palpate::object::SpringWallKind::point, .point = Vector3<>(0.1, 0.0, 0.0), .stiffness = Vector3<>::Constant(300.0)});  // N/m
  palpate::servo::Servo<PolarArm, SpringWall> servo({.start = {0.0, 0.1}}, spring);
  const auto& tick = servo.tick({0.1, 0.105}, Vector3<>::Zero());
  std::printf("tip %.3f %.3f mm, torque %.4f N*m, force of the slide %.4f N\n", 1e3 * tick.tip[0], 1e3 * tick.tip[1], tick.torque[0],
              tick.torque[1]);

  const PolarArm arm;
  const auto acceleration = arm.acceleration(Joints<2>(0.1, 0.105), Joints<2>(2.0, 0.0), tick.torque);  // under that torque
  std::printf("accelerations %.1f rad/s^2, %.3f m/s^2\n", acceleration[0], acceleration[1]);
}
