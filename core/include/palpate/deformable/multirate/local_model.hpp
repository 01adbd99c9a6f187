#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/contact_result.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Rigid tips that indent one body at the same time.
struct TipPair {
  static constexpr int max_tips = 2;
  int count = 0;
  std::array<Tip, max_tips> tip{};
};

/// Linearization of a body about one of its states, at the nodes near the tips (local model, Barbagli, Prattichizzo & Salisbury 2005).
struct LocalModel {
  static constexpr int capacity = ContactLcp::capacity;
  static constexpr int max_inner = 64;  ///< nodes with computed compliance; that of the others is extrapolated (ComplianceExtrapolation)

  SurfaceNodes nodes;                                    ///< deformed positions and outward normals (negative displacement directions)
  std::array<std::int32_t, capacity> node_ids{};         ///< surface node of each, ascending
  std::array<bool, capacity> inner{};                    ///< whether the compliance was computed
  std::array<double, capacity> force{};                  ///< of the state, along the inward normals, N
  std::array<double, capacity> residual_displacement{};  ///< still to go to equilibrium under these forces, along the inward normals, m
  std::array<double, capacity> elastic_displacement{};   ///< compliance times force, m
  std::array<Vector3<>, capacity> displacement{};        ///< of the state, m
  std::vector<double> compliance_matrix;                 ///< capacity x capacity, along the inward normals, m/N
  long version = 0;                                      ///< of the state, increasing

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return compliance_matrix[static_cast<std::size_t>(i) * capacity + static_cast<std::size_t>(j)];
  }
};

/// Result of a contact step with several tips.
struct MultiTipResult {
  std::array<ContactResult, TipPair::max_tips> tip{};
  double energy = 0.0;  ///< released when all tips leave, J
  int nodes = 0;        ///< number of contact nodes
  bool solved = true;
};

/// Frictionless unilateral contact of rigid tips with a local model; the tips interact through the body. As in TipContact, the forces are
/// the negative gradients of a potential by the tip positions.
class LocalModelContact {
 public:
  /// Solve for the contact forces. The compliance is scaled by `compliance_scale` about the model's state. `last_nodes` are the contact
  /// nodes of the last step (surface ids, ascending): the initial basis.
  const MultiTipResult& solve(const LocalModel& model, const TipPair& tips, double compliance_scale, const std::int32_t* last_nodes,
                              int count) noexcept {
    if (model.version != version_) forced_.fill(false);
    find_candidates(model, tips, compliance_scale);
    do {
      assemble_lcp(model, tips);
      if (model.version != version_ || compliance_scale != compliance_scale_ || !unchanged_)
        restart(model, compliance_scale, last_nodes, count);
      result_.solved = lcp_.solve();
    } while (add_violated_nodes(model));
    update_result(model, tips.count);
    return result_;
  }

  [[nodiscard]] const MultiTipResult& last() const noexcept { return result_; }
  /// Contact nodes (surface ids, ascending) and the forces on them along their inward normals [N]; last().nodes entries each.
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept { return contact_nodes_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }
  [[nodiscard]] const int* contact_tips() const noexcept { return contact_tips_.data(); }  ///< tip of each contact node

 private:
  struct ContactRow {
    SurfaceNodes::NodeContact contact;
    int tip = 0;
  };

  /// Find the nodes in or near a tip. A node under two tips belongs to the one with the larger depth.
  void find_candidates(const LocalModel& model, const TipPair& tips, double compliance_scale) noexcept {
    const auto size = static_cast<std::size_t>(model.nodes.size());
    std::fill(tip_of_.begin(), tip_of_.begin() + static_cast<std::ptrdiff_t>(size), -1);
    double max_depth = 0.0;
    for (int t = 0; t < tips.count; ++t)
      model.nodes.query_tip_all(
          tips.tip[static_cast<std::size_t>(t)],
          [&](std::int32_t node) {
            return compliance_scale * model.elastic_displacement[static_cast<std::size_t>(node)] -
                   model.residual_displacement[static_cast<std::size_t>(node)];
          },
          [&](std::int32_t node, double depth) {
            const auto i = static_cast<std::size_t>(node);
            max_depth = std::max(max_depth, depth);
            if (tip_of_[i] >= 0 && !(depth > depth_[i])) return;
            tip_of_[i] = t;
            depth_[i] = depth;
          });
    max_depth_ = max_depth;
  }

  /// Assemble the LCP rows: nodes with a depth above minus a quarter of the largest, and those forced in by add_violated_nodes().
  void assemble_lcp(const LocalModel& model, const TipPair& tips) noexcept {
    next_count_ = 0;
    unchanged_ = true;
    for (std::size_t i = 0; i < static_cast<std::size_t>(model.nodes.size()); ++i) {
      forced_[i] = forced_[i] && tip_of_[i] >= 0;
      if (tip_of_[i] < 0 || !(max_depth_ > 0.0) || !(depth_[i] > -0.25 * max_depth_ || forced_[i])) continue;
      const auto a = static_cast<std::size_t>(next_count_);
      ContactRow& row = rows_[a];
      const std::int32_t last_node = row.contact.node;
      const double last_coverage = row.contact.coverage;
      row = {model.nodes.contact_at_without_fade(tips.tip[static_cast<std::size_t>(tip_of_[i])], static_cast<std::int32_t>(i)), tip_of_[i]};
      row.contact.depth = depth_[i];
      unchanged_ = unchanged_ && row.contact.node == last_node && row.contact.coverage == last_coverage;
      lcp_.depth(next_count_++) = depth_[i];
    }
    unchanged_ = unchanged_ && next_count_ == row_count_;
  }

