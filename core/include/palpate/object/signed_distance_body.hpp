#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/dry_friction.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/signed_distance_contact.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/deformable/linear/creep_motion.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/deformable/linear/modal_motion.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/deformable_object.hpp"

namespace palpate::object {

/// Material, friction and tips of a SignedDistanceBody.
struct SignedDistanceOptions {
  double sideways = 1.0;  ///< see FullCompliance
  deformable::DryFriction friction;
  double period = 1e-3;              ///< of a tick, s; of a body with memory
  deformable::ModalData modes;       ///< none: without inertia
  double instantaneous_ratio = 1.0;  ///< of the instantaneous to the long-term modulus; 1: elastic
  double retardation_time = 1.0;     ///< s
  int tips = 1;                      ///< at most SignedDistanceContact::max_tips
};

/// A linear body whose contact follows the tip's signed distance (SignedDistanceContact): static, of a standard linear solid, or with
/// inertia.
///
///   const auto data = std::make_shared<const SignedDistanceBody::Data>(nodes, full, surface);
///   BodyPlacement placement{.body = std::make_shared<SignedDistanceBody>(data)};
///
/// `nodes`, `full` and the surface's vertices and triangles are those of a body file: nodes, compliance, points, contact triangles.
class SignedDistanceBody : public DeformableObject {
 public:
  /// Data that copies share.
  struct Data {
    deformable::SurfaceNodes nodes;
    deformable::FullCompliance compliance;  ///< of one period
    deformable::ContactPatches patches;
    std::unique_ptr<const deformable::BodyMotion> motion;  ///< at rest; null: static
    double sideways = 1.0;
    deformable::DryFriction friction;
    double rim = 0.0;  ///< radius of the rounded edge of a flat end: a quarter of the mean node spacing, m
    int tips = 1;

    /// `full` is 3n x 3n [m/N], row 3 x node + axis; the surface's nodes are those of `at`.
    Data(deformable::SurfaceNodes at, const float* full, const deformable::ContactSurface& surface,
         const SignedDistanceOptions& options = {})
        : nodes(std::move(at)),
          patches(surface, deformable::creep_law(options.instantaneous_ratio, options.retardation_time, options.period)),
          sideways(options.sideways),
          friction(options.friction),
          tips(options.tips) {
      for (std::int32_t i = 0; i < nodes.size(); ++i) rim += 0.25 * patches.round.spacing(i) / nodes.size();
      const bool moves = !options.modes.frequencies.empty();
      const std::size_t size = 3 * static_cast<std::size_t>(nodes.size());
      std::vector<float> period;
      if (moves)
        period = deformable::ModalMotion::period_compliance(full, nodes.size(), options.modes, options.period, options.instantaneous_ratio,
                                                            options.retardation_time);
      else if (options.instantaneous_ratio > 1.0)
        for (std::size_t k = 0; k < size * size; ++k) period.push_back(static_cast<float>(patches.creep.period_ratio) * full[k]);
      compliance = deformable::FullCompliance(nodes, period.empty() ? full : period.data(), sideways);
      if (moves)
        motion = std::make_unique<deformable::ModalMotion>(nodes, options.modes, options.period, options.instantaneous_ratio,
                                                           options.retardation_time, sideways);
      else if (options.instantaneous_ratio > 1.0)
        motion = std::make_unique<deformable::CreepMotion>(compliance, patches.creep);
    }
  };

  explicit SignedDistanceBody(std::shared_ptr<const Data> data)
      : data_(std::move(data)),
        contact_(data_->nodes, data_->compliance, data_->patches, data_->friction, data_->motion ? data_->motion->clone_at_rest() : nullptr,
                 data_->tips) {}

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override { return step(shape_of(tip), tip.center); }

  /// Advance by one period with a tip of any shape, centered at `center` [m].
  virtual const deformable::ContactResult& step(const deformable::TipGeometry& tip, const Vector3<>& center) noexcept {
    const deformable::ContactResult& result = contact_.step(tip, center);
    for (int k = 0; k < contact_.contact_count(); ++k) contact_nodes_[static_cast<std::size_t>(k)] = contact_.contact_node(k);
    return result;
  }

  /// Advance by one period with all tips; see contact().last().
  virtual void step(const deformable::SignedDistanceContact::PlacedTip* tips) noexcept { contact_.step(tips); }

  /// Shape of a tip of the kinds that all bodies know.
  [[nodiscard]] deformable::TipGeometry shape_of(const deformable::Tip& tip) const noexcept {
    const bool flat = tip.kind == deformable::Tip::Kind::flat;
    return flat ? deformable::TipGeometry::cylinder(tip.radius, data_->rim, tip.outward) : deformable::TipGeometry::sphere(tip.radius);
  }

  void reset() noexcept { contact_.reset(); }

  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return contact_.last(); }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept override { return contact_nodes_.data(); }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept override { return contact_.node_force(k); }
  [[nodiscard]] const deformable::SurfaceNodes& nodes() const noexcept { return data_->nodes; }
  [[nodiscard]] double sideways() const noexcept { return data_->sideways; }
  [[nodiscard]] bool has_memory() const noexcept { return data_->motion != nullptr; }
  /// Contact of all tips.
  [[nodiscard]] const deformable::SignedDistanceContact& contact() const noexcept { return contact_; }

  /// In contact the direction of the normal force on the tip, otherwise the normal of the nearest node. It has no influence on the force.
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override {
    return deformable::estimate_outward(data_->nodes, tip, last().nodes, [this](int k) { return Vector3<>(-contact_.normal_force(k)); });
  }

  [[nodiscard]] std::unique_ptr<DeformableObject> clone_at_rest() const override { return std::make_unique<SignedDistanceBody>(data_); }

 private:
  std::shared_ptr<const Data> data_;
  deformable::SignedDistanceContact contact_;
  std::array<std::int32_t, static_cast<std::size_t>(deformable::SignedDistanceContact::capacity)> contact_nodes_{};
};

}  // namespace palpate::object
