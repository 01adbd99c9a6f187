#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/near_compliance.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Nodes near a tip with their compliance and forces. The first engaged() of count() places carry forces.
///
/// The list reaches ahead of the tip by `margin` radii, so that a node is known before it comes into contact. A tick copies the compliance
/// of the nodes that the tip may reach at once, and of one more. A node that is not engaged is evaluated again only when the tip and the
/// body may have closed its clearance; the body near the tip is taken to move at most 1.5 times as far as the tip.
class NearNodes {
 public:
  static constexpr int capacity = PlaceForces::capacity;

  struct Place {
    std::int32_t node = 0;
    Vector3<> force = Vector3<>::Zero(), last_force = Vector3<>::Zero();  // of the tip on the node; of the last tick, N
    Vector3<> change = Vector3<>::Zero();                                 // last change of the force, N
    Vector3<> displacement = Vector3<>::Zero();                           // m
    Vector3<> target = Vector3<>::Zero();                                 // resultant of the node's points, N
    Vector3<> direction = Vector3<>::Zero();                              // of the target
    double stiffness = 0.0;                                               // of the points in contact, N/m
    double clear_until = 0.0;                                             // value of `travelled_` up to which the node is clear, m
  };

  NearNodes(const SurfaceNodes& nodes, const FullCompliance& compliance)
      : nodes_(&nodes), compliance_(&compliance), place_of_(static_cast<std::size_t>(nodes.size()), -1) {}

  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] int engaged() const noexcept { return engaged_; }
  [[nodiscard]] Place& place(int k) noexcept { return places_[at(k)]; }
  [[nodiscard]] const Place& place(int k) const noexcept { return places_[at(k)]; }

  /// Update the list for a tip at `center` that has moved by `way` [m] since the last tick. `deflection` is the body's mean displacement
  /// under the tip [m]. After a `jump` all nodes are copied at once. Return false if more nodes are near than places.
  bool update(const TipGeometry& tip, const PatchPoints& points, const Vector3<>& center, const Vector3<>& deflection, double way,
              bool jump) noexcept {
    travelled_ += 2.5 * way;
    const double ahead = margin * tip.radius;
    if (jump || (center - listed_center_).norm() + (deflection - listed_deflection_).norm() > 0.25 * ahead) {
      listed_center_ = center;
      listed_deflection_ = deflection;
      drop_far(tip, points, 1.5 * ahead);
      list(tip, points, ahead);
    }
    bool all_known = true;
    for (bool one_more = true; pending_count_ > 0;) {
      const auto end = pending_.begin() + pending_count_;
      const auto nearest = std::min_element(pending_.begin(), end, [](const Pending& a, const Pending& b) { return a.gap < b.gap; });
      const bool urgent = jump || nearest->gap < 2.5 * way + 0.25 * ahead;
      if (!urgent && !one_more) break;
      one_more = urgent && one_more;
      if (count_ == capacity) {
        all_known = nearest->gap > 0.0;
        break;
      }
      enter(nearest->node);
      *nearest = pending_[at(--pending_count_)];
    }
    return all_known;
  }

  void clear() noexcept {
    while (count_ > 0) place_of_[at(places_[at(--count_)].node)] = -1;
    engaged_ = pending_count_ = 0;
    forces_ = scratch_ = {};
    travelled_ = 0.0;
    listed_center_.setZero();
    listed_deflection_.setZero();
  }

  /// Set all forces to zero.
  void release_all() noexcept {
    for (int k = 0; k < engaged_; ++k) {
      place(k).force.setZero();
      place(k).last_force.setZero();
      place(k).clear_until = 0.0;
    }
    engaged_ = 0;
    forces_ = {};
  }

  /// Place of the node nearest to `center` at rest, or -1.
  [[nodiscard]] int nearest(const Vector3<>& center) const noexcept {
    int found = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < count_; ++k) {
      const double square = (nodes_->point(place(k).node) - center).squaredNorm();
      if (square >= least) continue;
      least = square;
      found = k;
    }
    return found;
  }

  [[nodiscard]] bool certainly_clear(int k) const noexcept { return place(k).clear_until > travelled_; }
  void set_clearance(int k, double clearance) noexcept { place(k).clear_until = travelled_ + clearance; }

  void engage(int k) noexcept {
    place(k).force.setZero();
    place(k).last_force.setZero();
    place(k).change.setZero();
    swap(k, engaged_++);
  }
  void disengage(int k) noexcept {
    place(k).force.setZero();
    place(k).last_force.setZero();
    place(k).change.setZero();
    set_force(k);
    place(k).clear_until = travelled_;
    swap(k, --engaged_);
  }

  void set_force(int k) noexcept { forces_.set(k, place(k).force); }
  [[nodiscard]] Vector3<> displacement(int k) const noexcept { return copy_.displacement(k, forces_, engaged_); }

  /// Second set of forces: set it for every engaged place, then call finish_scratch().
  void finish_scratch() noexcept {
    for (int k = engaged_; k % 8 != 0; ++k) scratch_.set(k, Vector3<>::Zero());
  }
  void set_scratch(int k, const Vector3<>& force) noexcept { scratch_.set(k, force); }
  [[nodiscard]] Vector3<> scratch_displacement(int k) const noexcept { return copy_.displacement(k, scratch_, engaged_); }
  /// See NearCompliance::along(); unit forces along the vectors in the second set.
  void along(int k, const Vector3<>& direction, float* out) const noexcept { copy_.along(k, direction, scratch_, engaged_, out); }

 private:
  static constexpr double margin = 0.15;
  static constexpr int max_pending = 1024;
  struct Pending {
    std::int32_t node;
    double gap;
  };

  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  /// Distance of a node's patch from the tip, m, with the node anywhere between rest and the mean displacement.
  [[nodiscard]] double gap(const TipGeometry& tip, const PatchPoints& points, std::int32_t node) const noexcept {
    const Vector3<> y = nodes_->point(node) - listed_center_;
    double least = tip.distance(y);
    if (listed_deflection_.squaredNorm() > 0.0)
      for (const double share : {0.5, 1.0}) least = std::min(least, tip.distance(y + share * listed_deflection_));
    return least - points.reach(node);
  }

  void drop_far(const TipGeometry& tip, const PatchPoints& points, double beyond) noexcept {
    for (int k = count_ - 1; k >= engaged_; --k) {
      if (gap(tip, points, place(k).node) <= beyond) continue;
      swap(k, count_ - 1);
      place_of_[at(place(--count_).node)] = -1;
    }
  }

  /// List the nodes within `ahead` [m] of the tip that have no place.
  void list(const TipGeometry& tip, const PatchPoints& points, double ahead) noexcept {
    const double shaft = tip.shape == TipGeometry::Shape::capsule ? tip.length : 2.0 * tip.radius + listed_deflection_.norm();
    Vector3<> low = listed_center_, high = listed_center_;
    const Vector3<> other = listed_center_ + shaft * tip.axis;
    for (const Vector3<>& p : {other, Vector3<>(listed_center_ - listed_deflection_), Vector3<>(other - listed_deflection_)}) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    pending_count_ = 0;
    nodes_->query_box(low, high, tip.radius + ahead + points.max_reach(), [&](std::int32_t node) {
      if (place_of_[at(node)] >= 0 || pending_count_ == max_pending) return;
      const double distance = gap(tip, points, node);
      if (distance < ahead) pending_[at(pending_count_++)] = {node, distance};
    });
  }

  void enter(std::int32_t node) noexcept {
    place_of_[at(node)] = count_;
    place(count_) = {};
    place(count_).node = node;
    node_[at(count_)] = node;
    forces_.set(count_, Vector3<>::Zero());
    ++count_;
    copy_.enter(*compliance_, node_.data(), count_);
  }

  void swap(int k, int l) noexcept {
    if (k == l) return;
    std::swap(places_[at(k)], places_[at(l)]);
    std::swap(node_[at(k)], node_[at(l)]);
    place_of_[at(node_[at(k)])] = k;
    place_of_[at(node_[at(l)])] = l;
    set_force(k);
    set_force(l);
    copy_.swap(k, l, count_);
  }

  const SurfaceNodes* nodes_;
  const FullCompliance* compliance_;
  std::vector<std::int32_t> place_of_;  // by node; -1: none
  int count_ = 0, engaged_ = 0, pending_count_ = 0;
  double travelled_ = 0.0;  // way of the tip times 2.5, m
  Vector3<> listed_center_ = Vector3<>::Zero(), listed_deflection_ = Vector3<>::Zero();
  std::array<Place, static_cast<std::size_t>(capacity)> places_;
  std::array<std::int32_t, static_cast<std::size_t>(capacity)> node_{};
  std::array<Pending, static_cast<std::size_t>(max_pending)> pending_;
  NearCompliance copy_;
  PlaceForces forces_, scratch_;
};

}  // namespace palpate::deformable
