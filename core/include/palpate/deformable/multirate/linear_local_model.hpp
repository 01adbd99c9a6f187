#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_contact.hpp"
#include "palpate/deformable/linear/compliance.hpp"
#include "palpate/deformable/multirate/multi_tip_result.hpp"

namespace palpate::deformable {

/// Local model of a linear body: under forces f along the inward normals that are constant until the time of its use, the nodes are then
/// at `free_displacement` + C f. C is the compliance over that time, the same for all local models of a body (LinearLocalContact). The
/// free displacements contain the residual motion from the state; without the forces of the state they are those of `nodes` alone.
///
/// Of a nonlinear body C is the compliance at rest. About the forces f0 of the state the nodes are at
/// `free_displacement` + C f0 + `compliance_ratio` C (f - f0).
struct LinearLocalModel {
  std::vector<double> free_displacement;     ///< of each node along its inward normal, without force, m
  std::vector<double> elastic_displacement;  ///< compliance times force at the state, C f0, m
  double compliance_ratio = 1.0;             ///< of the tangent compliance at the state to C
  double lowest_free = 0.0;                  ///< lower bounds of both, m
  double lowest_elastic = 0.0;
  bool inverted = false;    ///< whether the body has inverted tetrahedra at the state
  bool has_memory = false;  ///< whether the body may swing or recover when the tip has left
  double returnable = 0.0;  ///< energy that the body with memory may still return, J
  long version = 0;         ///< increasing

  [[nodiscard]] bool empty() const noexcept { return free_displacement.empty(); }
};

/// Contact of a rigid tip with the local models of a linear body: TipContact, whose force is the gradient of the potential
///   V = max over f >= 0 of f.(depth - free displacement) - f.C f / 2.
/// Nothing of the surface is omitted, so a fast tip does not leave the model. A compliance s C about the state gives the forces f / s of
/// the free displacements w + (1 - s) C f_state, and V / s.
class LinearLocalContact {
 public:
  using Model = LinearLocalModel;

  /// Data of the body, the same for all its models.
  struct Body {
    const SurfaceNodes* nodes = nullptr;  ///< must outlive the contact
    Compliance compliance;                ///< along the inward normals over the time to the use of a model, m/N
    std::vector<double> layer;            ///< of each node: compliance that a partial coverage of its patch divides, m/N
  };

  explicit LinearLocalContact(const Body& body) : state_(std::make_unique<State>(body)) {}

  /// Solve for the contact forces of the first tip. The compliance is scaled by `compliance_scale` about the model's state.
  const MultiTipResult& solve(const LinearLocalModel& model, const TipPair& tips, double compliance_scale) noexcept {
    if (model.empty() || tips.count == 0) return result_ = {};
    if (model.version == version_ && compliance_scale == scale_ && is_last(tips.tip[0])) return result_;
    version_ = model.version;
    scale_ = compliance_scale;
    tip_ = tips.tip[0];
    const double scale = compliance_scale * model.compliance_ratio;
    state_->held.model = &model;
    state_->held.remainder = 1.0 - scale;
    ContactResult& tip = result_.tip[0];
    tip = state_->contact.step(tip_);
    const double factor = 1.0 / scale;
    tip.force *= factor;
    tip.energy *= factor;
    result_.energy = tip.energy;
    result_.nodes = tip.nodes;
    result_.solved = tip.solved && !model.inverted;
    for (std::size_t k = 0; k < static_cast<std::size_t>(tip.nodes); ++k) forces_[k] = factor * state_->contact.forces()[k];
    return result_;
  }

  /// Each contact continues from its own last forces.
  void start_from(const LinearLocalModel& /*model*/, const LinearLocalContact& /*other*/) noexcept {}

  [[nodiscard]] const MultiTipResult& last() const noexcept { return result_; }
  /// Contact nodes (ascending), the forces on them along their inward normals [N], and the force vectors; last().nodes entries each.
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept { return state_->contact.contact_nodes(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept {
    return -forces_[static_cast<std::size_t>(k)] * state_->body.nodes->normal(contact_nodes()[k]);
  }
  /// There is no layer between tip and nodes.
  [[nodiscard]] static double layer_stiffness(int /*k*/) noexcept { return std::numeric_limits<double>::infinity(); }
  /// See TipContact::outward.
  [[nodiscard]] Vector3<> outward(const Tip& tip) const noexcept { return state_->contact.outward(tip); }

 private:
  /// The body until the next model, as required by TipContact.
  struct Held {
    const Body* body;
    const LinearLocalModel* model = nullptr;
    double remainder = 0.0;  // 1 - s, with the scale s of the compliance

    [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept { return body->compliance.compliance(i, j); }
    [[nodiscard]] double layer_compliance(std::int32_t i) const noexcept { return body->layer[static_cast<std::size_t>(i)]; }
    [[nodiscard]] double free_displacement(std::int32_t i) const noexcept {
      const auto k = static_cast<std::size_t>(i);
      return model->free_displacement[k] + remainder * model->elastic_displacement[k];
    }
    [[nodiscard]] bool group_free_displacement_at_least(std::size_t /*group*/, double value) const noexcept {
      return model->lowest_free + remainder * model->lowest_elastic >= value;
    }
    void advance(const std::int32_t*, const double*, int) noexcept {}
    void reset() noexcept {}
  };
  struct State {
    explicit State(const Body& of) : body(of), held{&body}, contact(*body.nodes, held) {}
    Body body;
    Held held;
    TipContact<Held> contact;
  };

  [[nodiscard]] bool is_last(const Tip& tip) const noexcept {
    return tip.kind == tip_.kind && tip.radius == tip_.radius && tip.outward == tip_.outward && tip.center == tip_.center;
  }

  std::unique_ptr<State> state_;
  MultiTipResult result_;
  Tip tip_;  // of the last step
  long version_ = -1;
  double scale_ = 1.0;
  std::array<double, static_cast<std::size_t>(TipContact<Held>::capacity)> forces_{};  // N
};

}  // namespace palpate::deformable
