#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_contact.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// The rigid tips that press one body at a time.
struct TipPair {
  static constexpr int most = 2;
  int count = 0;
  std::array<Tip, most> tip{};
};

/// A body that is linear about one of its states: the nodes near the tips, where they are, and how they give way (Barbagli, Prattichizzo
/// & Salisbury 2005). Its memory is taken by the first fill().
struct LocalModel {
  static constexpr int capacity = ContactLcp::capacity;
  static constexpr int most_inner = 64;  ///< nodes whose compliance is solved for; that of the others is estimated (Beyond)

  SurfaceNodes nodes;                         ///< deformed places of the nodes near the tips, and the ways that they are pressed, outward
  std::array<std::int32_t, capacity> name{};  ///< of each on the body's surface, rising
  std::array<bool, capacity> inner{};
  std::array<double, capacity> force{};            ///< along the inward normals, of the state, N
  std::array<double, capacity> ahead{};            ///< from its place to where it rests under these forces, along its inward normal, m
  std::array<double, capacity> given{};            ///< what these forces give there, m
  std::array<Vector3<>, capacity> displacement{};  ///< of the state, m
  std::vector<double> compliance;                  ///< capacity x capacity, along the inward normals, m/N
  long number = 0;                                 ///< of the state, rising

  [[nodiscard]] double between(std::int32_t i, std::int32_t j) const noexcept {
    return compliance[static_cast<std::size_t>(i) * capacity + static_cast<std::size_t>(j)];
  }
};

/// What a body answers to several tips.
struct MultiTipResult {
  std::array<ContactResult, TipPair::most> tip{};
  double energy = 0.0;  ///< that the contact gives out when the tips leave, J
  int nodes = 0;        ///< pressed
  bool solved = true;
};

/// Rigid tips on a snapshot: one-sided, without friction, the tips feeling each other through the body. As in BodyContact the forces are
/// the slopes of a potential by the tips' places.
class LocalModelContact {
 public:
  /// `share` of the compliance is taken about the snapshot's state. `before` are names of nodes that were pressed in the last step,
  /// rising, to try first.
  const MultiTipResult& solve(const LocalModel& body, const TipPair& tips, double share, const std::int32_t* before, int count) noexcept {
    if (body.number != number_) needed_.fill(false);
    find(body, tips, share);
    do {
      place(body, tips);
      if (body.number != number_ || share != share_ || !same_) start(body, share, before, count);
      answer_.solved = solver_.solve();
    } while (left_out(body));
    answer(body, tips.count);
    return answer_;
  }

  [[nodiscard]] const MultiTipResult& last() const noexcept { return answer_; }
  /// Names of the nodes that were pressed, rising, last().nodes of them, and the forces on them along their inward normals [N].
  [[nodiscard]] const std::int32_t* pressed() const noexcept { return pressed_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }
  [[nodiscard]] const int* tips() const noexcept { return pressing_.data(); }  ///< that press them

 private:
  struct TipState {
    SurfaceNodes::Near near;
    int tip = 0;
  };

  /// Nodes that a tip is in, or nearly; a node under two tips is pressed by the one that is deeper in.
  void find(const LocalModel& body, const TipPair& tips, double share) noexcept {
    const auto size = static_cast<std::size_t>(body.nodes.size());
    std::fill(tip_of_.begin(), tip_of_.begin() + static_cast<std::ptrdiff_t>(size), -1);
    double deepest = 0.0;
    for (int t = 0; t < tips.count; ++t)
      body.nodes.under_all(
          tips.tip[static_cast<std::size_t>(t)],
          [&](std::int32_t node) {
            return share * body.given[static_cast<std::size_t>(node)] - body.ahead[static_cast<std::size_t>(node)];
          },
          [&](std::int32_t node, double depth) {
            const auto i = static_cast<std::size_t>(node);
            deepest = std::max(deepest, depth);
            if (tip_of_[i] >= 0 && !(depth > depth_[i])) return;
            tip_of_[i] = t;
            depth_[i] = depth;
          });
    deepest_ = deepest;
  }

  /// Those of them that go into the solver: which are as deep in as nodes are that are pressed as a rule, and which were needed besides.
  void place(const LocalModel& body, const TipPair& tips) noexcept {
    next_ = 0;
    same_ = true;
    for (std::size_t i = 0; i < static_cast<std::size_t>(body.nodes.size()); ++i) {
      needed_[i] = needed_[i] && tip_of_[i] >= 0;
      if (tip_of_[i] < 0 || !(deepest_ > 0.0) || !(depth_[i] > -0.25 * deepest_ || needed_[i])) continue;
      const auto a = static_cast<std::size_t>(next_);
      TipState& place = place_[a];
      const std::int32_t node_before = place.near.node;
      const double cover_before = place.near.cover;
      place = {body.nodes.at(tips.tip[static_cast<std::size_t>(tip_of_[i])], static_cast<std::int32_t>(i)), tip_of_[i]};
      place.near.depth = depth_[i];
      same_ = same_ && place.near.node == node_before && place.near.cover == cover_before;
      solver_.depth(next_++) = depth_[i];
    }
    same_ = same_ && next_ == count_;
  }

