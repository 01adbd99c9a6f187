#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/layer_point.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Triangles of a local model that rigid tips press: the forces and the stiffness of the elastic layer between them (press_point). They are
/// evaluated side by side, in as many lanes as registers have.
class PressedTriangles {
 public:
  static constexpr std::size_t lanes = detail::float_lanes;
  /// Displacements of the model's nodes from its state, along their inward normals, m; those beyond the nodes are zero.
  using Displacements = std::array<float, LocalModel::capacity + 16>;
  using Scalar = detail::FloatPack;
  using PackVector = Vector3<Scalar>;

  /// Triangles side by side under a tip.
  struct Group {
    std::size_t first = 0, tip = 0;
    std::array<PackVector, 3> force;  // on the corners, N
    std::array<Scalar, 6> stiffness;  // between the corners along their directions: 00, 11, 22, 01, 12, 20, N/m
    PackVector deflection;            // of the layer's outer side, weighted by the force, N m
    Scalar total, energy;             // sum of the weights, N; J
  };

  /// Index of a node in arrays by node; nodes that do not move have the last.
  [[nodiscard]] static std::size_t slot(std::int16_t node) noexcept {
    return node < 0 ? static_cast<std::size_t>(LocalModel::capacity) : static_cast<std::size_t>(node);
  }

  /// Find the groups of triangles that the tips press at the displacements of the nodes. The model must live until the last use of the
  /// result.
  void press(const LocalModel& model, const TipPair& tips, const Displacements& displacement) noexcept {
    model_ = &model;
    tips_ = tips;
    for (std::size_t t = 0; t < TipPair::max_tips; ++t) tips_.tip[t].continued = model.continued[t];
    displacement_ = &displacement;
    count_ = 0;
    if (may_reach_others()) list_near();
    for (std::size_t k = 0; k < near_count_; ++k) press(near_[k].tip, near_[k].first);
  }

  [[nodiscard]] const Group* begin() const noexcept { return groups_.data(); }
  [[nodiscard]] const Group* end() const noexcept { return groups_.data() + count_; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

  /// Call visit(node, force along its direction) for the corners of the triangles.
  template <class Visit>
  void for_each_force(const Group& p, Visit visit) const noexcept {
    for (std::size_t c = 0; c < 3; ++c) {
      const Scalar along = detail::dot(p.force[c], model_->triangles.load_vector(LocalTriangles::direction + 3 * c, p.first));
      for (std::size_t l = 0; l < lanes; ++l) visit(slot(model_->triangles.nodes(p.first + l)[c]), along[l]);
    }
  }

  /// Whether the model is that of the body, and triangles whose contact nodes are all in it bear the forces of press().
  [[nodiscard]] bool is_complete() const noexcept {
    double beyond = 0.0, total = 0.0;
    for (const Group& p : *this)
      for (std::size_t l = 0; l < lanes; ++l) {
        const auto push = static_cast<double>(p.total[l]);
        total += push;
        if (!model_->triangles.is_complete(p.first + l)) beyond += push;
      }
    return !model_->truncated && !model_->inverted && beyond <= LocalModel::max_beyond * total;
  }

 private:
  static constexpr std::size_t max_groups = TipPair::max_tips * LocalTriangles::max_triangles / lanes;
  static constexpr double list_margin = 0.05;  // over the radius of the tip

  struct Near {
    std::size_t first = 0, tip = 0;
  };

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(model_->nodes.size()); }

  /// Corners of triangles side by side relative to a tip, and the directions in which they move.
  [[gnu::always_inline]] void place(const Tip& tip, std::size_t first, std::array<PackVector, 3>& corner,
                                    std::array<PackVector, 3>& direction) const noexcept {
    const LocalTriangles& triangles = model_->triangles;
    const PackVector center = detail::spread<Scalar>(tip.center - triangles.origin());
    for (std::size_t c = 0; c < 3; ++c) {
      Scalar moved;
      for (std::size_t l = 0; l < lanes; ++l) moved.set(l, (*displacement_)[slot(triangles.nodes(first + l)[c])]);
      direction[c] = triangles.load_vector(LocalTriangles::direction + 3 * c, first);
      corner[c] = (triangles.load_vector(LocalTriangles::position + 3 * c, first) - center) + moved * direction[c];
    }
  }

  /// Whether triangles that are not listed may be in a tip by now. A point moves in a tip by no more than the tip and its nodes move.
  [[nodiscard]] bool may_reach_others() const noexcept {
    if (listed_version_ != model_->version || listed_tips_.count != tips_.count) return true;
    Scalar most(0.0);
    for (std::size_t i = 0; i < size(); i += lanes) {
      const Scalar d = *detail::as_packs(displacement_->data() + i) - *detail::as_packs(listed_displacement_.data() + i);
      most = max_of(most, d * d);
    }
    float square = 0.0F;
    for (std::size_t l = 0; l < lanes; ++l) square = std::max(square, most[l]);
    for (std::size_t t = 0; t < at(tips_.count); ++t) {
      const Tip &now = tips_.tip[t], &then = listed_tips_.tip[t];
      if (now.kind != then.kind || now.radius != then.radius || now.outward != then.outward) return true;
      if ((now.center - then.center).norm() + static_cast<double>(std::sqrt(square)) > list_margin * now.radius) return true;
    }
    return false;
  }

