#pragma once

#include <Eigen/Core>
#include <array>
#include <concepts>
#include <cstddef>
#include <type_traits>

#include "palpate/math/dual.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/inverse_kinematics.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"

namespace palpate::mechanism {

/// Square matrix in joint space: mass matrix, Coriolis matrix.
template <int dof, class Scalar = double>
using JointMatrix = Eigen::Matrix<Scalar, dof, dof>;

/// Return the joint coordinates `q` as independent variables of differentiation.
template <int dof, class Scalar>
[[nodiscard]] Joints<dof, Dual<dof, Scalar>> joint_variables(const Eigen::Matrix<Scalar, dof, 1>& q) {
  Joints<dof, Dual<dof, Scalar>> out;
  for (int i = 0; i < dof; ++i) out[i] = Dual<dof, Scalar>::variable(q[i], i);
  return out;
}

/// Return the inverse of a symmetric positive definite matrix by Gauss-Jordan elimination, which needs no pivoting for such matrices.
template <int n, class Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, n, n> inverse_of_spd(Eigen::Matrix<Scalar, n, n> a) {
  for (int k = 0; k < n; ++k) {
    const Scalar pivot = Scalar(1.0) / a(k, k);
    a(k, k) = Scalar(1.0);
    for (int j = 0; j < n; ++j) a(k, j) = a(k, j) * pivot;
    for (int i = 0; i < n; ++i) {
      if (i == k) continue;
      const Scalar factor = a(i, k);
      a(i, k) = Scalar(0.0);
      for (int j = 0; j < n; ++j) a(i, j) = a(i, j) - factor * a(k, j);
    }
  }
  return a;
}

/// Equations of motion at one pose of any mechanism, M qdd = torque - C qd - N, with the Christoffel symbols of M.
template <int dof, class Scalar>
struct ChristoffelDynamics {
  using Vector = Joints<dof, Scalar>;
  using Matrix = JointMatrix<dof, Scalar>;

  Matrix mass;                          ///< M
  std::array<Matrix, dof> christoffel;  ///< symbol i, j, k at [i](j, k)
  Vector gravity;                       ///< N

  /// M^-1, or its equivalent with some joints stuck.
  struct Inverse {
    Matrix matrix;
    [[nodiscard]] Vector operator*(const Vector& force) const { return matrix * force; }
  };

  /// Compute M, its Christoffel symbols and N from a mass matrix and a potential that carry derivatives by the joint coordinates.
  ChristoffelDynamics(const JointMatrix<dof, Dual<dof, Scalar>>& m, const Dual<dof, Scalar>& potential) : gravity(potential.gradient) {
    for (int i = 0; i < dof; ++i) {
      for (int j = 0; j < dof; ++j) {
        mass(i, j) = m(i, j).value;
        for (int k = 0; k < dof; ++k)
          christoffel[static_cast<std::size_t>(i)](j, k) = 0.5 * (m(i, j).gradient[k] + m(i, k).gradient[j] - m(j, k).gradient[i]);
      }
    }
  }

  /// Coriolis and centrifugal matrix C(q, qd). dM/dt - 2C is skew-symmetric.
  [[nodiscard]] Matrix coriolis(const Vector& qd) const {
    Matrix c;
    for (int i = 0; i < dof; ++i)
      for (int j = 0; j < dof; ++j) {
        Scalar sum = christoffel[static_cast<std::size_t>(i)](j, 0) * qd[0];
        for (int k = 1; k < dof; ++k) sum = sum + christoffel[static_cast<std::size_t>(i)](j, k) * qd[k];
        c(i, j) = sum;
      }
    return c;
  }

  /// Generalized force that accelerates the mechanism [N*m], torque - C qd - N.
  [[nodiscard]] Vector generalized_force(const Vector& torque, const Vector& qd) const { return torque - coriolis(qd) * qd - gravity; }

  [[nodiscard]] Inverse inverse() const { return {inverse_of_spd<dof, Scalar>(mass)}; }

