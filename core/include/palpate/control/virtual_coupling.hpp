#pragma once

#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

/// How a virtual coupling takes the speed from samples.
enum class CouplingDifference { backward, bilinear };

/// A spring and a dashpot in parallel between tip and surface, sampled (Zilles & Salisbury 1995; thesis 3.34).
/// Force of the tip on the object: K d + B d', with d' by backward difference or by the bilinear rule
/// d'_k = 2/T (d_k - d_{k-1}) - d'_{k-1}, whose pole at -1 keeps a period-two ripple for ever.
template <class Scalar>
class BasicVirtualCoupling {
 public:
  using Difference = CouplingDifference;

  BasicVirtualCoupling() = default;
  /// Stiffness [N/m] and damping [N*s/m] of each axis; servo period [s].
  BasicVirtualCoupling(const Vector3<Scalar>& stiffness, const Vector3<Scalar>& damping, Difference difference, double period)
      : stiffness_(stiffness), damping_(damping), difference_(difference), per_period_(1.0 / period) {}

  /// Force of the tip on the object [N] at this sample's deflection [m].
  [[gnu::always_inline]] Vector3<Scalar> force(const Vector3<Scalar>& deflection) noexcept {
    const Vector3<Scalar> change = (deflection - previous_) * per_period_;
    rate_ = difference_ == Difference::backward ? change : Vector3<Scalar>(2.0 * change - rate_);
    previous_ = deflection;
    return stiffness_.cwiseProduct(deflection) + damping_.cwiseProduct(rate_);
  }

  /// Puts one loop's coupling into a lane; all lanes have the same rule and period.
  void set_lane(int lane, const BasicVirtualCoupling<double>& one) {
    using math::set_lane;
    set_lane(stiffness_, lane, one.stiffness_);
    set_lane(damping_, lane, one.damping_);
    difference_ = one.difference_;
    per_period_ = one.per_period_;
    set_lane(previous_, lane, one.previous_);
    set_lane(rate_, lane, one.rate_);
  }

 private:
  template <class>
  friend class BasicVirtualCoupling;

  Vector3<Scalar> stiffness_ = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> damping_ = Vector3<Scalar>::Constant(0.0);
  Difference difference_ = Difference::backward;
  double per_period_ = 0.0;
  Vector3<Scalar> previous_ = Vector3<Scalar>::Constant(0.0);
  Vector3<Scalar> rate_ = Vector3<Scalar>::Constant(0.0);
};
using VirtualCoupling = BasicVirtualCoupling<double>;

}  // namespace palpate::control
