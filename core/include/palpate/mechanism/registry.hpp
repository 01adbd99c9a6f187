#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>

#include "palpate/mechanism/five_bar.hpp"
#include "palpate/mechanism/mechanism.hpp"
#include "palpate/mechanism/premium.hpp"
#include "palpate/mechanism/slider.hpp"
#include "palpate/mechanism/tip_device.hpp"

namespace palpate::mechanism {

/// A mechanism that device files can name: a mechanism with a name, the kinds of its joints, a typical
/// pose and a table of its parameters.
template <class M>
concept RegisteredMechanism = Mechanism<M> && std::constructible_from<M, const typename M::Parameters&> && requires {
  { M::name } -> std::convertible_to<const char*>;
  { M::joints[0] } -> std::convertible_to<JointKind>;
  { M::working_pose[0] } -> std::convertible_to<double>;
  { M::parameters[0] } -> std::convertible_to<ParameterField<typename M::Parameters>>;
} && M::joints.size() == static_cast<std::size_t>(M::dof) && M::working_pose.size() == M::joints.size();

/// Whether all joints are of one kind, so that device files give them in one unit.
template <class M>
[[nodiscard]] constexpr bool has_uniform_joints() {
  for (const JointKind kind : M::joints)
    if (kind != M::joints[0]) return false;
  return true;
}

/// A list of mechanism types with operations on each.
template <class... Mechanisms>
struct MechanismList {
  static_assert((MechanismCheck<Mechanisms>::passed && ...));
  static_assert((RegisteredMechanism<Mechanisms> && ...),
                "a registered mechanism needs `Parameters` with a constructor from them, "
                "`name`, one entry of `joints` and `working_pose` per joint, and `parameters`");
  static_assert((has_uniform_joints<Mechanisms>() && ...), "all joints of a registered mechanism must be of one kind");
  static constexpr std::size_t size = sizeof...(Mechanisms);

  /// Call `function.template operator()<M>()` for each mechanism.
  template <class Function>
  static void for_each(Function&& function) {
    (function.template operator()<Mechanisms>(), ...);
  }

  /// Position of a mechanism in the list; `size` if it is not in it.
  template <class M>
  [[nodiscard]] static constexpr std::size_t index_of() {
    std::size_t index = 0;
    static_cast<void>(((std::is_same_v<M, Mechanisms> ? false : (++index, true)) && ...));
    return index;
  }
};

/// The mechanisms of the library. Python bindings, batch lanes and the schema of device files are generated from this list.
using Registry = MechanismList<Premium, Slider, FiveBar, TipDevice>;

}  // namespace palpate::mechanism
