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
#include "palpate/mechanism/conditioning.hpp"
#include "palpate/mechanism/inverse_kinematics.hpp"
#include "palpate/mechanism/parameters.hpp"
#include "palpate/mechanism/premium_inverse.hpp"
#include "palpate/mechanism/premium_parameters.hpp"

namespace palpate::mechanism {

/// Kinematics and dynamics of the PHANToM Premium.
///
/// Joints: theta1 base yaw, theta2 upper arm above the horizontal, theta3 forearm from the vertical (absolute because of the
/// parallelogram). The origin of the frame is the tip at theta = 0. The scalar is double, Pack (several loops side by side) or Dual
/// (derivatives). Equation numbers refer to Hosseini-Zadeh 2004.
class Premium {
 public:
  static constexpr int dof = 3;
  using Parameters = PremiumParameters;
  static constexpr const char* name = "premium";
  static constexpr std::array joints = {JointKind::revolute, JointKind::revolute, JointKind::revolute};
  static constexpr std::array working_pose = {0.0, 2.2305, 3.2776};  // torques (0, 0.01, 0.01) N*m balance gravity there
  static constexpr auto& parameters = premium_parameters;
  template <class Scalar>
  using Angles = Joints<3, Scalar>;

  Premium() = default;
  explicit Premium(const Parameters& p)
      : l1_(p.l1),
        l2_(p.l2),
        n2_(0.5 * p.gravity * (2.0 * p.l1 * p.mass_a + 2.0 * p.l5 * p.mass_be + p.l1 * p.mass_c)),
        n3_(0.5 * p.gravity * (p.l2 * p.mass_a + 2.0 * p.l3 * p.mass_c - 2.0 * p.l6 * p.mass_df)) {
    const Vector3<> rotor = p.rotor_inertia.cwiseProduct(p.gear.cwiseProduct(p.gear));
    const double upper = 0.125 * (4.0 * (p.inertia_be[1] - p.inertia_be[2] + p.inertia_c[1] - p.inertia_c[2]) +
                                  p.l1 * p.l1 * (4.0 * p.mass_a + p.mass_c));  // P/8
    const double fore = 0.125 * (-4.0 * (p.inertia_a[1] - p.inertia_a[2] + p.inertia_df[1] - p.inertia_df[2]) + p.l2 * p.l2 * p.mass_a +
                                 4.0 * p.l3 * p.l3 * p.mass_c);  // Q/8
    const double yaw = 0.125 * (4.0 * (p.inertia_a[1] + p.inertia_a[2] + p.inertia_be[1] + p.inertia_be[2] + p.inertia_c[1] +
                                       p.inertia_c[2] + p.inertia_df[1] + p.inertia_df[2]) +
                                8.0 * p.inertia_base + 4.0 * p.l1 * p.l1 * p.mass_a + p.l2 * p.l2 * p.mass_a + p.l1 * p.l1 * p.mass_c +
                                4.0 * p.l3 * p.l3 * p.mass_c) +
                       rotor[0];
    inertia_parameters_ = {.level = yaw + upper - fore,
                           .upper = 2.0 * upper,
                           .fore = 2.0 * fore,
                           .both = 0.5 * p.l1 * (p.l2 * p.mass_a + p.l3 * p.mass_c),
                           .m22 = p.inertia_be[0] + p.inertia_c[0] + p.l1 * p.l1 * (p.mass_a + 0.25 * p.mass_c) + rotor[1],
                           .m33 = p.inertia_a[0] + p.inertia_df[0] + 0.25 * p.l2 * p.l2 * p.mass_a + p.l3 * p.l3 * p.mass_c + rotor[2]};
  }

  /// Inertia parameters of the mechanism [kg*m^2]:
  ///   M11 = level - upper sin^2(theta2) + fore sin^2(theta3) + 2 both cos(theta2) sin(theta3),  M23 = -both sin(theta2 - theta3)
  template <class Scalar = double>
  struct InertiaParameters {
    Scalar level, upper, fore;  // of the base yaw
    Scalar both;                // h/2 = l1 (l2 ma + l3 mc)/2
    Scalar m22, m33;
  };
  [[nodiscard]] const InertiaParameters<>& inertia_parameters() const { return inertia_parameters_; }

  /// Inertia parameters with a point mass [kg] at the tip.
  template <class Scalar>
  [[nodiscard]] InertiaParameters<Scalar> inertia_parameters(const Scalar& tip_mass) const {
    const Scalar upper = tip_mass * (l1_ * l1_);
    const Scalar fore = tip_mass * (l2_ * l2_);
    return {inertia_parameters_.level + upper, inertia_parameters_.upper + upper,
            inertia_parameters_.fore + fore,   inertia_parameters_.both + tip_mass * (l1_ * l2_),
            inertia_parameters_.m22 + upper,   inertia_parameters_.m33 + fore};
  }

