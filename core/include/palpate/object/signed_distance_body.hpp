#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/signed_distance_contact.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/deformable_object.hpp"

namespace palpate::object {

/// A static linear body whose contact follows the tip's signed distance (SignedDistanceContact), without friction.
///
///   const auto data = std::make_shared<const SignedDistanceBody::Data>(nodes, full, surface, 1.0);
///   BodyPlacement placement{.body = std::make_shared<SignedDistanceBody>(data)};
///
/// `nodes`, `full` and the surface's vertices and triangles are those of a body file: nodes, compliance, points, contact triangles.
class SignedDistanceBody final : public DeformableObject {
 public:
  /// Data that copies share.
  struct Data {
    deformable::SurfaceNodes nodes;
    deformable::FullCompliance compliance;
    deformable::ContactPatches patches;
    double sideways = 1.0;  ///< see FullCompliance
    double rim = 0.0;       ///< radius of the rounded edge of a flat end: a quarter of the mean node spacing, m

    /// `full` is 3n x 3n [m/N], row 3 x node + axis; the surface's nodes are those of `at`.
    Data(deformable::SurfaceNodes at, const float* full, const deformable::ContactSurface& surface, double fraction)
        : nodes(std::move(at)), compliance(nodes, full, fraction), patches(surface), sideways(fraction) {
      for (std::int32_t i = 0; i < nodes.size(); ++i) rim += 0.25 * patches.round.spacing(i) / nodes.size();
    }
  };

  explicit SignedDistanceBody(std::shared_ptr<const Data> data)
      : data_(std::move(data)), contact_(data_->nodes, data_->compliance, data_->patches) {}

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override {
    const bool flat = tip.kind == deformable::Tip::Kind::flat;
    return step(flat ? deformable::TipGeometry::cylinder(tip.radius, data_->rim, tip.outward) : deformable::TipGeometry::sphere(tip.radius),
                tip.center);
  }

  /// Advance by one period with a tip of any shape, centered at `center` [m].
  const deformable::ContactResult& step(const deformable::TipGeometry& tip, const Vector3<>& center) noexcept {
    const deformable::ContactResult& result = contact_.step(tip, center);
    for (int k = 0; k < result.nodes; ++k) contact_nodes_[static_cast<std::size_t>(k)] = contact_.contact_node(k);
    return result;
  }

  void reset() noexcept { contact_.reset(); }

  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return contact_.last(); }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept override { return contact_nodes_.data(); }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept override { return contact_.node_force(k); }
  [[nodiscard]] const deformable::SurfaceNodes& nodes() const noexcept { return data_->nodes; }
  [[nodiscard]] double sideways() const noexcept { return data_->sideways; }

  /// In contact the direction of the force on the tip, otherwise the normal of the nearest node. It has no influence on the force.
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override {
    return deformable::estimate_outward(data_->nodes, tip, last().nodes, [this](int k) { return Vector3<>(-contact_.node_force(k)); });
  }

  [[nodiscard]] std::unique_ptr<DeformableObject> clone_at_rest() const override { return std::make_unique<SignedDistanceBody>(data_); }

 private:
  std::shared_ptr<const Data> data_;
  deformable::SignedDistanceContact contact_;
  std::array<std::int32_t, static_cast<std::size_t>(deformable::SignedDistanceContact::capacity)> contact_nodes_{};
};

}  // namespace palpate::object
