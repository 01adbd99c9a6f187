#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/displaced_nodes.hpp"
#include "palpate/deformable/contact/force_prediction.hpp"
#include "palpate/deformable/contact/near_compliance.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/deformable/linear/body_motion.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/deformable/linear/support_offset.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Points of a place that carry friction.
struct Grip {
  double stiffness = 0.0;                 ///< N/m
  Vector3<> carried = Vector3<>::Zero();  ///< traction without further slip, N
  double energy = 0.0;                    ///< of it, times twice the shear ratio, J
};

/// Nodes near the tips with their compliance and forces. A place is a pair of a node and a tip; the first engaged() of count() places carry
/// forces.
///
/// The list reaches ahead of each tip by `margin` radii, so that a node is known before it comes into contact. A tick copies the compliance
/// of the nodes that a tip may reach at once. It also does one of these: renew the list, copy one more node, drop one that is far. A place
/// that is not engaged is evaluated again only when the tips and the body may have closed its clearance; the body near a tip is taken to
/// move at most 1.5 times as far as the tips. On a body that moves by itself every place is evaluated once per tick.
///
/// A body that bends may move to a tip that is far from it at rest: look_on() evaluates all nodes in turn and lists those near a tip.
class NearNodes {
 public:
  static constexpr int capacity = PlaceForces::capacity;

  struct Place {
    ForcePrediction prediction;  // aligned, therefore first
    std::int32_t node = 0;
    int tip = 0;
    int slot = 0;                                  // of its own, for what is stored of its points
    bool rubs = false;                             // since the last tick at least: friction acts
    bool barred = false;                           // not touched until the tip is clear of it
    bool flexible = false;                         // the body yields there much more than the layer
    Vector3<> force = Vector3<>::Zero();           // of the tip on the node, N
    Vector3<> traction = Vector3<>::Zero();        // friction on the node, across `direction`, N
    Vector3<> last_relative = Vector3<>::Zero();   // displacement less the tip's center at the last tick, m
    Vector3<> free = Vector3<>::Zero();            // displacement at the end of the period without force, m
    Vector3<> free_change = Vector3<>::Zero();     // of `free` since the last period, m
    double layer_energy = 0.0;                     // of the points in contact, J
    double crept = 0.0;                            // creep of the layer, mean of the points in contact, m
    Vector3<> change = Vector3<>::Zero();          // last change of the force, N
    Vector3<> displacement = Vector3<>::Zero();    // m
    Vector3<> target = Vector3<>::Zero();          // resultant of the node's points, N
    Vector3<> direction = Vector3<>::Zero();       // of the target
    Vector3<> last_direction = Vector3<>::Zero();  // at the last tick
    double stiffness = 0.0;                        // of the points in contact, N/m
    Grip grip;                                     // of those that carry friction
    double clear_until = 0.0;                      // value of `travelled_` up to which the node is clear, m
    double clearance = 0.0;                        // when last evaluated, m
    Vector3<> clear_at = Vector3<>::Zero();        // position relative to the tip then, m
  };

  /// A tip and the points that it can press. Set by the contact before update().
  struct Tip {
    TipGeometry shape;
    const PatchPoints* points = nullptr;
    Vector3<> center = Vector3<>::Zero(), last_move = Vector3<>::Zero();  // m
    Vector3<> deflection = Vector3<>::Zero();                             // mean displacement of the body under the tip, m
    Vector3<> force = Vector3<>::Zero(), last_force = Vector3<>::Zero();  // on the body, in this tick and the last one, N
    double recent_force = 0.0;                                            // largest of the last ticks, fading, N
    Vector3<> listed_center = Vector3<>::Zero(), listed_deflection = Vector3<>::Zero();
    double way = 0.0;   // of the last tick, m
    bool jump = false;  // every node near the tip is copied at once
    bool lost = false;  // in the body without contact
  };

  /// `motion` may be null: the body is static. `bends` as for SignedDistanceContact.
  NearNodes(const SurfaceNodes& nodes, const FullCompliance& compliance, const BodyMotion* motion, int tips, bool bends)
      : nodes_(&nodes),
        compliance_(&compliance),
        motion_(motion),
        tips_(static_cast<std::size_t>(tips)),
        place_of_(static_cast<std::size_t>(nodes.size()) * tips_.size(), -1),
        displaced_(bends ? nodes.size() : 0) {
    for (int k = 0; k < capacity; ++k) place(k).slot = k;
  }

  /// Whether the body yields much more at a node whose compliance has the trace `own` [m/N] than the contact's layer of the stiffness
  /// `layer` [N/m].
  [[nodiscard]] static bool is_flexible(double own, double layer) noexcept { return own * layer > 3.0 * flexible_ratio; }