  /// With stuck joints, which have zero acceleration.
  [[nodiscard]] Inverse inverse(const std::array<Condition<Scalar>, dof>& stuck) const {
    const Scalar zero = 0.0;
    Matrix decoupled = mass;
    for (std::size_t i = 0; i < dof; ++i)
      for (std::size_t j = 0; j < dof; ++j) decoupled(i, j) = select(stuck[i] | stuck[j], i == j ? Scalar(1.0) : zero, decoupled(i, j));
    Inverse out{inverse_of_spd<dof, Scalar>(decoupled)};
    for (std::size_t i = 0; i < dof; ++i) out.matrix(i, i) = select(stuck[i], zero, out.matrix(i, i));
    return out;
  }

  /// M qdd [N*m].
  [[nodiscard]] Vector inertia_torque(const Vector& qdd) const { return mass * qdd; }
};

/// Base of a mechanism that supplies every function except the model itself.
///
/// A mechanism derives from `MechanismDefaults<Itself, dof>` and defines three functions, each a template on the scalar type:
///
///   template <class Scalar> Vector3<Scalar> forward(const Joints<dof, Scalar>& q) const;               // tip position, m
///   template <class Scalar> JointMatrix<dof, Scalar> mass_matrix(const Joints<dof, Scalar>& q) const;  // kg*m^2
///   template <class Scalar> Scalar potential(const Joints<dof, Scalar>& q) const;                      // potential energy, J
///
/// The scalar is double, Pack (several loops side by side) or Dual (derivatives). The defaults differentiate the three functions by
/// dual numbers. Any default can be replaced by a faster function of the same name in the derived class.
template <class Derived, int degrees_of_freedom>
class MechanismDefaults {
 public:
  static constexpr int dof = degrees_of_freedom;
  template <class Scalar>
  using Angles = Joints<dof, Scalar>;
  template <class Scalar>
  using Dynamics = ChristoffelDynamics<dof, Scalar>;

