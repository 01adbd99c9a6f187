#pragma once

#include "palpate/math/vector.hpp"

namespace palpate {

/// A spring and a dashpot in parallel between tip and surface, sampled (Zilles & Salisbury 1995; thesis 3.34).
/// Force of the tip on the object: K d + B d', with d' by backward difference or by the bilinear rule
/// d'_k = 2/T (d_k - d_{k-1}) - d'_{k-1}, whose pole at -1 keeps a period-two ripple for ever.
class VirtualCoupling {
 public:
  enum class Difference { backward, bilinear };

  VirtualCoupling() = default;
  /// Stiffness [N/m] and damping [N*s/m] of each axis; servo period [s].
  VirtualCoupling(const Vector3<>& stiffness, const Vector3<>& damping, Difference difference, double period)
      : stiffness_(stiffness), damping_(damping), difference_(difference), per_period_(1.0 / period) {}

  /// Force of the tip on the object [N] at this sample's deflection [m].
  Vector3<> force(const Vector3<>& deflection) noexcept {
    const Vector3<> change = (deflection - previous_) * per_period_;
    rate_ = difference_ == Difference::backward ? change : Vector3<>(2.0 * change - rate_);
    previous_ = deflection;
    return stiffness_.cwiseProduct(deflection) + damping_.cwiseProduct(rate_);
  }

 private:
  Vector3<> stiffness_ = Vector3<>::Zero();
  Vector3<> damping_ = Vector3<>::Zero();
  Difference difference_ = Difference::backward;
  double per_period_ = 0.0;
  Vector3<> previous_ = Vector3<>::Zero();
  Vector3<> rate_ = Vector3<>::Zero();
};

}  // namespace palpate
