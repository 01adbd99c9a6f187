#pragma once

#include "palpate/control/controller.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

/// Scales reference and object force of a tick to an object with the design stiffness K0.
///
/// In force tracking the object exists only in the servo: F = K d with the deflection d of the tip, and the plant from command to d does
/// not depend on K. With F_ref K0/K and F K0/K = K0 d in place of F_ref and F, the loop is the same for every K, and K may change at every
/// tick. K and F must be of the same tick.
///
/// - An object with a normal is scaled along it. Tangential forces, such as friction, pass unchanged.
/// - An object without a normal is scaled per axis. An axis without stiffness passes unchanged.
/// - Outside a surface whose signed depth is known, the scaled object force is K0 times the depth while the reference presses: the tip
///   approaches the surface as if a spring held it. Otherwise the object force is zero.
/// - If a contact has no normal or stiffness, the last one holds; before the first contact the forces pass unchanged.
template <class Number>
class BasicStiffnessNormalization {
 public:
  using Scalar = Number;
  using Vector = Vector3<Scalar>;

  /// Scaled forces, N.
  struct Forces {
    Vector reference, object;
  };

  BasicStiffnessNormalization() = default;
  /// @param design_stiffness  K0 per axis, positive, N/m
  explicit BasicStiffnessNormalization(const Vector3<>& design_stiffness) : design_(design_stiffness) {}

  [[nodiscard]] const Vector3<>& design_stiffness() const noexcept { return design_; }

  /// Return the normal along which the forces of the last tick were scaled; zero: none yet.
  [[nodiscard]] const Vector& normal() const noexcept { return normal_; }

  /// Return the forces of a tick, scaled.
  Forces apply(const BasicTickInput<Scalar>& input) noexcept {
    const object::BasicContactResult<Scalar>& contact = input.contact;
    const Scalar none = 0.0;
    Forces out{input.reference, input.object_force};
    for (int i = 0; i < 3; ++i) {
      const Scalar& axis = contact.axis_stiffness[i];
      const Scalar ratio = select(none < axis, design_[i] / axis, Scalar(1.0));
      out.reference[i] *= ratio;
      out.object[i] *= ratio;
    }
    const auto surface = none < contact.normal.squaredNorm();
    const auto known = surface & (none < contact.stiffness);
    normal_ = select_each(known, contact.normal, normal_);
    stiffness_ = select(known, contact.stiffness, stiffness_);
    const auto active = none < stiffness_;
    const Scalar pressed = normal_.dot(input.reference), felt = normal_.dot(input.object_force);
    const auto apart = surface & (contact.depth < none) & (pressed < none);
    const Scalar target = select(active, pressed / stiffness_, none);
    const Scalar deflection = select(apart, -contact.depth, select(active, felt / stiffness_, none));
    Scalar along = 0.0;  // design stiffness along the normal, N/m
    for (int i = 0; i < 3; ++i) along += normal_[i] * normal_[i] * design_[i];
    const Scalar more = select(active, along * target - pressed, none), felt_more = select(active, along * deflection - felt, none);
    out.reference += more * normal_;
    out.object += felt_more * normal_;
    return out;
  }

  /// Forget the last contact.
  void reset() noexcept {
    normal_ = Vector::Constant(0.0);
    stiffness_ = 0.0;
  }

  /// Set one lane; all lanes share the design stiffness.
  void set_lane(int lane, const BasicStiffnessNormalization<double>& one) {
    using math::set_lane;
    set_lane(normal_, lane, one.normal_);
    set_lane(stiffness_, lane, one.stiffness_);
  }

 private:
  template <class>
  friend class BasicStiffnessNormalization;

  Vector3<> design_ = Vector3<>::Zero();
  Vector normal_ = Vector::Constant(0.0);  // of the last contact
  Scalar stiffness_ = 0.0;                 // of the last contact, N/m; zero: none yet
};
using StiffnessNormalization = BasicStiffnessNormalization<double>;

}  // namespace palpate::control