  /// Add nodes that the current forces push into a tip (contact from opposite sides). Return true if any were added. The displacement of a
  /// node is at most sqrt(self-compliance x f.C f) by the Cauchy-Schwarz inequality.
  bool add_violated_nodes(const LocalModel& model) noexcept {
    double max_square = 0.0;
    for (int a = 0; a < row_count_; ++a) max_square += compliance_scale_ * lcp_.force(a) * lcp_.depth(a);
    bool any = false;
    for (std::int32_t i = 0; i < model.nodes.size() && max_square > 0.0; ++i) {
      const auto n = static_cast<std::size_t>(i);
      if (tip_of_[n] < 0 || depth_[n] > -0.25 * max_depth_ || forced_[n]) continue;
      if (depth_[n] * depth_[n] >= model.compliance(i, i) * max_square) continue;
      double displacement = 0.0;
      for (int a = 0; a < row_count_; ++a)
        displacement += lcp_.force(a) * model.compliance(i, rows_[static_cast<std::size_t>(a)].contact.node);
      if (compliance_scale_ * displacement < depth_[n]) any = forced_[n] = true;
    }
    return any;
  }

  void restart(const LocalModel& model, double compliance_scale, const std::int32_t* last_nodes, int count) noexcept {
    version_ = model.version;
    compliance_scale_ = compliance_scale;
    row_count_ = next_count_;
    for (int a = 0; a < row_count_; ++a) {
      const SurfaceNodes::NodeContact& contact = rows_[static_cast<std::size_t>(a)].contact;
      for (int b = 0; b < a; ++b)
        lcp_.compliance(a, b) = lcp_.compliance(b, a) =
            compliance_scale * model.compliance(contact.node, rows_[static_cast<std::size_t>(b)].contact.node);
      self_compliance_[static_cast<std::size_t>(a)] = compliance_scale * model.compliance(contact.node, contact.node);
      lcp_.compliance(a, a) = self_compliance_[static_cast<std::size_t>(a)] / contact.coverage;
    }
    lcp_.reset(row_count_, [&](int a) {
      const SurfaceNodes::NodeContact& contact = rows_[static_cast<std::size_t>(a)].contact;
      if (count == 0) return contact.depth > 0.5 * max_depth_;
      return std::binary_search(last_nodes, last_nodes + count, model.node_ids[static_cast<std::size_t>(contact.node)]);
    });
  }

  void update_result(const LocalModel& model, int tips) noexcept {
    const bool solved = result_.solved;
    result_ = {};
    result_.solved = solved;
    std::array<double, TipPair::max_tips> total{};
    for (int a = 0; a < row_count_; ++a) {
      const double f = lcp_.force(a);
      if (f <= 0.0) continue;
      const ContactRow& row = rows_[static_cast<std::size_t>(a)];
      const SurfaceNodes::NodeContact& contact = row.contact;
      const auto node = static_cast<std::size_t>(contact.node);
      contact_nodes_[static_cast<std::size_t>(result_.nodes)] = model.node_ids[node];
      contact_tips_[static_cast<std::size_t>(result_.nodes)] = row.tip;
      forces_[static_cast<std::size_t>(result_.nodes++)] = f;
      ContactResult& tip = result_.tip[static_cast<std::size_t>(row.tip)];
      tip.force -= f * contact.depth_gradient;
      if (contact.coverage < 1.0)
        tip.force -= (0.5 * f * f * self_compliance_[static_cast<std::size_t>(a)] / (contact.coverage * contact.coverage)) *
                     contact.coverage_gradient;
      tip.energy += 0.5 * f * contact.depth;
      // Relative to the state: to the position without forces, then inward by the depth.
      const double depth = contact.depth + model.residual_displacement[node] - compliance_scale_ * model.elastic_displacement[node];
      tip.deflection += f * (model.displacement[node] - depth * model.nodes.normal(contact.node));
      tip.touching = true;
      ++tip.nodes;
      total[static_cast<std::size_t>(row.tip)] += f;
    }
    for (std::size_t t = 0; t < static_cast<std::size_t>(tips); ++t) {
      result_.energy += result_.tip[t].energy;
      result_.tip[t].solved = solved;
      if (result_.tip[t].touching) result_.tip[t].deflection /= total[t];
    }
  }

  static constexpr std::size_t capacity = LocalModel::capacity;

  ContactLcp lcp_;
  MultiTipResult result_;
  long version_ = -1;
  double compliance_scale_ = 1.0;
  double max_depth_ = 0.0;
  int row_count_ = 0, next_count_ = 0;  // LCP rows of the last and of this step
  bool unchanged_ = false;
  std::array<int, capacity> tip_of_{};              // by node; -1: none
  std::array<double, capacity> depth_{};            // by node, m
  std::array<bool, capacity> forced_{};             // by node: row forced by add_violated_nodes()
  std::array<ContactRow, capacity> rows_{};         // LCP rows
  std::array<double, capacity> self_compliance_{};  // by row, m/N
  std::array<std::int32_t, capacity> contact_nodes_{};
  std::array<double, capacity> forces_{};
  std::array<int, capacity> contact_tips_{};
};

}  // namespace palpate::deformable
