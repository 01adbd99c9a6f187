#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/condensed_surface.hpp"
#include "palpate/deformable/linear/creep.hpp"
#include "palpate/deformable/linear/support_phase.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Displacement of a body whose held nodes stay where they were grasped, without the loads of a tip since then.
///
/// The nodes s are grasped at their displacements u_s*. The forces w = C_ss^-1 u_s* alone keep them there, so the body has the displacement
/// C_s^T w and the energy u_s* . w / 2; the loads f of a tip add C' f and f . C' f / 2, without a mixed term. A grasp at the present
/// displacements changes neither displacement nor energy. Without a support the energy is less: it is the least one that the remaining
/// constraints permit.
///
/// A standard linear solid (CreepMotion) also has the delayed forces q of the time before, which decay with the retardation time T. Those
/// on nodes n that are not held displace it by C' q_n; those on the held nodes do not, but they remain after a release. With the ratio r of
/// the moduli and delta = 1 - 1 / r, T q' = (r - 1) g - r q on held nodes, where the load g = w - C_ss^-1 C_sn g_n keeps their
/// displacement. The solution is
///   q_s = -C_ss^-1 C_sn q_n + delta w + exp(-r t / T) d,
/// with d from the grasp. Then the energy is that of the body with the compliance C' plus
///   u_s* . w / 2 + r / (2 delta) exp(-2 r t / T) d . C_ss d,   without mixed terms.
///
/// A body with inertia (SupportedModes) moves about this displacement. Its inertial and damping forces are loads of the modes.
class SupportField {
 public:
  /// `law` is that of a standard linear solid, or of an elastic body.
  explicit SupportField(std::shared_ptr<const SupportPhase> phase, const Creep& law = {})
      : phase_(std::move(phase)),
        law_(law),
        held_decay_(law.delayed_ratio > 0.0 ? std::pow(law.decay, 1.0 / (1.0 - law.delayed_ratio)) : 0.0),
        forces_(phase_->held().size(), Vector3<>::Zero()),
        excess_(forces_),
        delayed_shares_(forces_),
        known_(phase_->touched().size(), 0),
        held_displacement_(phase_->touched().size(), Vector3<>::Zero()),
        delayed_displacement_(held_displacement_) {
    if (!(law.delayed_ratio > 0.0)) return;
    delayed_.reserve(phase_->surface()->size());
    listed_.assign(phase_->surface()->size(), -1);
  }

  [[nodiscard]] const SupportPhase& phase() const noexcept { return *phase_; }

  /// Whether the body is displaced without a tip.
  [[nodiscard]] bool active() const noexcept { return active_; }
  /// Whether delayed forces of the time before displace the body.
  [[nodiscard]] bool remembers() const noexcept { return !delayed_.empty(); }
  /// Energy of the body without a tip, J; less that of `delayed` loads, which CreepMotion counts.
  [[nodiscard]] double energy() const noexcept {
    if (!(law_.delayed_ratio > 0.0)) return 0.5 * held_work_;
    return 0.5 * held_work_ + 0.5 * excess_left_ * excess_left_ * excess_work_ / (law_.delayed_ratio * (1.0 - law_.delayed_ratio));
  }

  /// Displacement of a touched node by the supports, by its index among them, m. Computed when first asked for.
  [[nodiscard]] const Vector3<>& displacement(std::int32_t local) noexcept { return held_displacement_[known(local)]; }
  /// Displacement of a touched node by the delayed forces of the time before, m.
  [[nodiscard]] Vector3<> delayed_displacement(std::int32_t local) noexcept { return delayed_left_ * delayed_displacement_[known(local)]; }

