#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdio>

#include "palpate/math/sincos.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/mechanism/parameters.hpp"

namespace palpate::mechanism {

/// Geometry and inertia of a planar five-bar linkage (pantograph). Pairs hold the right chain (motor 1), then the left chain (motor 2).
struct FiveBarParameters {
  using Pair = Eigen::Vector2d;
  double base = 0.025;                               ///< distance between the motor axes, m
  Pair proximal_length = Pair::Constant(0.063);      ///< motor axis to elbow, m
  Pair distal_length = Pair::Constant(0.075);        ///< elbow to tip, m
  Pair proximal_mass = Pair::Constant(0.01);         ///< kg
  Pair proximal_center = Pair::Constant(0.0315);     ///< motor axis to center of mass, m
  Pair proximal_inertia = Pair::Constant(1.323e-5);  ///< about the motor axis, kg*m^2
  Pair distal_mass = Pair::Constant(0.01);           ///< kg
  Pair distal_center = Pair::Constant(0.0375);       ///< elbow to center of mass, m
  Pair distal_inertia = Pair::Constant(4.6875e-6);   ///< about the center of mass, kg*m^2
  double tip_mass = 0.0;                             ///< kg
  Pair rotor_inertia = Pair::Zero();                 ///< of the motors, kg*m^2
  Pair gear = Pair::Ones();                          ///< motor turns per joint turn
  double gravity = 9.81;                             ///< along -y, m/s^2; 0 if the plane is horizontal
};

/// Planar five-bar linkage with two motors and the tip where the distal links meet (Campion, Wang & Hayward, IROS 2005).
///
/// The linkage moves in the plane z = 0. The motor axes are at x = base/2 and -base/2, y = 0. The joints are the angles of the proximal
/// links from the x axis. Of the two positions that close the loop, the tip takes the one on the left when looking from the left elbow
/// to the right elbow, i.e. above the motors in the usual configuration.
///
/// Positions that do not close the loop give NaN. The Jacobian is singular where the distal links are in line.
class FiveBar : public MechanismDefaults<FiveBar, 2> {
 public:
  using Parameters = FiveBarParameters;
  static constexpr const char* name = "five_bar";
  static constexpr std::array joints = {JointKind::revolute, JointKind::revolute};
  static constexpr std::array working_pose = {0.7, 2.4415927};  // symmetric
  static constexpr std::array parameters = {
      parameter<&Parameters::base>("geometry.base", "m", ParameterRange::nonnegative, "distance between the motor axes"),
      parameter<&Parameters::proximal_length>("geometry.proximal", "m", ParameterRange::positive, "motor axis to elbow"),
      parameter<&Parameters::distal_length>("geometry.distal", "m", ParameterRange::positive, "elbow to tip"),
      parameter<&Parameters::proximal_center>("geometry.proximal_center", "m", ParameterRange::any, "motor axis to center of mass"),
      parameter<&Parameters::distal_center>("geometry.distal_center", "m", ParameterRange::any, "elbow to center of mass"),
      parameter<&Parameters::proximal_mass>("mass.proximal", "kg", ParameterRange::nonnegative, "proximal links"),
      parameter<&Parameters::distal_mass>("mass.distal", "kg", ParameterRange::nonnegative, "distal links"),
      parameter<&Parameters::tip_mass>("mass.tip", "kg", ParameterRange::nonnegative, "handle", false),
      parameter<&Parameters::proximal_inertia>("inertia.proximal", "kg*m^2", ParameterRange::nonnegative, "about the motor axis"),
      parameter<&Parameters::distal_inertia>("inertia.distal", "kg*m^2", ParameterRange::nonnegative, "about the center of mass"),
      parameter<&Parameters::rotor_inertia>("drive.rotor_inertia", "kg*m^2", ParameterRange::nonnegative, "motor rotors", false),
      parameter<&Parameters::gear>("drive.gear", "", ParameterRange::positive, "motor turns per joint turn", false),
      parameter<&Parameters::gravity>("environment.gravity", "m/s^2", ParameterRange::any, "along -y", false),
  };

