#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/contact_newton.hpp"
#include "palpate/deformable/contact/contact_result.hpp"
#include "palpate/deformable/contact/equilibrium_path.hpp"
#include "palpate/deformable/contact/layer_contact.hpp"
#include "palpate/deformable/contact/lost_tips.hpp"
#include "palpate/deformable/contact/near_compliance.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/deformable/linear/body_motion.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Contact of rigid tips with a linear body. No direction has to be chosen.
///
/// A tip at c presses the points of the nodes' patches (PatchPoints) along its own normals. With the forces F_i on the nodes and their
/// displacements u = C F, the forces minimize one energy,
///   Pi(F; c) = 1/2 F.C F + sum over the points q of 1/2 kappa_q w_q max(0, depth(x_q + u - c))^2,
/// and the force on the tip is its negative gradient by c: closed paths that begin and end free gain no work, on any mesh. The weight w
/// falls from 1 to 0 where a point's surface looks away from the tip by 90 to 120 degrees. All tips share this energy.
///
/// Each iteration solves for one number per place, the change of its force along the direction of its points' resultant:
///   (d_i.C_ij d_j + 1/h_i) delta = right-hand side,   h_i the stiffness of the node's points in contact,
/// a positive definite system; the directions follow by fixed point. Start from the forces predicted from the tips' motion: one iteration
/// per tick is typical, `max_iterations` bound it. Friction (LayerFriction) is found between the iterations, and its tractions move the
/// nodes in all directions. Where the whole contact slips at once, the error falls slowly, by the deflection over the radius per iteration.
/// A tick of moving tips therefore ends after one or two iterations, and the next one continues. Slow and resting tips iterate further, or
/// the remaining error would do work.
///
/// On a body with memory (BodyMotion) C is the compliance of one period, and u contains the displacement at its end without force.
///
/// Beyond about one radius of depth a thick body is pushed through: the energy has no minimum near the last one. The result is then
/// `lost`, without force, until the tip is outside again. Stored energy is lost, none is gained.
class SignedDistanceContact {  // NOLINT(clang-analyzer-optin.performance.Padding): one object per body
 public:
  static constexpr int capacity = PlaceForces::capacity;  ///< places near the tips; further ones are ignored and `solved` is false
  static constexpr int max_iterations = 8;
  static constexpr int max_tips = static_cast<int>(LayerFriction::max_tips);

  /// A tip and its place.
  struct PlacedTip {
    TipGeometry shape;
    Vector3<> center = Vector3<>::Zero();  ///< m
  };

  /// The first three arguments must outlive the contact. `motion` is null for a static body; `tips` is at most `max_tips`. A body that
  /// `bends` yields somewhere, under lasting forces, much more than the layer of the contact of a round tip (NearNodes::is_flexible).
  SignedDistanceContact(const SurfaceNodes& nodes, const FullCompliance& compliance, const ContactPatches& patches,
                        DryFriction friction = {}, std::unique_ptr<BodyMotion> motion = nullptr, int tips = 1, bool bends = false)
      : motion_(std::move(motion)),
        near_(nodes, compliance, motion_.get(), std::clamp(tips, 1, max_tips), bends),
        layer_(nodes, patches, friction),
        lost_(nodes) {}
  SignedDistanceContact(const SurfaceNodes&&, const FullCompliance&, const ContactPatches&, DryFriction = {},
                        std::unique_ptr<BodyMotion> = nullptr, int = 1, bool = false) = delete;
  SignedDistanceContact(const SurfaceNodes&, const FullCompliance&&, const ContactPatches&, DryFriction = {},
                        std::unique_ptr<BodyMotion> = nullptr, int = 1, bool = false) = delete;
  SignedDistanceContact(const SurfaceNodes&, const FullCompliance&, const ContactPatches&&, DryFriction = {},
                        std::unique_ptr<BodyMotion> = nullptr, int = 1, bool = false) = delete;

  /// Advance by one period with the first tip's center at `center` [m]. Does not allocate. Other tips stay where they are.
  const ContactResult& step(const TipGeometry& tip, const Vector3<>& center) noexcept {
    placed_[0] = {tip, center};
    return step(placed_.data());
  }

  /// Advance by one period with all tips. Does not allocate. Return the result of the first one.
  const ContactResult& step(const PlacedTip* tips) noexcept {
    bool jump = !started_ || taken_over_;
    if (offset_ != nullptr) offset_->look_on();
    for (int t = 0; t < near_.tip_count(); ++t) jump = place_tip(t, tips[t]) || jump;
    const bool solved = near_.update(taken_over_);
    near_.look_on();
    layer_.begin_period();
    for (int t = 0; t < near_.tip_count(); ++t) lost_.check_inside(near_, layer_, t, !started_ || near_.tip(t).jump);
    lost_.begin(near_);
    started_ = true;
    if (near_.any_flexible()) path_.begin(near_, layer_);
    predict();
    const bool converged = find_forces(jump);
    if (offset_ != nullptr) near_.admit_cleared();
    taken_over_ = false;
    sum_forces();
    release_pushed_through(jump);
    finish_tick();
    report(solved && converged);
    return results_[0];
  }

