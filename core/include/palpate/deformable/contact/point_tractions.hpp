#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/linear/creep.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Friction of the single points of each place, for LayerFriction. A point of the shear stiffness k has the traction t and the energy
/// t.t / (2 K): K <= k is the stiffness that carries t. A point that comes deeper gains stiffness that carries no traction yet, and as it
/// leaves that part leaves first. While k falls below K, t falls with it, and the energy too: to and fro, only the first fall loses
/// traction, as in a contact of Mindlin and Deresiewicz (1953). Stiffnesses are those under pressure; LayerFriction applies the ratio.
/// Points that slip share the traction of their node in proportion to k.
///
/// On a body that creeps, the points creep in shear as well, by the law of LayerCreep. A point with the delayed slip e has the delayed
/// force r = k e. Its energy is tracked like that of t.
class PointTractions {
 public:
  /// Columns of a place: traction [N] (0 to 2), 1 / K [m/N] (3), t.t / K [J] (4), k when last evaluated [N/m] (5). On a body that creeps
  /// they are those at the end of the next period without slip, and others follow: delayed force [N] (6 to 8), r.r / K of it [J] (9).
  static constexpr std::size_t columns = 6, columns_of_creep = 10;

  PointTractions() = default;
  PointTractions(const ContactPatches& patches, int places)
      : creep_(patches.creep), columns_(creep_.delayed_ratio > 0.0 ? columns_of_creep : columns) {
    std::size_t most = 0;
    for (const PatchPoints* points : {&patches.round, &patches.flat})
      for (std::int32_t i = 0; i < points->size(); ++i) most = std::max(most, points->end(i) - points->begin(i));
    lines_ = (most + 15) / 16;
    state_.resize(static_cast<std::size_t>(places) * columns_ * lines_);
  }

  /// First column of a slot; the next ones follow at distances of stride().
  [[nodiscard]] float* first(int slot) noexcept { return state_[line(slot)].value.data(); }
  [[nodiscard]] std::size_t stride() const noexcept { return 16 * lines_; }

  void clear(int slot) noexcept { std::fill_n(state_.begin() + static_cast<std::ptrdiff_t>(line(slot)), columns_ * lines_, Line()); }

  /// Continue with the tractions of the same slots of `before`, whose nodes have the same points.
  void take_over(const PointTractions& before) noexcept {
    const std::size_t common = std::min(lines_, before.lines_), rows = lines_ > 0 ? state_.size() / lines_ : 0;
    for (std::size_t r = 0; r < rows; ++r)
      std::copy_n(before.state_.begin() + static_cast<std::ptrdiff_t>(r * before.lines_), common,
                  state_.begin() + static_cast<std::ptrdiff_t>(r * lines_));
  }

  /// Give the `points` of a slot the traction `total` [N]. They share its change in proportion to k or, if they slip, the whole of it.
  /// Return the traction and its energy at the end of the period, with that of the delayed force.
  Grip share(int slot, std::size_t points, const Grip& grip, const Vector3<>& total, bool slips) noexcept {
    using detail::FloatPack, math::max_of, math::min_of;
    const Vector3<> strain = (slips ? total : Vector3<>(total - grip.carried)) / grip.stiffness;
    const std::array<FloatPack, 3> by{FloatPack(strain[0]), FloatPack(strain[1]), FloatPack(strain[2])};
    const auto at = [this, from = first(slot)](std::size_t number, std::size_t q) -> FloatPack& {
      return *detail::as_packs(from + number * stride() + q);
    };
    const bool creeps = columns_ == columns_of_creep;
    FloatPack energy(0.0);
    for (std::size_t q = 0; q < points; q += detail::float_lanes) {
      const FloatPack k = at(5, q), least_inverse = FloatPack(1.0) / max_of(k, FloatPack(tiny)), inverse = at(3, q);
      const FloatPack left = min_of(FloatPack(1.0), k * inverse), kept = slips ? FloatPack(0.0) : left;
      FloatPack square(0.0), stored = kept * at(4, q);
      for (std::size_t a = 0; a < 3; ++a) {
        const FloatPack carried = kept * at(a, q), now = carried + k * by[a];
        stored += (carried + now) * by[a];
        at(a, q) = now;
        square += now * now;
      }
      const FloatPack least = square * least_inverse, most = max_of(square * inverse, least);
      stored = slips ? least : min_of(max_of(stored, least), most);
      energy += creeps ? creep(at, q, left, least_inverse, stored, square) : stored;
      at(4, q) = stored;
      at(3, q) = min_of(FloatPack(above_one) * stored / max_of(square, FloatPack(tiny)), FloatPack(1.0 / tiny));
    }
    return {grip.stiffness, total, static_cast<double>(detail::sum_of(energy))};
  }