  // Inlined, so that no copy compiled for wide vector registers is shared with other files.
  [[gnu::always_inline]] FiveBar() : FiveBar(Parameters{}) {}
  [[gnu::always_inline]] explicit FiveBar(const Parameters& p) : p_(p) {
    for (int i = 0; i < 2; ++i) {
      // A rigid bar between two moving points: kinetic energy (ve' W ve)/2 in the velocities of elbow and tip, with constant W.
      const double c = p.distal_center[i] / p.distal_length[i];
      const double rotation = p.distal_inertia[i] / (p.distal_length[i] * p.distal_length[i]);
      elbow_[i] = p.distal_mass[i] * (1.0 - c) * (1.0 - c) + rotation;
      elbow_tip_[i] = p.distal_mass[i] * c * (1.0 - c) - rotation;
      tip_ += p.distal_mass[i] * c * c + rotation;
      crank_[i] = p.proximal_inertia[i] + p.rotor_inertia[i] * (p.gear[i] * p.gear[i]);
      crank_weight_[i] = p.gravity * p.proximal_mass[i] * p.proximal_center[i];
      elbow_weight_[i] = p.gravity * p.distal_mass[i] * (1.0 - c);
      tip_weight_ += p.gravity * p.distal_mass[i] * c;
    }
    tip_ += p.tip_mass;
    tip_weight_ += p.gravity * p.tip_mass;
  }

  /// Tip position [m].
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Joints<2, Scalar>& q) const {
    const Linkage<Scalar> at = linkage(q);
    return {at.tip[0], at.tip[1], Scalar(0.0)};
  }

  /// Tip Jacobian [m/rad] from the closure of both loops: (P - E_i) . dP = (P - E_i) . dE_i.
  template <class Scalar>
  [[nodiscard]] TipJacobian<2, Scalar> jacobian(const Joints<2, Scalar>& q) const {
    return jacobian(linkage(q));
  }

