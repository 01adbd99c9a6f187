#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/dry_friction.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/creep.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Coulomb friction of a rigid tip on an elastic surface with partial slip. Each contact node carries a tangential force q_i in its tangent
/// plane, bounded by the friction cone; where the bound is reached, the node slips relative to the tip:
///   |q_i| <= mu f_i,   slip_i = (tip motion)_i - (T dq)_i,   slip_i = 0 inside the cone and parallel to q_i on it,
/// with the tangential compliance T [m/N]. On a half-space this is the contact of Cattaneo (1938) and Mindlin (1949): an inner stick zone
/// surrounded by a slip annulus.
///
/// The forces minimize q.T q / 2 - q.(tip motion) over the cones (TANG of Kalker 1990). The solver is projected Gauss-Seidel, started from
/// the forces of the previous tick. The residual lag of a sticking node is carried over to the next tick. Forces and slip never oppose
/// each other, so friction only dissipates.
///
/// On a model with memory, nodes move without force. The position of a new node at the start of the tick is unknown, so friction acts on
/// it from the next tick on.
class PartialSlip {
 public:
  static constexpr int capacity = 256;  ///< slots: nodes in contact now or in the previous tick

  PartialSlip() = default;

  /// Allocate for a body of `node_count` surface nodes; at most `max_sweeps` Gauss-Seidel sweeps per tick.
  PartialSlip(DryFriction friction, std::int32_t node_count, int max_sweeps = 12)
      : friction_(friction),
        max_sweeps_(max_sweeps),
        slot_of_(static_cast<std::size_t>(node_count), -1),
        compliance_(2 * capacity + 8, 2 * capacity) {
    compliance_.setZero();
  }

  [[nodiscard]] bool enabled() const noexcept { return static_cast<bool>(friction_); }

  [[nodiscard]] const DryFriction& friction() const noexcept { return friction_; }

  /// Advance by one period. The tip moved by `tip_motion` [m] and presses `count` nodes with `forces` [N]. `coverages` are the covered
  /// fractions of the nodes' patches.
  template <class Surface, class Model>
  void step(const Surface& surface, const Model& model, const std::int32_t* contact_nodes, const double* forces, const double* coverages,
            int count, const Vector3<>& tip_motion) noexcept {
    if (count == 0) return reset();
    ++steps_;
    const double mu = sliding_ ? friction_.mu_dynamic : friction_.mu_static;
    const int before = count_;
    std::fill_n(cone_radius_.begin(), count_, 0.0);
    if constexpr (has_creep<Model>) creep_ = model.creep();
    if constexpr (has_memory<Model>)
      for (int s = 0; s < count_; ++s) advance_memory(model, s);
    for (int c = 0; c < count; ++c) {
      const int s = slot_for(model, contact_nodes[c]);
      if (s < 0) continue;
      set_coverage(s, coverages[c], new_points_are_unloaded<Model>);
      cone_radius_[at(s)] = mu * forces[c];
    }
    if constexpr (has_memory<Model>)
      for (int s = before; s < count_; ++s) cone_radius_[at(s)] = 0.0;
    if (changes_) {
      start_force_.head(2 * count_) = force_.head(2 * count_);
      start_displacement_.head(2 * count_) = displacement_.head(2 * count_);
      start_lag_.head(2 * count_) = lag_.head(2 * count_);
    }
    for (int s = 0; s < count_; ++s) {
      lag(s) += surface.tangent_basis(node_[at(s)]).transpose() * tip_motion;
      target_.segment<2>(2 * s) = displacement_.segment<2>(2 * s) + lag(s);
    }
    for (int s = 0; s < max_sweeps_ && !sweep(); ++s) {
    }
    displacement_.head(2 * count_) = target_.head(2 * count_) - lag_.head(2 * count_);
    if (changes_) {
      count_supply();
      pay_by_slip();
      limit_energy();
    }
    update_slip_state(has_memory<Model> ? before : count_);
  }

  void reset() noexcept {
    for (int s = 0; s < count_; ++s) slot_of_[static_cast<std::size_t>(node_[at(s)])] = -1;
    count_ = 0;
    left_over_ = exchanged_ = 0.0;
    steps_ = 0;
    sliding_ = changes_ = false;
  }

  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

