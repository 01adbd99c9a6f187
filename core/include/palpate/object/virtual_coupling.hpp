#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::object {

/// Discrete derivative of the deflection in a virtual coupling.
enum class CouplingDifference { backward, bilinear };

/// Sampled spring and damper in parallel between tip and surface (Zilles & Salisbury 1995; Hosseini-Zadeh 2004, eq. 3.34).
///
/// Force of the tip on the object: K d + B d'. The velocity d' is a backward difference or the bilinear rule
/// d'_k = 2/T (d_k - d_{k-1}) - d'_{k-1}, whose pole at -1 sustains a ripple of period two.
template <class Scalar>
class BasicVirtualCoupling {
 public:
  using Difference = CouplingDifference;

  BasicVirtualCoupling() = default;
  /// Stiffness [N/m] and damping [N*s/m] per axis.
  BasicVirtualCoupling(const Vector3<Scalar>& stiffness, const Vector3<Scalar>& damping, Difference difference)
      : stiffness_(stiffness), damping_(damping), difference_(difference) {}

  /// Return the force of the tip on the object [N] for this sample's deflection [m], `rate` [1/s] after the last sample.
  [[gnu::always_inline]] Vector3<Scalar> force(const Vector3<Scalar>& deflection, double rate) noexcept {
    const Vector3<Scalar> change = (deflection - previous_) * rate;
    velocity_ = difference_ == Difference::backward ? change : Vector3<Scalar>(2.0 * change - velocity_);
    previous_ = deflection;
    return stiffness_.cwiseProduct(deflection) + damping_.cwiseProduct(velocity_);
  }

  /// Forget the last sample.
  void reset() noexcept {
    previous_ = Vector3<Scalar>::Constant(0.0);
    velocity_ = Vector3<Scalar>::Constant(0.0);
  }

  /// Set one lane from a scalar coupling; all lanes share the difference rule.
  void set_lane(int lane, const BasicVirtualCoupling<double>& one) {
    using math::set_lane;
    set_lane(stiffness_, lane, one.stiffness_);
    set_lane(damping_, lane, one.damping_);
    difference_ = one.difference_;
    set_lane(previous_, lane, one.previous_);
    set_lane(velocity_, lane, one.velocity_);
  }

 private:
  template <class>
  friend class BasicVirtualCoupling;

  Vector3<Scalar> stiffness_ = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> damping_ = Vector3<Scalar>::Constant(0.0);
  Difference difference_ = Difference::backward;
  Vector3<Scalar> previous_ = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> velocity_ = Vector3<Scalar>::Constant(0.0);
};
using VirtualCoupling = BasicVirtualCoupling<double>;

}  // namespace palpate::object
