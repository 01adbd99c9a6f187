#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/layer_creep.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/point_tractions.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Points of a node in contact with a tip.
struct PressedPoints {
  Vector3<> force = Vector3<>::Zero();  ///< of the tip on the node, N
  double stiffness = 0.0;               ///< of the points in contact, N/m
  Grip grip{};                          ///< its stiffness does not jump as a point comes into contact
  double energy = 0.0;                  ///< J
  double clearance = 0.0;               ///< signed distance of the tip from the nearest point, m
  double crept = 0.0;                   ///< creep of the points in contact before the period, weighted by their stiffness, N
};

namespace detail {

/// Two double-precision numbers, one register on every target: Eigen aligns no wider numbers without AVX.
using DoublePack = math::Pack<2>;

/// Numbers from `from` on as a pack.
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline Scalar read_pack(const float* from) noexcept {
  if constexpr (std::is_same_v<Scalar, FloatPack>) {
    return *as_packs(from);
  } else {
    using Lanes = math::detail::Lanes<Scalar::width>;
    typename Lanes::Float numbers;
    std::memcpy(&numbers, from, sizeof numbers);
    return Scalar(__builtin_convertvector(numbers, typename Lanes::Vector));
  }
}

[[nodiscard, gnu::always_inline]] inline double total_of(const FloatPack& v) noexcept {
  return static_cast<double>(sum_of(v));
}
[[nodiscard, gnu::always_inline]] inline double total_of(const DoublePack& v) noexcept {
  return v[0] + v[1];
}
[[nodiscard, gnu::always_inline]] inline double most_of(const FloatPack& v) noexcept {
  return static_cast<double>(largest_of(v));
}
[[nodiscard, gnu::always_inline]] inline double most_of(const DoublePack& v) noexcept {
  return std::max(v[0], v[1]);
}
[[nodiscard, gnu::always_inline]] inline std::array<double, 4> totals_of(const FloatPack& a, const FloatPack& b, const FloatPack& c,
                                                                         const FloatPack& d) noexcept {
  const auto sums = sums_of(a, b, c, d);
  return {sums[0], sums[1], sums[2], sums[3]};
}
[[nodiscard, gnu::always_inline]] inline std::array<double, 4> totals_of(const DoublePack& a, const DoublePack& b, const DoublePack& c,
                                                                         const DoublePack& d) noexcept {
  return {total_of(a), total_of(b), total_of(c), total_of(d)};
}

}  // namespace detail