  /// Set the displacement of the body by its supports, or null; it must outlive the list.
  void set_offset(SupportOffset* offset) noexcept { offset_ = offset; }
  [[nodiscard]] const SupportOffset* offset() const noexcept { return offset_; }

  /// Continue, without places so far, the list `before` of the same body with other supports or touched nodes; `node_after(i)` is the node
  /// i of `before`, or -1. Nodes that enter until admit_cleared() are barred.
  template <class NodeAfter>
  void take_over(const NearNodes& before, NodeAfter node_after) noexcept {
    travelled_ = before.travelled_;
    tips_ = before.tips_;
    displaced_.take_over(before.displaced_, node_after);
    for (int k = 0; k < before.count_; ++k) {
      const Place& old = before.place(k);
      const std::int32_t node = node_after(old.node);
      if (node < 0) continue;
      enter(node, old.tip);
      Place& p = place(count_ - 1);
      const Vector3<> free = p.free;
      const bool flexible = p.flexible;
      for (Place& other : places_)
        if (other.slot == old.slot) other.slot = p.slot;
      p = old;
      p.node = node;
      p.free = free;
      p.flexible = flexible;
      p.clearance = p.clear_until = 0.0;
      if (k >= before.engaged_) continue;
      ++engaged_;
      set_force(count_ - 1);
    }
    bars_ = true;
  }
  /// Admit the barred places that their tips do not overlap.
  void admit_cleared() noexcept {
    bars_ = false;
    for (int k = engaged_; k < count_; ++k)
      if (place(k).stiffness == 0.0) place(k).barred = false;
  }

  /// Whether the body moves by itself.
  [[nodiscard]] bool has_motion() const noexcept { return motion_ != nullptr; }

  [[nodiscard]] int tip_count() const noexcept { return static_cast<int>(tips_.size()); }
  [[nodiscard]] Tip& tip(int t) noexcept { return tips_[at(t)]; }
  [[nodiscard]] const Tip& tip(int t) const noexcept { return tips_[at(t)]; }
  [[nodiscard]] const Tip& tip_of(const Place& place) const noexcept { return tips_[at(place.tip)]; }

