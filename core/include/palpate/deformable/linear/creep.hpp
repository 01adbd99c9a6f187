#pragma once

namespace palpate::deformable {

/// How a spring of a standard linear solid gives way that has no place in a body's compliance: under forces f, held for a period each, by
/// `share` f + `stays` q of what it gives an elastic one at last, where `stays` q + `gains` f is the next q.
struct Creep {
  double share = 1.0, stays = 0.0, gains = 0.0;
  double late = 0.0;  ///< the part that it gives later on

  /// Energy in the spring beside its dashpot: q.C q / 2 late, from `crept` = q.C q with its compliance C at last.
  [[nodiscard]] double stored(double crept) const noexcept { return late > 0.0 ? 0.5 * crept / late : 0.0; }

  /// The same and that of the spring in line with both, which gives way at once: (1 - late) f.C f / 2, from `pressed` = f.C f. (Kelvin's
  /// form of the standard linear solid: the dashpot has no energy.)
  [[nodiscard]] double energy(double pressed, double crept) const noexcept { return 0.5 * (1.0 - late) * pressed + stored(crept); }
};

}  // namespace palpate::deformable
