#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/partial_slip.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// What a body answers to a tip.
struct ContactResult {
  bool touching = false;
  Vector3<> force = Vector3<>::Zero();       ///< of the body on the tip, N
  Vector3<> deflection = Vector3<>::Zero();  ///< mean displacement of the pressed patch, weighted by its forces, m
  Vector3<> friction = Vector3<>::Zero();    ///< the part of `force` that drags along the surface, N
  double energy = 0.0;                       ///< in the body at the end of the tick, kinetic and of its springs, J
  double saved = 0.0;                        ///< put in besides, and kept for what snapshots to come ask for (BlendedContact), J
  int nodes = 0;                             ///< pressed
  bool sliding = false;                      ///< the whole patch slides: dynamic friction
  bool solved = true;                        ///< false: the bound on moves was reached, or more nodes lie under the tip than are looked at
};

/// Which way nodes face that are pressed or near: BodyContact::outward.
template <class Load>
[[nodiscard]] Vector3<> outward_of(const SurfaceNodes& nodes, const Tip& tip, int pressed, Load load) noexcept {
  Vector3<> outward = Vector3<>::Zero();
  for (int k = 0; k < pressed; ++k) outward += load(k);
  const double length = outward.norm();
  if (length > 0.0) return outward / length;
  const std::int32_t node = nodes.nearest(tip.centre, 2.0 * tip.radius);
  return node >= 0 ? nodes.normal(node) : tip.outward;
}

/// A body that can be dragged along its surface: it has a tangential compliance.
template <class Kind>
concept HasTangentialCompliance = requires(const Kind& kind) { kind.tangential(0, 0); };

/// A rigid tip on a linear body: which nodes lie under it, and the forces that keep them out of it.
///
/// `Kind` is any body that is linear over one servo period:
///   double compliance(i, j)   how far node i has moved along its inward normal at the end of the period, by a unit force along node j's
///                             that is held from its beginning, m/N; symmetric
///   double at_rest(i)         where node i will be then without any force, m
///   void advance(nodes, forces, count)   one period with these forces
///   void reset()
/// A kind with a state tells what it holds: double energy(), or double energy(yielded), J, after advance(), where `yielded` is f.C f with
/// the compliance of the period [N m]. One without holds half of that. A kind may tell nodes that need not be asked: bool surely_above(i,
/// place), at_rest(i) >= place [m], and bool surely_above_all(group, place), the same of all nodes of a group (BodyNodes::group). For
/// friction also
///   Matrix2d tangential(i, j)   the same in the nodes' tangent planes (BodyNodes::across), m/N
/// and if there is memory in them, Vector2d tangential_at_rest(i) and advance(nodes, forces, tangential_forces, count).
/// A kind that creeps tells how what yields besides does: Creep creep().
/// A tip may go as deep as it likes, step by step: nodes that it has passed still lie under it. Displacements are small: nodes move along
/// their normals at rest. So the force is the slope of the stored energy by the tip's place, and no closed path of the tip gives work,
/// whatever the mesh. Friction takes from it (PartialSlip); what the normal forces move sideways and the tangential ones inwards is left
/// out of both.
template <class Kind>
class TipContact {
 public:
  static constexpr int capacity = ContactLcp::capacity;

  /// The nodes and the body outlive the contact. A kind that cannot be dragged has no friction.
  TipContact(const SurfaceNodes& nodes, Kind& kind, DryFriction friction = {}) : nodes_(&nodes), kind_(&kind) {
    if (HasTangentialCompliance<Kind> && friction) slip_ = PartialSlip(friction, nodes.size());
    raises_.assign(static_cast<std::size_t>(nodes.size()), 0.0);
    for (std::int32_t i = 0; i < nodes.size(); ++i)
      for (std::int32_t j = 0; j < i; ++j)
        for (const std::int32_t k : {i, j})
          raises_[static_cast<std::size_t>(k)] = std::max(raises_[static_cast<std::size_t>(k)], -kind.compliance(i, j));
  }

