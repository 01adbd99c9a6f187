#pragma once

#include <array>

#include "palpate/math/vector.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/mechanism/parameters.hpp"

namespace palpate::mechanism {

/// Apparent inertia of a device that is described at its tip.
struct TipDeviceParameters {
  Vector3<> mass = Vector3<>::Constant(0.1);  ///< apparent mass along x, y and z, kg
};

/// A device whose driver gives the tip position and takes the tip force, as those of Force Dimension and Novint do.
///
/// The joint coordinates are the tip position [m] and the joint torques are the tip force [N]. Its dynamics are a constant apparent mass.
/// The driver compensates gravity.
class TipDevice : public MechanismDefaults<TipDevice, 3> {
 public:
  using Parameters = TipDeviceParameters;
  static constexpr const char* name = "tip_device";
  static constexpr std::array joints = {JointKind::prismatic, JointKind::prismatic, JointKind::prismatic};
  static constexpr std::array working_pose = {0.0, 0.0, 0.0};
  static constexpr std::array parameters = {
      parameter<&Parameters::mass>("mass.apparent", "kg", ParameterRange::positive, "apparent mass along x, y and z"),
  };

  TipDevice() = default;
  explicit TipDevice(const Parameters& p) : mass_(p.mass) {}

  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> forward(const Joints<3, Scalar>& q) const {
    return q;
  }

  template <class Scalar>
  [[nodiscard]] JointMatrix<3, Scalar> mass_matrix(const Joints<3, Scalar>& /*q*/) const {
    JointMatrix<3, Scalar> m = JointMatrix<3, Scalar>::Constant(Scalar(0.0));
    for (int i = 0; i < 3; ++i) m(i, i) = mass_[i];
    return m;
  }

  template <class Scalar>
  [[nodiscard]] Scalar potential(const Joints<3, Scalar>& /*q*/) const {
    return Scalar(0.0);
  }

  // Faster than the defaults.
  template <class Scalar>
  [[nodiscard]] Vector3<Scalar> velocity(const Joints<3, Scalar>& /*q*/, const Joints<3, Scalar>& qd) const {
    return qd;
  }
  template <class Scalar>
  [[nodiscard]] Joints<3, Scalar> apply_jacobian_transpose(const Joints<3, Scalar>& /*q*/, const Vector3<Scalar>& force) const {
    return force;
  }
  [[nodiscard]] InverseKinematics<3> inverse_kinematics(const Vector3<>& p, const Joints<3>& /*nearest_to*/) const { return {{p}, {}}; }

 private:
  Vector3<> mass_ = TipDeviceParameters{}.mass;
};

}  // namespace palpate::mechanism
