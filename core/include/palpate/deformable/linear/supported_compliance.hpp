#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/compliance.hpp"
#include "palpate/deformable/linear/support_field.hpp"

namespace palpate::deformable {

/// A condensed body between two changes of its supports, along the inward normals (concept ContactModel).
class SupportedCompliance {
 public:
  /// `nodes` are the touched ones of the phase and must outlive the model.
  SupportedCompliance(const SurfaceNodes& nodes, std::shared_ptr<const SupportPhase> phase)
      : nodes_(&nodes), elastic_(nodes, phase->compliance().data()), field_(std::move(phase)) {
    const CondensedSurface& surface = *field_.phase().surface();
    const std::size_t row = 3 * surface.size();
    for (const std::int32_t node : field_.phase().touched()) {
      const auto i = static_cast<std::size_t>(node);
      const Vector3<>& n = surface.normals[i];
      double sum = 0.0;
      for (std::size_t a = 0; a < 3; ++a) {
        const float* c = surface.compliance.data() + (3 * i + a) * row + 3 * i;
        sum += n[static_cast<int>(a)] *
               (static_cast<double>(c[0]) * n[0] + static_cast<double>(c[1]) * n[1] + static_cast<double>(c[2]) * n[2]);
      }
      layer_.push_back(static_cast<double>(static_cast<float>(sum)));
    }
  }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept { return elastic_.compliance(i, j); }
  /// Self-compliance without the supports, which that of a partially covered patch exceeds: supports must not change it, or a grasp would
  /// supply energy.
  [[nodiscard]] double layer_compliance(std::int32_t i) const noexcept { return layer_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double free_displacement(std::int32_t i) const noexcept {
    return field_.active() ? -nodes_->normal(i).dot(field_.displacement(i)) : 0.0;
  }
  [[nodiscard]] bool group_free_displacement_at_least(std::size_t, double value) const noexcept { return !field_.active() && value <= 0.0; }
  void advance(const std::int32_t*, const double*, int) noexcept {}
  void reset() noexcept { field_.release(); }
  [[nodiscard]] double energy(double compliance_work) const noexcept { return 0.5 * compliance_work + field_.energy(); }

  [[nodiscard]] SupportField& field() noexcept { return field_; }

 private:
  const SurfaceNodes* nodes_;
  Compliance elastic_;
  mutable SupportField field_;  // its displacements are computed when asked for
  std::vector<double> layer_;   // m/N
};

}  // namespace palpate::deformable