  /// Mass matrix [kg*m^2].
  template <class Scalar>
  [[nodiscard]] JointMatrix<2, Scalar> mass_matrix(const Joints<2, Scalar>& q) const {
    const Linkage<Scalar> at = linkage(q);
    const TipJacobian<2, Scalar> j = jacobian(at);
    JointMatrix<2, Scalar> m;
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b) m(a, b) = tip_ * (j(0, a) * j(0, b) + j(1, a) * j(1, b));
    for (int i = 0; i < 2; ++i) {
      const Planar<Scalar> elbow = at.elbow_rate(i);
      m(i, i) += elbow_[i] * (elbow[0] * elbow[0] + elbow[1] * elbow[1]) + crank_[i];
      for (int k = 0; k < 2; ++k) {
        const Scalar product = elbow_tip_[i] * (elbow[0] * j(0, k) + elbow[1] * j(1, k));
        m(i, k) += product;
        m(k, i) += product;
      }
    }
    return m;
  }

  /// Potential energy [J].
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Joints<2, Scalar>& q) const {
    const Linkage<Scalar> at = linkage(q);
    Scalar v = tip_weight_ * at.tip[1];
    for (int i = 0; i < 2; ++i) {
      const auto k = static_cast<std::size_t>(i);
      v += crank_weight_[i] * at.angle[k].sine + elbow_weight_[i] * at.elbow[k][1];
    }
    return v;
  }

  /// Poses whose tip is at `p` [m]: each elbow may be outward or inward.
  [[nodiscard]] InverseKinematics<2> inverse_kinematics(const Vector3<>& p, const Joints<2>& /*nearest_to*/) const {
    char text[96];
    if (std::abs(p[2]) > 1e-9) {
      std::snprintf(text, sizeof text, "it is %.1f mm away from the plane of the linkage", 1e3 * std::abs(p[2]));
      return {{}, text};
    }
    double direction[2], opening[2];
    for (int i = 0; i < 2; ++i) {
      const double x = p[0] - motor(i);
      const double r = std::hypot(x, p[1]);
      const double a = p_.proximal_length[i];
      const double b = p_.distal_length[i];
      if (!(r <= a + b) || r < std::abs(a - b) || r == 0.0) {
        std::snprintf(text, sizeof text, "%.1f mm from motor %d, and its links reach from %.1f to %.1f mm", 1e3 * r, i + 1,
                      1e3 * std::abs(a - b), 1e3 * (a + b));
        return {{}, text};
      }
      direction[i] = std::atan2(p[1], x);
      opening[i] = std::acos((a * a + r * r - b * b) / (2.0 * a * r));
    }
    InverseKinematics<2> out;
    for (const double right : {-1.0, 1.0})
      for (const double left : {1.0, -1.0}) {
        const Joints<2> q(direction[0] + right * opening[0], direction[1] + left * opening[1]);
        if ((forward(q) - p).norm() < 1e-9) out.poses.push_back(q);
      }
    if (out.poses.empty()) out.error = "it closes the loop only on the other side of the elbows";
    return out;
  }

 private:
  template <class Scalar>
  using Planar = Eigen::Matrix<Scalar, 2, 1>;

  /// Positions of the elbows and of the tip [m].
  template <class Scalar>
  struct Linkage {
    std::array<SineCosine<Scalar>, 2> angle;
    std::array<double, 2> length;
    std::array<Planar<Scalar>, 2> elbow;
    Planar<Scalar> tip;

    /// Derivative of an elbow by its own angle.
    [[nodiscard]] Planar<Scalar> elbow_rate(int i) const {
      const auto k = static_cast<std::size_t>(i);
      return {-length[k] * angle[k].sine, length[k] * angle[k].cosine};
    }
  };

  [[nodiscard]] double motor(int i) const { return i == 0 ? 0.5 * p_.base : -0.5 * p_.base; }

  template <class Scalar>
  [[nodiscard]] Linkage<Scalar> linkage(const Joints<2, Scalar>& q) const {
    using std::sqrt;
    Linkage<Scalar> at;
    for (int i = 0; i < 2; ++i) {
      const auto k = static_cast<std::size_t>(i);
      at.length[k] = p_.proximal_length[i];
      at.angle[k] = sincos(q[i]);
      at.elbow[k] = Planar<Scalar>(at.length[k] * at.angle[k].cosine + motor(i), at.length[k] * at.angle[k].sine);
    }
    // Intersection of the circles about both elbows: `along` and `across` in units of the distance between them.
    const double b0 = p_.distal_length[0];
    const double b1 = p_.distal_length[1];
    const Scalar dx = at.elbow[1][0] - at.elbow[0][0];
    const Scalar dy = at.elbow[1][1] - at.elbow[0][1];
    const Scalar inverse_square = 1.0 / (dx * dx + dy * dy);
    const Scalar along = (0.5 * (b0 * b0 - b1 * b1)) * inverse_square + 0.5;
    const Scalar across = sqrt(Scalar((b0 * b0) * inverse_square - along * along));
    at.tip = Planar<Scalar>(at.elbow[0][0] + along * dx + across * dy, at.elbow[0][1] + along * dy - across * dx);
    return at;
  }

  template <class Scalar>
  [[nodiscard]] TipJacobian<2, Scalar> jacobian(const Linkage<Scalar>& at) const {
    std::array<Planar<Scalar>, 2> link, rate;
    for (int i = 0; i < 2; ++i) {
      const auto k = static_cast<std::size_t>(i);
      link[k] = Planar<Scalar>(at.tip[0] - at.elbow[k][0], at.tip[1] - at.elbow[k][1]);
      rate[k] = at.elbow_rate(i);
    }
    const Scalar per_determinant = 1.0 / (link[0][0] * link[1][1] - link[0][1] * link[1][0]);
    const Scalar right = (link[0][0] * rate[0][0] + link[0][1] * rate[0][1]) * per_determinant;
    const Scalar left = (link[1][0] * rate[1][0] + link[1][1] * rate[1][1]) * per_determinant;
    TipJacobian<2, Scalar> j;
    j << link[1][1] * right, -link[0][1] * left,  //
        -link[1][0] * right, link[0][0] * left,   //
        Scalar(0.0), Scalar(0.0);
    return j;
  }

  Parameters p_;
  // Weights of the kinetic and potential energy.
  Parameters::Pair elbow_, elbow_tip_, crank_, crank_weight_, elbow_weight_;
  double tip_ = 0.0;
  double tip_weight_ = 0.0;
};

}  // namespace palpate::mechanism