  /// Motion of a place's node relative to its tip since the last tick under constant forces, m; zero if the tip jumps.
  [[nodiscard]] Vector3<> way(const Place& place) const noexcept {
    const Tip& tip = tip_of(place);
    return tip.jump ? Vector3<>(Vector3<>::Zero()) : Vector3<>(place.free_change - tip.last_move);
  }

  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] int engaged() const noexcept { return engaged_; }
  [[nodiscard]] Place& place(int k) noexcept { return places_[at(k)]; }
  [[nodiscard]] const Place& place(int k) const noexcept { return places_[at(k)]; }

  /// Update the list for the tips' centers, `all` of it at once. Return false if more nodes are near than places.
  bool update(bool all = false) noexcept {
    for (const Tip& tip : tips_) travelled_ += 2.5 * tip.way;
    bool renewed = false;
    for (int t = 0; t < tip_count(); ++t) {
      Tip& tip = tips_[at(t)];
      for (int k = 0; tip.jump && k < count_; ++k)
        if (place(k).tip == t) place(k).clearance = 0.0;
      const double moved = (tip.center - tip.listed_center).norm() + (tip.deflection - tip.listed_deflection).norm();
      if (!tip.jump && !all && moved <= 0.25 * ahead(tip)) continue;
      tip.listed_center = tip.center;
      tip.listed_deflection = tip.deflection;
      if (tip.jump || count_ > capacity / 2) drop_far(t);
      list(t);
      renewed = true;
    }
    bool all_known = true;
    for (bool one_more = !renewed; pending_count_ > 0;) {
      Pending& nearest = nearest_pending();
      const Tip& tip = tips_[at(nearest.tip)];
      const bool urgent = tip.jump || all || nearest.gap < 2.5 * tip.way + 0.25 * ahead(tip);
      if (!urgent && !one_more) break;
      one_more = false;
      if (count_ == capacity) {
        all_known = nearest.gap > 0.0;
        break;
      }
      if (place_of(nearest.node, nearest.tip) < 0) enter(nearest.node, nearest.tip);  // unless look_on() has listed it
      nearest = pending_[at(--pending_count_)];
      renewed = true;
    }
    if (!renewed) drop_next();
    if (pending_count_ > 0) copy_.prefetch(*compliance_, nearest_pending().node, node_.data(), count_);
    return all_known;
  }

  /// Evaluate the displacements of more nodes of a body that bends, or of `all`, under the present forces. List those near a tip.
  void look_on(bool all = false) noexcept {
    if (displaced_.size() == 0) return;
    const int some = motion_ != nullptr && !motion_->costly() ? nodes_per_look / 4 : nodes_per_look;
    const int count = all ? displaced_.size() : std::min<int>(some, displaced_.size());
    const double ticks = all ? 0.0 : static_cast<double>(displaced_.size()) / some;  // between two looks at a node
    for (int i = 0; i < count; ++i) {
      const std::int32_t node = displaced_.next();
      const double moved = displaced_.set(node, displacement_of(node));
      for (int t = 0; t < tip_count() && count_ < capacity; ++t) {
        const Tip& tip = tips_[at(t)];
        if (place_of(node, t) >= 0) continue;
        const double most = ahead(tip) + moved + ticks * tip.way + tip.points->reach(node);
        if (tip.shape.within(nodes_->point(node) + displaced_.get(node) - tip.center, most)) enter(node, t);
      }
    }
  }

  void clear() noexcept {
    while (count_ > 0) {
      --count_;
      place_of(places_[at(count_)].node, places_[at(count_)].tip) = -1;
    }
    engaged_ = pending_count_ = looked_at_ = flexible_ = 0;
    bars_ = false;
    displaced_.reset();
    forces_ = scratch_ = {};
    travelled_ = 0.0;
    std::fill(tips_.begin(), tips_.end(), Tip());
  }

  /// Release the body from a tip.
  void release(int tip) noexcept {
    for (int k = engaged_ - 1; k >= 0; --k)
      if (place(k).tip == tip) disengage(k);
  }

  /// Position of a node without a tip, m.
  [[nodiscard]] Vector3<> free_point(std::int32_t node) const noexcept {
    return offset_ != nullptr && offset_->active() ? Vector3<>(nodes_->point(node) + offset_->present(node)) : nodes_->point(node);
  }
  /// The same with the tips on a body that bends, as last looked at.
  [[nodiscard]] Vector3<> present_point(std::int32_t node) const noexcept {
    return displaced_.size() > 0 ? Vector3<>(nodes_->point(node) + displaced_.get(node)) : free_point(node);
  }

  /// Place of a tip's node nearest to it, or -1: at rest, or on a body that bends as last looked at.
  [[nodiscard]] int nearest(int tip, bool at_rest) const noexcept {
    int found = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < count_; ++k) {
      if (place(k).tip != tip) continue;
      const std::int32_t node = place(k).node;
      const Vector3<> moved = at_rest ? Vector3<>(Vector3<>::Zero()) : displaced_.get(node);
      const double square = (nodes_->point(node) + moved - tips_[at(tip)].center).squaredNorm();
      if (square >= least) continue;
      least = square;
      found = k;
    }
    return found;
  }

  /// Number of engaged places of a tip.
  [[nodiscard]] int engaged(int tip) const noexcept {
    int number = 0;
    for (int k = 0; k < engaged_; ++k) number += place(k).tip == tip ? 1 : 0;
    return number;
  }

  /// Whether a place need not be evaluated; `again`: it has been evaluated in this tick.
  [[nodiscard]] bool certainly_clear(int k, bool again) const noexcept {
    return (motion_ == nullptr || again) && place(k).clear_until > travelled_;
  }
  /// Whether a place was farther from its tip, when last evaluated, than tips and body are expected to move in some ticks.
  [[nodiscard]] bool is_far(int k) const noexcept {
    const Tip& tip = tip_of(place(k));
    return place(k).clear_until - travelled_ > 0.02 * tip.shape.radius + 10.0 * tip.way;
  }
  /// Record the clearance of a place at the position `at` relative to its tip [m].
  void set_clearance(int k, double clearance, const Vector3<>& at) noexcept {
    Place& p = place(k);
    p.clear_until = travelled_ + clearance;
    p.clearance = clearance;
    p.clear_at = at;
  }
  /// Whether a place that is not engaged is clear at `at` by its last clearance and its motion since then.
  [[nodiscard]] bool still_clear(int k, const Vector3<>& at) noexcept {
    Place& p = place(k);
    const double rest = p.clearance - (at - p.clear_at).norm();
    if (!(rest > 0.0)) return false;
    p.clear_until = travelled_ + rest;
    return true;
  }

  void engage(int k) noexcept {
    clear_forces(place(k));
    place(k).prediction.start(way(place(k)));
    swap(k, engaged_++);
  }
  void disengage(int k) noexcept {
    clear_forces(place(k));
    set_force(k);
    set_clearance(k, 0.0, Vector3<>::Zero());
    swap(k, --engaged_);
  }

  void set_force(int k) noexcept { forces_.set(k, place(k).force + place(k).traction); }
  /// Displacement of a place by the forces, m.
  [[nodiscard]] Vector3<> displacement(int k) const noexcept { return copy_.displacement(k, forces_, engaged_); }
  /// Set the displacement of a place to that by the forces.
  void move(int k) noexcept { place(k).displacement = place(k).free + displacement(k); }
  /// Add the displacements of the engaged places by a force on place k to `sum`.
  void add_displacements(int k, const Vector3<>& force, PlaceForces& sum) const noexcept {
    copy_.add_displacements(k, force, engaged_, sum);
  }
  /// Displacement of place k by a force on place j, m/N.
  [[nodiscard]] Matrix3<> compliance(int k, int j) const noexcept { return copy_.block(k, j); }
  /// Whether the body near a tip yields much more than the layer of the contact.
  [[nodiscard]] bool any_flexible() const noexcept { return flexible_ > 0; }

  /// Second set of forces: set it for every engaged place, then call finish_scratch().
  void finish_scratch() noexcept {
    for (int k = engaged_; k % 8 != 0; ++k) scratch_.set(k, Vector3<>::Zero());
  }
  void set_scratch(int k, const Vector3<>& force) noexcept { scratch_.set(k, force); }
  [[nodiscard]] Vector3<> scratch_displacement(int k) const noexcept { return copy_.displacement(k, scratch_, engaged_); }
  /// See NearCompliance::along(); unit forces along the vectors in the second set.
  void along(int k, const Vector3<>& direction, int first, float* out) const noexcept {
    copy_.along(k, direction, scratch_, first, engaged_, out);
  }

 private:
  static constexpr double margin = 0.15;
  static constexpr double flexible_ratio = 10.0;  // of compliances, body over layer; at most 8 on a block, above 20 on cantilevers
  static constexpr double stricter = 2.0;         // on a body that bends anywhere
  static constexpr int max_pending = 1024;
  static constexpr int nodes_per_look = 32;
  struct Pending {
    std::int32_t node;
    int tip;
    double gap;
  };

  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  [[nodiscard]] Pending& nearest_pending() noexcept {
    return *std::min_element(pending_.begin(), pending_.begin() + pending_count_,
                             [](const Pending& a, const Pending& b) { return a.gap < b.gap; });
  }

  [[nodiscard]] std::int32_t& place_of(std::int32_t node, int tip) noexcept { return place_of_[at(node) * tips_.size() + at(tip)]; }

  static void clear_forces(Place& p) noexcept {
    p.force.setZero();
    p.change.setZero();
    p.traction.setZero();
    p.rubs = false;
  }

  /// Displacement of a node by all forces, m.
  [[nodiscard]] Vector3<> displacement_of(std::int32_t node) noexcept {
    const float* const row = compliance_->block(node, 0);
    float x = 0.0F, y = 0.0F, z = 0.0F;
    for (int j = 0; j < engaged_; ++j) {
      const float* const c = row + 9 * node_[at(j)];
      const float fx = forces_.axis(0)[j], fy = forces_.axis(1)[j], fz = forces_.axis(2)[j];
      x += c[0] * fx + c[1] * fy + c[2] * fz;
      y += c[3] * fx + c[4] * fy + c[5] * fz;
      z += c[6] * fx + c[7] * fy + c[8] * fz;
    }
    return Vector3<>(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)) + free_displacement(node);
  }
  /// Displacement of a node at the end of the period without force, m.
  [[nodiscard]] Vector3<> free_displacement(std::int32_t node) noexcept {
    Vector3<> u = motion_ != nullptr ? motion_->free_displacement(node) : Vector3<>(Vector3<>::Zero());
    if (offset_ != nullptr && offset_->active()) u += offset_->displacement(node);
    return u;
  }

  /// Distance of a node's patch from a tip, m, with the node anywhere between rest and the mean displacement, or as last looked at.
  [[nodiscard]] double gap(const Tip& tip, std::int32_t node) const noexcept {
    const Vector3<> y = free_point(node) - tip.listed_center;
    double least = tip.shape.distance(y);
    if (displaced_.size() > 0) least = std::min(least, tip.shape.distance(present_point(node) - tip.listed_center));
    if (tip.listed_deflection.squaredNorm() > 0.0)
      for (const double share : {0.5, 1.0}) least = std::min(least, tip.shape.distance(y + share * tip.listed_deflection));
    return least - tip.points->reach(node);
  }

  /// Whether gap() is less than `most`.
  [[nodiscard]] bool within(const Tip& tip, std::int32_t node, double most) const noexcept {
    const Vector3<> y = free_point(node) - tip.listed_center;
    most += tip.points->reach(node);
    return tip.shape.within(y, most) || tip.shape.within(y + 0.5 * tip.listed_deflection, most) ||
           tip.shape.within(y + tip.listed_deflection, most);
  }

  [[nodiscard]] static double ahead(const Tip& tip) noexcept { return margin * tip.shape.radius; }
  [[nodiscard]] bool dispensable(int k) const noexcept {
    const Tip& tip = tip_of(place(k));
    return k >= engaged_ && gap(tip, place(k).node) > 1.5 * ahead(tip);
  }

  void drop(int k) noexcept {
    swap(k, count_ - 1);
    --count_;
    flexible_ -= place(count_).flexible ? 1 : 0;
    place_of(place(count_).node, place(count_).tip) = -1;
  }
  void drop_far(int tip) noexcept {
    for (int k = count_ - 1; k >= engaged_; --k)
      if (place(k).tip == tip && dispensable(k)) drop(k);
  }
  /// Look at one place, another at each call.
  void drop_next() noexcept {
    if (++looked_at_ >= count_) looked_at_ = engaged_;
    if (looked_at_ < count_ && dispensable(looked_at_)) drop(looked_at_);
  }

  /// List the nodes near a tip that have no place.
  void list(int t) noexcept {
    const Tip& tip = tips_[at(t)];
    const TipGeometry& shape = tip.shape;
    const double shaft = shape.shape == TipGeometry::Shape::capsule ? shape.length : 2.0 * shape.radius + tip.listed_deflection.norm();
    Vector3<> low = tip.listed_center, high = tip.listed_center;
    const Vector3<> other = tip.listed_center + shaft * shape.axis;
    for (const Vector3<>& p : {other, Vector3<>(tip.listed_center - tip.listed_deflection), Vector3<>(other - tip.listed_deflection)}) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const auto kept = std::remove_if(pending_.begin(), pending_.begin() + pending_count_, [t](const Pending& p) { return p.tip == t; });
    pending_count_ = static_cast<int>(kept - pending_.begin());
    const double reach = shape.reach() + ahead(tip) + tip.points->max_reach() + (offset_ != nullptr ? offset_->largest() : 0.0);
    nodes_->query_box(low, high, reach, [&](std::int32_t node) {
      if (place_of(node, t) >= 0 || pending_count_ == max_pending || !within(tip, node, ahead(tip))) return;
      pending_[at(pending_count_++)] = {node, t, gap(tip, node)};
    });
  }

  void enter(std::int32_t node, int tip) noexcept {
    place_of(node, tip) = count_;
    const int slot = place(count_).slot;
    place(count_) = {};
    place(count_).slot = slot;
    place(count_).node = node;
    place(count_).tip = tip;
    place(count_).barred = bars_;
    place(count_).free = free_displacement(node);
    node_[at(count_)] = node;
    forces_.set(count_, Vector3<>::Zero());
    ++count_;
    copy_.enter(*compliance_, node_.data(), count_);
    Place& p = place(count_ - 1);
    const double layer = tip_of(p).points->stiffness(node) * (displaced_.size() > 0 ? stricter : 1.0);
    p.flexible = is_flexible(copy_.block(count_ - 1, count_ - 1).trace(), layer);
    flexible_ += p.flexible ? 1 : 0;
  }

  void swap(int k, int l) noexcept {
    if (k == l) return;
    std::swap(places_[at(k)], places_[at(l)]);
    std::swap(node_[at(k)], node_[at(l)]);
    place_of(place(k).node, place(k).tip) = k;
    place_of(place(l).node, place(l).tip) = l;
    set_force(k);
    set_force(l);
    copy_.swap(k, l, count_);
  }

  const SurfaceNodes* nodes_;
  const FullCompliance* compliance_;
  const BodyMotion* motion_;
  SupportOffset* offset_ = nullptr;
  bool bars_ = false;  // nodes that enter are barred
  std::vector<Tip> tips_;
  std::vector<std::int32_t> place_of_;  // by node and tip; -1: none
  int count_ = 0, engaged_ = 0, pending_count_ = 0, looked_at_ = 0, flexible_ = 0;
  double travelled_ = 0.0;  // way of the tips times 2.5, m
  std::array<Place, static_cast<std::size_t>(capacity)> places_;
  std::array<std::int32_t, static_cast<std::size_t>(capacity)> node_{};
  std::array<Pending, static_cast<std::size_t>(max_pending)> pending_;
  DisplacedNodes displaced_;
  NearCompliance copy_;
  PlaceForces forces_, scratch_;
};

}  // namespace palpate::deformable