  /// Adopt a changed compliance. A model that holds for the state of the body at the first step of an interval between changes is adopted
  /// at the end of that interval. The forces of sticking nodes that have grown meanwhile under an older compliance are therefore corrected
  /// to the one at the middle of the interval they grew in, interpolated between this change and the next: the force stays an integral over
  /// the way of the tip, to second order in the interval. Without it a tip that swings would drain or raise its force in every swing.
  template <class Model>
  void update_compliance(const Model& model) noexcept {
    const Eigen::Index size = 2 * count_;
    const double before = twice_energy();
    changes_ = true;
    const double earlier = steps_ > 0 ? 0.5 - 1.0 / steps_ : 0.0;
    steps_ = 0;
    recent_.head(size) = force_.head(size) - adopted_force_.head(size) + earlier * recent_.head(size);
    lag_.head(size).noalias() += compliance_.topLeftCorner(size, size) * recent_.head(size);
    for (int s = 0; s < count_; ++s) {
      for (int t = 0; t <= s; ++t) {
        const Eigen::Matrix2d block = model.tangential(node_[at(s)], node_[at(t)]);
        compliance_.block<2, 2>(2 * s, 2 * t) = block;
        compliance_.block<2, 2>(2 * t, 2 * s) = block.transpose();
      }
      set_self_compliance(model, s);
    }
    lag_.head(size).noalias() -= compliance_.topLeftCorner(size, size) * recent_.head(size);
    recent_.head(size) = force_.head(size) - adopted_force_.head(size);
    for (int s = 0; s < count_; ++s)
      if (is_at_limit(s)) lag(s).setZero();
    for (int s = 0; s < max_sweeps_ && !sweep(); ++s) {
    }
    for (int s = 0; s < count_; ++s) displacement_.segment<2>(2 * s) = elastic_displacement(s, count_);
    left_over_ += before - twice_energy();
    limit_energy();
    adopted_force_.head(size) = force_.head(size);
  }

  /// Whether the whole contact slides: true from full sliding until every node sticks again.
  [[nodiscard]] bool sliding() const noexcept { return sliding_; }

  /// Tangential force [N] on a node and its displacement [m] in the last step, in the basis SurfaceNodes::tangent_basis.
  [[nodiscard]] Eigen::Vector2d force(std::int32_t node) const noexcept {
    const int s = slot_of_[static_cast<std::size_t>(node)];
    return s < 0 ? Eigen::Vector2d::Zero() : Eigen::Vector2d(force_.segment<2>(2 * s));
  }
  [[nodiscard]] Eigen::Vector2d displacement(std::int32_t node) const noexcept {
    const int s = slot_of_[static_cast<std::size_t>(node)];
    return s < 0 ? Eigen::Vector2d::Zero() : Eigen::Vector2d(displacement_.segment<2>(2 * s));
  }

  /// Energy stored by the forces of the last step, at most what the tip has supplied, J.
  [[nodiscard]] double energy() const noexcept { return 0.5 * std::max(twice_energy() + std::min(left_over_, 0.0), 0.0); }

  /// q.T q of the last step [N m], with the compliance T of the fully covered patches within a period.
  [[nodiscard]] double compliance_work() const noexcept {
    const Eigen::Index size = 2 * count_;
    double sum = force_.head(size).dot(displacement_.head(size) - memory_displacement_.head(size));
    for (int s = 0; s < count_; ++s) sum -= (1.0 / coverage_[at(s)] - 1.0) * layer_work(s, force_.segment<2>(2 * s));
    return sum;
  }

  /// Energy [J] stored in the extra compliance of partially covered patches after the last step.
  [[nodiscard]] double partial_coverage_energy() const noexcept {
    double sum = 0.0;
    for (int s = 0; s < count_; ++s) {
      const Eigen::Vector2d q = force_.segment<2>(2 * s), next = creep_.decay * creep_state_[at(s)] + creep_.gain * q;
      sum += (1.0 / coverage_[at(s)] - 1.0) * creep_.energy(layer_work(s, q), layer_work(s, next)) / creep_.period_ratio;
    }
    return sum;
  }

