#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <optional>

#include "palpate/math/choose.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/sincos.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// Geometry and inertia of a PHANToM Premium arm: a yawing base that carries a parallelogram (Cavusoglu, Feygin &
/// Tendick 2002; Hosseini-Zadeh 2004, ch. 2). Segment inertias are diagonal, in segment axes; those of `be` and `df`
/// are taken about the joint axis, so their centres of mass enter gravity only.
struct PremiumParameters {
  double l1 = 0.0;                              ///< upper arm, m
  double l2 = 0.0;                              ///< forearm, elbow to tip, m
  double l3 = 0.0;                              ///< parallelogram's short side, m
  double l5 = 0.0;                              ///< centre of mass of segment be along the upper arm, m
  double l6 = 0.0;                              ///< centre of mass of segment df along the forearm, m
  double mass_a = 0.0;                          ///< forearm tube, kg
  double mass_c = 0.0;                          ///< parallel rod, kg
  double mass_be = 0.0;                         ///< upper arm with its motor, kg
  double mass_df = 0.0;                         ///< short link with its motor, kg
  Vector3<> inertia_a = Vector3<>::Zero();      ///< about the centre of mass (xx, yy, zz), kg*m^2
  Vector3<> inertia_c = Vector3<>::Zero();      ///< about the centre of mass, kg*m^2
  Vector3<> inertia_be = Vector3<>::Zero();     ///< about the joint, kg*m^2
  Vector3<> inertia_df = Vector3<>::Zero();     ///< about the joint, kg*m^2
  double inertia_base = 0.0;                    ///< base about the vertical, kg*m^2
  Vector3<> rotor_inertia = Vector3<>::Zero();  ///< motor rotors reflected to the joints, N^2 J, kg*m^2
  double gravity = 9.81;                        ///< m/s^2
};

/// The arm's kinematics and dynamics. Joints: theta1 base yaw, theta2 upper arm above the horizontal, theta3 forearm
/// from the vertical (absolute, because of the parallelogram). The frame's origin is the tip at theta = 0.
///
/// Every formula is written once on a scalar type: double to simulate, Dual for exact derivatives.
class Premium {
 public:
  static constexpr int dof = 3;
  template <class Scalar>
  using Angles = Joints<3, Scalar>;

  Premium() = default;
  explicit Premium(const PremiumParameters& p)
      : l1_(p.l1),
        l2_(p.l2),
        h_(p.l1 * (p.l2 * p.mass_a + p.l3 * p.mass_c)),
        yaw_upper_(0.125 * (4.0 * (p.inertia_be[1] - p.inertia_be[2] + p.inertia_c[1] - p.inertia_c[2]) +
                            p.l1 * p.l1 * (4.0 * p.mass_a + p.mass_c))),
        yaw_fore_(0.125 * (-4.0 * (p.inertia_a[1] - p.inertia_a[2] + p.inertia_df[1] - p.inertia_df[2]) + p.l2 * p.l2 * p.mass_a +
                           4.0 * p.l3 * p.l3 * p.mass_c)),
        yaw_(0.125 * (4.0 * (p.inertia_a[1] + p.inertia_a[2] + p.inertia_be[1] + p.inertia_be[2] + p.inertia_c[1] + p.inertia_c[2] +
                             p.inertia_df[1] + p.inertia_df[2]) +
                      8.0 * p.inertia_base + 4.0 * p.l1 * p.l1 * p.mass_a + p.l2 * p.l2 * p.mass_a + p.l1 * p.l1 * p.mass_c +
                      4.0 * p.l3 * p.l3 * p.mass_c) +
             p.rotor_inertia[0]),
        m22_(p.inertia_be[0] + p.inertia_c[0] + p.l1 * p.l1 * (p.mass_a + 0.25 * p.mass_c) + p.rotor_inertia[1]),
        m33_(p.inertia_a[0] + p.inertia_df[0] + 0.25 * p.l2 * p.l2 * p.mass_a + p.l3 * p.l3 * p.mass_c + p.rotor_inertia[2]),
        n2_(0.5 * p.gravity * (2.0 * p.l1 * p.mass_a + 2.0 * p.l5 * p.mass_be + p.l1 * p.mass_c)),
        n3_(0.5 * p.gravity * (p.l2 * p.mass_a + 2.0 * p.l3 * p.mass_c - 2.0 * p.l6 * p.mass_df)) {}