 private:
  using Line = detail::FloatLine;
  static constexpr double tiny = 1e-30;
  static constexpr double above_one = 1.0 + 1e-6;  // a k that stays as it is loses nothing by rounding

  /// Creep of points from `q` on, which keep the part `left` of their delayed forces: the tractions, the energies `stored` in them and
  /// their squares become those at the end of the next period without slip. Return the energy at the end of this period.
  template <class At>
  [[gnu::always_inline]] detail::FloatPack creep(const At& at, std::size_t q, const detail::FloatPack& left,
                                                 const detail::FloatPack& inverse, detail::FloatPack& stored,
                                                 detail::FloatPack& square) const noexcept {
    using detail::FloatPack, math::max_of;
    const FloatPack decay(creep_.decay), gain(creep_.period_gain()), series(creep_.period_series()), delayed(creep_.period_delayed());
    const FloatPack in_series = series * stored;
    FloatPack delayed_square(0.0), in_delayed = left * (decay * decay) * at(9, q);
    square = FloatPack(0.0);
    for (std::size_t a = 0; a < 3; ++a) {
      const FloatPack now = at(a, q), kept = left * at(6 + a, q), before = decay * kept, by = gain * now, crept = before + by;
      const FloatPack next = now + decay * (kept - crept);
      in_delayed += (before + crept) * (by * inverse);
      stored += (now + next) * ((next - now) * inverse);
      at(6 + a, q) = crept;
      at(a, q) = next;
      delayed_square += crept * crept;
      square += next * next;
    }
    in_delayed = max_of(in_delayed, delayed_square * inverse);
    stored = max_of(stored, square * inverse);
    at(9, q) = in_delayed;
    return in_series + delayed * in_delayed;
  }

  [[nodiscard]] std::size_t line(int slot) const noexcept { return static_cast<std::size_t>(slot) * columns_ * lines_; }

  Creep creep_;
  std::size_t columns_ = columns;
  std::size_t lines_ = 0;  // of 16 points, in a column
  std::vector<Line> state_;
};

/// Friction of a node's points, for press_points(): a view of PointTractions.
struct RubbedPoints {
  double fading = 0.0;         ///< depth below which a point carries less friction, m; 0: without friction
  double excess = 0.0;         ///< the same for the compression of the layer in excess of the delayed one, m
  float* tractions = nullptr;  ///< PointTractions::first(); null: none of the points carries a traction yet
  std::size_t stride = 0;

  [[nodiscard]] float* column(std::size_t number) const noexcept { return tractions + number * stride; }
  /// Store the stiffnesses of points from `from` on, N/m.
  template <class Scalar>
  [[gnu::always_inline]] void store(std::size_t from, const Scalar& stiffness) const noexcept {
    float* const to = column(5) + from;
    if constexpr (std::is_same_v<Scalar, detail::FloatPack>) {
      *detail::as_packs(to) = stiffness;
    } else {
      for (std::size_t l = 0; l < Scalar::width; ++l) to[l] = static_cast<float>(stiffness[l]);
    }
  }
};

}  // namespace palpate::deformable