  /// Goes on by one period with the tip where it is.
  const ContactResult& step(const Tip& tip) noexcept {
    faced_ = tip.outward;
    find(tip);
    do solve();
    while (left_out(tip));
    answer();
    if constexpr (HasTangentialCompliance<Kind>)
      if (slip_.on()) drag(tip);
    advance();
    store();
    return answer_;
  }

  void reset() noexcept {
    count_ = 0;
    deepest_ = deep_ = 0.0;
    solver_.start(0, [](int) { return false; });
    answer_ = {};
    slip_.reset();
    placed_ = false;
    kind_->reset();
  }

  [[nodiscard]] const ContactResult& last() const noexcept { return answer_; }

  /// Out of the body, unit: while the tip is free, as the nearest node faces, or as the tip does if none is near; while it presses, as it
  /// did before, and never more than 45 degrees off the way that it is pushed out. What it presses depends on this, so a path on which the
  /// direction turned with every change of the force could get work out of the body.
  [[nodiscard]] Vector3<> outward(const Tip& tip) const noexcept {
    Vector3<> pushed = outward_of(*nodes_, tip, answer_.nodes, [this](int k) {
      const auto c = static_cast<std::size_t>(k);
      return Vector3<>(forces_[c] * nodes_->normal(pressed_[c]));
    });
    const double along = faced_.dot(pushed);
    if (answer_.nodes == 0) return pushed;
    if (along >= std::sqrt(0.5)) return faced_;
    const Vector3<> aside = faced_ - along * pushed;
    return aside.norm() > 1e-9 ? Vector3<>((pushed + aside.normalized()).normalized()) : pushed;
  }

  /// The pressed nodes of the last step and the forces on them along their inward normals [N], answer.nodes of each.
  [[nodiscard]] const std::int32_t* pressed() const noexcept { return pressed_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }

  [[nodiscard]] const DryFriction& friction() const noexcept { return slip_.friction(); }

  /// What the tip drags a pressed node of the last step with, N.
  [[nodiscard]] Vector3<> dragged(std::int32_t node) const noexcept {
    return slip_.on() ? Vector3<>(nodes_->across(node) * slip_.force(node)) : Vector3<>::Zero();
  }

 private:
  using Near = SurfaceNodes::Near;
  struct Seen {
    std::int32_t node;
    double depth;
  };
  static constexpr int capacity_seen = 1024;

  /// The nodes that the tip is in, or nearly: those whose depth is above minus a quarter of the deepest one's. `left_out` finds whoever
  /// is needed besides.
  void find(const Tip& tip) noexcept {
    answer_ = {};
    if constexpr (creeps) creep();
    deep_before_ = deep_;
    double expected = 1.1 * deepest_;  // the last tick's, and some more: seldom is a second look needed
    int found = look(tip, 0.25 * expected);
    while (deepest_ > expected) {
      expected = 1.1 * deepest_;
      found = look(tip, 0.25 * expected);
    }
    above_ = 0.25 * deepest_;
    found = deepest_ > 0.0 ? keep(found, [this](const Seen& s) { return s.depth > -above_; }) : 0;
    if (found > capacity) {  // the deepest stay
      std::nth_element(seen_.begin(), seen_.begin() + capacity, seen_.begin() + found,
                       [](const Seen& a, const Seen& b) { return a.depth > b.depth; });
      above_ = -seen_[capacity].depth;
      if (above_ < 0.0) answer_.solved = false;
      found = capacity;
    }
    place(tip, found);
  }

  /// Puts the first `found` nodes that were seen into the solver.
  void place(const Tip& tip, int found) noexcept {
    std::sort(seen_.begin(), seen_.begin() + found, [](const Seen& a, const Seen& b) { return a.node < b.node; });
    match(found);
    for (int a = 0; a < count_; ++a) {
      Near& near = near_[static_cast<std::size_t>(a)];
      near = nodes_->reached(tip, node_[static_cast<std::size_t>(a)]);
      inward_[static_cast<std::size_t>(a)] = near.depth;
      near.depth = seen_[static_cast<std::size_t>(a)].depth;
      if constexpr (creeps) near.depth -= (1.0 / near.cover - 1.0) * crept(a);
      solver_.depth(a) = near.depth;
      solver_.own(a, own_[static_cast<std::size_t>(a)] / near.cover);
    }
  }