  /// Derivative of the stored energy by the coverage of a node's patch at fixed displacement [J].
  [[nodiscard]] double coverage_derivative(std::int32_t node) const noexcept {
    const int s = slot_of_[static_cast<std::size_t>(node)];
    if (s < 0) return 0.0;
    const Eigen::Vector2d q = force_.segment<2>(2 * s);
    const Eigen::Vector2d &creep_state = creep_state_[at(s)], whole = layer_compliance_[at(s)] * creep_state / creep_.period_ratio;
    return (0.5 * layer_work(s, q) + creep_.decay * q.dot(whole) - creep_.delayed_energy(creep_state.dot(whole))) /
           (coverage_[at(s)] * coverage_[at(s)]);
  }

 private:
  using SlotVector = Eigen::Matrix<double, 2 * capacity, 1>;

  template <class Model>
  static constexpr bool has_memory = requires(const Model& model) { model.free_tangential_displacement(0); };

  template <class Model>
  static constexpr bool has_creep = requires(const Model& model) { model.creep(); };

  template <class Model>
  static constexpr bool new_points_are_unloaded = requires { Model::new_points_are_unloaded; };

  static constexpr double most_energy = 4.0;   // of limit_energy()
  static constexpr double unaccounted = 1e-3;  // of the exchanged energy
  static constexpr double tolerance = 1e-3;    // convergence: largest force change relative to the largest force
  static constexpr double round_off = 1e-14;
  static constexpr double cone_tolerance = 1e-9;  // relative; keeps the slip state independent of the last bits

  static std::size_t at(int s) noexcept { return static_cast<std::size_t>(s); }
  Eigen::VectorBlock<SlotVector, 2> lag(int s) noexcept { return lag_.segment<2>(2 * s); }

  /// q.C q [N m] with the self-compliance C of a patch that a partial coverage divides.
  [[nodiscard]] double layer_work(int s, const Eigen::Vector2d& q) const noexcept { return q.dot(layer_compliance_[at(s)] * q); }

  /// Take the self-compliance of slot s, which is in the diagonal block, for a fully covered patch; apply the coverage.
  template <class Model>
  void set_self_compliance(const Model& model, int s) noexcept {
    self_compliance_[at(s)] = layer_compliance_[at(s)] = compliance_.block<2, 2>(2 * s, 2 * s);
    if constexpr (requires { model.tangential_layer(0); }) layer_compliance_[at(s)] = model.tangential_layer(node_[at(s)]);
    compliance_.block<2, 2>(2 * s, 2 * s) = covered_compliance(s, coverage_[at(s)]);
    update_max_compliance(s);
  }

  /// Self-compliance of slot s at a covered fraction of its patch, m/N.
  [[nodiscard]] Eigen::Matrix2d covered_compliance(int s, double coverage) const noexcept {
    return self_compliance_[at(s)] + (1.0 / coverage - 1.0) * layer_compliance_[at(s)];
  }

  /// Displacement [m] of slot s by the forces on the first `slots` slots.
  [[nodiscard]] Eigen::Vector2d elastic_displacement(int s, int slots) const noexcept {
    const auto forces = force_.head(2 * slots);
    return {compliance_.col(2 * s).head(2 * slots).dot(forces), compliance_.col(2 * s + 1).head(2 * slots).dot(forces)};
  }

  /// Return the slot of a node. A new slot starts with zero force at the displacement caused by the other forces. -1 if all are in use.
  template <class Model>
  int slot_for(const Model& model, std::int32_t node) noexcept {
    int s = slot_of_[static_cast<std::size_t>(node)];
    if (s >= 0 || count_ == capacity) return s;
    s = count_++;
    slot_of_[static_cast<std::size_t>(node)] = static_cast<std::int16_t>(s);
    node_[at(s)] = node;
    for (int t = 0; t <= s; ++t) {
      const Eigen::Matrix2d block = model.tangential(node, node_[at(t)]);
      compliance_.block<2, 2>(2 * s, 2 * t) = block;
      compliance_.block<2, 2>(2 * t, 2 * s) = block.transpose();
    }
    coverage_[at(s)] = 1.0;
    set_self_compliance(model, s);
    creep_state_[at(s)].setZero();
    force_.segment<2>(2 * s).setZero();
    adopted_force_.segment<2>(2 * s).setZero();
    recent_.segment<2>(2 * s).setZero();
    lag(s).setZero();
    memory_displacement_.segment<2>(2 * s).setZero();
    if constexpr (has_memory<Model>) memory_displacement_.segment<2>(2 * s) = model.free_tangential_displacement(node);
    displacement_.segment<2>(2 * s) = elastic_displacement(s, s) + memory_displacement_.segment<2>(2 * s);
    return s;
  }

