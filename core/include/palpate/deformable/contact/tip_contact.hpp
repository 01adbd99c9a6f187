#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/contact_model.hpp"
#include "palpate/deformable/contact/contact_result.hpp"
#include "palpate/deformable/contact/partial_slip.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Contact of a rigid tip with a body that is linear over one period (concept ContactModel): finds the nodes under the tip and the normal
/// forces that prevent penetration.
///
/// The tip may penetrate to any depth in small steps: nodes behind it stay in contact. Displacements are assumed small, i.e. nodes move
/// along their undeformed normals. The force is therefore the negative gradient of the stored energy by the tip position, and no closed
/// path of the tip gains work, on any mesh. Friction only dissipates (PartialSlip). Both neglect the coupling between normal and tangential
/// forces and displacements.
template <ContactModel Model>
class TipContact {
 public:
  static constexpr int capacity = ContactLcp::capacity;

  /// `nodes` and `model` must outlive the contact. A model without tangential compliance has no friction.
  TipContact(const SurfaceNodes& nodes, Model& model, DryFriction friction = {}) : nodes_(&nodes), model_(&model) {
    if (has_tangential(model) && friction) slip_ = PartialSlip(friction, nodes.size());
    barred_at_.assign(static_cast<std::size_t>(nodes.size()), -1);
    barred_.reserve(barred_at_.size());
    max_cross_uplift_.assign(static_cast<std::size_t>(nodes.size()), 0.0);
    for (std::int32_t i = 0; i < nodes.size(); ++i)
      for (std::int32_t j = 0; j < i; ++j)
        for (const std::int32_t k : {i, j})
          max_cross_uplift_[static_cast<std::size_t>(k)] =
              std::max(max_cross_uplift_[static_cast<std::size_t>(k)], -model.compliance(i, j));
  }

  TipContact(const SurfaceNodes&& nodes, Model& model, DryFriction friction = {}) = delete;

  /// Advance by one period with the tip at its present position.
  const ContactResult& step(const Tip& tip) noexcept {
    last_normal_ = tip.outward;
    find_candidates(tip);
    do solve_lcp();
    while (add_violated_nodes(tip));
    admit_cleared();
    update_contact_force();
    if constexpr (HasTangentialCompliance<Model>)
      if (slip_.enabled()) update_friction(tip);
    advance_model();
    if constexpr (requires { model_->inverted(); }) result_.solved = result_.solved && !model_->inverted();
    update_energy();
    return result_;
  }

  void reset() noexcept {
    row_count_ = 0;
    max_depth_ = max_rest_depth_ = 0.0;
    lcp_.reset(0, [](int) { return false; });
    result_ = {};
    slip_.reset();
    has_last_center_ = false;
    for (const Candidate& node : barred_) barred_at_[static_cast<std::size_t>(node.node)] = -1;
    barred_.clear();
    model_->reset();
  }

