#pragma once

namespace palpate::deformable {

/// Discrete creep law of a standard linear solid, for springs outside the body's compliance matrix. With the long-term compliance C, forces
/// f held over a period and the delayed force q, the displacement at the end of the period is C (`period_ratio` f + `decay` q), and the
/// next q is `decay` q + `gain` f.
struct Creep {
  double period_ratio = 1.0, decay = 0.0, gain = 0.0;
  double delayed_ratio = 0.0;  ///< delayed part of the compliance, 1 - 1 / instantaneous_ratio

  /// For springs whose stiffness k is that of a period: k times the change of the delayed displacement by a force, relative to it.
  [[nodiscard]] double period_gain() const noexcept { return gain / period_ratio; }
  /// Their energy is k (period_series() x^2 + period_delayed() e^2) / 2, with the displacement x in excess of the delayed one e.
  [[nodiscard]] double period_series() const noexcept { return (1.0 - delayed_ratio) / period_ratio; }
  [[nodiscard]] double period_delayed() const noexcept { return delayed_ratio > 0.0 ? period_ratio / delayed_ratio : 0.0; }

  /// Energy of the Kelvin element's spring: q.C q / (2 delayed_ratio), from `state_form` = q.C q.
  [[nodiscard]] double delayed_energy(double state_form) const noexcept {
    return delayed_ratio > 0.0 ? 0.5 * state_form / delayed_ratio : 0.0;
  }

  /// Energy of both springs: that above and the series spring's, (1 - delayed_ratio) f.C f / 2, from `force_form` = f.C f. (Kelvin form of
  /// the standard linear solid; the dashpot stores none.)
  [[nodiscard]] double energy(double force_form, double state_form) const noexcept {
    return 0.5 * (1.0 - delayed_ratio) * force_form + delayed_energy(state_form);
  }
};

}  // namespace palpate::deformable