  /// Advance the creep state. The motion of the node under the forces of earlier ticks adds to its lag behind the tip.
  template <class Model>
  void advance_memory(const Model& model, int s) noexcept {
    creep_state_[at(s)] = creep_.decay * creep_state_[at(s)] + creep_.gain * force_.segment<2>(2 * s);
    memory_displacement_.segment<2>(2 * s) = model.free_tangential_displacement(node_[at(s)]) + partial_coverage_creep(s, coverage_[at(s)]);
    const Eigen::Vector2d now = memory_displacement_.segment<2>(2 * s) + elastic_displacement(s, count_);
    lag(s) += displacement_.segment<2>(2 * s) - now;
    displacement_.segment<2>(2 * s) = now;
  }

  /// Set the covered fraction of a patch. With `unloaded` what is newly covered begins without force and stays until the node leaves, so
  /// that the energy never rises, and a load that varies to and fro does not drain the force: the caller need not count the coverage in
  /// the normal force (coverage_derivative).
  void set_coverage(int s, double coverage, bool unloaded) noexcept {
    if (coverage == coverage_[at(s)] || (unloaded && force_.segment<2>(2 * s) != Eigen::Vector2d::Zero() && coverage < coverage_[at(s)]))
      return;
    const Eigen::Vector2d creep_state = partial_coverage_creep(s, coverage) - partial_coverage_creep(s, coverage_[at(s)]);
    coverage_[at(s)] = coverage;
    memory_displacement_.segment<2>(2 * s) += creep_state;
    const Eigen::Matrix2d block = covered_compliance(s, coverage);
    const Eigen::Vector2d more = (block - compliance_.block<2, 2>(2 * s, 2 * s)) * force_.segment<2>(2 * s) + creep_state;
    if (!unloaded) lag(s) -= more;
    displacement_.segment<2>(2 * s) += more;
    compliance_.block<2, 2>(2 * s, 2 * s) = block;
    update_max_compliance(s);
  }

  /// Extra creep displacement [m] of a partially covered patch (see TipContact::advance_creep).
  [[nodiscard]] Eigen::Vector2d partial_coverage_creep(int s, double coverage) const noexcept {
    return ((1.0 / coverage - 1.0) * creep_.decay / creep_.period_ratio) * (layer_compliance_[at(s)] * creep_state_[at(s)]);
  }

  /// Update the larger eigenvalue of a slot's self-compliance [m/N].
  void update_max_compliance(int s) noexcept {
    const double a = compliance_(2 * s, 2 * s), b = compliance_(2 * s, 2 * s + 1), d = compliance_(2 * s + 1, 2 * s + 1);
    max_compliance_[at(s)] = 0.5 * (a + d) + std::hypot(0.5 * (a - d), b);
  }

  /// Perform one Gauss-Seidel sweep over all slots. Return true if it converged.
  bool sweep() noexcept {
    double max_change = 0.0, max_force = 0.0;  // squared norms
    const Eigen::Index size = 2 * count_;
    for (int s = 0; s < count_; ++s) {
      const Eigen::Vector2d old = force_.segment<2>(2 * s);
      Eigen::Vector2d next = old + lag(s) / max_compliance_[at(s)];
      const double square = next.squaredNorm(), radius = cone_radius_[at(s)];
      if (square > radius * radius) next *= radius / std::sqrt(square);
      const Eigen::Vector2d change = next - old;
      const double length = change.squaredNorm();
      max_force = std::max(max_force, next.squaredNorm());
      if (!(length > round_off * round_off * max_force)) continue;
      max_change = std::max(max_change, length);
      force_.segment<2>(2 * s) = next;
      lag_.head(size) -= change[0] * compliance_.col(2 * s).head(size) + change[1] * compliance_.col(2 * s + 1).head(size);
    }
    return !(max_change > tolerance * tolerance * max_force);
  }