  /// A pose with the sines and cosines of its angles.
  template <class Scalar = double>
  struct KinematicsCache {
    Angles<Scalar> q;
    SineCosine<Scalar> yaw;    // theta1
    SineCosine<Scalar> upper;  // theta2
    SineCosine<Scalar> fore;   // theta3

    /// Copy the cache of one loop into a lane.
    void set_lane(int lane, const KinematicsCache<double>& one) {
      using math::set_lane;
      set_lane(q, lane, one.q);
      set_lane(yaw, lane, one.yaw);
      set_lane(upper, lane, one.upper);
      set_lane(fore, lane, one.fore);
    }
  };

  /// Compute the cache at `q` [rad].
  template <class Scalar>
  [[nodiscard]] KinematicsCache<Scalar> kinematics(const Angles<Scalar>& q) const {
    return {q, sincos(q[0]), sincos(q[1]), sincos(q[2])};
  }

  /// Return the cache at `from.q + dq`. It is cheaper than a new one if `dq` [rad] is small.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] KinematicsCache<Scalar> advance(const KinematicsCache<Scalar>& from, const Angles<Scalar>& dq) const {
    const Angles<Scalar> q = from.q + dq;
    return {q, advance_joint(from.yaw, dq[0], q[0]), advance_joint(from.upper, dq[1], q[1]), advance_joint(from.fore, dq[2], q[2])};
  }