  void reset() noexcept {
    near_.clear();
    layer_.reset();
    if (motion_) motion_->reset();
    started_ = taken_over_ = false;
    if (offset_ != nullptr) offset_->release();
    last_energy_ = tick_energy_ = 0.0;
    newton_.reset();
    path_.reset();
    results_.fill({});
  }

  /// Let the supports displace the body by `offset`, which must outlive the contact.
  void set_offset(SupportOffset* offset) noexcept {
    offset_ = offset;
    near_.set_offset(offset);
  }

  /// Continue, at rest so far, the contact `before` of the same body with other supports or touched nodes; `node_after(i)` is the node i of
  /// `before`, or -1. A node that was not touched before is not touched until the tip is clear of it, so its force begins with zero and no
  /// energy is supplied. Does not allocate.
  template <class NodeAfter>
  void take_over(const SignedDistanceContact& before, NodeAfter node_after) noexcept {
    near_.take_over(before.near_, node_after);
    layer_.take_over(before.layer_, node_after);
    placed_ = before.placed_;
    started_ = before.started_;
    taken_over_ = true;
  }

  /// Memory of the body, or null.
  [[nodiscard]] BodyMotion* motion() noexcept { return motion_.get(); }
  [[nodiscard]] const BodyMotion* motion() const noexcept { return motion_.get(); }

  [[nodiscard]] const ContactResult& last(int tip = 0) const noexcept { return results_[at(tip)]; }
  [[nodiscard]] int tip_count() const noexcept { return near_.tip_count(); }

  /// Number of iterations of the last step.
  [[nodiscard]] int iterations() const noexcept { return iterations_; }

  /// Places in contact, of all tips; with one tip they are last().nodes.
  [[nodiscard]] int contact_count() const noexcept { return near_.engaged(); }
  /// Node and tip of place k < contact_count(), and the force of the tip on the node, N.
  [[nodiscard]] std::int32_t contact_node(int k) const noexcept { return near_.place(k).node; }
  [[nodiscard]] int contact_tip(int k) const noexcept { return near_.place(k).tip; }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept { return near_.place(k).force + near_.place(k).traction; }
  /// The same without friction.
  [[nodiscard]] const Vector3<>& normal_force(int k) const noexcept { return near_.place(k).force; }

 private:
  static constexpr int far_interval = 4;           // ticks between evaluations of the motion of a node away from the tips
  static constexpr double max_smooth_move = 0.05;  // of the radius per tick; beyond it every node near the tip is evaluated
  static constexpr double acceptable = 20.0;       // times the tolerance: the next tick continues from there
  static constexpr double rubbing = 5.0;           // the same after one iteration of a tick that may be brief
  static constexpr double slipping = 50.0;         // and after two: a contact that begins to slip as a whole loses force in one tick
  static constexpr double brief_move = 5e-4;       // of the radius per tick; with friction, a tick of a tip that moves farther may be brief