  /// Whether the forces raise nodes into the tip that are not in the solver, as they may at an edge or on a slender body. They are in from
  /// now on. No node rises by more than the sum of what each force raises where it raises most.
  bool left_out(const Tip& tip) noexcept {
    double raised = 0.0;
    for (int a = 0; a < count_; ++a) raised += solver_.force(a) * raises_[static_cast<std::size_t>(node_[static_cast<std::size_t>(a)])];
    if (!(raised > above_)) return false;
    const int known = count_, found = keep(look(tip, raised), [this, known](const Seen& s) {
                                const auto end = node_.begin() + known, at = std::lower_bound(node_.begin(), end, s.node);
                                if (at != end && *at == s.node) return true;
                                double moved = 0.0;
                                for (int a = 0; a < known; ++a)
                                  if (solver_.force(a) > 0.0)
                                    moved += solver_.force(a) * kind_->compliance(s.node, node_[static_cast<std::size_t>(a)]);
                                return moved < s.depth - 1e-9 * deepest_;
                              });
    if (found <= known) return false;
    if (found > capacity) {
      answer_.solved = false;
      return false;
    }
    place(tip, found);
    return true;
  }

  /// Lists the nodes whose depth is more than minus `above` [m], and finds the deepest one's; returns how many.
  int look(const Tip& tip, double above) noexcept {
    int found = 0;
    deepest_ = deep_ = 0.0;
    nodes_->under(
        tip, deep_before_,
        [&](std::size_t group, double depth) {
          if (depth > 0.0) return false;
          if constexpr (requires { kind_->surely_above_all(group, depth); }) return kind_->surely_above_all(group, depth + above);
          return false;
        },
        [&](std::int32_t node, double depth) {
          deep_ = std::max(deep_, depth);
          if constexpr (requires { kind_->surely_above(node, depth); })
            if (kind_->surely_above(node, depth + above)) return;
          depth -= kind_->at_rest(node);
          deepest_ = std::max(deepest_, depth);
          if (!(depth > -above)) return;
          if (found == capacity_seen) found = keep(found, [this](const Seen& s) { return s.depth > -0.25 * deepest_; });
          if (found < capacity_seen)
            seen_[static_cast<std::size_t>(found++)] = {node, depth};
          else
            answer_.solved = false;
        });
    return found;
  }

  static constexpr bool creeps = requires(const Kind& kind) { kind.creep(); };

  /// A body that creeps remembers by node what its whole patch has crept; what a patch gives way more because the tip covers a part of it
  /// only is remembered here, by place, as long as the tip presses it.
  void creep() noexcept {
    const Creep creep = kind_->creep();
    for (int a = 0; a < count_; ++a) {
      double& q = crept_[static_cast<std::size_t>(a)];
      q = solver_.force(a) > 0.0 ? creep.stays * q + creep.gains * solver_.force(a) : 0.0;
    }
  }

  /// How far a whole patch would have crept by its own force, m.
  [[nodiscard]] double crept(int a) const noexcept {
    const Creep creep = kind_->creep();
    return own_[static_cast<std::size_t>(a)] / creep.share * creep.stays * crept_[static_cast<std::size_t>(a)];
  }

  /// Energy that a pressed place holds by one over the covered part, J: of its spring, and of what it remembers.
  [[nodiscard]] double by_cover(int a, double force) const noexcept {
    const double own = own_[static_cast<std::size_t>(a)];
    double energy = 0.5 * force * force * own;
    if constexpr (creeps) {
      const Creep creep = kind_->creep();
      const double q = crept_[static_cast<std::size_t>(a)];
      energy += force * crept(a) - own / creep.share * creep.stored(q * q);
    }
    return energy;
  }