  /// List the triangles that are in a tip or near it.
  void list_near() noexcept {
    listed_version_ = model_->version;
    listed_tips_ = tips_;
    listed_displacement_ = *displacement_;
    near_count_ = 0;
    std::array<PackVector, 3> corner, direction;
    for (std::size_t t = 0; t < at(tips_.count); ++t)
      for (std::size_t first = 0; first < model_->triangles.count(); first += lanes) {
        place(tips_.tip[t], first, corner, direction);
        if (within_reach(tips_.tip[t], corner, first, list_margin * tips_.tip[t].radius)) near_[near_count_++] = {first, t};
      }
  }

  /// Press triangles side by side by tip `t`.
  void press(std::size_t t, std::size_t first) noexcept {
    const LocalTriangles& triangles = model_->triangles;
    const Tip& tip = tips_.tip[t];
    std::array<PackVector, 3> corner, direction;
    place(tip, first, corner, direction);
    if (!within_reach(tip, corner, first, 0.0)) return;
    Group& p = groups_[count_];
    p.first = first;
    p.tip = t;
    const Scalar zero(0.0);
    p.force.fill(PackVector(zero, zero, zero));
    p.stiffness.fill(zero);
    p.deflection = PackVector(zero, zero, zero);
    p.total = p.energy = zero;
    std::array<Scalar, 3> share{zero, zero, zero};
    const PackVector normal = triangles.load_vector(LocalTriangles::normal, first);
    bool touched = false;
    const std::size_t row = tip.kind == Tip::Kind::flat ? LocalTriangles::flat_stiffness : LocalTriangles::round_stiffness;
    const Scalar cone = triangles.load(LocalTriangles::cone + t, first);
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t next = (c + 1) % 3, last = (c + 2) % 3;
      const Scalar stiffness = triangles.load(row + c, first), radius = triangles.load(LocalTriangles::radius + c, first);
      const Scalar inverse = Scalar(1.0) / (Scalar(LayerConstants::scale) * radius);
      for (const CornerPoint& q : corner_points) {
        const Scalar own_weight(q.own), next_weight(q.next), last_weight(q.last);
        const PackVector y = own_weight * corner[c] + next_weight * corner[next] + last_weight * corner[last];
        if (tip.kind == Tip::Kind::sphere && !any(may_be_in_sphere(tip, y))) continue;
        const PointContact<Scalar> contact = press_point<Scalar>(tip, y, normal, {Scalar(q.share) * stiffness, radius, inverse, cone});
        if (!any(contact.stiffness > zero)) continue;
        touched = true;
        p.energy += contact.energy;
        p.total += contact.push;
        p.deflection += (contact.push * contact.depth) * contact.away;
        p.force[c] += own_weight * contact.force;
        share[c] += own_weight * contact.push;
        const Scalar along = own_weight * detail::dot(contact.away, direction[c]), stiff = contact.stiffness * along;
        p.stiffness[c] += stiff * along;
        if (q.own == 1.0) continue;
        p.force[next] += next_weight * contact.force;
        p.force[last] += last_weight * contact.force;
        share[next] += next_weight * contact.push;
        share[last] += last_weight * contact.push;
        const Scalar along_next = next_weight * detail::dot(contact.away, direction[next]);
        const Scalar along_last = last_weight * detail::dot(contact.away, direction[last]);
        const Scalar stiff_last = contact.stiffness * along_last;
        p.stiffness[next] += contact.stiffness * along_next * along_next;
        p.stiffness[last] += stiff_last * along_last;
        p.stiffness[3 + c] += stiff * along_next;
        p.stiffness[3 + next] += stiff_last * along_next;
        p.stiffness[3 + last] += stiff_last * along;
      }
    }
    if (!touched) return;
    const PackVector center = detail::spread<Scalar>(tip.center - triangles.origin());
    for (std::size_t c = 0; c < 3; ++c)
      p.deflection += share[c] * (triangles.load_vector(LocalTriangles::displacement + 3 * c, first) +
                                  (corner[c] + center - triangles.load_vector(LocalTriangles::position + 3 * c, first)));
    ++count_;
  }

  /// Whether any of the triangles may be in the tip.
  [[nodiscard, gnu::always_inline]] bool within_reach(const Tip& tip, const std::array<PackVector, 3>& corner, std::size_t first,
                                                      double margin) const noexcept {
    const PackVector center = Scalar(1.0 / 3.0) * (corner[0] + corner[1] + corner[2]);
    Scalar reach(0.0), size(0.0);
    for (std::size_t c = 0; c < 3; ++c) {
      const PackVector arm = corner[c] - center;
      reach = max_of(reach, detail::dot(arm, arm));
      size = max_of(size, model_->triangles.load(LocalTriangles::radius + c, first));
    }
    return any(depth_in_tip<Scalar>(tip, center, center, size).depth + sqrt(reach) > Scalar(-margin));
  }

  alignas(64) Displacements listed_displacement_{};  // when the list was made
  std::array<Group, max_groups> groups_;
  std::array<Near, max_groups> near_{};
  const LocalModel* model_ = nullptr;
  const Displacements* displacement_ = nullptr;
  std::size_t count_ = 0, near_count_ = 0;
  long listed_version_ = -1;  // state of the list
  TipPair tips_, listed_tips_;
};

}  // namespace palpate::deformable