  using Place = NearNodes::Place;

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] LayerFriction& friction() noexcept { return layer_.friction(); }

  /// Move a tip. Return whether it jumps.
  bool place_tip(int t, const PlacedTip& to) noexcept {
    NearNodes::Tip& tip = near_.tip(t);
    const Vector3<> move = started_ ? Vector3<>(to.center - tip.center) : Vector3<>::Zero();
    tip.way = move.norm();
    tip.jump = !started_ || tip.way > max_smooth_move * to.shape.radius || to.shape.shape != tip.shape.shape ||
               to.shape.radius != tip.shape.radius;
    tip.points = &layer_.points(to.shape);
    tip.shape = to.shape;
    tip.center = to.center;
    tip.last_move = move;
    tip.last_force = tip.force;
    tip.recent_force = std::max(tip.force.norm(), 0.95 * tip.recent_force);
    return tip.jump;
  }

  /// Predict the forces from the nodes' motion relative to the tips.
  void predict() noexcept {
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      const auto change = p.prediction.step(p.force, p.traction, near_.way(p), 1e-3 * near_.tip_of(p).shape.radius);
      if (change.force.squaredNorm() < p.force.squaredNorm()) p.force += change.force;
      if (friction() && p.rubs) {
        p.traction += change.traction;
        friction().limit(p);
      }
      near_.set_force(k);
    }
  }

  /// Find the forces. Return whether they are acceptable.
  bool find_forces(bool jump) noexcept {
    if (!near_.any_flexible()) return iterate(jump);
    bool found = path_.find(near_, layer_, jump);
    iterations_ = path_.iterations();
    if (found) {
      tick_energy_ = layer_.energy(near_);
    } else {
      const bool may_differ = jump || path_.crowded();
      found = iterate(jump) && (may_differ || path_.has_gained_nothing(near_, layer_));
      if (!found && !may_differ) {  // unconverged forces may have any energy
        path_.keep_start(near_, layer_);
        tick_energy_ = layer_.energy(near_);
      }
    }
    path_.end(found);
    return found;
  }

  /// Find the forces by ContactNewton and sweeps of friction. Return whether they are acceptable.
  bool iterate(bool thorough) noexcept {
    double lowest = std::numeric_limits<double>::infinity(), last_error = 0.0;
    int halvings = 0;
    bool factored = false, brief = friction() && !thorough;
    for (int t = 0; t < near_.tip_count(); ++t)
      brief = brief && (near_.engaged(t) == 0 || near_.tip(t).way > brief_move * near_.tip(t).shape.radius);
    for (int k = 0; k < near_.engaged(); ++k) near_.place(k).change.setZero();
    for (iterations_ = 1; iterations_ <= max_iterations; ++iterations_) {
      const double energy = evaluate(thorough);
      if (!friction() && energy > lowest + 1e-6 * std::abs(lowest) && halvings < 3) {
        ++halvings;
        halve_last_change();
        continue;
      }
      lowest = energy;
      halvings = 0;
      if (newton_.assemble(near_) || !factored) factored = newton_.factor(near_);
      if (!factored) break;
      double error = newton_.step(near_);
      if (friction()) error = std::max(error, 0.3 * friction().sweep(near_) / (ContactNewton::tolerance * newton_.force().norm() + 1e-30));
      factored = iterations_ < 3 || error < 0.3 * last_error;
      last_error = error;
      if (error <= (!brief ? 1.0 : iterations_ == 1 ? rubbing : slipping)) break;
    }
    iterations_ = std::min(iterations_, max_iterations);
    tick_energy_ = friction() ? layer_.energy(near_, true) : lowest < std::numeric_limits<double>::infinity() ? lowest : 0.0;
    return last_error <= (brief ? slipping : acceptable);
  }

  void halve_last_change() noexcept {
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      p.change *= 0.5;
      p.force -= p.change;
      near_.set_force(k);
    }
  }

  /// Evaluate the points of the engaged nodes and of the others that may have come near. Return the energy.
  double evaluate(bool thorough) noexcept {
    double energy = 0.0;
    if (!friction() || iterations_ == 1)                        // afterwards friction has moved them
      for (int k = 0; k < near_.engaged(); ++k) near_.move(k);  // a loop of its own: the processor works on several nodes at once
    for (int k = near_.engaged() - 1; k >= 0; --k) {
      energy += layer_.press(near_, k);
      const Place& p = near_.place(k);
      if (p.stiffness == 0.0 && p.force.squaredNorm() == 0.0) near_.disengage(k);
    }
    for (int k = near_.engaged(); k < near_.count(); ++k) {
      if ((!thorough && near_.certainly_clear(k, iterations_ > 1)) || near_.tip_of(near_.place(k)).lost) continue;
      near_.move(k);
      const double pressed = layer_.press(near_, k);
      if (near_.place(k).barred) continue;
      energy += pressed;
      if (near_.place(k).stiffness > 0.0) near_.engage(k);
    }
    return energy;
  }

  /// Release the body from the tips that have been pushed through.
  void release_pushed_through(bool jump) noexcept {
    const double allowed = motion_ ? 0.5 : 0.1;  // the tick of a body with motion has an energy of its own
    if (!lost_.release_pushed_through(near_, friction(), last_energy_, tick_energy_, allowed, jump)) return;
    if (near_.tip_count() == 1) tick_energy_ = 0.0;
    for (int k = 0; k < near_.engaged(); ++k) near_.move(k);
    sum_forces();
  }

  /// Sum the forces of each tip on the body, and on the first one without friction.
  void sum_forces() noexcept {
    for (int t = 0; t < near_.tip_count(); ++t) near_.tip(t).force.setZero();
    for (int k = 0; k < near_.engaged(); ++k) near_.tip(near_.place(k).tip).force += node_force(k);
  }

  /// Record the state of friction and body at the end of the tick.
  void finish_tick() noexcept {
    last_energy_ = tick_energy_;
    stored_energy_ = tick_energy_ + held_energy();
    if (!friction() && !motion_) return;
    if (friction()) friction().finish(near_);
    double layers = 0.0;
    BodyMotion::Period period{.nodes = load_node_.data(), .forces = loads_.data()};
    for (int k = 0; k < near_.engaged(); ++k) {
      if (!friction()) near_.move(k);
      Place& p = near_.place(k);
      const Vector3<> force = node_force(k);
      period.compliance_work += force.dot(p.displacement - p.free);
      period.free_work += force.dot(p.free - held_at(p.node));
      layers += layer_.settle(near_, p);
    }
    layers += layer_.delayed_energy();
    stored_energy_ = layers + 0.5 * period.compliance_work + held_energy();
    if (!motion_) return;
    period.count = gather_loads();
    stored_energy_ = layers + motion_->advance(period);
    if (offset_ != nullptr) offset_->end_period();
    stored_energy_ += held_energy();
    ++tick_;
    for (int k = 0; k < near_.count(); ++k) {
      Place& p = near_.place(k);
      if (k >= near_.engaged() && motion_->costly() && (k + tick_) % far_interval != 0 && near_.is_far(k)) continue;
      const Vector3<> by_forces = k < near_.engaged() ? p.displacement - p.free
                                  : motion_->costly() ? Vector3<>(Vector3<>::Zero())
                                                      : near_.displacement(k);
      const Vector3<> held = held_at(p.node), next = held + motion_->next_free(p.node, p.free - held, by_forces);
      p.free_change = next - p.free;
      p.free = next;
    }
  }

  /// Displacement of a node by the supports, m, and the energy of the body that they hold, J.
  [[nodiscard]] Vector3<> held_at(std::int32_t node) const noexcept {
    return offset_ != nullptr ? offset_->displacement(node) : Vector3<>(Vector3<>::Zero());
  }
  [[nodiscard]] double held_energy() const noexcept { return offset_ != nullptr ? offset_->energy() : 0.0; }

  /// List the forces of all tips by node. Return their number.
  int gather_loads() noexcept {
    int count = 0;
    for (int k = 0; k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      int a = count;
      if (near_.tip_count() > 1)
        for (a = 0; a < count && load_node_[at(a)] != p.node;) ++a;
      if (a == count) {
        load_node_[at(a)] = p.node;
        loads_[at(count++)].setZero();
      }
      loads_[at(a)] += node_force(k);
    }
    return count;
  }

  void report(bool solved) noexcept {
    std::array<double, static_cast<std::size_t>(max_tips)> total{};
    for (int t = 0; t < near_.tip_count(); ++t) {
      ContactResult& result = results_[at(t)] = {};
      result.solved = solved;
      result.lost = near_.tip(t).lost;
      result.energy = stored_energy_;
      result.force = -near_.tip(t).force;
      result.sliding = friction() && friction().sliding(t);
    }
    for (int k = 0; k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      ContactResult& result = results_[at(p.tip)];
      const double size = p.force.norm();
      total[at(p.tip)] += size;
      ++result.nodes;
      result.friction -= p.traction;
      if (friction() || !near_.tip_of(p).shape.is_sphere()) result.moment -= lever(p, size).cross(p.force + p.traction);
      result.deflection += size * p.displacement;
      if (p.stiffness > 0.0) result.deflection += (size / p.stiffness + p.crept) * p.force;
    }
    for (int t = 0; t < near_.tip_count(); ++t) {
      ContactResult& result = results_[at(t)];
      result.touching = total[at(t)] > 0.0;
      result.deflection = result.touching ? Vector3<>(result.deflection / total[at(t)]) : Vector3<>::Zero();
      near_.tip(t).deflection = result.deflection;
    }
  }

  /// Lever of a place's force about the center of its tip, m. `size` is the norm of the normal force, which passes through a sphere's
  /// center.
  [[nodiscard]] Vector3<> lever(const Place& p, double size) const noexcept {
    const NearNodes::Tip& tip = near_.tip_of(p);
    if (tip.shape.is_sphere()) return (tip.shape.radius / std::max(size, 1e-300)) * p.force;
    return layer_.position(near_, p);
  }

  template <class T>
  using Rows = std::array<T, static_cast<std::size_t>(capacity)>;

  ContactNewton newton_;
  std::unique_ptr<BodyMotion> motion_;
  SupportOffset* offset_ = nullptr;
  NearNodes near_;
  LayerContact layer_;
  EquilibriumPath path_;  // of flexible bodies
  LostTips lost_;
  double last_energy_ = 0.0, tick_energy_ = 0.0;  // minimum of the tick's energy: last tick, this tick, J
  double stored_energy_ = 0.0;                    // of body and layers at the end of the tick, J
  std::array<PlacedTip, static_cast<std::size_t>(max_tips)> placed_{};
  std::array<ContactResult, static_cast<std::size_t>(max_tips)> results_{};
  Rows<Vector3<>> loads_{};
  int iterations_ = 0, tick_ = 0;
  Rows<std::int32_t> load_node_{};
  bool started_ = false;
  bool taken_over_ = false;  // since the last step
};

}  // namespace palpate::deformable