  /// Return the cache at `q` [rad], computed from the nearby `reference`. If a joint is more than `max_medium_rotation` away from the
  /// reference, its sine and cosine are recomputed and the reference moves to `q`.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] KinematicsCache<Scalar> kinematics_near(KinematicsCache<Scalar>& reference,
                                                                            const Angles<Scalar>& q) const {
    using std::abs;
    const Angles<Scalar> dq = q - reference.q;
    const Scalar limit = max_medium_rotation;
    KinematicsCache<Scalar> out{q, rotate_medium(reference.yaw, dq[0]), rotate_medium(reference.upper, dq[1]),
                                rotate_medium(reference.fore, dq[2])};
    if (all((abs(dq[0]) <= limit) & (abs(dq[1]) <= limit) & (abs(dq[2]) <= limit))) [[likely]]
      return out;
    recompute(reference, out, dq);
    return out;
  }

  /// As `advance`, for displacements that satisfy `is_small`, without branches or calls.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] KinematicsCache<Scalar> advance_small(const KinematicsCache<Scalar>& from,
                                                                          const Angles<Scalar>& dq) const {
    return {from.q + dq, math::rotate_small(from.yaw, dq[0]), math::rotate_small(from.upper, dq[1]), math::rotate_small(from.fore, dq[2])};
  }
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] static Condition<Scalar> is_small(const Angles<Scalar>& dq) {
    using std::abs;
    const Scalar limit = max_small_rotation;
    return (abs(dq[0]) <= limit) & (abs(dq[1]) <= limit) & (abs(dq[2]) <= limit);
  }

  /// Tip position [m] (2.10).
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Vector3<Scalar> forward(const KinematicsCache<Scalar>& at) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    return {at.yaw.sine * reach, l2_ - l2_ * at.fore.cosine + l1_ * at.upper.sine, at.yaw.cosine * reach - l1_};
  }

  /// Tip Jacobian dp/dq [m/rad], 3 x 3; equals R(q) J_body(q) of (2.8) and (2.14).
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] TipJacobian<3, Scalar> jacobian(const KinematicsCache<Scalar>& at) const {
    const auto& [s1, c1] = at.yaw;
    const auto& [s2, c2] = at.upper;
    const auto& [s3, c3] = at.fore;
    const Scalar reach = l1_ * c2 + l2_ * s3;
    TipJacobian<3, Scalar> j;
    j(0, 0) = c1 * reach;
    j(1, 0) = Scalar(0.0);
    j(2, 0) = -s1 * reach;
    j(0, 1) = -l1_ * s1 * s2;
    j(1, 1) = l1_ * c2;
    j(2, 1) = -l1_ * c1 * s2;
    j(0, 2) = l2_ * s1 * c3;
    j(1, 2) = l2_ * s3;
    j(2, 2) = l2_ * c1 * c3;
    return j;
  }

  /// Size of the tip Jacobian without forming J. Its columns have the lengths |reach|, l1 and l2, the first is normal to the others.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] JacobianSize<Scalar> jacobian_size(const KinematicsCache<Scalar>& at) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    const Scalar area = (l1_ * l2_) * (at.upper.cosine * at.fore.cosine + at.upper.sine * at.fore.sine);
    const Scalar squared = reach * reach;
    return {squared * (area * area), squared + (l1_ * l1_ + l2_ * l2_)};
  }

  /// Tip velocity [m/s], J qd, without forming J.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Vector3<Scalar> velocity(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd) const {
    const Scalar tangential = (l1_ * at.upper.cosine + l2_ * at.fore.sine) * qd[0];
    const Scalar radial = l2_ * at.fore.cosine * qd[2] - l1_ * at.upper.sine * qd[1];
    return {at.yaw.cosine * tangential + at.yaw.sine * radial, l1_ * at.upper.cosine * qd[1] + l2_ * at.fore.sine * qd[2],
            at.yaw.cosine * radial - at.yaw.sine * tangential};
  }

  /// Acceleration of the tip at constant joint speeds [m/s^2], J' qd.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Vector3<Scalar> velocity_product(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd) const {
    const Scalar squared2 = qd[1] * qd[1], squared3 = qd[2] * qd[2];
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    const Scalar radial_speed = l2_ * at.fore.cosine * qd[2] - l1_ * at.upper.sine * qd[1];
    const Scalar tangential = 2.0 * radial_speed * qd[0];
    const Scalar radial = -(l2_ * at.fore.sine * squared3 + l1_ * at.upper.cosine * squared2) - reach * (qd[0] * qd[0]);
    return {at.yaw.cosine * tangential + at.yaw.sine * radial, l2_ * at.fore.cosine * squared3 - l1_ * at.upper.sine * squared2,
            at.yaw.cosine * radial - at.yaw.sine * tangential};
  }

  /// Joint torques [N*m] of a tip force [N], J^T force, without forming J.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Angles<Scalar> apply_jacobian_transpose(const KinematicsCache<Scalar>& at,
                                                                            const Vector3<Scalar>& force) const {
    const Scalar reach = l1_ * at.upper.cosine + l2_ * at.fore.sine;
    const Scalar radial = at.yaw.sine * force[0] + at.yaw.cosine * force[2];
    return {reach * (at.yaw.cosine * force[0] - at.yaw.sine * force[2]), l1_ * (at.upper.cosine * force[1] - at.upper.sine * radial),
            l2_ * (at.fore.sine * force[1] + at.fore.cosine * radial)};
  }

  /// Equations of motion at one pose, M qdd = torque - C qd - N.
  ///
  /// M(q) follows (2.62)-(2.66) with M23 = -h/2 sin(theta2 - theta3); the printed plus sign violates energy conservation.
  /// C(q, qd) has Christoffel form, so dM/dt - 2C is skew-symmetric; (2.67)-(2.73) with C32 = -h/2 cos(theta2 - theta3) theta2'.
  template <class Scalar>
  struct Dynamics {
    Scalar m11, m22, m33, m23;
    Scalar half_dm11_2, half_dm11_3;  // half of dM11/dtheta2 and dM11/dtheta3
    Scalar coupling;                  // h/2 cos(theta2 - theta3)
    Scalar gravity2, gravity3;

    /// M^-1, or its equivalent with some joints stuck.
    struct Inverse {
      Scalar i11, i22, i33, i23;
      [[gnu::always_inline]] Angles<Scalar> operator*(const Angles<Scalar>& f) const {
        return {i11 * f[0], i22 * f[1] + i23 * f[2], i23 * f[1] + i33 * f[2]};
      }
    };

    /// Generalized force that accelerates the mechanism [N*m], torque - C qd - N.
    [[nodiscard, gnu::always_inline]] Angles<Scalar> generalized_force(const Angles<Scalar>& torque, const Angles<Scalar>& qd) const {
      const Scalar yaw_rate_squared = qd[0] * qd[0];
      return {torque[0] - (half_dm11_2 * qd[1] + half_dm11_3 * qd[2]) * (2.0 * qd[0]),
              (torque[1] - gravity2) + (half_dm11_2 * yaw_rate_squared - coupling * (qd[2] * qd[2])),
              (torque[2] - gravity3) + (half_dm11_3 * yaw_rate_squared + coupling * (qd[1] * qd[1]))};
    }

    [[nodiscard, gnu::always_inline]] Inverse inverse() const {
      // A single division serves all entries.
      const Scalar determinant = m22 * m33 - m23 * m23;
      const Scalar factor = 1.0 / (determinant * m11);
      const Scalar factor_23 = factor * m11;
      return {factor * determinant, m33 * factor_23, m22 * factor_23, -m23 * factor_23};
    }

    /// With stuck joints, which have zero acceleration.
    [[nodiscard, gnu::always_inline]] Inverse inverse(const std::array<Condition<Scalar>, 3>& stuck) const {
      const Scalar zero = 0.0;
      Dynamics decoupled = *this;
      decoupled.m23 = select(stuck[1] | stuck[2], zero, m23);
      Inverse out = decoupled.inverse();
      out.i11 = select(stuck[0], zero, out.i11);
      out.i22 = select(stuck[1], zero, out.i22);
      out.i33 = select(stuck[2], zero, out.i33);
      return out;
    }

    /// M qdd [N*m].
    [[nodiscard, gnu::always_inline]] Angles<Scalar> inertia_torque(const Angles<Scalar>& qdd) const {
      return {m11 * qdd[0], m22 * qdd[1] + m23 * qdd[2], m23 * qdd[1] + m33 * qdd[2]};
    }
  };

  /// Equations of motion with the given inertia parameters, e.g. with a weightless point mass at the tip.
  template <class Scalar, class Mass = double>
  [[nodiscard, gnu::always_inline]] Dynamics<Scalar> dynamics(const KinematicsCache<Scalar>& at, const InertiaParameters<Mass>& m) const {
    const auto& [s2, c2] = at.upper;
    const auto& [s3, c3] = at.fore;
    const Scalar c2s3 = c2 * s3;
    const Scalar s2c3 = s2 * c3;
    const Scalar c2c3 = c2 * c3;
    const Scalar s2s3 = s2 * s3;
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
    return dynamics(at, inertia_parameters_);
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

  /// Torques that balance gravity, N(q) = dV/dq [N*m] (2.74, 2.75).
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const KinematicsCache<Scalar>& at) const {
    return {Scalar(0.0), n2_ * at.upper.cosine, n3_ * at.fore.sine};
  }

  /// Potential energy [J]; zero at theta2 = 0, theta3 = pi/2.
  template <class Scalar>
  [[nodiscard]] Scalar potential(const KinematicsCache<Scalar>& at) const {
    return n2_ * at.upper.sine - n3_ * at.fore.cosine;
  }

  /// Joint accelerations [rad/s^2] under joint torques [N*m] that include friction: M^-1 (torque - C qd - N).
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const KinematicsCache<Scalar>& at, const Angles<Scalar>& qd,
                                            const Angles<Scalar>& torque) const {
    const Dynamics<Scalar> d = dynamics(at);
    return d.inverse() * d.generalized_force(torque, qd);
  }

  // Overloads that take the angles instead of the cache.
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

  /// Return one pose [rad] whose tip is at `p` [m]; see PremiumInverse.
  [[nodiscard]] PremiumInverse::Solution inverse(const Vector3<>& p, bool behind = false, bool elbow_down = false) const {
    return PremiumInverse{l1_, l2_}.solve(p, behind, elbow_down);
  }

  /// Return all poses whose tip is at `p` [m].
  [[nodiscard]] InverseKinematics<3> inverse_kinematics(const Vector3<>& p, const Joints<3>& /*nearest_to*/) const {
    return PremiumInverse{l1_, l2_}.solve_all(p);
  }

 private:
  /// Sine and cosine of one joint after the displacement `dq`, at the angle `q`. Each joint and lane chooses the cheap form independently.
  template <class Scalar>
  [[gnu::always_inline]] static SineCosine<Scalar> advance_joint(const SineCosine<Scalar>& from, const Scalar& dq, const Scalar& q) {
    using std::abs;
    const auto small = abs(dq) <= Scalar(max_small_rotation);
    if (all(small)) [[likely]]
      return math::rotate_small(from, dq);
    const SineCosine<Scalar> near = math::rotate_small(from, dq);
    const SineCosine<Scalar> far = sincos(q);
    return {select(small, near.sine, far.sine), select(small, near.cosine, far.cosine)};
  }

  /// Recompute the sines and cosines of joints with a large displacement, in a cache and in its reference.
  template <class Scalar>
  [[gnu::noinline]] static void recompute(KinematicsCache<Scalar>& reference, KinematicsCache<Scalar>& at, const Angles<Scalar>& dq) {
    using std::abs;
    const auto joint = [&](int i, SineCosine<Scalar>& at_reference, SineCosine<Scalar>& at_q) {
      const auto near = abs(dq[i]) <= Scalar(max_medium_rotation);
      if (all(near)) return;
      const SineCosine<Scalar> fresh = sincos(at.q[i]);
      reference.q[i] = select(near, reference.q[i], at.q[i]);
      at_reference = {select(near, at_reference.sine, fresh.sine), select(near, at_reference.cosine, fresh.cosine)};
      at_q = {select(near, at_q.sine, fresh.sine), select(near, at_q.cosine, fresh.cosine)};
    };
    joint(0, reference.yaw, at.yaw);
    joint(1, reference.upper, at.upper);
    joint(2, reference.fore, at.fore);
  }

  double l1_ = 0.0, l2_ = 0.0;
  InertiaParameters<> inertia_parameters_{};
  double n2_ = 0.0, n3_ = 0.0;  // N2 = n2 cos(theta2), N3 = n3 sin(theta3)
};

}  // namespace palpate::mechanism
