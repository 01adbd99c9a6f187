#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <numbers>

#include "palpate/math/dual.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/sincos.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::mechanism {

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
        n2_(0.5 * p.gravity * (2.0 * p.l1 * p.mass_a + 2.0 * p.l5 * p.mass_be + p.l1 * p.mass_c)),
        n3_(0.5 * p.gravity * (p.l2 * p.mass_a + 2.0 * p.l3 * p.mass_c - 2.0 * p.l6 * p.mass_df)) {
    const double upper = 0.125 * (4.0 * (p.inertia_be[1] - p.inertia_be[2] + p.inertia_c[1] - p.inertia_c[2]) +
                                  p.l1 * p.l1 * (4.0 * p.mass_a + p.mass_c));  // P/8
    const double fore = 0.125 * (-4.0 * (p.inertia_a[1] - p.inertia_a[2] + p.inertia_df[1] - p.inertia_df[2]) + p.l2 * p.l2 * p.mass_a +
                                 4.0 * p.l3 * p.l3 * p.mass_c);  // Q/8
    const double yaw = 0.125 * (4.0 * (p.inertia_a[1] + p.inertia_a[2] + p.inertia_be[1] + p.inertia_be[2] + p.inertia_c[1] +
                                       p.inertia_c[2] + p.inertia_df[1] + p.inertia_df[2]) +
                                8.0 * p.inertia_base + 4.0 * p.l1 * p.l1 * p.mass_a + p.l2 * p.l2 * p.mass_a + p.l1 * p.l1 * p.mass_c +
                                4.0 * p.l3 * p.l3 * p.mass_c) +
                       p.rotor_inertia[0];
    masses_ = {.level = yaw + upper - fore,
               .upper = 2.0 * upper,
               .fore = 2.0 * fore,
               .both = 0.5 * p.l1 * (p.l2 * p.mass_a + p.l3 * p.mass_c),
               .m22 = p.inertia_be[0] + p.inertia_c[0] + p.l1 * p.l1 * (p.mass_a + 0.25 * p.mass_c) + p.rotor_inertia[1],
               .m33 = p.inertia_a[0] + p.inertia_df[0] + 0.25 * p.l2 * p.l2 * p.mass_a + p.l3 * p.l3 * p.mass_c + p.rotor_inertia[2]};
  }

  /// Moments of inertia of the whole arm [kg*m^2]:
  ///   M11 = level - upper sin^2(theta2) + fore sin^2(theta3) + 2 both cos(theta2) sin(theta3),  M23 = -both sin(theta2 - theta3)
  template <class Scalar = double>
  struct Masses {
    Scalar level, upper, fore;  // of the yaw
    Scalar both;                // h/2 = l1 (l2 ma + l3 mc)/2
    Scalar m22, m33;
  };
  [[nodiscard]] const Masses<>& inertia_parameters() const { return masses_; }

  /// The same with a point mass [kg] at the tip.
  template <class Scalar>
  [[nodiscard]] Masses<Scalar> inertia_parameters(const Scalar& at_tip) const {
    const Scalar upper = at_tip * (l1_ * l1_);
    const Scalar fore = at_tip * (l2_ * l2_);
    return {masses_.level + upper, masses_.upper + upper, masses_.fore + fore, masses_.both + at_tip * (l1_ * l2_),
            masses_.m22 + upper,   masses_.m33 + fore};
  }

  /// A pose with the sines and cosines of its angles: computed once, used by everything that is asked at that pose.
  template <class Scalar = double>
  struct KinematicsCache {
    Angles<Scalar> q;
    SineCosine<Scalar> yaw;    // theta1
    SineCosine<Scalar> upper;  // theta2
    SineCosine<Scalar> fore;   // theta3

    /// Puts one loop's posture into a lane.
    void set_lane(int lane, const KinematicsCache<double>& one) {
      using math::set_lane;
      set_lane(q, lane, one.q);
      set_lane(yaw, lane, one.yaw);
      set_lane(upper, lane, one.upper);
      set_lane(fore, lane, one.fore);
    }
  };

  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> kinematics(const Angles<Scalar>& q) const {
    return {q, sincos(q[0]), sincos(q[1]), sincos(q[2])};
  }

  /// The posture `turn` [rad] further on, cheaper than a new one when the turn is small.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] KinematicsCache<Scalar> turned(const KinematicsCache<Scalar>& from, const Angles<Scalar>& turn) const {
    const Angles<Scalar> q = from.q + turn;
    return {q, turned_joint(from.yaw, turn[0], q[0]), turned_joint(from.upper, turn[1], q[1]), turned_joint(from.fore, turn[2], q[2])};
  }

  /// The posture at `q` [rad] for whoever moves: turned from `anchor`, a posture near by. Where a joint has left its neighbourhood, joint
  /// and anchor get new sines and cosines.
  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> kinematics_near(KinematicsCache<Scalar>& anchor, const Angles<Scalar>& q) const {
    using std::abs;
    const Angles<Scalar> turn = q - anchor.q;
    const Scalar most = max_medium_rotation;
    KinematicsCache<Scalar> out{q, rotate_medium(anchor.yaw, turn[0]), rotate_medium(anchor.upper, turn[1]),
                                rotate_medium(anchor.fore, turn[2])};
    if (all((abs(turn[0]) <= most) & (abs(turn[1]) <= most) & (abs(turn[2]) <= most))) [[likely]]
      return out;
    renew(anchor, out, turn);
    return out;
  }

  /// The same for turns that are all `little`: nothing is decided, nothing called.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] KinematicsCache<Scalar> advance_small(const KinematicsCache<Scalar>& from,
                                                                          const Angles<Scalar>& turn) const {
    return {from.q + turn, math::rotate_small(from.yaw, turn[0]), math::rotate_small(from.upper, turn[1]),
            math::rotate_small(from.fore, turn[2])};
  }
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] static Condition<Scalar> is_small(const Angles<Scalar>& turn) {
    using std::abs;
    const Scalar most = max_small_rotation;
    return (abs(turn[0]) <= most) & (abs(turn[1]) <= most) & (abs(turn[2]) <= most);
  }

  /// Tip position [m] (thesis 2.10).
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Vector3<Scalar> forward(const KinematicsCache<Scalar>& at) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    return {at.yaw.sine * reach, l2_ - l2_ * at.fore.cosine + l1_ * at.upper.sine, at.yaw.cosine * reach - l1_};
  }

  /// Tip Jacobian dp/dq [m/rad], 3 x 3; equals R(q) J_body(q) of thesis 2.8 and 2.14.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] TipJacobian<3, Scalar> jacobian(const KinematicsCache<Scalar>& at) const {
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

  /// Velocity of the tip [m/s], J qd, without building J.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Vector3<Scalar> velocity(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd) const {
    const Scalar across = (l1_ * at.upper.cosine + l2_ * at.fore.sine) * qd[0];
    const Scalar outwards = l2_ * at.fore.cosine * qd[2] - l1_ * at.upper.sine * qd[1];
    return {at.yaw.cosine * across + at.yaw.sine * outwards, l1_ * at.upper.cosine * qd[1] + l2_ * at.fore.sine * qd[2],
            at.yaw.cosine * outwards - at.yaw.sine * across};
  }

  /// Joint torques [N*m] of a force [N] at the tip, J^T force, without building J.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Angles<Scalar> torque(const KinematicsCache<Scalar>& at, const Vector3<Scalar>& force) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    const Scalar outwards = at.yaw.sine * force[0] + at.yaw.cosine * force[2];
    return {reach * (at.yaw.cosine * force[0] - at.yaw.sine * force[2]), l1_ * (at.upper.cosine * force[1] - at.upper.sine * outwards),
            l2_ * (at.fore.sine * force[1] + at.fore.cosine * outwards)};
  }

  /// The equations of motion at one posture, M qdd = torque - C qd - N, computed once for all that is asked there.
  ///
  /// M(q) is that of thesis 2.62-2.66 with M23 = -h/2 sin(theta2 - theta3): the printed plus sign breaks energy conservation.
  /// C(q, qd) is in Christoffel form, so that dM/dt - 2C is skew-symmetric (2.67-2.73 with C32 = -h/2 cos(theta2 - theta3) theta2').
  template <class Scalar>
  struct Dynamics {
    Scalar m11, m22, m33, m23;
    Scalar half_dm11_2, half_dm11_3;  // of dM11/dtheta2 and dM11/dtheta3
    Scalar coupling;                  // h/2 cos(theta2 - theta3)
    Scalar gravity2, gravity3;

    /// M^-1, or that of the arm with some joints held.
    struct Inverse {
      Scalar i11, i22, i33, i23;
      [[gnu::always_inline]] Angles<Scalar> operator*(const Angles<Scalar>& f) const {
        return {i11 * f[0], i22 * f[1] + i23 * f[2], i23 * f[1] + i33 * f[2]};
      }
    };

    /// What is left of joint torques [N*m] to accelerate the arm: torque - C qd - N.
    [[nodiscard, gnu::always_inline]] Angles<Scalar> net(const Angles<Scalar>& torque, const Angles<Scalar>& qd) const {
      const Scalar yaw_rate_squared = qd[0] * qd[0];
      return {torque[0] - (half_dm11_2 * qd[1] + half_dm11_3 * qd[2]) * (2.0 * qd[0]),
              (torque[1] - gravity2) + (half_dm11_2 * yaw_rate_squared - coupling * (qd[2] * qd[2])),
              (torque[2] - gravity3) + (half_dm11_3 * yaw_rate_squared + coupling * (qd[1] * qd[1]))};
    }

    [[nodiscard, gnu::always_inline]] Inverse inverse() const {
      // One division for all: the denominators share it.
      const Scalar determinant = m22 * m33 - m23 * m23;
      const Scalar shared = 1.0 / (determinant * m11);
      const Scalar of_two = shared * m11;
      return {shared * determinant, m33 * of_two, m22 * of_two, -m23 * of_two};
    }

    /// With the joints `held` at rest: they get no acceleration, and give none to the others.
    [[nodiscard, gnu::always_inline]] Inverse inverse(const std::array<Condition<Scalar>, 3>& held) const {
      const Scalar none = 0.0;
      Dynamics freed = *this;
      freed.m23 = select(held[1] | held[2], none, m23);
      Inverse out = freed.inverse();
      out.i11 = select(held[0], none, out.i11);
      out.i22 = select(held[1], none, out.i22);
      out.i33 = select(held[2], none, out.i33);
      return out;
    }

    /// M qdd [N*m].
    [[nodiscard, gnu::always_inline]] Angles<Scalar> inertial(const Angles<Scalar>& qdd) const {
      return {m11 * qdd[0], m22 * qdd[1] + m23 * qdd[2], m23 * qdd[1] + m33 * qdd[2]};
    }
  };

  /// @param masses  the arm's own, or with a mass at the tip that gravity does not pull
  template <class Scalar, class Mass = double>
  [[nodiscard, gnu::always_inline]] Dynamics<Scalar> dynamics(const KinematicsCache<Scalar>& at,
                                                              const Masses<Mass>& inertia_parameters) const {
    const auto& [s2, c2] = at.upper;
    const auto& [s3, c3] = at.fore;
    const Scalar c2s3 = c2 * s3;
    const Scalar s2c3 = s2 * c3;
    const Scalar c2c3 = c2 * c3;
    const Scalar s2s3 = s2 * s3;
    const auto& m = inertia_parameters;
    return {.m11 = (m.level - m.upper * (s2 * s2)) + (m.fore * (s3 * s3) + (2.0 * m.both) * c2s3),
            .m22 = Scalar(m.m22),
            .m33 = Scalar(m.m33),
            .m23 = m.both * (c2s3 - s2c3),
            .half_dm11_2 = -(m.upper * (s2 * c2) + m.both * s2s3),
            .half_dm11_3 = m.fore * (s3 * c3) + m.both * c2c3,
            .coupling = m.both * (c2c3 + s2s3),
            .gravity2 = n2_ * c2,
            .gravity3 = n3_ * s3};
  }
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Dynamics<Scalar> dynamics(const KinematicsCache<Scalar>& at) const {
    return dynamics(at, masses_);
  }

  /// Inertia matrix M(q) [kg*m^2], 3 x 3.
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> mass_matrix(const KinematicsCache<Scalar>& at) const {
    const Dynamics<Scalar> d = dynamics(at);
    Eigen::Matrix<Scalar, 3, 3> m = Eigen::Matrix<Scalar, 3, 3>::Constant(Scalar(0.0));
    m(0, 0) = d.m11;
    m(1, 1) = d.m22;
    m(2, 2) = d.m33;
    m(1, 2) = m(2, 1) = d.m23;
    return m;
  }

  /// Coriolis and centrifugal matrix C(q, qd) [kg*m^2/s].
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> coriolis(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd) const {
    const Dynamics<Scalar> d = dynamics(at);
    Eigen::Matrix<Scalar, 3, 3> c = Eigen::Matrix<Scalar, 3, 3>::Constant(Scalar(0.0));
    c(0, 0) = d.half_dm11_2 * qd[1] + d.half_dm11_3 * qd[2];
    c(0, 1) = d.half_dm11_2 * qd[0];
    c(1, 0) = -c(0, 1);
    c(0, 2) = d.half_dm11_3 * qd[0];
    c(2, 0) = -c(0, 2);
    c(1, 2) = d.coupling * qd[2];
    c(2, 1) = -d.coupling * qd[1];
    return c;
  }

  /// Torques that hold the arm against gravity, N(q) = dV/dq [N*m] (thesis 2.74, 2.75).
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const KinematicsCache<Scalar>& at) const {
    return {Scalar(0.0), n2_ * at.upper.cosine, n3_ * at.fore.sine};
  }

  /// Potential energy [J]; zero at theta2 = 0, theta3 = pi/2.
  template <class Scalar>
  [[nodiscard]] Scalar potential(const KinematicsCache<Scalar>& at) const {
    return n2_ * at.upper.sine - n3_ * at.fore.cosine;
  }

  /// Joint accelerations [rad/s^2] under joint torques [N*m] (friction's among them): M^-1 (torque - C qd - N).
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd,
                                            const Angles<Scalar>& torque) const {
    const Dynamics<Scalar> d = dynamics(at);
    return d.inverse() * d.net(torque, qd);
  }

  // The same, asked once at a pose.
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Angles<Scalar>& q) const {
    return forward(kinematics(q));
  }
  template <class Scalar>
  [[nodiscard]] TipJacobian<3, Scalar> jacobian(const Angles<Scalar>& q) const {
    return jacobian(kinematics(q));
  }
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> mass_matrix(const Angles<Scalar>& q) const {
    return mass_matrix(kinematics(q));
  }
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 3, 3> coriolis(const Angles<Scalar>& q, const Angles<Scalar>& qd) const {
    return coriolis(kinematics(q), qd);
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const Angles<Scalar>& q) const {
    return gravity(kinematics(q));
  }
  template <class Scalar>
  [[nodiscard]] Scalar potential(const Angles<Scalar>& q) const {
    return potential(kinematics(q));
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const Angles<Scalar>& q, const Angles<Scalar>& qd, const Angles<Scalar>& torque) const {
    return acceleration(kinematics(q), qd, torque);
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
    return {Reach::reachable, Joints<3>(yaw, theta2, theta2 + alpha - 0.5 * std::numbers::pi)};
  }

 private:
  /// One joint's sine and cosine, `turn` further on, at the angle `q`: each joint, and each lane, decides by itself what is small.
  template <class Scalar>
  [[gnu::always_inline]] static SineCosine<Scalar> turned_joint(const SineCosine<Scalar>& from, const Scalar& turn, const Scalar& q) {
    using std::abs;
    const auto small = abs(turn) <= Scalar(max_small_rotation);
    if (all(small)) [[likely]]
      return math::rotate_small(from, turn);
    const SineCosine<Scalar> near = math::rotate_small(from, turn);
    const SineCosine<Scalar> far = sincos(q);
    return {select(small, near.sine, far.sine), select(small, near.cosine, far.cosine)};
  }

  /// New sines and cosines of joints whose `turn` is wide, for a posture and the anchor it was turned from.
  template <class Scalar>
  [[gnu::noinline]] static void renew(KinematicsCache<Scalar>& anchor, KinematicsCache<Scalar>& at, const Angles<Scalar>& turn) {
    using std::abs;
    const auto joint = [&](int i, SineCosine<Scalar>& of_anchor, SineCosine<Scalar>& of_joint) {
      const auto near = abs(turn[i]) <= Scalar(max_medium_rotation);
      if (all(near)) return;
      const SineCosine<Scalar> fresh = sincos(at.q[i]);
      anchor.q[i] = select(near, anchor.q[i], at.q[i]);
      of_anchor = {select(near, of_anchor.sine, fresh.sine), select(near, of_anchor.cosine, fresh.cosine)};
      of_joint = {select(near, of_joint.sine, fresh.sine), select(near, of_joint.cosine, fresh.cosine)};
    };
    joint(0, anchor.yaw, at.yaw);
    joint(1, anchor.upper, at.upper);
    joint(2, anchor.fore, at.fore);
  }

  double l1_ = 0.0, l2_ = 0.0;
  Masses<> masses_{};
  double n2_ = 0.0, n3_ = 0.0;  // N2 = n2 cos(theta2), N3 = n3 sin(theta3)
};

}  // namespace palpate::mechanism
