#pragma once

#include <algorithm>
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
  double period = 1e-3;                   ///< of a tick, s; of a body with memory
  deformable::ModalData modes;            ///< none: without inertia
  double instantaneous_ratio = 1.0;       ///< of the instantaneous to the long-term modulus; 1: elastic
  double retardation_time = 1.0;          ///< s
  int tips = 1;                           ///< at most SignedDistanceContact::max_tips
  std::vector<Vector3<>> contact_points;  ///< of a rigid tool: centers of its equal tips less the tip's center, m; none: one tip
  double flare = 0.0;                     ///< of a flat end, see TipGeometry, m; 0: the mean node spacing
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
    double flare = 0.0;  ///< of a flat end, m
    int tips = 1;
    bool bends = false;                     ///< see SignedDistanceContact
    std::vector<Vector3<>> contact_points;  ///< of a rigid tool, see SignedDistanceOptions

    /// `full` is 3n x 3n [m/N], row 3 x node + axis; the surface's nodes are those of `at`.
    Data(deformable::SurfaceNodes at, const float* full, const deformable::ContactSurface& surface,
         const SignedDistanceOptions& options = {})
        : nodes(std::move(at)),
          patches(surface, deformable::creep_law(options.instantaneous_ratio, options.retardation_time, options.period)),
          sideways(options.sideways),
          friction(options.friction),
          flare(options.flare > 0.0 ? options.flare : deformable::PatchPoints::mean_spacing(surface)),
          tips(options.contact_points.empty() ? options.tips : static_cast<int>(options.contact_points.size())),
          contact_points(options.contact_points) {
      bends = yields_at_some_node(full);
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

   private:
    /// See `bends`. Of the compliance across the normal `sideways` squared counts (FullCompliance). The layer's stiffness is the long-term
    /// one, as the compliance.
    [[nodiscard]] bool yields_at_some_node(const float* full) const {
      const std::size_t row = 3 * static_cast<std::size_t>(nodes.size());
      for (std::int32_t i = 0; i < nodes.size(); ++i) {
        const std::size_t first = 3 * static_cast<std::size_t>(i);
        Matrix3<> own;
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            own(static_cast<int>(a), static_cast<int>(b)) = static_cast<double>(full[(first + a) * row + first + b]);
        const double along = nodes.normal(i).dot(own * nodes.normal(i));
        const double layer = patches.creep.period_ratio * patches.round.stiffness(i);
        if (deformable::NearNodes::is_flexible(along + sideways * sideways * (own.trace() - along), layer)) return true;
      }
      return false;
    }
  };

  explicit SignedDistanceBody(std::shared_ptr<const Data> data)
      : data_(std::move(data)),
        points_(data_->contact_points),
        contact_(data_->nodes, data_->compliance, data_->patches, data_->friction, data_->motion ? data_->motion->clone_at_rest() : nullptr,
                 data_->tips, data_->bends) {}

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override { return step(shape_of(tip), tip.center); }

  /// Advance by one period with a tip of any shape, centered at `center` [m].
  virtual const deformable::ContactResult& step(const deformable::TipGeometry& tip, const Vector3<>& center) noexcept {
    if (points_.empty()) {
      contact_.step(tip, center);
    } else {
      for (std::size_t t = 0; t < points_.size(); ++t) tool_[t] = {tip, center + points_[t]};
      contact_.step(tool_.data());
      sum_of_tool_ = sum_tool();
    }
    for (int k = 0; k < contact_.contact_count(); ++k) contact_nodes_[static_cast<std::size_t>(k)] = contact_.contact_node(k);
    return last();
  }

  /// Advance by one period with all tips; see contact().last().
  virtual void step(const deformable::SignedDistanceContact::PlacedTip* tips) noexcept { contact_.step(tips); }

  /// Shape of a tip of the kinds that all bodies know.
  [[nodiscard]] deformable::TipGeometry shape_of(const deformable::Tip& tip) const noexcept {
    const bool flat = tip.kind == deformable::Tip::Kind::flat;
    return flat ? deformable::TipGeometry::cylinder(tip.radius, data_->flare, tip.outward) : deformable::TipGeometry::sphere(tip.radius);
  }

  [[nodiscard]] int tool_tips() const noexcept override { return static_cast<int>(points_.size()); }
  void place_tool(const Vector3<>* centers) noexcept override { std::copy_n(centers, points_.size(), points_.begin()); }
  [[nodiscard]] Vector3<> tool_force(int tip) const noexcept override { return contact_.last(tip).force; }

  void reset() noexcept {
    contact_.reset();
    points_ = data_->contact_points;
    sum_of_tool_ = {};
  }

  /// Result of the last step: of the tip, or of the whole tool.
  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return points_.empty() ? contact_.last() : sum_of_tool_; }
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

 protected:
  /// Place the tips of the tool where those of another body are.
  void take_tool(const SignedDistanceBody& other) noexcept { place_tool(other.points_.data()); }
  [[nodiscard]] deformable::SignedDistanceContact& contact_of_tips() noexcept { return contact_; }

 private:
  static constexpr double same_side = 0.7;  // least |sum of normal forces| over the sum of their norms: within about 45 degrees

  /// Sum the tips of a tool: one rigid body moves them all, so forces and moments add up.
  [[nodiscard]] deformable::ContactResult sum_tool() const noexcept {
    deformable::ContactResult sum;
    sum.energy = contact_.last().energy;
    sum.solved = contact_.last().solved;
    Vector3<> pressed = Vector3<>::Zero();
    double total = 0.0;
    bool sticks = false;
    for (std::size_t t = 0; t < points_.size(); ++t) {
      const deformable::ContactResult& one = contact_.last(static_cast<int>(t));
      const Vector3<> normal = one.force - one.friction;
      const double size = normal.norm();
      sum.force += one.force;
      sum.friction += one.friction;
      sum.moment += one.moment + points_[t].cross(one.force);
      sum.deflection += size * one.deflection;
      sum.nodes += one.nodes;
      sum.touching = sum.touching || one.touching;
      sum.lost = sum.lost || one.lost;
      sum.sliding = sum.sliding || one.sliding;
      sticks = sticks || (one.touching && !one.sliding);
      pressed += normal;
      total += size;
    }
    sum.deflection = total > 0.0 ? Vector3<>(sum.deflection / total) : Vector3<>::Zero();
    sum.sliding = sum.sliding && !sticks;
    sum.opposed = pressed.norm() < same_side * total;
    return sum;
  }

  std::shared_ptr<const Data> data_;
  std::vector<Vector3<>> points_;  // of a tool, as it is now
  deformable::SignedDistanceContact contact_;
  std::array<deformable::SignedDistanceContact::PlacedTip, static_cast<std::size_t>(deformable::SignedDistanceContact::max_tips)> tool_{};
  deformable::ContactResult sum_of_tool_;
  std::array<std::int32_t, static_cast<std::size_t>(deformable::SignedDistanceContact::capacity)> contact_nodes_{};
};

}  // namespace palpate::object