  /// Drops of the nodes seen those that shall not `stay`; returns how many do.
  template <class Stay>
  int keep(int found, Stay stay) noexcept {
    const auto end = std::remove_if(seen_.begin(), seen_.begin() + found, [&stay](const Seen& s) { return !stay(s); });
    return static_cast<int>(end - seen_.begin());
  }

  /// Lets places go whose nodes are not among the first `found` that were seen, and makes places for new ones, in the nodes' order. What
  /// stays keeps its compliance and its part of the factor: a tick in which nodes come and go fetches no more than those.
  void match(int found) noexcept {
    for (int a = count_ - 1, s = found - 1; a >= 0; --a) {
      const auto at = static_cast<std::size_t>(a);
      while (s >= 0 && seen_[static_cast<std::size_t>(s)].node > node_[at]) --s;
      if (s >= 0 && seen_[static_cast<std::size_t>(s)].node == node_[at]) continue;
      solver_.remove(a);
      std::copy(node_.begin() + a + 1, node_.begin() + count_, node_.begin() + a);
      std::copy(own_.begin() + a + 1, own_.begin() + count_, own_.begin() + a);
      std::copy(crept_.begin() + a + 1, crept_.begin() + count_, crept_.begin() + a);
      --count_;
    }
    for (int a = 0; a < found; ++a) {
      const auto at = static_cast<std::size_t>(a);
      const std::int32_t node = seen_[at].node;
      if (a < count_ && node_[at] == node) continue;
      solver_.insert(a);
      std::copy_backward(node_.begin() + a, node_.begin() + count_, node_.begin() + count_ + 1);
      std::copy_backward(own_.begin() + a, own_.begin() + count_, own_.begin() + count_ + 1);
      std::copy_backward(crept_.begin() + a, crept_.begin() + count_, crept_.begin() + count_ + 1);
      ++count_;
      node_[at] = node;
      crept_[at] = 0.0;
      own_[at] = solver_.compliance(a, a) = kind_->compliance(node, node);
      for (int b = 0; b < count_; ++b)
        if (b != a) solver_.compliance(a, b) = solver_.compliance(b, a) = kind_->compliance(node, node_[static_cast<std::size_t>(b)]);
    }
  }

  void solve() noexcept {
    // The nodes of the last step that were pressed are tried first; without any, those that Hertz would press: deeper than half.
    if (!solver_.any_pressed())
      for (int a = 0; a < count_; ++a)
        if (near_[static_cast<std::size_t>(a)].depth > 0.5 * deepest_) solver_.attempt(a);
    answer_.solved = solver_.solve() && answer_.solved;
  }

  void answer() noexcept {
    double total = 0.0;
    for (int a = 0; a < count_; ++a) {
      const double f = solver_.force(a);
      if (f <= 0.0) continue;
      const Near& near = near_[static_cast<std::size_t>(a)];
      pressed_[static_cast<std::size_t>(answer_.nodes)] = near.node;
      held_[static_cast<std::size_t>(answer_.nodes)] = a;
      forces_[static_cast<std::size_t>(answer_.nodes++)] = f;
      // Minus the slope of the stored energy, max f.(g - C f/2), by the tip's place.
      answer_.force -= f * near.slope;
      if (near.cover < 1.0) answer_.force -= (by_cover(a, f) / (near.cover * near.cover)) * near.cover_slope;
      answer_.deflection -= (f * inward_[static_cast<std::size_t>(a)]) * nodes_->normal(near.node);
      total += f;
    }
    answer_.touching = answer_.nodes > 0;
    if (answer_.touching) answer_.deflection /= total;
  }