  /// Hold the nodes where the body is under all its loads, those of supports included (see append()). Does not allocate. Takes a time in
  /// proportion to the held nodes times the loads.
  void grasp(const BodyLoads& loads) noexcept {
    release();
    phase_->modes().add_share(loads.modes, forces_);
    for (const NodeLoad& load : loads.nodes) {
      add_share(load.node, load.total(), forces_);
      if (law_.delayed_ratio > 0.0) add_share(load.node, load.delayed, excess_);
    }
    double both_work = 0.0, delayed_work = 0.0;
    held_work_ += phase_->modes().work(loads.modes, forces_);
    for (const NodeLoad& load : loads.nodes) {
      const Vector3<> u = of_supports(load.node, forces_);
      held_work_ += load.total().dot(u);
      if (!(law_.delayed_ratio > 0.0)) continue;
      both_work += load.delayed.dot(u);
      delayed_work += load.delayed.dot(of_supports(load.node, excess_));
      if (phase_->held_index(load.node) < 0) remember(load.node, load.delayed);
    }
    for (const NodeLoad& load : delayed_) add_share(load.node, load.delayed, delayed_shares_);
    active_ = !loads.empty() && (!forces_.empty() || remembers());
    if (!(law_.delayed_ratio > 0.0)) return;
    const double delta = law_.delayed_ratio;
    for (std::size_t h = 0; h < excess_.size(); ++h) excess_[h] -= delta * forces_[h];
    mixed_work_ = both_work - delta * held_work_;
    excess_work_ = std::fmax(delayed_work - 2.0 * delta * both_work + delta * delta * held_work_, 0.0);
  }

  /// q_s . C_ss q_s of the held nodes' delayed forces, without the part that moves with those of the other nodes, N m.
  [[nodiscard]] double delayed_work() const noexcept {
    const double delta = law_.delayed_ratio;
    return delta * delta * held_work_ + excess_left_ * (2.0 * delta * mixed_work_ + excess_left_ * excess_work_);
  }

  /// Advance the delayed forces by one period.
  void advance() noexcept {
    if (!(law_.delayed_ratio > 0.0) || !active_) return;
    excess_left_ *= excess_left_ > negligible ? held_decay_ : 0.0;
    delayed_left_ *= delayed_left_ > negligible ? law_.decay : 0.0;
    if (delayed_left_ == 0.0) forget();
  }

  /// Return to the body at rest.
  void release() noexcept {
    for (std::vector<Vector3<>>* forces : {&forces_, &excess_, &delayed_shares_})
      for (Vector3<>& force : *forces) force.setZero();
    forget();
    if (active_)
      for (std::vector<Vector3<>>* displacements : {&held_displacement_, &delayed_displacement_})
        for (Vector3<>& u : *displacements) u.setZero();
    ++version_;
    active_ = false;
    held_work_ = mixed_work_ = excess_work_ = 0.0;
    delayed_left_ = excess_left_ = 1.0;
  }

  /// Append the delayed forces of the time before and the forces of the supports to the loads of a tip and of the modes. Does not allocate
  /// within the capacity of `of_body`.
  void append(BodyLoads& of_body) noexcept {
    std::vector<NodeLoad>& loads = of_body.nodes;
    for (const NodeLoad& load : delayed_) loads.push_back({.node = load.node, .delayed = delayed_left_ * load.delayed});
    const std::vector<std::int32_t>& held = phase_->held();
    const std::size_t others = loads.size();
    if (held.empty() || (of_body.empty() && !active_)) return;
    const double delta = law_.delayed_ratio;
    for (std::size_t h = 0; h < held.size(); ++h)
      loads.push_back({held[h], (1.0 - delta) * forces_[h] - excess_left_ * excess_[h], delta * forces_[h] + excess_left_ * excess_[h]});
    for (std::size_t k = 0; k < others; ++k) {
      subtract_share(loads[k].node, loads[k].force, loads.data() + others, &NodeLoad::force);
      if (delta > 0.0) subtract_share(loads[k].node, loads[k].delayed, loads.data() + others, &NodeLoad::delayed);
    }
    phase_->modes().subtract_share(of_body.modes, loads.data() + others);
  }

  /// Displacement of any node of the body under all its loads, m.
  [[nodiscard]] Vector3<> displacement_under(std::int32_t node, const BodyLoads& loads) const noexcept {
    return displacement_under(node, loads.nodes) + phase_->modes().displacement(node, loads.modes);
  }

  /// Forces w of the supports, N.
  [[nodiscard]] const std::vector<Vector3<>>& forces() const noexcept { return forces_; }

 private:
  [[nodiscard]] Vector3<> displacement_under(std::int32_t node, const std::vector<NodeLoad>& loads) const noexcept {
    Vector3<> u = Vector3<>::Zero();
    for (const NodeLoad& load : loads) u += block(node, load.node) * load.total();
    return u;
  }

