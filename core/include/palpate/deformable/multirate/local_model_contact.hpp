#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/deformable/contact/contact_result.hpp"
#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/layer_point.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/deformable/multirate/local_newton.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Result of a contact step with several tips.
struct MultiTipResult {
  std::array<ContactResult, TipPair::max_tips> tip{};
  double energy = 0.0;  ///< released when all tips leave, J
  int nodes = 0;        ///< number of contact nodes
  bool solved = true;   ///< the forces have converged, and the model has the nodes that bear them
};

/// Frictionless contact of rigid tips with a local model through the elastic layer of its surface; the tips interact through the body.
///
/// With the forces f of the nodes along their inward normals, their displacements v = v0 + C f from the state, and the points x_q(v) of the
/// surface, the forces minimize
///   Pi(f; c) = 1/2 f.C f + sum over tips and points of the energy of the layer (press_point) at x_q(v) - c,
/// and the force on a tip is -dPi/dc. Newton's method solves (I + H C) df = F(v) - f, with the forces F of the layer on the nodes and their
/// stiffness H without the curvature of the tip. It starts from the forces of the last tick, or of the model's state. Single precision
/// suffices, because displacements are relative to the state.
class LocalModelContact {
 public:
  static constexpr int max_iterations = 20;

  /// Solve for the contact forces. The compliance is scaled by `compliance_scale` about the model's state.
  const MultiTipResult& solve(const LocalModel& model, const TipPair& tips, double compliance_scale) noexcept {
    if (converged_ && model.version == version_ && compliance_scale == scale_ && are_last(tips)) return result_;
    model_ = &model;
    tips_ = &tips;
    scale_ = compliance_scale;
    if (model.version != version_) {
      adopt(model);
      for (std::size_t i = 0; i < capacity; ++i) force_[i] = static_cast<float>(model.force[i]);
    }
    predict();
    double energy = evaluate();
    double before = error(0.0);
    const double enough = std::clamp(kept_rate * before, tolerance, step_tolerance);
    for (int iteration = 0; iteration < max_iterations && before > (iteration > 0 ? enough : tolerance); ++iteration) {
      compute_change(iteration > 0);
      before_ = force_;
      float length = 1.0F;
      double next = 0.0;
      for (int halvings = 0; halvings < max_halvings; ++halvings, length *= 0.5F) {
        for (std::size_t i = 0; i < size(); ++i) force_[i] = before_[i] + length * change_[i];
        next = evaluate();
        if (next <= energy * (1.0 + round_off) + round_off_length * total_force_) break;
      }
      energy = next;
      const double now = error(0.0);
      if (now > kept_rate * before) factored_version_ = -1;
      if (iteration > 0 && now > 0.5 * before && now < step_tolerance) break;  // round-off
      before = now;
    }
    finish(energy, error(round_off_length) <= acceptable && is_complete());
    converged_ = before <= tolerance;
    return result_;
  }

  /// Start the next solution, for a new model, from the forces that another contact found with an earlier one.
  void start_from(const LocalModel& model, const LocalModelContact& other) noexcept {
    if (model.version == version_ || other.model_ == nullptr) return;
    adopt(model);
    force_.fill(0.0F);
    const LocalModel& earlier = *other.model_;
    for (std::size_t i = 0, j = 0; i < static_cast<std::size_t>(model.nodes.size()); ++i) {
      while (j < other.size() && earlier.node_ids[j] < model.node_ids[i]) ++j;
      if (j < other.size() && earlier.node_ids[j] == model.node_ids[i]) force_[i] = other.force_[j];
    }
  }

  [[nodiscard]] const MultiTipResult& last() const noexcept { return result_; }
  /// Contact nodes (surface ids, ascending), the forces on them along their inward normals [N], and the force vectors; last().nodes entries
  /// each.
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept { return contact_nodes_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return contact_forces_.data(); }
  [[nodiscard]] const Vector3<>& node_force(int k) const noexcept { return node_forces_[static_cast<std::size_t>(k)]; }
  /// Displacement of a node of the model from its state, along its inward normal, m.
  [[nodiscard]] double displacement(std::size_t node) const noexcept { return static_cast<double>(displacement_[node]); }
  /// Force on a node of the model along its inward normal, N.
  [[nodiscard]] double force(std::size_t node) const noexcept { return static_cast<double>(force_[node]); }

