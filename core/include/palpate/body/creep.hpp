#pragma once

namespace palpate {

/// How a spring of a standard linear solid gives way that has no place in a body's compliance: under forces f, held for a period each, by
/// `share` f + `stays` q of what it gives an elastic one at last, where `stays` q + `gains` f is the next q.
struct Creep {
  double share = 1.0, stays = 0.0, gains = 0.0;
  double late = 0.0;  ///< the part that it gives later on

  /// Energy [J m/N] in its dashpot's spring, by its compliance [m/N].
  [[nodiscard]] double stored(double square) const noexcept { return late > 0.0 ? 0.5 * square / late : 0.0; }
};

}  // namespace palpate