  // The kinematics cache is the joint coordinates.
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> kinematics(const Angles<Scalar>& q) const {
    return q;
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> kinematics_near(const Angles<Scalar>& /*reference*/, const Angles<Scalar>& q) const {
    return q;
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> advance(const Angles<Scalar>& from, const Angles<Scalar>& dq) const {
    return from + dq;
  }
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> advance_small(const Angles<Scalar>& from, const Angles<Scalar>& dq) const {
    return from + dq;
  }
  template <class Scalar>
  [[nodiscard]] static Condition<Scalar> is_small(const Angles<Scalar>& /*dq*/) {
    return true;
  }

  /// Tip Jacobian dp/dq [m/rad], 3 x dof: the derivative of `forward`.
  template <class Scalar>
  [[nodiscard]] TipJacobian<dof, Scalar> jacobian(const Angles<Scalar>& q) const {
    const Vector3<Dual<dof, Scalar>> p = self().forward(joint_variables<dof, Scalar>(q));
    TipJacobian<dof, Scalar> j;
    for (int row = 0; row < 3; ++row) j.row(row) = p[row].gradient.transpose();
    return j;
  }

  /// Tip velocity [m/s], J qd.
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> velocity(const Angles<Scalar>& q, const Angles<Scalar>& qd) const {
    return self().jacobian(q) * qd;
  }

  /// Acceleration of the tip at constant joint speeds [m/s^2], J' qd: the derivative of `velocity` along qd.
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> velocity_product(const Angles<Scalar>& q, const Angles<Scalar>& qd) const {
    using Variable = Dual<1, Scalar>;
    Joints<dof, Variable> moving, constant;
    for (int i = 0; i < dof; ++i) {
      moving[i] = Variable(q[i]);
      moving[i].gradient[0] = qd[i];
      constant[i] = Variable(qd[i]);
    }
    const Vector3<Variable> velocity = self().velocity(self().kinematics(moving), constant);
    return {velocity[0].gradient[0], velocity[1].gradient[0], velocity[2].gradient[0]};
  }

  /// Joint torques [N*m] of a tip force [N], J^T force.
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> apply_jacobian_transpose(const Angles<Scalar>& q, const Vector3<Scalar>& force) const {
    return self().jacobian(q).transpose() * force;
  }

  /// The inertia parameters that the dynamics may vary: a weightless point mass at the tip [kg].
  [[nodiscard]] double inertia_parameters() const { return 0.0; }
  template <class Scalar>
  [[nodiscard]] Scalar inertia_parameters(const Scalar& tip_mass) const {
    return tip_mass;
  }

  /// Equations of motion at `q`.
  template <class Scalar>
  [[nodiscard]] Dynamics<Scalar> dynamics(const Angles<Scalar>& q) const {
    const auto variables = joint_variables<dof, Scalar>(q);
    return Dynamics<Scalar>(self().mass_matrix(variables), self().potential(variables));
  }

  /// Equations of motion with a weightless point mass at the tip [kg], which adds m J^T J to the mass matrix.
  template <class Scalar, class Mass>
  [[nodiscard]] Dynamics<Scalar> dynamics(const Angles<Scalar>& q, const Mass& tip_mass) const {
    using Variable = Dual<dof, Scalar>;
    const auto variables = joint_variables<dof, Scalar>(q);
    JointMatrix<dof, Variable> m = self().mass_matrix(variables);
    const TipJacobian<dof, Variable> j = self().jacobian(variables);
    const Variable mass{Scalar(tip_mass)};
    for (int a = 0; a < dof; ++a)
      for (int b = 0; b < dof; ++b) m(a, b) += mass * (j(0, a) * j(0, b) + j(1, a) * j(1, b) + j(2, a) * j(2, b));
    return Dynamics<Scalar>(m, self().potential(variables));
  }

  /// Coriolis and centrifugal matrix C(q, qd) [kg*m^2/s].
  template <class Scalar>
  [[nodiscard]] JointMatrix<dof, Scalar> coriolis(const Angles<Scalar>& q, const Angles<Scalar>& qd) const {
    return self().dynamics(q).coriolis(qd);
  }

  /// Torques that balance gravity, N(q) = dV/dq [N*m].
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> gravity(const Angles<Scalar>& q) const {
    const Dual<dof, Scalar> v = self().potential(joint_variables<dof, Scalar>(q));
    return v.gradient;
  }

  /// Joint accelerations [rad/s^2] under joint torques [N*m] that include friction: M^-1 (torque - C qd - N).
  template <class Scalar>
  [[nodiscard]] Angles<Scalar> acceleration(const Angles<Scalar>& q, const Angles<Scalar>& qd, const Angles<Scalar>& torque) const {
    const Dynamics<Scalar> d = self().dynamics(q);
    return d.inverse() * d.generalized_force(torque, qd);
  }

  /// Poses whose tip is at `p` [m]; here the one found from the pose `nearest_to`.
  [[nodiscard]] InverseKinematics<dof> inverse_kinematics(const Vector3<>& p, const Joints<dof>& nearest_to) const {
    return newton_inverse(self(), p, nearest_to);
  }

 private:
  [[nodiscard]] const Derived& self() const { return static_cast<const Derived&>(*this); }
};

// What a mechanism has to define, one concept per function, so that MechanismCheck can name the missing one.

/// A class with a number of joints `dof`.
template <class M>
concept HasDof = requires {
  { M::dof } -> std::convertible_to<int>;
};

/// The dual number with one derivative per joint.
template <class M>
struct JointDualOf {
  using Type = Dual<1>;
};
template <HasDof M>
struct JointDualOf<M> {
  using Type = Dual<M::dof>;
};
template <class M>
using JointDual = typename JointDualOf<M>::Type;

/// A matrix of the given scalar and size. Eigen would convert other scalars silently.
template <class T, class Scalar, int rows, int columns>
concept MatrixOf = std::same_as<typename std::remove_cvref_t<T>::Scalar, Scalar> && std::remove_cvref_t<T>::RowsAtCompileTime == rows &&
                   std::remove_cvref_t<T>::ColsAtCompileTime == columns;

/// A class with forward kinematics on `Scalar`.
template <class M, class Scalar>
concept HasForward = requires(const M& m, const Joints<M::dof, Scalar>& q) {
  { m.forward(q) } -> MatrixOf<Scalar, 3, 1>;
};

/// A class with a mass matrix on `Scalar`.
template <class M, class Scalar>
concept HasMassMatrix = requires(const M& m, const Joints<M::dof, Scalar>& q) {
  { m.mass_matrix(q) } -> MatrixOf<Scalar, M::dof, M::dof>;
};

/// A class with a potential energy on `Scalar`.
template <class M, class Scalar>
concept HasPotential = requires(const M& m, const Joints<M::dof, Scalar>& q) {
  { m.potential(q) } -> std::same_as<Scalar>;
};

/// The kinematics that a servo uses. MechanismDefaults supplies them.
template <class M>
concept HasKinematicFunctions = requires(const M& m, const Joints<M::dof>& q, const Vector3<>& v, KinematicsCacheOf<M>& cache) {
  { m.forward(cache) } -> std::convertible_to<Vector3<>>;
  { m.jacobian(q) } -> std::convertible_to<TipJacobian<M::dof>>;
  { m.apply_jacobian_transpose(cache, v) } -> std::convertible_to<Joints<M::dof>>;
};

/// The dynamics and the incremental kinematics that plant and analysis use. MechanismDefaults supplies them.
template <class M>
concept HasDynamicFunctions = requires(const M& m, const Joints<M::dof>& q, const Vector3<>& v, KinematicsCacheOf<M>& cache) {
  m.kinematics_near(cache, q);
  m.advance(cache, q);
  m.advance_small(cache, q);
  { M::is_small(q) } -> std::convertible_to<bool>;
  { m.velocity(cache, q) } -> std::convertible_to<Vector3<>>;
  { m.velocity_product(cache, q) } -> std::convertible_to<Vector3<>>;
  { m.dynamics(cache, m.inertia_parameters(0.1)).generalized_force(q, q) } -> std::convertible_to<Joints<M::dof>>;
  { m.dynamics(cache).inverse() * q } -> std::convertible_to<Joints<M::dof>>;
  { m.coriolis(q, q) } -> std::convertible_to<JointMatrix<M::dof>>;
  { m.gravity(q) } -> std::convertible_to<Joints<M::dof>>;
  { m.acceleration(q, q, q) } -> std::convertible_to<Joints<M::dof>>;
  { m.inverse_kinematics(v, q) } -> std::convertible_to<InverseKinematics<M::dof>>;
};

/// The kinematics of a mechanism, which are enough for a servo on a real device.
template <class M>
concept KinematicMechanism = std::copyable<M> && std::default_initializable<M> && HasDof<M> && HasForward<M, double> &&
                             HasForward<M, JointDual<M>> && HasKinematicFunctions<M>;

/// A haptic mechanism: tip kinematics and rigid-body dynamics in joint space, on any scalar type.
template <class M>
concept Mechanism = KinematicMechanism<M> && HasMassMatrix<M, double> && HasMassMatrix<M, JointDual<M>> && HasPotential<M, double> &&
                    HasPotential<M, JointDual<M>> && HasDynamicFunctions<M>;

/// Explains why a class is no KinematicMechanism, by assertions that name the missing function.
template <class M>
struct KinematicsCheck {
  static_assert(std::copyable<M> && std::default_initializable<M>, "a mechanism needs a default constructor and must be copyable");
  static_assert(HasDof<M>, "a mechanism needs `static constexpr int dof`; derive it from MechanismDefaults<Itself, dof>");
  static_assert(!HasDof<M> || HasForward<M, double>, "a mechanism needs `forward(const Joints<dof, Scalar>& q) const -> Vector3<Scalar>`");
  static_assert(!HasForward<M, double> || HasForward<M, JointDual<M>>, "`forward` must be a template on the scalar type");
  static_assert(!HasDof<M> || HasKinematicFunctions<M>, "a mechanism must derive from MechanismDefaults<Itself, dof>");
  static constexpr bool passed = true;
};

/// Explains why a class is no Mechanism.
template <class M>
struct MechanismCheck {
  static_assert(KinematicsCheck<M>::passed);
  static_assert(!HasDof<M> || HasMassMatrix<M, double>,
                "a mechanism needs `mass_matrix(const Joints<dof, Scalar>& q) const -> JointMatrix<dof, Scalar>`");
  static_assert(!HasMassMatrix<M, double> || HasMassMatrix<M, JointDual<M>>, "`mass_matrix` must be a template on the scalar type");
  static_assert(!HasDof<M> || HasPotential<M, double>, "a mechanism needs `potential(const Joints<dof, Scalar>& q) const -> Scalar`");
  static_assert(!HasPotential<M, double> || HasPotential<M, JointDual<M>>, "`potential` must be a template on the scalar type");
  static_assert(!HasDof<M> || HasDynamicFunctions<M>, "a mechanism must derive from MechanismDefaults<Itself, dof>");
  static constexpr bool passed = true;
};

}  // namespace palpate::mechanism