  /// The tip has moved over the surface, and drags it along.
  void drag(const Tip& tip) noexcept {
    const Vector3<> way = placed_ ? Vector3<>(tip.centre - centre_) : Vector3<>::Zero();
    centre_ = tip.centre;
    placed_ = centre_.allFinite();
    for (int c = 0; c < answer_.nodes; ++c) covers_[static_cast<std::size_t>(c)] = near(c).cover;
    slip_.step(*nodes_, *kind_, pressed_.data(), forces_.data(), covers_.data(), answer_.nodes, way);
    double total = 0.0;
    Vector3<> along = Vector3<>::Zero();
    for (int c = 0; c < answer_.nodes; ++c) {
      const std::int32_t node = near(c).node;
      const Eigen::Vector2d force = slip_.force(node), moved = slip_.moved(node);
      along += forces_[static_cast<std::size_t>(c)] * (nodes_->across(node) * moved);
      total += forces_[static_cast<std::size_t>(c)];
      answer_.friction -= nodes_->across(node) * force;
      if (near(c).cover < 1.0) answer_.friction -= slip_.by_cover(node) * near(c).cover_slope;
      tangential_[static_cast<std::size_t>(c)] = force;
    }
    if (total > 0.0) answer_.deflection += along / total;
    answer_.force += answer_.friction;
    answer_.sliding = slip_.sliding();
  }

  void advance() noexcept {
    if constexpr (requires { kind_->advance(pressed_.data(), forces_.data(), tangential_.data(), 0); })
      if (slip_.on()) return kind_->advance(pressed_.data(), forces_.data(), tangential_.data(), answer_.nodes);
    kind_->advance(pressed_.data(), forces_.data(), answer_.nodes);
  }

  /// The body's energy at the end of the period, and that of what patches give way more that lie under the tip in part.
  void store() noexcept {
    double yielded = 0.0, besides = 0.0;
    for (int c = 0; c < answer_.nodes; ++c) {
      const auto a = static_cast<std::size_t>(held_[static_cast<std::size_t>(c)]);
      const double f = forces_[static_cast<std::size_t>(c)], more = (1.0 / near_[a].cover - 1.0) * own_[a];
      yielded += f * (near_[a].depth - more * f);
      Creep creep;
      if constexpr (creeps) creep = kind_->creep();
      const double next = creep.stays * crept_[a] + creep.gains * f;
      besides += more * creep.energy(f * f, next * next) / creep.share;
    }
    if (slip_.on()) {
      yielded += slip_.yielded();
      besides += slip_.in_parts();
    }
    if constexpr (requires { kind_->energy(yielded); })
      answer_.energy = kind_->energy(yielded) + besides;
    else if constexpr (requires { kind_->energy(); })
      answer_.energy = kind_->energy() + besides;
    else
      answer_.energy = 0.5 * yielded + besides;
  }

  [[nodiscard]] const Near& near(int pressed) const noexcept {
    return near_[static_cast<std::size_t>(held_[static_cast<std::size_t>(pressed)])];
  }

  const SurfaceNodes* nodes_;
  Kind* kind_;
  ContactLcp solver_;
  ContactResult answer_;
  int count_ = 0;               // places in the solver
  double deepest_ = 0.0;        // m
  double deep_ = 0.0;           // how deep the tip was in the last step against places at rest, m
  double deep_before_ = 0.0;    // the same, of the step before
  double above_ = 0.0;          // nodes higher than this are not in the solver at first, m
  std::vector<double> raises_;  // by node: the most that a unit force on it raises another, m/N
  std::array<Seen, capacity_seen> seen_{};
  std::array<Near, capacity> near_{};
  std::array<std::int32_t, capacity> node_{};  // by place
  std::array<double, capacity> own_{};         // compliance of a place by itself, m/N
  std::array<double, capacity> crept_{};       // by place, N
  std::array<double, capacity> inward_{};      // how far a place goes in if it is pressed, from where it is at rest, m
  std::array<std::int32_t, capacity> pressed_{};
  std::array<double, capacity> forces_{};
  std::array<int, capacity> held_{};      // places of the pressed
  Vector3<> faced_ = Vector3<>::UnitZ();  // the tip's outward in the last step
  PartialSlip slip_;
  bool placed_ = false;                                 // the tip has been somewhere before
  Vector3<> centre_ = Vector3<>::Zero();                // where it was, m
  std::array<double, capacity> covers_{};               // of the pressed
  std::array<Eigen::Vector2d, capacity> tangential_{};  // on the pressed, N
};

}  // namespace palpate::deformable