  /// Whether the forces push a node into a tip that is not in the solver, as they may where the tip presses nodes from opposite sides. It
  /// is in from now on. No node moves farther than the root of what it gives way by itself times f.C f (Cauchy and Schwarz).
  bool left_out(const LocalModel& body) noexcept {
    double most = 0.0;
    for (int a = 0; a < count_; ++a) most += share_ * solver_.force(a) * solver_.depth(a);
    bool any = false;
    for (std::int32_t i = 0; i < body.nodes.size() && most > 0.0; ++i) {
      const auto n = static_cast<std::size_t>(i);
      if (tip_of_[n] < 0 || depth_[n] > -0.25 * deepest_ || needed_[n]) continue;
      if (depth_[n] * depth_[n] >= body.between(i, i) * most) continue;
      double moved = 0.0;
      for (int a = 0; a < count_; ++a) moved += solver_.force(a) * body.between(i, place_[static_cast<std::size_t>(a)].near.node);
      if (share_ * moved < depth_[n]) any = needed_[n] = true;
    }
    return any;
  }

  void start(const LocalModel& body, double share, const std::int32_t* before, int count) noexcept {
    number_ = body.number;
    share_ = share;
    count_ = next_;
    for (int a = 0; a < count_; ++a) {
      const SurfaceNodes::Near& near = place_[static_cast<std::size_t>(a)].near;
      for (int b = 0; b < a; ++b)
        solver_.compliance(a, b) = solver_.compliance(b, a) =
            share * body.between(near.node, place_[static_cast<std::size_t>(b)].near.node);
      own_[static_cast<std::size_t>(a)] = share * body.between(near.node, near.node);
      solver_.compliance(a, a) = own_[static_cast<std::size_t>(a)] / near.cover;
    }
    solver_.start(count_, [&](int a) {
      const SurfaceNodes::Near& near = place_[static_cast<std::size_t>(a)].near;
      if (count == 0) return near.depth > 0.5 * deepest_;
      return std::binary_search(before, before + count, body.name[static_cast<std::size_t>(near.node)]);
    });
  }

  void answer(const LocalModel& body, int tips) noexcept {
    const bool solved = answer_.solved;
    answer_ = {};
    answer_.solved = solved;
    std::array<double, TipPair::most> total{};
    for (int a = 0; a < count_; ++a) {
      const double f = solver_.force(a);
      if (f <= 0.0) continue;
      const TipState& place = place_[static_cast<std::size_t>(a)];
      const SurfaceNodes::Near& near = place.near;
      const auto node = static_cast<std::size_t>(near.node);
      pressed_[static_cast<std::size_t>(answer_.nodes)] = body.name[node];
      pressing_[static_cast<std::size_t>(answer_.nodes)] = place.tip;
      forces_[static_cast<std::size_t>(answer_.nodes++)] = f;
      ContactResult& tip = answer_.tip[static_cast<std::size_t>(place.tip)];
      tip.force -= f * near.slope;
      if (near.cover < 1.0) tip.force -= (0.5 * f * f * own_[static_cast<std::size_t>(a)] / (near.cover * near.cover)) * near.cover_slope;
      tip.energy += 0.5 * f * near.depth;
      // From the state: to where it rests without forces, and in by the depth.
      const double inward = near.depth + body.ahead[node] - share_ * body.given[node];
      tip.deflection += f * (body.displacement[node] - inward * body.nodes.normal(near.node));
      tip.touching = true;
      ++tip.nodes;
      total[static_cast<std::size_t>(place.tip)] += f;
    }
    for (std::size_t t = 0; t < static_cast<std::size_t>(tips); ++t) {
      answer_.energy += answer_.tip[t].energy;
      answer_.tip[t].solved = solved;
      if (answer_.tip[t].touching) answer_.tip[t].deflection /= total[t];
    }
  }

  static constexpr std::size_t capacity = LocalModel::capacity;

  ContactLcp solver_;
  MultiTipResult answer_;
  long number_ = -1;
  double share_ = 1.0;
  double deepest_ = 0.0;
  int count_ = 0, next_ = 0;  // places in the solver, and found in this step
  bool same_ = false;
  std::array<int, capacity> tip_of_{};      // by node; -1: under none
  std::array<double, capacity> depth_{};    // by node, m
  std::array<bool, capacity> needed_{};     // by node
  std::array<TipState, capacity> place_{};  // in the solver
  std::array<double, capacity> own_{};      // compliance of a place by itself, m/N
  std::array<std::int32_t, capacity> pressed_{};
  std::array<double, capacity> forces_{};
  std::array<int, capacity> pressing_{};
};

}  // namespace palpate::deformable
