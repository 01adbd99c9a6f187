#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "palpate/deformable/contact/partial_slip.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tangential_compliance.hpp"
#include "palpate/deformable/multirate/linear_local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Coulomb friction of one tip on the local models of a linear body, node by node (PartialSlip), with the static compliance of the body in
/// the nodes' tangent planes, times the compliance ratio of the local model. Inertia and creep along the surface are neglected.
class LinearLocalSlip {
 public:
  LinearLocalSlip() = default;

  /// `nodes` must outlive the object.
  LinearLocalSlip(DryFriction friction, const SurfaceNodes& nodes, TangentialCompliance compliance)
      : slip_(friction, nodes.size()), nodes_(&nodes), compliance_(std::move(compliance)) {
    full_coverage_.fill(1.0);
  }

  [[nodiscard]] bool enabled() const noexcept { return slip_.enabled(); }
  [[nodiscard]] bool sliding() const noexcept { return slip_.sliding(); }

  /// Advance by one period. The tip moved by `tip_motion` [m] and presses `count` nodes with `forces` [N] along their inward normals.
  void step(const LinearLocalModel& model, const Vector3<>& /*outward*/, const std::int32_t* contact_nodes, const double* forces,
            const double* /*layer_stiffness*/, int count, const Vector3<>& tip_motion) noexcept {
    if (model.compliance_ratio != ratio_) {
      ratio_ = model.compliance_ratio;
      slip_.update_compliance(*this);
    }
    slip_.step(*nodes_, *this, contact_nodes, forces, full_coverage_.data(), count, tip_motion);
  }

  /// Friction force [N] on a node of the last step, and its displacement [m].
  [[nodiscard]] Vector3<> force(std::int32_t node) const noexcept { return nodes_->tangent_basis(node) * slip_.force(node); }
  [[nodiscard]] Vector3<> displacement(std::int32_t node) const noexcept { return nodes_->tangent_basis(node) * slip_.displacement(node); }

  /// Energy that friction stores, J.
  [[nodiscard]] double energy() const noexcept { return slip_.energy(); }

  void reset() noexcept {
    slip_.reset();
    ratio_ = 1.0;
  }

  /// Interface for PartialSlip.
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept { return ratio_ * compliance_(i, j); }

 private:
  PartialSlip slip_;
  const SurfaceNodes* nodes_ = nullptr;
  TangentialCompliance compliance_;
  double ratio_ = 1.0;  // of the tangent compliance to that at rest
  std::array<double, static_cast<std::size_t>(PartialSlip::capacity)> full_coverage_{};
};

}  // namespace palpate::deformable