  /// Force times displacement [N m]: twice the energy that the forces store while the compliance does not change.
  [[nodiscard]] double twice_energy() const noexcept { return force_.head(2 * count_).dot(displacement_.head(2 * count_)); }

  /// Exclude from the energy that the tip has supplied what this step's sweeps have changed by making up for the lag of the last one. Where
  /// the node slips, a part of that lag may be lost.
  void count_supply() noexcept {
    double change = 0.0;
    for (int s = 0; s < count_; ++s) {
      const Eigen::Vector2d both = start_force_.segment<2>(2 * s) + force_.segment<2>(2 * s), before = start_lag_.segment<2>(2 * s);
      const double stored = both.dot(displacement_.segment<2>(2 * s) - start_displacement_.segment<2>(2 * s)), late = both.dot(before);
      left_over_ -= slips(s) ? std::min(late, std::max(stored, 0.0)) : both.dot(before - lag(s));
      change += stored;
    }
    exchanged_ += std::abs(change);
  }

  /// Count work of slip as supplied as far as changes of the compliance have raised the stored energy. Slip by the tip's motion dissipates
  /// what the tip supplies. On a body that yields more and more while the tip slides, a part of this way is elastic.
  void pay_by_slip() noexcept {
    double slip_work = 0.0;
    for (int s = 0; s < count_; ++s) {
      if (!slips(s)) continue;
      const auto force = force_.segment<2>(2 * s);
      slip_work += std::max(force.dot(lag(s)) - std::max(force.dot(start_lag_.segment<2>(2 * s)), 0.0), 0.0);
    }
    left_over_ = std::max(left_over_, std::min(left_over_ + 2.0 * slip_work, 0.0));
  }

  /// Scale the forces down where they would store more than `most_energy` times the energy that the tip has supplied and slip has not
  /// dissipated. In a body that softens with the way, less energy is supplied than its tangent compliance suggests; the bound keeps what
  /// the tip can take out below what it has supplied and a thousandth of what has gone to and fro. Without that allowance the errors of the
  /// sum would drain the force of a tip that swings to the place of its first contact, where the energy is zero.
  void limit_energy() noexcept {
    if (left_over_ >= 0.0) return;
    const double energy = twice_energy(), allowed = most_energy * std::max(energy + left_over_ + unaccounted * exchanged_, 0.0);
    if (energy <= allowed) return;
    const double less = std::sqrt(allowed / energy);
    force_.head(2 * count_) *= less;
    displacement_.head(2 * count_) *= less;
    left_over_ = std::max(left_over_ + energy - allowed, -allowed - unaccounted * exchanged_);  // forces without energy owe none
  }

  /// Whether the force of a slot reaches its friction cone.
  [[nodiscard]] bool is_at_limit(int s) const noexcept {
    return force_.segment<2>(2 * s).squaredNorm() >= (1.0 - cone_tolerance) * cone_radius_[at(s)] * cone_radius_[at(s)];
  }

  /// Whether the lag of a slot is slip.
  [[nodiscard]] bool slips(int s) const noexcept { return is_at_limit(s) && force_.segment<2>(2 * s).dot(lag_.segment<2>(2 * s)) > 0.0; }

  /// Reset the lag of slipping nodes and remove slots without normal force. Slots from `first_new` on are not subject to friction yet.
  void update_slip_state(int first_new) noexcept {
    bool all = true, any = false;
    for (int s = first_new; s < count_; ++s) lag(s).setZero();
    for (int s = first_new - 1; s >= 0; --s) {
      const double radius = cone_radius_[at(s)];
      if (!(radius > 0.0)) {
        remove_slot(s);
        continue;
      }
      const bool slipping = slips(s);
      const bool slides = slipping && force_.segment<2>(2 * s).dot(lag(s)) > cone_tolerance * max_compliance_[at(s)] * radius * radius;
      all = all && slides;
      any = any || slides;
      if (slipping) lag(s).setZero();
    }
    sliding_ = any && (all || sliding_);
  }