/// Press the points of a node at `at` relative to the tip [m]. With `settle` record the creep of the layer at the end of the period
/// instead; `energy` is the one stored then, without LayerCreep::delayed_energy(), `crept` is set, and there is no force. `layer` is null
/// without creep. Points less deep than the `friction`'s depth, if that is not 0, count in proportion to their depth in `grip`. `Scalar` is
/// FloatPack or DoublePack, which cannot settle.
template <bool settle, class Scalar = detail::FloatPack>
PressedPoints press_points(std::int32_t node, const NearNodes::Tip& tip, const Vector3<>& at, LayerCreep* layer,
                           const RubbedPoints& friction = {}) noexcept {
  using math::any, math::select, math::max_of, math::min_of;
  constexpr std::size_t lanes = std::is_same_v<Scalar, detail::FloatPack> ? detail::float_lanes : detail::DoublePack::width;
  const PatchPoints& points = *tip.points;
  const auto load = [&points](std::size_t number, std::size_t q) { return detail::read_pack<Scalar>(points.coordinate(number) + q); };
  Vector3<Scalar> force(Scalar(0.0), Scalar(0.0), Scalar(0.0));
  Vector3<Scalar> carried(Scalar(0.0), Scalar(0.0), Scalar(0.0));
  Scalar stiffness(0.0), grip(0.0), sheared(0.0), energy(0.0), delayed(0.0), creep(0.0), deepest(-std::numeric_limits<float>::max());
  const Scalar remaining(layer != nullptr ? static_cast<double>(layer->remaining(node)) : 0.0);
  for (std::size_t q = points.begin(node); q < points.end(node); q += lanes) {
    const Vector3<Scalar> y(load(0, q) + Scalar(at[0]), load(1, q) + Scalar(at[1]), load(2, q) + Scalar(at[2]));
    const Vector3<Scalar> normal(load(3, q), load(4, q), load(5, q));
    const auto in = tip.shape.evaluate<Scalar>(y, normal);
    deepest = max_of(deepest, in.depth);
    Scalar excess = in.depth, crept(0.0);
    if (layer != nullptr) {
      crept = remaining * detail::read_pack<Scalar>(layer->state() + q);
      excess -= crept;
    }
    if constexpr (!settle) {
      if (!any(excess > Scalar(0.0))) {
        if (friction.tractions != nullptr) friction.store(q - points.begin(node), Scalar(0.0));
        continue;
      }
    }
    const Scalar depth = max_of(excess, Scalar(0.0));
    const Scalar facing = (in.away[0] * normal[0] + in.away[1] * normal[1]) + in.away[2] * normal[2];
    const Scalar x = min_of(max_of(Scalar(1.0) - Scalar(2.0) * facing, Scalar(0.0)), Scalar(1.0));
    const Scalar weight = x * x * (Scalar(3.0) - Scalar(2.0) * x), pressed = load(6, q) * weight;
    if constexpr (settle) {
      const Scalar more = Scalar(static_cast<double>(layer->gain())) * depth * select(weight > Scalar(0.0), Scalar(1.0), Scalar(0.0));
      *detail::as_packs(layer->state() + q) = crept + more;
      energy += load(6, q) * (weight * Scalar(static_cast<double>(layer->series())) * depth * depth);
      delayed += load(6, q) * (more * (crept + (crept + more)));
      creep += select(excess > Scalar(0.0), pressed * (in.slope * in.slope), Scalar(0.0)) * crept;
      continue;
    }
    const Scalar turned = load(6, q) * (Scalar(6.0) * x * (Scalar(1.0) - x)) * depth * depth;
    const Scalar push = pressed * depth, pushed = push * in.slope;
    for (int a = 0; a < 3; ++a) force[a] += pushed * in.away[a] + turned * in.bend[a];
    const Scalar counted = select(excess > Scalar(0.0), pressed * (in.slope * in.slope), Scalar(0.0));
    stiffness += counted;
    if (friction.fading > 0.0) {
      const Scalar least = min_of(depth * Scalar(1.0 / friction.excess), in.depth * Scalar(1.0 / friction.fading));
      const Scalar gripping = counted * min_of(least, Scalar(1.0));
      grip += gripping;
      if (friction.tractions != nullptr) {
        const std::size_t at_point = q - points.begin(node);
        const auto stored = [&](std::size_t number) { return detail::read_pack<Scalar>(friction.column(number) + at_point); };
        const Scalar kept = min_of(gripping * stored(3), Scalar(1.0));
        for (std::size_t a = 0; a < 3; ++a) carried[static_cast<Eigen::Index>(a)] += kept * stored(a);
        sheared += kept * stored(4);
        friction.store(at_point, gripping);
      }
    }
    energy += push * depth;
  }
  PressedPoints all{.energy = 0.5 * detail::total_of(energy), .clearance = -detail::most_of(deepest)};
  if constexpr (settle) {
    layer->add_energy(0.5 * static_cast<double>(layer->delayed()) * detail::total_of(delayed));
    all.crept = detail::total_of(creep);
  } else {
    const auto sums = detail::totals_of(force[0], force[1], force[2], stiffness);
    all.force = Vector3<>(sums[0], sums[1], sums[2]);
    all.stiffness = sums[3];
    if (friction.fading > 0.0) all.grip.stiffness = detail::total_of(grip);
    if (friction.tractions != nullptr) {
      const auto of_friction = detail::totals_of(carried[0], carried[1], carried[2], sheared);
      all.grip.carried = Vector3<>(of_friction[0], of_friction[1], of_friction[2]);
      all.grip.energy = of_friction[3];
    }
  }
  return all;
}

}  // namespace palpate::deformable
