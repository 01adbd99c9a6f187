#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/support_phase.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Force on a contact node of a condensed body.
struct NodeLoad {
  std::int32_t node = 0;
  Vector3<> force = Vector3<>::Zero();  ///< N
};

/// Displacement of a body whose held nodes stay where they were grasped, without a tip.
///
/// The nodes s are grasped at their displacements u_s*. The forces w = C_ss^-1 u_s* alone keep them there, so the body has the displacement
/// C_s^T w and the energy u_s* . w / 2; the forces f of a tip add C' f and f . C' f / 2, without a mixed term. A grasp at the present
/// displacements changes neither displacement nor energy. Without a support the energy is less: it is the least one that the remaining
/// constraints permit.
class SupportField {
 public:
  explicit SupportField(std::shared_ptr<const SupportPhase> phase)
      : phase_(std::move(phase)),
        forces_(phase_->held().size(), Vector3<>::Zero()),
        reactions_(forces_),
        known_(phase_->touched().size(), 0),
        cache_(phase_->touched().size(), Vector3<>::Zero()) {}

  [[nodiscard]] const SupportPhase& phase() const noexcept { return *phase_; }

  /// Whether nodes are held elsewhere than at rest; otherwise the displacement is zero.
  [[nodiscard]] bool active() const noexcept { return active_; }
  /// Energy of the body without a tip, J.
  [[nodiscard]] double energy() const noexcept { return energy_; }

  /// Displacement of a touched node, by its index among them, m. Computed when first asked for.
  [[nodiscard]] const Vector3<>& displacement(std::int32_t local) noexcept {
    const std::size_t i = at(local);
    if (active_ && known_[i] != version_) {
      cache_[i] = of_supports(phase_->touched()[i], forces_);
      known_[i] = version_;
    }
    return cache_[i];
  }

  /// Hold the nodes where a body is under `count` loads of a tip and the supports of `before`. Does not allocate. Takes a time in
  /// proportion to the held nodes times the loads, which include the supports before.
  void grasp(SupportField& before, const NodeLoad* loads, int count) noexcept {
    release();
    const std::vector<std::int32_t>& old = before.phase_->held();
    if (phase_->held().empty() || (count == 0 && !before.active_)) return;
    before.react(loads, count);
    for (int k = 0; k < count; ++k) add_share(loads[k], 1.0, forces_);
    for (std::size_t h = 0; h < old.size(); ++h) add_share({old[h], before.reactions_[h]}, 1.0, forces_);
    for (int k = 0; k < count; ++k) energy_ += 0.5 * loads[k].force.dot(of_supports(loads[k].node, forces_));
    for (std::size_t h = 0; h < old.size(); ++h) energy_ += 0.5 * before.reactions_[h].dot(of_supports(old[h], forces_));
    active_ = true;
  }

  /// Return to the body at rest.
  void release() noexcept {
    for (Vector3<>& force : forces_) force.setZero();
    if (active_)
      for (Vector3<>& u : cache_) u.setZero();
    ++version_;
    active_ = false;
    energy_ = 0.0;
  }

  /// Compute the forces of the supports under loads of a tip, r = w - C_ss^-1 C_s f.
  void react(const NodeLoad* loads, int count) noexcept {
    reactions_ = forces_;
    for (int k = 0; k < count; ++k) add_share(loads[k], -1.0, reactions_);
  }

  /// Displacement of any node of the body under the same loads after react(), m.
  [[nodiscard]] Vector3<> displacement_under(std::int32_t node, const NodeLoad* loads, int count) const noexcept {
    Vector3<> u = of_supports(node, reactions_);
    for (int k = 0; k < count; ++k) u += block(node, loads[k].node) * loads[k].force;
    return u;
  }

 private:
  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  /// Add `sign` times C_ss^-1 C_s of a load to forces of the supports; a load on a held node is its own share.
  void add_share(const NodeLoad& load, double sign, std::vector<Vector3<>>& forces) const noexcept {
    if (const std::int32_t h = phase_->held_index(load.node); h >= 0) {
      forces[at(h)] += sign * load.force;
      return;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const float* share = phase_->share(load.node, axis);
      const double force = sign * load.force[axis];
      double* sum = forces.data()->data();
      for (std::size_t r = 0; r < 3 * forces.size(); ++r) sum[r] += force * static_cast<double>(share[r]);
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

  /// Displacement of a node under forces of the supports, m.
  [[nodiscard]] Vector3<> of_supports(std::int32_t node, const std::vector<Vector3<>>& forces) const noexcept {
    const std::vector<std::int32_t>& held = phase_->held();
    Vector3<> u = Vector3<>::Zero();
    for (std::size_t h = 0; h < held.size(); ++h) u += block(node, held[h]) * forces[h];
    return u;
  }

  std::shared_ptr<const SupportPhase> phase_;
  std::vector<Vector3<>> forces_;     // w, N
  std::vector<Vector3<>> reactions_;  // to the last loads, N
  std::vector<std::int64_t> known_;   // by touched node: version of its displacement
  std::vector<Vector3<>> cache_;      // by touched node, m
  std::int64_t version_ = 1;
  bool active_ = false;
  double energy_ = 0.0;
};

}  // namespace palpate::deformable
