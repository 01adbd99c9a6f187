#pragma once

#include <Eigen/Core>
#include <type_traits>

#include "palpate/math/dual.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/mechanism.hpp"

namespace palpate::mechanism {

/// Map from joint angles to the tip position and from tip forces to joint torques: exact, or linearized at a pose.
///
/// Linearized, p = p0 + J0 (q - q0) and tau = J0^T f + d(J^T f0)/dq (q - q0), where f0 is the constant part of the tip force.
template <class Mechanism, class Scalar = double>
class TipKinematics {
 public:
  static_assert(KinematicsCheck<Mechanism>::passed);
  static constexpr int dof = Mechanism::dof;
  using Angles = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;

  TipKinematics() = default;
  explicit TipKinematics(const Mechanism& mechanism) : mechanism_(mechanism) {}

  /// Linearize the kinematics at `pose` [rad], where the tip force has the constant part `constant_force` [N].
  TipKinematics(const Mechanism& mechanism, const Angles& pose, const Vector& constant_force)
      : mechanism_(mechanism),
        linearized_(true),
        pose_(pose),
        pose_tip_(mechanism.forward(pose)),
        tip_(pose_tip_),
        jacobian_(mechanism.jacobian(pose)) {
    using Variable = Dual<dof, Scalar>;
    Joints<dof, Variable> q;
    for (int i = 0; i < dof; ++i) q[i] = Variable::variable(pose[i], i);
    const TipJacobian<dof, Variable> j = mechanism.jacobian(q);
    geometric_stiffness_.setConstant(0.0);
    for (int i = 0; i < dof; ++i)
      for (int row = 0; row < 3; ++row)
        for (int k = 0; k < dof; ++k) geometric_stiffness_(i, k) += constant_force[row] * j(row, i).gradient[k];
  }

  /// Copy the kinematics of one loop into a lane. All lanes have the same mechanism, and all or none are linearized.
  void set_lane(int lane, const TipKinematics<Mechanism>& one) {
    using math::set_lane;
    mechanism_ = one.mechanism_;
    linearized_ = one.linearized_;
    set_lane(pose_, lane, one.pose_);
    set_lane(pose_tip_, lane, one.pose_tip_);
    set_lane(jacobian_, lane, one.jacobian_);
    set_lane(geometric_stiffness_, lane, one.geometric_stiffness_);
  }

  /// Move to the angles `q` [rad].
  void update(const Angles& q) noexcept {
    if (linearized_) {
      displacement_ = q - pose_;
      tip_ = pose_tip_ + math::product(jacobian_, displacement_);
      return;
    }
    cache_ = mechanism_.kinematics(q);
    tip_ = mechanism_.forward(cache_);
  }

  /// Move to the pose of `cache`, which the caller has computed already. Exact kinematics only.
  void update(const KinematicsCacheOf<Mechanism, Scalar>& cache) noexcept
    requires(!std::is_same_v<KinematicsCacheOf<Mechanism, Scalar>, Angles>)
  {
    cache_ = cache;
    tip_ = mechanism_.forward(cache_);
  }

  /// Tip position [m].
  [[nodiscard]] const Vector& tip() const noexcept { return tip_; }

  /// Return the tip position [m] at other angles `q` [rad].
  [[nodiscard]] Vector tip_at(const Angles& q) const noexcept {
    if (linearized_) return pose_tip_ + math::product(jacobian_, Angles(q - pose_));
    return mechanism_.forward(mechanism_.kinematics(q));
  }

  /// Joint torques [N*m] of the tip force `force` [N], which includes the constant part.
  [[nodiscard, gnu::always_inline]] Angles torque(const Vector& force) const noexcept {
    if (linearized_) [[unlikely]]
      return math::transposed_product(jacobian_, force) + math::product(geometric_stiffness_, displacement_);
    return mechanism_.apply_jacobian_transpose(cache_, force);
  }

 private:
  template <class, class>
  friend class TipKinematics;

  Mechanism mechanism_;
  bool linearized_ = false;
  Angles pose_ = Angles::Constant(0.0);
  Vector pose_tip_ = Vector::Constant(0.0);
  Angles displacement_ = Angles::Constant(0.0);  // from the pose of linearization
  Vector tip_ = Vector::Constant(0.0);
  TipJacobian<dof, Scalar> jacobian_ = TipJacobian<dof, Scalar>::Constant(0.0);
  KinematicsCacheOf<Mechanism, Scalar> cache_ = Mechanism().kinematics(Angles(Angles::Constant(0.0)));
  Eigen::Matrix<Scalar, dof, dof> geometric_stiffness_ = Eigen::Matrix<Scalar, dof, dof>::Constant(0.0);  // d(J^T f0)/dq
};

}  // namespace palpate::mechanism
