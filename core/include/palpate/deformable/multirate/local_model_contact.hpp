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
#include "palpate/deformable/multirate/multi_tip_result.hpp"
#include "palpate/deformable/multirate/pressed_triangles.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

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
  using Model = LocalModel;
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
    total_stiffness_ = 0.0;
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
    finish(energy, std::isfinite(energy) && error(round_off_length) <= acceptable && pressed_.is_complete());
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
  /// Stiffness of the layer's points in contact at a contact node, N/m.
  [[nodiscard]] double layer_stiffness(int k) const noexcept { return layer_stiffness_[static_cast<std::size_t>(k)]; }
  /// Displacement of a node of the model from its state, along its inward normal, m.
  [[nodiscard]] double displacement(std::size_t node) const noexcept { return static_cast<double>(displacement_[node]); }
  /// Force on a node of the model along its inward normal, N.
  [[nodiscard]] double force(std::size_t node) const noexcept { return static_cast<double>(force_[node]); }

 private:
  using Group = PressedTriangles::Group;
  static constexpr std::size_t capacity = LocalModel::capacity;
  static constexpr std::size_t lanes = PressedTriangles::lanes;
  static constexpr double tolerance = 2e-6;         // of the forces, relative to their sum
  static constexpr double step_tolerance = 1e-3;    // same, at most, after an iteration; the rest is left to the next call
  static constexpr double acceptable = 1e-2;        // same
  static constexpr double kept_rate = 0.2;          // of an error by a step, above which the factor is not kept
  static constexpr double round_off = 1e-6;         // of the energy
  static constexpr double round_off_length = 4e-9;  // of a position, m
  static constexpr int max_halvings = 6;

  template <class T>
  using ByNode = std::array<T, capacity + 1>;  // the last entry is that of nodes that do not move

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(model_->nodes.size()); }

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

  /// Sum of |F - f|, less the round-off by a position, over the sum of |F|; not a number if a force is none.
  [[nodiscard]] double error(double position) noexcept {
    float error = 0.0F, total = 0.0F;
    for (std::size_t i = 0; i < size(); ++i) {
      error += std::abs(target_[i] - force_[i]);
      total += std::abs(target_[i]);
    }
    total_force_ = static_cast<double>(total);
    const double beyond = static_cast<double>(error) - position * total_stiffness_;
    return beyond <= 0.0 ? 0.0 : beyond / (total_force_ + 1e-12);
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
      for (std::size_t i = 0; i < padded; i += lanes) *detail::as_packs(displacement_.data() + i) += change * *detail::as_packs(row + i);
    }
    displacement_[capacity] = 0.0F;
    double energy = 0.0;
    for (std::size_t i = 0; i < size(); ++i)
      if (force_[i] != 0.0F) energy += 0.5 * static_cast<double>(force_[i]) * moved(i);
    double stiffness = 0.0;
    target_.fill(0.0F);
    pressed_.press(model, *tips_, displacement_);
    for (const Group& p : pressed_) {
      energy += static_cast<double>(detail::sum_of(p.energy));
      stiffness += static_cast<double>(detail::sum_of(p.stiffness[0] + p.stiffness[1] + p.stiffness[2]));
      pressed_.for_each_force(p, [this](std::size_t node, float force) { target_[node] += force; });
    }
    total_stiffness_ = std::max(total_stiffness_, stiffness);
    target_[capacity] = 0.0F;
    return energy;
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
      for (const Group& p : pressed_) add_stiffness(p);
      for (std::size_t i = 0; i < size(); ++i)
        if (force_[i] != 0.0F || target_[i] != 0.0F) newton_.add_row(static_cast<std::int16_t>(i));
      newton_.factor(*model_, static_cast<float>(scale_));
    }
    newton_.solve([this](std::size_t i) { return target_[i] - force_[i]; }, change_);
  }

  void add_stiffness(const Group& p) noexcept {
    for (std::size_t l = 0; l < lanes; ++l) {
      const auto& nodes = model_->triangles.nodes(p.first + l);
      for (std::size_t c = 0; c < 3; ++c) {
        if (p.stiffness[c][l] > 0.0F) newton_.add(nodes[c], nodes[c], p.stiffness[c][l]);
        if (p.stiffness[3 + c][l] != 0.0F) newton_.add(nodes[c], nodes[(c + 1) % 3], p.stiffness[3 + c][l]);
      }
    }
  }

  void finish(double energy, bool solved) noexcept {
    result_ = {};
    result_.energy = energy;
    result_.solved = solved;
    if (pressed_.empty()) {
      for (ContactResult& tip : result_.tip) tip.solved = solved;
      return;
    }
    ByNode<Vector3<>>& push = node_forces_of_;
    push.fill(Vector3<>::Zero());
    ByNode<float>& stiffness = before_;  // no longer needed in this call
    stiffness.fill(0.0F);
    for (std::size_t t = 0; t < at(tips_->count); ++t) {
      ContactResult& tip = result_.tip[t];
      tip.solved = solved;
      tip_target_.fill(0.0F);
      double total = 0.0;
      for (const Group& p : pressed_) {
        if (p.tip != t) continue;
        tip.energy += static_cast<double>(detail::sum_of(p.energy));
        total += static_cast<double>(detail::sum_of(p.total));
        for (int a = 0; a < 3; ++a) tip.deflection[a] += static_cast<double>(detail::sum_of(p.deflection[a]));
        for (std::size_t c = 0; c < 3; ++c)
          for (std::size_t l = 0; l < lanes; ++l) {
            const Vector3<> force(static_cast<double>(p.force[c][0][l]), static_cast<double>(p.force[c][1][l]),
                                  static_cast<double>(p.force[c][2][l]));
            const std::size_t node = PressedTriangles::slot(model_->triangles.nodes(p.first + l)[c]);
            push[node] += force;
            stiffness[node] += p.stiffness[c][l] + p.stiffness[3 + c][l] + p.stiffness[3 + (c + 2) % 3][l];
            tip.force -= force;
          }
        pressed_.for_each_force(p, [this](std::size_t node, float force) { tip_target_[node] += force; });
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
      layer_stiffness_[k] = static_cast<double>(stiffness[i]);
    }
  }

  // Large members first: they are aligned to cache lines.
  alignas(64) PressedTriangles::Displacements displacement_{};  // v
  LocalNewton newton_;
  PressedTriangles pressed_;
  const LocalModel* model_ = nullptr;
  const TipPair* tips_ = nullptr;
  long version_ = -1;
  double scale_ = 1.0;
  double total_force_ = 0.0;      // of the last evaluation: sum of |F|, N
  double total_stiffness_ = 0.0;  // of the call's evaluations: largest sum of the diagonal of H, N/m
  double last_way_ = 0.0;         // square of the tips' way from the call before to the last, m^2
  long factored_version_ = -1;    // state of the factor
  double factored_scale_ = 1.0;
  std::array<Vector3<>, TipPair::max_tips> last_move_{Vector3<>::Zero(), Vector3<>::Zero()};  // to the last call, m
  TipPair last_tips_;
  MultiTipResult result_;
  std::array<double, capacity> contact_forces_{}, layer_stiffness_{};
  std::array<Vector3<>, capacity> node_forces_{};  // by contact node, N
  ByNode<Vector3<>> node_forces_of_{};             // of the layer, by node, N
  std::array<std::int32_t, capacity> contact_nodes_{};
  ByNode<float> force_{}, target_{}, tip_target_{};  // f, F, part of F by a tip, N
  ByNode<float> change_{}, before_{}, earlier_{};    // df, f before the step and before the call, N
  bool converged_ = false;                           // the last call, within the tolerance
};

}  // namespace palpate::deformable