  /// A pose with the sines and cosines of its angles: computed once, used by everything that is asked at that pose.
  template <class Scalar = double>
  struct Posture {
    Angles<Scalar> q;
    SineCosine<Scalar> yaw;    // theta1
    SineCosine<Scalar> upper;  // theta2
    SineCosine<Scalar> fore;   // theta3
  };

  template <class Scalar>
  [[nodiscard]] Posture<Scalar> posture(const Angles<Scalar>& q) const {
    return {q, sincos(q[0]), sincos(q[1]), sincos(q[2])};
  }

  /// The posture `turn` [rad] further on, cheaper than a new one when the turn is small.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Posture<Scalar> turned(const Posture<Scalar>& from, const Angles<Scalar>& turn) const {
    const Angles<Scalar> q = from.q + turn;
    return {q, turned_joint(from.yaw, turn[0], q[0]), turned_joint(from.upper, turn[1], q[1]), turned_joint(from.fore, turn[2], q[2])};
  }

  /// The posture as a function of time, at joint speeds `qd` [rad/s].
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Posture<Dual<1, Scalar>> moving(const Posture<Scalar>& at, const Angles<Scalar>& qd) const {
    using Rate = Eigen::Matrix<Scalar, 1, 1>;
    Posture<Dual<1, Scalar>> out;
    for (int i = 0; i < 3; ++i) out.q[i] = {at.q[i], Rate(qd[i])};
    out.yaw = sincos<1, Scalar>(at.yaw, Rate(qd[0]));
    out.upper = sincos<1, Scalar>(at.upper, Rate(qd[1]));
    out.fore = sincos<1, Scalar>(at.fore, Rate(qd[2]));
    return out;
  }

  /// Tip position [m] (thesis 2.10).
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Posture<Scalar>& at) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    return {at.yaw.sine * reach, l2_ - l2_ * at.fore.cosine + l1_ * at.upper.sine, at.yaw.cosine * reach - l1_};
  }

  /// Tip Jacobian dp/dq [m/rad], 3 x 3; equals R(q) J_body(q) of thesis 2.8 and 2.14.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] TipJacobian<3, Scalar> jacobian(const Posture<Scalar>& at) const {
    const auto& [s1, c1] = at.yaw;
    const auto& [s2, c2] = at.upper;
    const auto& [s3, c3] = at.fore;
    const Scalar reach = l1_ * c2 + l2_ * s3;
    TipJacobian<3, Scalar> j;
    j << c1 * reach, -l1_ * s1 * s2, l2_ * s1 * c3,  //
        Scalar(0.0), l1_ * c2, l2_ * s3,             //
        -s1 * reach, -l1_ * c1 * s2, l2_ * c1 * c3;
    return j;
  }

  /// Joint torques [N*m] of a force [N] at the tip, J^T force, without building J.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Angles<Scalar> torque(const Posture<Scalar>& at, const Vector3<Scalar>& force) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    const Scalar outwards = at.yaw.sine * force[0] + at.yaw.cosine * force[2];
    return {reach * (at.yaw.cosine * force[0] - at.yaw.sine * force[2]), l1_ * (at.upper.cosine * force[1] - at.upper.sine * outwards),
            l2_ * (at.fore.sine * force[1] + at.fore.cosine * outwards)};
  }

  /// Inertia matrix M(q) [kg*m^2], 3 x 3 (thesis 2.62-2.66 with M23 = -h/2 sin(theta2 - theta3): the printed plus sign
  /// breaks energy conservation).
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> mass_matrix(const Posture<Scalar>& at) const {
    const Terms<Scalar> t = terms(at);
    Eigen::Matrix<Scalar, 3, 3> m = Eigen::Matrix<Scalar, 3, 3>::Constant(Scalar(0.0));
    m(0, 0) = t.m11;
    m(1, 1) = Scalar(m22_);
    m(2, 2) = Scalar(m33_);
    m(1, 2) = m(2, 1) = t.m23;
    return m;
  }

  /// Coriolis and centrifugal matrix C(q, qd) [kg*m^2/s] in Christoffel form, so that dM/dt - 2C is skew-symmetric
  /// (thesis 2.67-2.73 with C32 = -h/2 cos(theta2 - theta3) theta2').
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> coriolis(const Posture<Scalar>& at, const Angles<Scalar>& qd) const {
    const Terms<Scalar> t = terms(at);
    Eigen::Matrix<Scalar, 3, 3> c = Eigen::Matrix<Scalar, 3, 3>::Constant(Scalar(0.0));
    c(0, 0) = 0.5 * (t.dm11_2 * qd[1] + t.dm11_3 * qd[2]);
    c(0, 1) = 0.5 * t.dm11_2 * qd[0];
    c(1, 0) = -c(0, 1);
    c(0, 2) = 0.5 * t.dm11_3 * qd[0];
    c(2, 0) = -c(0, 2);
    c(1, 2) = t.coupling * qd[2];
    c(2, 1) = -t.coupling * qd[1];
    return c;
  }

  /// Torques that hold the arm against gravity, N(q) = dV/dq [N*m] (thesis 2.74, 2.75).
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const Posture<Scalar>& at) const {
    return {Scalar(0.0), n2_ * at.upper.cosine, n3_ * at.fore.sine};
  }

  /// Potential energy [J]; zero at theta2 = 0, theta3 = pi/2.
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Posture<Scalar>& at) const {
    return n2_ * at.upper.sine - n3_ * at.fore.cosine;
  }

  /// Joint accelerations [rad/s^2] under joint torques [N*m] (friction's among them): M^-1 (torque - C qd - N).
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Angles<Scalar> acceleration(const Posture<Scalar>& at, const Angles<Scalar>& qd,
                                                                const Angles<Scalar>& torque) const {
    const Terms<Scalar> t = terms(at);
    const Scalar yaw_rate_squared = qd[0] * qd[0];
    const Scalar f1 = torque[0] - (t.dm11_2 * qd[1] + t.dm11_3 * qd[2]) * qd[0];
    const Scalar f2 = torque[1] + 0.5 * t.dm11_2 * yaw_rate_squared - t.coupling * qd[2] * qd[2] - n2_ * t.c2;
    const Scalar f3 = torque[2] + 0.5 * t.dm11_3 * yaw_rate_squared + t.coupling * qd[1] * qd[1] - n3_ * t.s3;
    // One division for all three: the denominators share it.
    const Scalar determinant = m22_ * m33_ - t.m23 * t.m23;
    const Scalar inverse = 1.0 / (determinant * t.m11);
    const Scalar inverse_determinant = inverse * t.m11;
    return {f1 * (inverse * determinant), (m33_ * f2 - t.m23 * f3) * inverse_determinant, (m22_ * f3 - t.m23 * f2) * inverse_determinant};
  }

  // The same, asked once at a pose.
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Angles<Scalar>& q) const {
    return forward(posture(q));
  }
  template <class Scalar>
  [[nodiscard]] TipJacobian<3, Scalar> jacobian(const Angles<Scalar>& q) const {
    return jacobian(posture(q));
  }
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> mass_matrix(const Angles<Scalar>& q) const {
    return mass_matrix(posture(q));
  }
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> coriolis(const Angles<Scalar>& q, const Angles<Scalar>& qd) const {
    return coriolis(posture(q), qd);
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const Angles<Scalar>& q) const {
    return gravity(posture(q));
  }
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Angles<Scalar>& q) const {
    return potential(posture(q));
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const Angles<Scalar>& q, const Angles<Scalar>& qd, const Angles<Scalar>& torque) const {
    return acceleration(posture(q), qd, torque);
  }

  /// Why a position has no pose.
  enum class Reach { reachable, too_far, too_close, on_yaw_axis, not_finite };

  struct Pose {
    Reach reach = Reach::reachable;
    Joints<3> q = Joints<3>::Zero();
  };

  /// A pose [rad] whose tip is at `p` [m] (thesis 2.11-2.13). The arm has up to four: `behind` turns the base half a turn and
  /// reaches over it, `elbow_down` folds the other way. Without them, the thesis's branch.
  [[nodiscard]] Pose inverse(const Vector3<>& p, bool behind = false, bool elbow_down = false) const {
    if (!p.allFinite()) return {Reach::not_finite, Joints<3>::Zero()};
    const double forwards = p[2] + l1_;
    double horizontal = std::hypot(p[0], forwards);
    const double up = p[1] - l2_;
    const double r2 = horizontal * horizontal + up * up;
    const double r = std::sqrt(r2);
    constexpr double rounding = 1e-12;
    if (r > (l1_ + l2_) * (1.0 + rounding)) return {Reach::too_far, Joints<3>::Zero()};
    if (r < std::abs(l1_ - l2_) * (1.0 - rounding) || r <= rounding * l1_) return {Reach::too_close, Joints<3>::Zero()};
    if (horizontal <= rounding * l1_) return {Reach::on_yaw_axis, Joints<3>::Zero()};
    double yaw = std::atan2(p[0], forwards);
    if (behind) {
      horizontal = -horizontal;
      yaw = std::atan2(-p[0], -forwards);
    }
    const auto clamped_acos = [](double x) { return std::acos(std::fmin(1.0, std::fmax(-1.0, x))); };
    const double side = elbow_down ? -1.0 : 1.0;
    const double beta = std::atan2(up, horizontal);
    const double gamma = side * clamped_acos((l1_ * l1_ + r2 - l2_ * l2_) / (2.0 * l1_ * r));
    const double alpha = side * clamped_acos((l1_ * l1_ + l2_ * l2_ - r2) / (2.0 * l1_ * l2_));
    const double theta2 = gamma + beta;
    return {Reach::reachable, Joints<3>(yaw, theta2, theta2 + alpha - 0.5 * M_PI)};
  }

 private:
  /// One joint's sine and cosine, `turn` further on, at the angle `q`: each joint, and each lane, decides by itself what is small.
  template <class Scalar>
  [[gnu::always_inline]] static SineCosine<Scalar> turned_joint(const SineCosine<Scalar>& from, const Scalar& turn, const Scalar& q) {
    using std::abs;
    const auto small = abs(turn) <= Scalar(small_turn);
    if (all(small)) [[likely]]
      return palpate::turned(from, turn);
    const SineCosine<Scalar> near = palpate::turned(from, turn);
    const SineCosine<Scalar> far = sincos(q);
    return {choose(small, near.sine, far.sine), choose(small, near.cosine, far.cosine)};
  }

  template <class Scalar>
  struct Terms {
    Scalar s3, c2;
    Scalar m11;       // M11
    Scalar m23;       // M23 = M32
    Scalar dm11_2;    // dM11/dtheta2
    Scalar dm11_3;    // dM11/dtheta3
    Scalar coupling;  // h/2 cos(theta2 - theta3)
  };

  template <class Scalar>
  [[gnu::always_inline]] Terms<Scalar> terms(const Posture<Scalar>& at) const {
    const auto& [s2, c2] = at.upper;
    const auto& [s3, c3] = at.fore;
    Terms<Scalar> t;
    t.s3 = s3;
    t.c2 = c2;
    t.m11 = yaw_ + yaw_upper_ * (1.0 - 2.0 * s2 * s2) - yaw_fore_ * (1.0 - 2.0 * s3 * s3) + h_ * c2 * s3;
    t.m23 = -0.5 * h_ * (s2 * c3 - c2 * s3);
    t.dm11_2 = -4.0 * yaw_upper_ * s2 * c2 - h_ * s2 * s3;
    t.dm11_3 = 4.0 * yaw_fore_ * s3 * c3 + h_ * c2 * c3;
    t.coupling = 0.5 * h_ * (c2 * c3 + s2 * s3);
    return t;
  }

  double l1_ = 0.0, l2_ = 0.0;
  double h_ = 0.0;          // l1 (l2 ma + l3 mc)
  double yaw_upper_ = 0.0;  // P/8
  double yaw_fore_ = 0.0;   // Q/8
  double yaw_ = 0.0;        // constant part of M11
  double m22_ = 0.0, m33_ = 0.0;
  double n2_ = 0.0, n3_ = 0.0;  // N2 = n2 cos(theta2), N3 = n3 sin(theta3)
};

}  // namespace palpate