 private:
  using Scalar = detail::FloatPack;
  using PackVector = Vector3<Scalar>;
  static constexpr std::size_t capacity = LocalModel::capacity;
  static constexpr std::size_t lanes = detail::float_lanes;
  static constexpr std::size_t max_groups = TipPair::max_tips * LocalTriangles::max_triangles / lanes;
  static constexpr double tolerance = 2e-6;         // of the forces, relative to their sum
  static constexpr double step_tolerance = 1e-3;    // same, at most, after an iteration; the rest is left to the next call
  static constexpr double acceptable = 1e-2;        // same
  static constexpr double kept_rate = 0.2;          // of an error by a step, above which the factor is not kept
  static constexpr double round_off = 1e-6;         // of the energy
  static constexpr double round_off_length = 4e-9;  // of a position, m
  static constexpr double list_margin = 0.05;       // over the radius of the tip
  static constexpr int max_halvings = 6;

  template <class T>
  using ByNode = std::array<T, capacity + 1>;  // the last entry is that of nodes that do not move

  /// Triangles side by side under a tip.
  struct Pressed {
    std::size_t first = 0, tip = 0;
    std::array<PackVector, 3> force;  // on the corners, N
    std::array<Scalar, 6> stiffness;  // between the corners along their directions: 00, 11, 22, 01, 12, 20, N/m
    PackVector deflection;            // of the layer's outer side, weighted by the force, N m
    Scalar total, energy;             // sum of the weights, N; J
  };

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(model_->nodes.size()); }
  [[nodiscard]] static std::size_t slot(std::int16_t node) noexcept { return node < 0 ? capacity : static_cast<std::size_t>(node); }

  void adopt(const LocalModel& model) noexcept {
    version_ = model.version;
    last_tips_.count = 0;
    last_way_ = 0.0;
    converged_ = false;
  }

  /// Whether the tips are where they were in the last call.
  [[nodiscard]] bool are_last(const TipPair& tips) const noexcept {
    if (tips.count != last_tips_.count) return false;
    for (std::size_t t = 0; t < at(tips.count); ++t) {
      const Tip &now = tips.tip[t], &then = last_tips_.tip[t];
      if (now.kind != then.kind || now.radius != then.radius || now.outward != then.outward || now.center != then.center) return false;
    }
    return true;
  }

  /// Extrapolate the forces along the way of the tips since the last call.
  void predict() noexcept {
    if (last_tips_.count != tips_->count) {
      last_tips_ = *tips_;
      last_way_ = 0.0;
      return;
    }
    double way = 0.0, along = 0.0;
    for (std::size_t t = 0; t < at(tips_->count); ++t) {
      const Vector3<> move = tips_->tip[t].center - last_tips_.tip[t].center;
      way += move.squaredNorm();
      along += move.dot(last_move_[t]);
    }
    if (way == 0.0) {
      last_tips_ = *tips_;
      return;
    }
    const auto part = static_cast<float>(last_way_ > 0.0 ? std::clamp(along / last_way_, -1.0, 1.0) : 0.0);
    for (std::size_t i = 0; i < size(); ++i) {
      const float now = force_[i], next = now + part * (now - earlier_[i]);
      earlier_[i] = now;
      if (next > 0.0F && now > 0.0F) force_[i] = next;
    }
    for (std::size_t t = 0; t < at(tips_->count); ++t) last_move_[t] = tips_->tip[t].center - last_tips_.tip[t].center;
    last_way_ = way;
    last_tips_ = *tips_;
  }

  /// Sum of |F - f|, less the round-off by a position, over the sum of |F|.
  [[nodiscard]] double error(double position) noexcept {
    float error = 0.0F, total = 0.0F;
    for (std::size_t i = 0; i < size(); ++i) {
      error += std::abs(target_[i] - force_[i]);
      total += std::abs(target_[i]);
    }
    total_force_ = static_cast<double>(total);
    const double beyond = static_cast<double>(error) - position * total_stiffness_;
    return beyond > 0.0 ? beyond / (total_force_ + 1e-12) : 0.0;
  }

  /// Displacement of a node by the forces alone, m.
  [[nodiscard]] double moved(std::size_t i) const noexcept {
    return static_cast<double>(displacement_[i]) - model_->residual_displacement[i] + scale_ * model_->elastic_displacement[i];
  }

  /// Evaluate the displacements under the forces, the forces and stiffness of the layer there, and the energy, J.
  double evaluate() noexcept {
    const LocalModel& model = *model_;
    const std::size_t padded = (size() + lanes - 1) / lanes * lanes;
    for (std::size_t i = 0; i < padded; ++i) displacement_[i] = i < size() ? static_cast<float>(model.residual_displacement[i]) : 0.0F;
    for (std::size_t j = 0; j < size(); ++j) {
      const float change = static_cast<float>(scale_ * (static_cast<double>(force_[j]) - model.force[j]));
      if (change == 0.0F) continue;
      const float* row = model.row(j);
      for (std::size_t i = 0; i < padded; i += lanes) *detail::as_floats(displacement_.data() + i) += change * *detail::as_floats(row + i);
    }
    displacement_[capacity] = 0.0F;
    double energy = 0.0;
    for (std::size_t i = 0; i < size(); ++i)
      if (force_[i] != 0.0F) energy += 0.5 * static_cast<double>(force_[i]) * moved(i);
    pressed_count_ = 0;
    total_stiffness_ = 0.0;
    target_.fill(0.0F);
    if (may_reach_others()) list_near();
    for (std::size_t k = 0; k < near_count_; ++k) press(near_[k].tip, near_[k].first);
    for (std::size_t k = 0; k < pressed_count_; ++k) {
      const Pressed& p = pressed_[k];
      energy += static_cast<double>(detail::sum_of(p.energy.v));
      total_stiffness_ += static_cast<double>(detail::sum_of((p.stiffness[0] + p.stiffness[1] + p.stiffness[2]).v));
      for_each_force(p, [this](std::size_t node, float force) { target_[node] += force; });
    }
    target_[capacity] = 0.0F;
    return energy;
  }

  /// Call visit(node, force along its direction) for the corners of the triangles.
  template <class Visit>
  void for_each_force(const Pressed& p, Visit visit) const noexcept {
    for (std::size_t c = 0; c < 3; ++c) {
      const Scalar along = detail::dot(p.force[c], model_->triangles.load_vector(LocalTriangles::direction + 3 * c, p.first));
      for (std::size_t l = 0; l < lanes; ++l) visit(slot(model_->triangles.nodes(p.first + l)[c]), along.v[l]);
    }
  }

  /// Corners of triangles side by side relative to a tip, and the directions in which they move.
  [[gnu::always_inline]] void place(const Tip& tip, std::size_t first, std::array<PackVector, 3>& corner,
                                    std::array<PackVector, 3>& direction) const noexcept {
    const LocalTriangles& triangles = model_->triangles;
    const PackVector center = detail::spread<Scalar>(tip.center - triangles.origin());
    for (std::size_t c = 0; c < 3; ++c) {
      Scalar moved;
      for (std::size_t l = 0; l < lanes; ++l) moved.v[l] = displacement_[slot(triangles.nodes(first + l)[c])];
      direction[c] = triangles.load_vector(LocalTriangles::direction + 3 * c, first);
      corner[c] = (triangles.load_vector(LocalTriangles::position + 3 * c, first) - center) + moved * direction[c];
    }
  }

  /// Whether triangles that are not listed may be in a tip by now. A point moves in a tip by no more than the tip and its nodes move.
  [[nodiscard]] bool may_reach_others() const noexcept {
    if (listed_version_ != version_ || listed_tips_.count != tips_->count) return true;
    Scalar most(0.0);
    for (std::size_t i = 0; i < size(); i += lanes) {
      const Scalar d(*detail::as_floats(displacement_.data() + i) - *detail::as_floats(listed_displacement_.data() + i));
      most = max_of(most, d * d);
    }
    float square = 0.0F;
    for (std::size_t l = 0; l < lanes; ++l) square = std::max(square, most.v[l]);
    for (std::size_t t = 0; t < at(tips_->count); ++t) {
      const Tip &now = tips_->tip[t], &then = listed_tips_.tip[t];
      if (now.kind != then.kind || now.radius != then.radius || now.outward != then.outward) return true;
      if ((now.center - then.center).norm() + static_cast<double>(std::sqrt(square)) > list_margin * now.radius) return true;
    }
    return false;
  }

  /// List the triangles that are in a tip or near it.
  void list_near() noexcept {
    listed_version_ = version_;
    listed_tips_ = *tips_;
    listed_displacement_ = displacement_;
    near_count_ = 0;
    std::array<PackVector, 3> corner, direction;
    for (std::size_t t = 0; t < at(tips_->count); ++t)
      for (std::size_t first = 0; first < model_->triangles.count(); first += lanes) {
        place(tips_->tip[t], first, corner, direction);
        if (within_reach(tips_->tip[t], corner, first, list_margin * tips_->tip[t].radius)) near_[near_count_++] = {first, t};
      }
  }

  /// Press triangles side by side by tip `t`.
  void press(std::size_t t, std::size_t first) noexcept {
    const LocalTriangles& triangles = model_->triangles;
    const Tip& tip = tips_->tip[t];
    std::array<PackVector, 3> corner, direction;
    place(tip, first, corner, direction);
    if (!within_reach(tip, corner, first, 0.0)) return;
    Pressed& p = pressed_[pressed_count_];
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
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t next = (c + 1) % 3, last = (c + 2) % 3;
      const Scalar stiffness = triangles.load(LocalTriangles::stiffness + c, first),
                   radius = triangles.load(LocalTriangles::radius + c, first);
      const Scalar inverse = Scalar(1.0) / (Scalar(LayerConstants::scale) * radius);
      for (const CornerPoint& q : corner_points) {
        const Scalar own_weight(q.own), next_weight(q.next), last_weight(q.last);
        const PackVector y = own_weight * corner[c] + next_weight * corner[next] + last_weight * corner[last];
        if (tip.kind == Tip::Kind::sphere && !any(may_be_in_sphere(tip, y))) continue;
        const PointContact<Scalar> contact = press_point<Scalar>(tip, y, normal, {Scalar(q.share) * stiffness, radius, inverse});
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
    ++pressed_count_;
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
    const Scalar radius = Scalar(tip.radius) + Scalar(LayerConstants::extra) * size;
    const Scalar depth = tip.kind == Tip::Kind::sphere
                             ? depth_in_sphere<Scalar>(tip, center, center).depth
                             : TipGeometry::in_cylinder<Scalar>(center, center, tip.outward, radius, Scalar(1e-3) * radius).depth;
    return any(depth + sqrt(reach) > Scalar(-margin));
  }

  /// Whether the factor of an earlier step serves again.
  [[nodiscard]] bool is_factored() const noexcept {
    if (factored_version_ != version_ || factored_scale_ != scale_) return false;
    for (std::size_t i = 0; i < size(); ++i)
      if ((force_[i] != 0.0F || target_[i] != 0.0F) && !newton_.has_row(i)) return false;
    return true;
  }

  /// Solve (I + H C) change = F - f, with an earlier H unless `anew`.
  void compute_change(bool anew) noexcept {
    if (anew || !is_factored()) {
      factored_version_ = version_;
      factored_scale_ = scale_;
      newton_.clear();
      for (std::size_t k = 0; k < pressed_count_; ++k) add_stiffness(pressed_[k]);
      for (std::size_t i = 0; i < size(); ++i)
        if (force_[i] != 0.0F || target_[i] != 0.0F) newton_.add_row(static_cast<std::int16_t>(i));
      newton_.factor(*model_, static_cast<float>(scale_));
    }
    newton_.solve([this](std::size_t i) { return target_[i] - force_[i]; }, change_);
  }

  void add_stiffness(const Pressed& p) noexcept {
    for (std::size_t l = 0; l < lanes; ++l) {
      const auto& nodes = model_->triangles.nodes(p.first + l);
      for (std::size_t c = 0; c < 3; ++c) {
        if (p.stiffness[c].v[l] > 0.0F) newton_.add(nodes[c], nodes[c], p.stiffness[c].v[l]);
        if (p.stiffness[3 + c].v[l] != 0.0F) newton_.add(nodes[c], nodes[(c + 1) % 3], p.stiffness[3 + c].v[l]);
      }
    }
  }

  /// Whether triangles whose contact nodes are all in the model bear the force.
  [[nodiscard]] bool is_complete() const noexcept {
    double beyond = 0.0, total = 0.0;
    for (std::size_t k = 0; k < pressed_count_; ++k)
      for (std::size_t l = 0; l < lanes; ++l) {
        const auto push = static_cast<double>(pressed_[k].total.v[l]);
        total += push;
        if (!model_->triangles.is_complete(pressed_[k].first + l)) beyond += push;
      }
    return !model_->truncated && beyond <= LocalModel::max_beyond * total;
  }

  void finish(double energy, bool solved) noexcept {
    result_ = {};
    result_.energy = energy;
    result_.solved = solved;
    if (pressed_count_ == 0) {
      for (ContactResult& tip : result_.tip) tip.solved = solved;
      return;
    }
    ByNode<Vector3<>>& push = node_forces_of_;
    push.fill(Vector3<>::Zero());
    for (std::size_t t = 0; t < at(tips_->count); ++t) {
      ContactResult& tip = result_.tip[t];
      tip.solved = solved;
      tip_target_.fill(0.0F);
      double total = 0.0;
      for (std::size_t k = 0; k < pressed_count_; ++k) {
        const Pressed& p = pressed_[k];
        if (p.tip != t) continue;
        tip.energy += static_cast<double>(detail::sum_of(p.energy.v));
        total += static_cast<double>(detail::sum_of(p.total.v));
        for (int a = 0; a < 3; ++a) tip.deflection[a] += static_cast<double>(detail::sum_of(p.deflection[a].v));
        for (std::size_t c = 0; c < 3; ++c)
          for (std::size_t l = 0; l < lanes; ++l) {
            const Vector3<> force(static_cast<double>(p.force[c][0].v[l]), static_cast<double>(p.force[c][1].v[l]),
                                  static_cast<double>(p.force[c][2].v[l]));
            push[slot(model_->triangles.nodes(p.first + l)[c])] += force;
            tip.force -= force;
          }
        for_each_force(p, [this](std::size_t node, float force) { tip_target_[node] += force; });
      }
      for (std::size_t i = 0; i < size(); ++i) {
        if (!(tip_target_[i] > 0.0F)) continue;
        ++tip.nodes;
        tip.touching = true;
        tip.energy += 0.5 * static_cast<double>(tip_target_[i]) * moved(i);
      }
      if (total > 0.0) tip.deflection /= total;
    }
    for (std::size_t i = 0; i < size(); ++i) {
      if (!(target_[i] > 0.0F)) continue;
      const std::size_t k = at(result_.nodes++);
      contact_nodes_[k] = model_->node_ids[i];
      contact_forces_[k] = static_cast<double>(target_[i]);
      node_forces_[k] = push[i];
    }
  }

  struct Near {
    std::size_t first = 0, tip = 0;
  };

  // Large members first: they are aligned to cache lines.
  alignas(64) std::array<float, capacity + 16> displacement_{};         // v; the entry after the last is zero
  alignas(64) std::array<float, capacity + 16> listed_displacement_{};  // when the list was made
  LocalNewton newton_;
  std::array<Pressed, max_groups> pressed_;
  const LocalModel* model_ = nullptr;
  const TipPair* tips_ = nullptr;
  long version_ = -1;
  double scale_ = 1.0;
  double total_force_ = 0.0, total_stiffness_ = 0.0;  // of the last evaluation: sum of |F|, N, and of the diagonal of H, N/m
  double last_way_ = 0.0;                             // square of the tips' way from the call before to the last, m^2
  std::size_t pressed_count_ = 0, near_count_ = 0;
  long listed_version_ = -1, factored_version_ = -1;  // states of the list and of the factor
  double factored_scale_ = 1.0;
  std::array<Vector3<>, TipPair::max_tips> last_move_{Vector3<>::Zero(), Vector3<>::Zero()};  // to the last call, m
  TipPair last_tips_, listed_tips_;
  MultiTipResult result_;
  std::array<double, capacity> contact_forces_{};
  std::array<Near, max_groups> near_{};
  std::array<Vector3<>, capacity> node_forces_{};  // by contact node, N
  ByNode<Vector3<>> node_forces_of_{};             // of the layer, by node, N
  std::array<std::int32_t, capacity> contact_nodes_{};
  ByNode<float> force_{}, target_{}, tip_target_{};  // f, F, part of F by a tip, N
  ByNode<float> change_{}, before_{}, earlier_{};    // df, f before the step and before the call, N
  bool converged_ = false;                           // the last call, within the tolerance
};

}  // namespace palpate::deformable