  /// Remove a slot without force; the last slot takes its place.
  void remove_slot(int s) noexcept {
    slot_of_[static_cast<std::size_t>(node_[at(s)])] = -1;
    const int last = --count_;
    if (s == last) return;
    node_[at(s)] = node_[at(last)];
    slot_of_[static_cast<std::size_t>(node_[at(s)])] = static_cast<std::int16_t>(s);
    cone_radius_[at(s)] = cone_radius_[at(last)];
    max_compliance_[at(s)] = max_compliance_[at(last)];
    coverage_[at(s)] = coverage_[at(last)];
    self_compliance_[at(s)] = self_compliance_[at(last)];
    layer_compliance_[at(s)] = layer_compliance_[at(last)];
    creep_state_[at(s)] = creep_state_[at(last)];
    force_.segment<2>(2 * s) = force_.segment<2>(2 * last);
    adopted_force_.segment<2>(2 * s) = adopted_force_.segment<2>(2 * last);
    recent_.segment<2>(2 * s) = recent_.segment<2>(2 * last);
    lag_.segment<2>(2 * s) = lag_.segment<2>(2 * last);
    displacement_.segment<2>(2 * s) = displacement_.segment<2>(2 * last);
    memory_displacement_.segment<2>(2 * s) = memory_displacement_.segment<2>(2 * last);
    const Eigen::Index size = 2 * last;
    compliance_.block(2 * s, 0, 2, size) = compliance_.block(2 * last, 0, 2, size);
    compliance_.block(0, 2 * s, size, 2) = compliance_.block(0, 2 * last, size, 2);
    compliance_.block<2, 2>(2 * s, 2 * s) = compliance_.block<2, 2>(2 * last, 2 * last);
  }

  DryFriction friction_;
  int max_sweeps_ = 0;
  bool sliding_ = false;
  bool changes_ = false;               // the compliance has changed during the contact
  double left_over_ = 0.0;             // twice the energy by which changes of the compliance have reduced what is stored, J
  double exchanged_ = 0.0;             // twice the sum of the changes of the stored energy by ticks, J
  int count_ = 0;                      // slots in use
  int steps_ = 0;                      // since the last change of the compliance
  std::vector<std::int16_t> slot_of_;  // by surface node, or -1
  Eigen::MatrixXd compliance_;         // m/N, by slot, in tangent planes; eight padding rows avoid cache-line conflicts between columns
  std::array<std::int32_t, capacity> node_{};
  std::array<double, capacity> cone_radius_{};     // mu f, N
  std::array<double, capacity> max_compliance_{};  // m/N
  std::array<double, capacity> coverage_{};
  std::array<Eigen::Matrix2d, capacity> self_compliance_{};   // of fully covered patches, m/N
  std::array<Eigen::Matrix2d, capacity> layer_compliance_{};  // part that the coverage divides, m/N
  std::array<Eigen::Vector2d, capacity> creep_state_{};       // delayed force of each patch (see Creep), N
  Creep creep_;
  SlotVector force_ = SlotVector::Zero();                // q, N
  SlotVector adopted_force_ = SlotVector::Zero();        // at the last change of the compliance, N
  SlotVector recent_ = SlotVector::Zero();               // change of the force in the interval before it, N
  SlotVector start_force_ = SlotVector::Zero();          // at the start of the step, N
  SlotVector start_displacement_ = SlotVector::Zero();   // likewise, m
  SlotVector start_lag_ = SlotVector::Zero();            // likewise, without the motion of the tip, m
  SlotVector lag_ = SlotVector::Zero();                  // lag of the node behind the tip, m
  SlotVector displacement_ = SlotVector::Zero();         // of the node, m
  SlotVector memory_displacement_ = SlotVector::Zero();  // part of it caused by forces of earlier ticks, m
  SlotVector target_ = SlotVector::Zero();               // displacement without slip, m
};

}  // namespace palpate::deformable
