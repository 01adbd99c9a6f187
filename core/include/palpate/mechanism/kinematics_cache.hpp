#pragma once

#include <type_traits>
#include <utility>

#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::mechanism {

/// Quantities that a mechanism computes once per pose and reuses, e.g. the sines and cosines of its angles.
template <class Mechanism, class Scalar = double>
using KinematicsCacheOf = std::decay_t<decltype(std::declval<Mechanism>().kinematics(std::declval<Joints<Mechanism::dof, Scalar>>()))>;

/// The kinematics of a moving mechanism: the current cache, and a nearby reference from which it is updated.
template <class Mechanism, class Scalar = double>
struct IncrementalKinematics {
  KinematicsCacheOf<Mechanism, Scalar> current{};
  KinematicsCacheOf<Mechanism, Scalar> reference{};

  IncrementalKinematics() = default;
  explicit IncrementalKinematics(const KinematicsCacheOf<Mechanism, Scalar>& start) : current(start), reference(start) {}

  /// Move to the pose `q`.
  void update(const Mechanism& mechanism, const Joints<Mechanism::dof, Scalar>& q) { current = mechanism.kinematics_near(reference, q); }

  /// Copy the kinematics of one loop into a lane.
  void set_lane(int lane, const IncrementalKinematics<Mechanism>& one) {
    set_cache_lane(current, lane, one.current);
    set_cache_lane(reference, lane, one.reference);
  }

 private:
  template <class Cache, class One>
  static void set_cache_lane(Cache& cache, int lane, const One& one) {
    if constexpr (requires { cache.set_lane(lane, one); })
      cache.set_lane(lane, one);
    else
      math::set_lane(cache, lane, one);
  }
};

}  // namespace palpate::mechanism