  /// Continue, at rest so far, the contact `before` of the same body with other supports or touched nodes; `node_before(i)` is the node i
  /// in `before`, or -1. A node that was not touched before is not touched until the tip is clear of it, so its force begins with zero and
  /// no energy is supplied. Does not allocate. Not for contacts with friction.
  template <class NodeBefore>
  void take_over(const TipContact& before, NodeBefore node_before) noexcept {
    max_depth_ = before.max_depth_;
    max_rest_depth_ = before.max_rest_depth_;
    for (std::int32_t i = 0; i < nodes_->size(); ++i) {
      const std::int32_t old = node_before(i);
      if (old >= 0 && !before.is_barred(old)) continue;
      barred_at_[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(barred_.size());
      barred_.push_back({i, 0.0});  // within the reserved capacity
    }
  }

  [[nodiscard]] const ContactResult& last() const noexcept { return result_; }

  /// Unit normal of the contact, out of the body. Free tip: normal of the nearest node, or `tip.outward` if none is near. In contact: the
  /// normal of the last step, turned only as far as needed to stay within 45 degrees of the resultant contact force. The contact set
  /// depends on this normal; if it followed every change of the force, a closed path could gain work.
  [[nodiscard]] Vector3<> outward(const Tip& tip) const noexcept {
    Vector3<> contact_normal = estimate_outward(*nodes_, tip, result_.nodes, [this](int k) {
      const auto c = static_cast<std::size_t>(k);
      return Vector3<>(forces_[c] * nodes_->normal(contact_nodes_[c]));
    });
    const double cosine = last_normal_.dot(contact_normal);
    if (result_.nodes == 0) return contact_normal;
    if (cosine >= std::sqrt(0.5)) return last_normal_;
    const Vector3<> aside = last_normal_ - cosine * contact_normal;
    return aside.norm() > 1e-9 ? Vector3<>((contact_normal + aside.normalized()).normalized()) : contact_normal;
  }

  /// Contact nodes of the last step and the forces on them along their inward normals [N]; last().nodes entries each.
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept { return contact_nodes_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }

  /// Displacement of a contact node of the last step by the partial coverage of its patch, per force of the period and by earlier forces.
  struct PartialDisplacement {
    double compliance;  ///< m/N
    double crept;       ///< at the end of the next period without force, m
  };
  [[nodiscard]] PartialDisplacement partial_displacement(int contact_node) const noexcept {
    const auto c = static_cast<std::size_t>(contact_node), a = static_cast<std::size_t>(contact_rows_[c]);
    const double uncovered = 1.0 / node_contacts_[a].coverage - 1.0;
    PartialDisplacement out{uncovered * layer_compliance_[a], 0.0};
    if constexpr (has_creep) {
      const Creep creep = model_->creep();
      out.crept = out.compliance / creep.period_ratio * (creep.decay * creep_state_[a] + creep.gain * forces_[c]);
    }
    return out;
  }

  [[nodiscard]] const DryFriction& friction() const noexcept { return slip_.friction(); }

  /// Friction force of the tip on a contact node of the last step, N.
  [[nodiscard]] Vector3<> tangential_force(std::int32_t node) const noexcept {
    return slip_.enabled() ? Vector3<>(nodes_->tangent_basis(node) * slip_.force(node)) : Vector3<>::Zero();
  }

 private:
  using NodeContact = SurfaceNodes::NodeContact;
  struct Candidate {
    std::int32_t node;
    double depth;
  };
  static constexpr int max_candidates = 1024;

  /// Select the rows of the LCP: nodes whose depth exceeds minus a quarter of the largest depth. add_violated_nodes() adds others if
  /// needed.
  void find_candidates(const Tip& tip) noexcept {
    result_ = {};
    if constexpr (has_creep) advance_creep();
    last_max_rest_depth_ = max_rest_depth_;
    double expected = 1.1 * max_depth_;  // margin over the last tick: a second query is rare
    int found = collect_candidates(tip, 0.25 * expected);
    while (max_depth_ > expected) {
      expected = 1.1 * max_depth_;
      found = collect_candidates(tip, 0.25 * expected);
    }
    candidate_clearance_ = 0.25 * max_depth_;
    found = max_depth_ > 0.0 ? filter_candidates(found, [this](const Candidate& s) { return s.depth > -candidate_clearance_; }) : 0;
    if (found > capacity) {  // keep the deepest
      std::nth_element(candidates_.begin(), candidates_.begin() + capacity, candidates_.begin() + found,
                       [](const Candidate& a, const Candidate& b) { return a.depth > b.depth; });
      candidate_clearance_ = -candidates_[capacity].depth;
      if (candidate_clearance_ < 0.0) result_.solved = false;
      found = capacity;
    }
    assemble_lcp(tip, found);
  }

  /// Set up the LCP for the first `found` candidates.
  void assemble_lcp(const Tip& tip, int found) noexcept {
    std::sort(candidates_.begin(), candidates_.begin() + found, [](const Candidate& a, const Candidate& b) { return a.node < b.node; });
    synchronize_rows(found);
    for (int a = 0; a < row_count_; ++a) {
      NodeContact& contact = node_contacts_[static_cast<std::size_t>(a)];
      contact = nodes_->contact_at(tip, row_node_[static_cast<std::size_t>(a)]);
      rest_depth_[static_cast<std::size_t>(a)] = contact.depth;
      contact.depth = candidates_[static_cast<std::size_t>(a)].depth;
      if constexpr (has_creep) contact.depth -= (1.0 / contact.coverage - 1.0) * creep_displacement(a);
      lcp_.depth(a) = contact.depth;
      const double layer = layer_compliance_[static_cast<std::size_t>(a)];
      lcp_.set_diagonal(a, (self_compliance_[static_cast<std::size_t>(a)] - layer) + layer / contact.coverage);
    }
  }

  /// Add nodes that the current forces push into the tip (edges, slender bodies). Return true if any were added. The uplift of any node is
  /// bounded by the sum over the forces of each one's largest negative cross compliance.
  bool add_violated_nodes(const Tip& tip) noexcept {
    double max_uplift = 0.0;
    for (int a = 0; a < row_count_; ++a)
      max_uplift += lcp_.force(a) * max_cross_uplift_[static_cast<std::size_t>(row_node_[static_cast<std::size_t>(a)])];
    if (!(max_uplift > candidate_clearance_)) return false;
    const int known_count = row_count_,
              found = filter_candidates(collect_candidates(tip, max_uplift), [this, known_count](const Candidate& s) {
                const auto end = row_node_.begin() + known_count, at = std::lower_bound(row_node_.begin(), end, s.node);
                if (at != end && *at == s.node) return true;
                double uplift = 0.0;
                for (int a = 0; a < known_count; ++a)
                  if (lcp_.force(a) > 0.0) uplift += lcp_.force(a) * model_->compliance(s.node, row_node_[static_cast<std::size_t>(a)]);
                return uplift < s.depth - 1e-9 * max_depth_;
              });
    if (found <= known_count) return false;
    if (found > capacity) {
      result_.solved = false;
      return false;
    }
    assemble_lcp(tip, found);
    return true;
  }

  /// Collect the nodes with depth > -`clearance` [m] and update the largest depth. Return their number.
  int collect_candidates(const Tip& tip, double clearance) noexcept {
    int found = 0;
    max_depth_ = max_rest_depth_ = 0.0;
    for (Candidate& node : barred_) node.depth = -std::numeric_limits<double>::infinity();  // clear, unless the query finds it
    nodes_->query_tip(
        tip, last_max_rest_depth_,
        [&](std::size_t group, double depth) {
          if (depth > 0.0) return false;
          if constexpr (requires { model_->group_free_displacement_at_least(group, depth); })
            return model_->group_free_displacement_at_least(group, depth + clearance);
          return false;
        },
        [&](std::int32_t node, double depth) {
          max_rest_depth_ = std::max(max_rest_depth_, depth);
          if (!barred_.empty() && is_barred(node)) {
            barred_[static_cast<std::size_t>(barred_at_[static_cast<std::size_t>(node)])].depth = depth - model_->free_displacement(node);
            return;
          }
          if constexpr (requires { model_->free_displacement_at_least(node, depth); })
            if (model_->free_displacement_at_least(node, depth + clearance)) return;
          depth -= model_->free_displacement(node);
          max_depth_ = std::max(max_depth_, depth);
          if (!(depth > -clearance)) return;
          if (found == max_candidates)
            found = filter_candidates(found, [this](const Candidate& s) { return s.depth > -0.25 * max_depth_; });
          if (found < max_candidates)
            candidates_[static_cast<std::size_t>(found++)] = {node, depth};
          else
            result_.solved = false;
        });
    return found;
  }

  [[nodiscard]] bool is_barred(std::int32_t node) const noexcept { return barred_at_[static_cast<std::size_t>(node)] >= 0; }

  /// Admit the barred nodes that the tip does not overlap under the present forces; they may be touched from the next step on.
  void admit_cleared() noexcept {
    for (std::size_t k = barred_.size(); k-- > 0;) {
      double depth = barred_[k].depth;
      for (int a = 0; a < row_count_ && depth > 0.0; ++a)
        depth -= lcp_.force(a) * model_->compliance(barred_[k].node, row_node_[static_cast<std::size_t>(a)]);
      if (depth > 0.0) continue;
      barred_at_[static_cast<std::size_t>(barred_[k].node)] = -1;
      barred_[k] = barred_.back();
      barred_at_[static_cast<std::size_t>(barred_[k].node)] = k + 1 < barred_.size() ? static_cast<std::int32_t>(k) : -1;
      barred_.pop_back();
    }
  }

  static constexpr bool has_creep = requires(const Model& model) { model.creep(); };

  /// Advance the creep of partially covered patches. The model stores the creep of whole patches by node. The additional creep of a partly
  /// covered patch is stored here by row, as long as the node is in contact.
  void advance_creep() noexcept {
    const Creep creep = model_->creep();
    for (int a = 0; a < row_count_; ++a) {
      double& q = creep_state_[static_cast<std::size_t>(a)];
      q = lcp_.force(a) > 0.0 ? creep.decay * q + creep.gain * lcp_.force(a) : 0.0;
    }
  }

  /// Creep displacement of the whole patch of row `a` by its own force, m.
  [[nodiscard]] double creep_displacement(int a) const noexcept {
    const Creep creep = model_->creep();
    return layer_compliance_[static_cast<std::size_t>(a)] / creep.period_ratio * creep.decay * creep_state_[static_cast<std::size_t>(a)];
  }

  /// Energy of a contact row per inverse coverage, J: elastic and creep part.
  [[nodiscard]] double coverage_energy(int a, double force) const noexcept {
    const double self = layer_compliance_[static_cast<std::size_t>(a)];
    double energy = 0.5 * force * force * self;
    if constexpr (has_creep) {
      const Creep creep = model_->creep();
      const double q = creep_state_[static_cast<std::size_t>(a)];
      energy += force * creep_displacement(a) - self / creep.period_ratio * creep.delayed_energy(q * q);
    }
    return energy;
  }

  /// Keep the candidates that satisfy `keep_if`. Return their number.
  template <class Keep>
  int filter_candidates(int found, Keep keep_if) noexcept {
    const auto end =
        std::remove_if(candidates_.begin(), candidates_.begin() + found, [&keep_if](const Candidate& s) { return !keep_if(s); });
    return static_cast<int>(end - candidates_.begin());
  }

  /// Synchronize the LCP rows with the first `found` candidates: remove rows of nodes no longer present, insert rows for new ones, in node
  /// order. Remaining rows keep their compliance and their part of the factor, so a tick evaluates the compliance of new nodes only.
  void synchronize_rows(int found) noexcept {
    for (int a = row_count_ - 1, s = found - 1; a >= 0; --a) {
      const auto at = static_cast<std::size_t>(a);
      while (s >= 0 && candidates_[static_cast<std::size_t>(s)].node > row_node_[at]) --s;
      if (s >= 0 && candidates_[static_cast<std::size_t>(s)].node == row_node_[at]) continue;
      lcp_.remove(a);
      std::copy(row_node_.begin() + a + 1, row_node_.begin() + row_count_, row_node_.begin() + a);
      std::copy(self_compliance_.begin() + a + 1, self_compliance_.begin() + row_count_, self_compliance_.begin() + a);
      std::copy(layer_compliance_.begin() + a + 1, layer_compliance_.begin() + row_count_, layer_compliance_.begin() + a);
      std::copy(creep_state_.begin() + a + 1, creep_state_.begin() + row_count_, creep_state_.begin() + a);
      --row_count_;
    }
    for (int a = 0; a < found; ++a) {
      const auto at = static_cast<std::size_t>(a);
      const std::int32_t node = candidates_[at].node;
      if (a < row_count_ && row_node_[at] == node) continue;
      lcp_.insert(a);
      std::copy_backward(row_node_.begin() + a, row_node_.begin() + row_count_, row_node_.begin() + row_count_ + 1);
      std::copy_backward(self_compliance_.begin() + a, self_compliance_.begin() + row_count_, self_compliance_.begin() + row_count_ + 1);
      std::copy_backward(layer_compliance_.begin() + a, layer_compliance_.begin() + row_count_, layer_compliance_.begin() + row_count_ + 1);
      std::copy_backward(creep_state_.begin() + a, creep_state_.begin() + row_count_, creep_state_.begin() + row_count_ + 1);
      ++row_count_;
      row_node_[at] = node;
      creep_state_[at] = 0.0;
      self_compliance_[at] = lcp_.compliance(a, a) = model_->compliance(node, node);
      layer_compliance_[at] = layer_compliance(*model_, node, self_compliance_[at]);
      for (int b = 0; b < row_count_; ++b)
        if (b != a) lcp_.compliance(a, b) = lcp_.compliance(b, a) = model_->compliance(node, row_node_[static_cast<std::size_t>(b)]);
    }
  }

  void solve_lcp() noexcept {
    // Warm start with the basis of the last step. Without one, start with the nodes that Hertz contact presses: deeper than half.
    if (!lcp_.any_active())
      for (int a = 0; a < row_count_; ++a)
        if (node_contacts_[static_cast<std::size_t>(a)].depth > 0.5 * max_depth_) lcp_.suggest_active(a);
    result_.solved = lcp_.solve() && result_.solved;
  }

  void update_contact_force() noexcept {
    double total = 0.0;
    for (int a = 0; a < row_count_; ++a) {
      const double f = lcp_.force(a);
      if (f <= 0.0) continue;
      const NodeContact& contact = node_contacts_[static_cast<std::size_t>(a)];
      contact_nodes_[static_cast<std::size_t>(result_.nodes)] = contact.node;
      contact_rows_[static_cast<std::size_t>(result_.nodes)] = a;
      forces_[static_cast<std::size_t>(result_.nodes++)] = f;
      // Negative gradient of the stored energy, max over f of f.(g - C f/2), by the tip center.
      result_.force -= f * contact.depth_gradient;
      if (contact.coverage < 1.0)
        result_.force -= (coverage_energy(a, f) / (contact.coverage * contact.coverage)) * contact.coverage_gradient;
      result_.deflection -= (f * rest_depth_[static_cast<std::size_t>(a)]) * nodes_->normal(contact.node);
      total += f;
    }
    result_.touching = result_.nodes > 0;
    if (result_.touching) result_.deflection /= total;
  }

  /// Apply friction for the tip motion since the last step.
  void update_friction(const Tip& tip) noexcept {
    const Vector3<> tip_motion = has_last_center_ ? Vector3<>(tip.center - last_center_) : Vector3<>::Zero();
    last_center_ = tip.center;
    has_last_center_ = last_center_.allFinite();
    for (int c = 0; c < result_.nodes; ++c) coverages_[static_cast<std::size_t>(c)] = contact_of(c).coverage;
    slip_.step(*nodes_, *model_, contact_nodes_.data(), forces_.data(), coverages_.data(), result_.nodes, tip_motion);
    double total = 0.0;
    Vector3<> weighted = Vector3<>::Zero();
    for (int c = 0; c < result_.nodes; ++c) {
      const std::int32_t node = contact_of(c).node;
      const Eigen::Vector2d force = slip_.force(node), displacement = slip_.displacement(node);
      weighted += forces_[static_cast<std::size_t>(c)] * (nodes_->tangent_basis(node) * displacement);
      total += forces_[static_cast<std::size_t>(c)];
      result_.friction -= nodes_->tangent_basis(node) * force;
      if (contact_of(c).coverage < 1.0) result_.friction -= slip_.coverage_derivative(node) * contact_of(c).coverage_gradient;
      tangential_[static_cast<std::size_t>(c)] = force;
    }
    if (total > 0.0) result_.deflection += weighted / total;
    result_.force += result_.friction;
    result_.sliding = slip_.sliding();
  }

  void advance_model() noexcept {
    if constexpr (requires { model_->advance(contact_nodes_.data(), forces_.data(), tangential_.data(), 0); })
      if (slip_.enabled()) return model_->advance(contact_nodes_.data(), forces_.data(), tangential_.data(), result_.nodes);
    model_->advance(contact_nodes_.data(), forces_.data(), result_.nodes);
  }

  /// Update the energy at the end of the period, including the extra compliance of partially covered patches.
  void update_energy() noexcept {
    double compliance_work = 0.0, partial_coverage_energy = 0.0;
    for (int c = 0; c < result_.nodes; ++c) {
      const auto a = static_cast<std::size_t>(contact_rows_[static_cast<std::size_t>(c)]);
      const double f = forces_[static_cast<std::size_t>(c)],
                   extra_compliance = (1.0 / node_contacts_[a].coverage - 1.0) * layer_compliance_[a];
      compliance_work += f * (node_contacts_[a].depth - extra_compliance * f);
      Creep creep;
      if constexpr (has_creep) creep = model_->creep();
      const double next = creep.decay * creep_state_[a] + creep.gain * f;
      partial_coverage_energy += extra_compliance * creep.energy(f * f, next * next) / creep.period_ratio;
    }
    if (slip_.enabled()) {
      compliance_work += slip_.compliance_work();
      partial_coverage_energy += slip_.partial_coverage_energy();
    }
    if constexpr (requires { model_->energy(compliance_work); })
      result_.energy = model_->energy(compliance_work) + partial_coverage_energy;
    else if constexpr (requires { model_->energy(); })
      result_.energy = model_->energy() + partial_coverage_energy;
    else
      result_.energy = 0.5 * compliance_work + partial_coverage_energy;
  }

  [[nodiscard]] const NodeContact& contact_of(int contact_nodes) const noexcept {
    return node_contacts_[static_cast<std::size_t>(contact_rows_[static_cast<std::size_t>(contact_nodes)])];
  }

  const SurfaceNodes* nodes_;
  Model* model_;
  ContactLcp lcp_;
  ContactResult result_;
  int row_count_ = 0;                     // rows of the LCP
  double max_depth_ = 0.0;                // m
  double max_rest_depth_ = 0.0;           // largest depth against the undeformed surface in the last step, m
  double last_max_rest_depth_ = 0.0;      // same, of the step before
  double candidate_clearance_ = 0.0;      // nodes farther above the tip surface are not LCP rows at first, m
  std::vector<double> max_cross_uplift_;  // by node: largest uplift of another node per unit force on it, m/N
  std::array<Candidate, max_candidates> candidates_{};
  std::vector<Candidate> barred_;        // nodes that are not touched until the tip is clear of them
  std::vector<std::int32_t> barred_at_;  // by node: index in `barred_`, or -1
  std::array<NodeContact, capacity> node_contacts_{};
  std::array<std::int32_t, capacity> row_node_{};    // by row
  std::array<double, capacity> self_compliance_{};   // by row, m/N
  std::array<double, capacity> layer_compliance_{};  // by row, m/N
  std::array<double, capacity> creep_state_{};       // by row, N
  std::array<double, capacity> rest_depth_{};        // depth against the undeformed surface, by row, m
  std::array<std::int32_t, capacity> contact_nodes_{};
  std::array<double, capacity> forces_{};
  std::array<int, capacity> contact_rows_{};    // row of each contact node
  Vector3<> last_normal_ = Vector3<>::UnitZ();  // tip.outward of the last step
  PartialSlip slip_;
  bool has_last_center_ = false;                        // false before the first step
  Vector3<> last_center_ = Vector3<>::Zero();           // tip center of the last step, m
  std::array<double, capacity> coverages_{};            // by contact node
  std::array<Eigen::Vector2d, capacity> tangential_{};  // by contact node, N
};

}  // namespace palpate::deformable