  static constexpr double negligible = 1e-12;

  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  /// List a delayed force of a node that is not held; several of one node are added.
  void remember(std::int32_t node, const Vector3<>& force) noexcept {
    std::int32_t& place = listed_[at(node)];
    if (place < 0) {
      place = static_cast<std::int32_t>(delayed_.size());
      delayed_.push_back({.node = node});  // within the reserved capacity
    }
    delayed_[at(place)].delayed += force;
  }
  void forget() noexcept {
    for (const NodeLoad& load : delayed_) listed_[at(load.node)] = -1;
    delayed_.clear();
  }

  /// Compute the displacements of a touched node if they are not known. Return its index.
  [[nodiscard]] std::size_t known(std::int32_t local) noexcept {
    const std::size_t i = at(local);
    if (!active_ || known_[i] == version_) return i;
    const std::int32_t node = phase_->touched()[i];
    held_displacement_[i] = of_supports(node, forces_);
    if (remembers()) delayed_displacement_[i] = displacement_under(node, delayed_) - of_supports(node, delayed_shares_);
    known_[i] = version_;
    return i;
  }

  /// Add C_ss^-1 C_s of a load to forces of the supports; a load on a held node is its own share.
  void add_share(std::int32_t node, const Vector3<>& load, std::vector<Vector3<>>& forces) const noexcept {
    if (const std::int32_t h = phase_->held_index(node); h >= 0) {
      forces[at(h)] += load;
      return;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const float* share = phase_->share(node, axis);
      double* sum = forces.data()->data();
      for (std::size_t r = 0; r < 3 * forces.size(); ++r) sum[r] += load[axis] * static_cast<double>(share[r]);
    }
  }
  /// Subtract the same of a load on a node that is not held from a part of the supports' loads.
  void subtract_share(std::int32_t node, const Vector3<>& load, NodeLoad* supports, Vector3<> NodeLoad::*part) const noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      const float* share = phase_->share(node, axis);
      for (std::size_t h = 0; h < forces_.size(); ++h)
        for (std::size_t a = 0; a < 3; ++a) (supports[h].*part)[static_cast<int>(a)] -= load[axis] * static_cast<double>(share[3 * h + a]);
    }
  }

  [[nodiscard]] Matrix3<> block(std::int32_t i, std::int32_t j) const noexcept {
    const CondensedSurface& surface = *phase_->surface();
    const std::size_t row = 3 * surface.size();
    const float* c = surface.compliance.data() + 3 * at(i) * row + 3 * at(j);
    Matrix3<> m;
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b) m(static_cast<int>(a), static_cast<int>(b)) = static_cast<double>(c[a * row + b]);
    return m;
  }

  /// Displacement of a node under forces of the supports, m; of a held node with that of its support.
  [[nodiscard]] Vector3<> of_supports(std::int32_t node, const std::vector<Vector3<>>& forces) const noexcept {
    const std::vector<std::int32_t>& held = phase_->held();
    Vector3<> u = Vector3<>::Zero();
    for (std::size_t h = 0; h < held.size(); ++h) u += block(node, held[h]) * forces[h];
    if (const std::int32_t h = phase_->held_index(node); h >= 0) u += phase_->yielding() * forces[at(h)];
    return u;
  }

  std::shared_ptr<const SupportPhase> phase_;
  Creep law_;
  double held_decay_;                                                // exp(-r t / T) of a period
  std::vector<Vector3<>> forces_, excess_;                           // w and d, N
  std::vector<Vector3<>> delayed_shares_;                            // C_ss^-1 C_sn q_n of `delayed_`, N
  std::vector<NodeLoad> delayed_;                                    // on nodes that are not held, at the grasp
  std::vector<std::int32_t> listed_;                                 // by node: index in `delayed_`, or -1
  std::vector<std::int64_t> known_;                                  // by touched node: version of its displacements
  std::vector<Vector3<>> held_displacement_, delayed_displacement_;  // by touched node: at the grasp, m
  std::int64_t version_ = 1;
  bool active_ = false;
  double held_work_ = 0.0, mixed_work_ = 0.0, excess_work_ = 0.0;  // w.C_ss w, w.C_ss d, d.C_ss d, N m
  double delayed_left_ = 1.0, excess_left_ = 1.0;                  // since the grasp
};

}  // namespace palpate::deformable
