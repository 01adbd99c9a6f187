#pragma once

#include <array>
#include <palpate/math/sincos.hpp>
#include <palpate/mechanism/mechanism.hpp>
#include <palpate/mechanism/parameters.hpp>

namespace palpate::mechanism {

struct PlanarArmParameters {
  double upper_length = 0.2;  ///< shoulder to elbow, m
  double fore_length = 0.2;   ///< elbow to tip, m
  double upper_mass = 0.1;    ///< uniform slender link, kg
  double fore_mass = 0.08;    ///< uniform slender link, kg
  double gravity = 9.81;      ///< along -y, m/s^2
};

/// Serial arm with two links in the plane z = 0. Both angles are measured from the x axis.
class PlanarArm : public MechanismDefaults<PlanarArm, 2> {
 public:
  // For device files: a name, the kind of each joint, a typical pose and the parameters.
  using Parameters = PlanarArmParameters;
  static constexpr const char* name = "planar_arm";
  static constexpr std::array joints = {JointKind::revolute, JointKind::revolute};
  static constexpr std::array working_pose = {0.5, -0.5};
  static constexpr std::array parameters = {
      parameter<&Parameters::upper_length>("geometry.upper", "m", ParameterRange::positive, "shoulder to elbow"),
      parameter<&Parameters::fore_length>("geometry.fore", "m", ParameterRange::positive, "elbow to tip"),
      parameter<&Parameters::upper_mass>("mass.upper", "kg", ParameterRange::positive, "upper link"),
      parameter<&Parameters::fore_mass>("mass.fore", "kg", ParameterRange::positive, "fore link"),
      parameter<&Parameters::gravity>("environment.gravity", "m/s^2", ParameterRange::any, "along -y", false),
  };

  PlanarArm() = default;
  explicit PlanarArm(const Parameters& p) : p_(p) {}

  /// Tip position [m].
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Joints<2, Scalar>& q) const {
    const auto [s1, c1] = sincos(q[0]);
    const auto [s2, c2] = sincos(q[1]);
    return {p_.upper_length * c1 + p_.fore_length * c2, p_.upper_length * s1 + p_.fore_length * s2, Scalar(0.0)};
  }

  /// Mass matrix [kg*m^2].
  template <class Scalar>
  [[nodiscard]] JointMatrix<2, Scalar> mass_matrix(const Joints<2, Scalar>& q) const {
    const double a = p_.upper_length;
    const double b = p_.fore_length;
    JointMatrix<2, Scalar> m;
    m(0, 0) = (p_.upper_mass / 3.0 + p_.fore_mass) * a * a;
    m(1, 1) = p_.fore_mass / 3.0 * b * b;
    m(0, 1) = m(1, 0) = 0.5 * p_.fore_mass * a * b * sincos(Scalar(q[0] - q[1])).cosine;
    return m;
  }

  /// Potential energy [J].
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Joints<2, Scalar>& q) const {
    const double first_moment = (0.5 * p_.upper_mass + p_.fore_mass) * p_.upper_length;
    return p_.gravity * (first_moment * sincos(q[0]).sine + 0.5 * p_.fore_mass * p_.fore_length * sincos(q[1]).sine);
  }

 private:
  Parameters p_;
};

}  // namespace palpate::mechanism
