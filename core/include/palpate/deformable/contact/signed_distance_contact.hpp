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
#include "palpate/deformable/contact/coupled_newton.hpp"
#include "palpate/deformable/contact/layer_creep.hpp"
#include "palpate/deformable/contact/layer_friction.hpp"
#include "palpate/deformable/contact/near_compliance.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/press_points.hpp"
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
      : nodes_(&nodes),
        patches_(&patches),
        motion_(std::move(motion)),
        near_(nodes, compliance, motion_.get(), std::clamp(tips, 1, max_tips), bends),
        friction_(friction, patches) {
    if (patches.creep.delayed_ratio > 0.0) layers_ = {LayerCreep(patches.round, patches.creep), LayerCreep(patches.flat, patches.creep)};
  }
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
    for (LayerCreep& layer : layers_) layer.begin_period();
    for (int t = 0; t < near_.tip_count(); ++t) check_inside(t, !started_ || near_.tip(t).jump);
    started_ = true;
    if (near_.any_flexible()) note_start();
    predict();
    const bool converged = find_forces(jump);
    if (offset_ != nullptr) near_.admit_cleared();
    taken_over_ = false;
    sum_forces();
    check_pushed_through(jump);
    finish_tick();
    report(solved && converged);
    return results_[0];
  }

  void reset() noexcept {
    near_.clear();
    friction_.reset();
    for (LayerCreep& layer : layers_) layer.reset();
    if (motion_) motion_->reset();
    started_ = taken_over_ = false;
    if (offset_ != nullptr) offset_->release();
    last_energy_ = tick_energy_ = 0.0;
    found_ = true;
    newton_.reset();
    coupled_.reset();
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
    friction_.take_over(before.friction_);
    for (std::size_t k = 0; k < layers_.size(); ++k) {
      const auto points = k == 0 ? &ContactPatches::round : &ContactPatches::flat;
      layers_[k].take_over(before.layers_[k], patches_->*points, before.patches_->*points, node_after);
    }
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

  // of flexible bodies
  static constexpr double smallest_part = 1.0 / 16.0;  // of a tick; a part of it is not halved further
  static constexpr double snap_reach = 0.03;           // of the radius: gap of places that take part where the contact snaps
  static constexpr double unaccounted = 0.02;          // share of energy and work by which an energy may differ from their sum

  using Place = NearNodes::Place;

  /// The places in contact at the end of the last tick, or of a part of this one, and the energy of their forces, J.
  struct Equilibrium {
    struct State {
      Vector3<> force, traction, displacement;
      double layer_energy, stiffness;
      std::int32_t node;
      int tip;
    };
    std::array<State, static_cast<std::size_t>(CoupledNewton::capacity)> states;
    int count = 0;
    double energy = 0.0;

    /// State of a place, or null.
    [[nodiscard]] const State* find(const Place& p) const noexcept {
      const State* const end = states.data() + count;
      const State* const s = std::find_if(states.data(), end, [&p](const State& s) { return s.node == p.node && s.tip == p.tip; });
      return s != end ? s : nullptr;
    }
  };

  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }

  /// Move a tip. Return whether it jumps.
  bool place_tip(int t, const PlacedTip& to) noexcept {
    NearNodes::Tip& tip = near_.tip(t);
    const Vector3<> move = started_ ? Vector3<>(to.center - tip.center) : Vector3<>::Zero();
    tip.way = move.norm();
    tip.jump = !started_ || tip.way > max_smooth_move * to.shape.radius || to.shape.shape != tip.shape.shape ||
               to.shape.radius != tip.shape.radius;
    tip.points = to.shape.shape == TipGeometry::Shape::cylinder ? &patches_->flat : &patches_->round;
    tip.shape = to.shape;
    tip.center = to.center;
    tip.last_move = move;
    return tip.jump;
  }

  /// Predict the forces from the nodes' motion relative to the tips.
  void predict() noexcept {
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      const auto change = p.prediction.step(p.force, p.traction, near_.way(p), 1e-3 * near_.tip_of(p).shape.radius);
      if (change.force.squaredNorm() < p.force.squaredNorm()) p.force += change.force;
      if (friction_ && p.rubs) {
        p.traction += change.traction;
        friction_.limit(p);
      }
      near_.set_force(k);
    }
  }

  /// Find the forces. Return whether they are acceptable.
  bool find_forces(bool jump) noexcept {
    if (!near_.any_flexible()) return iterate(jump);
    crowded_ = near_.engaged() > CoupledNewton::capacity;
    bool found = !crowded_ && iterate_coupled(jump);
    if (!found) {
      found = iterate(jump) && (jump || crowded_ || is_balanced(start_, 1.0, true));
      if (!found && !jump && !crowded_) keep_start();  // unconverged forces may have any energy
    }
    found_ = found;
    return found;
  }

  /// Record the places in contact at the end of the last tick, with the layer crept to the end of this one: it creeps at once, whereas
  /// tips and body move in parts.
  void note_start() noexcept {
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      const NearNodes::Tip& tip = near_.tip_of(p);
      const Vector3<> center = tip.center - tip.last_move;
      if (!friction_) p.last_relative = p.free - p.free_change + near_.displacement(k) - center;
      p.displacement = p.last_relative + center;
      LayerCreep* const layer = layer_of(tip);
      if (layer == nullptr) continue;
      const Vector3<> at = nodes_->point(p.node) + p.last_relative;
      const PressedPoints pressed = press_points<false, detail::DoublePack>(p.node, tip, at, layer, friction_.points(p, *tip.points));
      p.layer_energy = pressed.energy;
      p.grip = {pressed.grip.stiffness, p.traction, pressed.grip.energy};
    }
    record(start_);
  }

  /// Record the places in contact, as many as CoupledNewton takes.
  void record(Equilibrium& now) const noexcept {
    now.count = std::min(near_.engaged(), CoupledNewton::capacity);
    for (int k = 0; k < now.count; ++k) {
      const Place& p = near_.place(k);
      now.states[at(k)] = {p.force, p.traction, p.displacement, p.layer_energy, p.stiffness, p.node, p.tip};
    }
    now.energy = energy_of_forces();
  }

  /// Return to the forces of an equilibrium since which places have only come into contact.
  void return_to(const Equilibrium& before) noexcept {
    while (near_.engaged() > before.count) near_.disengage(near_.engaged() - 1);
    for (int k = 0; k < before.count; ++k) set_state(k, before.states[at(k)]);
  }

  /// Find the forces by CoupledNewton. Return whether they are found.
  bool iterate_coupled(bool jump) noexcept {
    iterations_ = 0;
    coupled_.begin_tick();
    return_to(start_);
    if (!(jump ? solve_from_forces(false) || solve_from_forces(true) : follow_motions())) {
      keep_start();
      return false;
    }
    release_untouched();
    tick_energy_ = energy_of_forces();
    return true;
  }

  /// Solve from the displacements by the present forces on.
  bool solve_from_forces(bool damped) noexcept {
    for (int k = 0; k < near_.engaged(); ++k) move_node(k);
    return engage_and_solve(damped);
  }

  /// Follow the equilibrium over the tick's motions of tips and body, in parts where Newton's method leads to none or to another one. Only
  /// within the smallest part may the contact snap. Return whether it is found to the end. The tips and the free body are then there.
  bool follow_motions() noexcept {
    const Equilibrium* before = &start_;
    double done = 0.0, reached = 1.0, part = 1.0;
    for (bool damped = false;;) {
      move_by(done + part - reached);
      reached = done + part;
      for (int k = 0; k < before->count; ++k) {
        Place& p = near_.place(k);
        p.displacement = before->states[at(k)].displacement + part * near_.tip_of(p).last_move;
      }
      if (engage_and_solve(damped) && is_balanced(*before, part, damped)) {
        if (reached == 1.0) return true;  // exact: the parts are sums of powers of two
        record(part_);
        before = &part_;
        done = reached;
        part = std::min(2.0 * part, 1.0 - done);
        damped = false;
        continue;
      }
      return_to(*before);
      if (damped) {
        move_by(1.0 - reached);
        return false;
      }
      damped = part <= smallest_part;
      if (!damped) part *= 0.5;
    }
  }

  /// Move the tips and the free body by a share of this tick's motions.
  void move_by(double share) noexcept {
    if (share == 0.0) return;
    for (int t = 0; t < near_.tip_count(); ++t) near_.tip(t).center += share * near_.tip(t).last_move;
    for (int k = 0; k < near_.count(); ++k) near_.place(k).free += share * near_.place(k).free_change;
  }

  /// Return to the forces of the last tick, and to its places in contact.
  void keep_start() noexcept {
    for (int k = near_.engaged() - 1; k >= 0; --k)
      if (start_.find(near_.place(k)) == nullptr) near_.disengage(k);
    for (int k = near_.engaged(); k < near_.count() && near_.engaged() < start_.count; ++k)
      if (start_.find(near_.place(k)) != nullptr) near_.engage(k);
    for (int k = 0; k < near_.engaged(); ++k) set_state(k, *start_.find(near_.place(k)));
    for (int k = 0; k < near_.engaged(); ++k) {
      move_node(k);
      near_.place(k).grip = law(near_.place(k), near_.place(k).displacement).grip;
    }
    tick_energy_ = energy_of_forces();
  }

  void set_state(int k, const Equilibrium::State& state) noexcept {
    Place& p = near_.place(k);
    p.force = state.force;
    p.traction = state.traction;
    p.layer_energy = state.layer_energy;
    p.stiffness = state.stiffness;
    near_.set_force(k);
  }

  /// Let the places close to their tips take part: where the contact snaps, they hold the body before it is in another equilibrium.
  void engage_close() noexcept {
    for (int k = near_.engaged(); k < near_.count() && near_.engaged() < CoupledNewton::capacity / 2; ++k) {
      const Place& p = near_.place(k);
      const NearNodes::Tip& tip = near_.tip_of(p);
      if (p.barred || tip.lost) continue;
      move_node(k);
      if (gap(p, position(p)) < snap_reach * tip.shape.radius) near_.engage(k);
    }
  }

  /// Solve for the places in contact until no other place comes into contact; `damped` lets the contact snap to another equilibrium. Return
  /// whether that ended.
  bool engage_and_solve(bool damped) noexcept {
    if (damped) engage_close();
    for (int round = 0; round < max_iterations; ++round) {
      const int before = near_.engaged();
      for (int k = before; (round > 0 || before == 0) && k < near_.count(); ++k) {
        if (near_.tip_of(near_.place(k)).lost) continue;
        move_node(k);
        press_node(k);
        if (!near_.place(k).barred && near_.place(k).stiffness > 0.0) near_.engage(k);
      }
      if (round > 0 && near_.engaged() == before) return true;
      crowded_ = near_.engaged() > CoupledNewton::capacity;
      if (crowded_) return false;
      if (!coupled_.solve(near_, damped, [this](int k, const Vector3<>& u) { return law(near_.place(k), u); })) return false;
      iterations_ += coupled_.iterations();
      if (damped) near_.look_on(true);  // a body that snaps may come to other tips
    }
    return false;
  }

  /// Find the forces by ContactNewton and sweeps of friction. Return whether they are acceptable.
  bool iterate(bool thorough) noexcept {
    double lowest = std::numeric_limits<double>::infinity(), last_error = 0.0;
    int halvings = 0;
    bool factored = false, brief = friction_ && !thorough;
    for (int t = 0; t < near_.tip_count(); ++t)
      brief = brief && (near_.engaged(t) == 0 || near_.tip(t).way > brief_move * near_.tip(t).shape.radius);
    for (int k = 0; k < near_.engaged(); ++k) near_.place(k).change.setZero();
    for (iterations_ = 1; iterations_ <= max_iterations; ++iterations_) {
      const double energy = evaluate(thorough);
      if (!friction_ && energy > lowest + 1e-6 * std::abs(lowest) && halvings < 3) {
        ++halvings;
        halve_last_change();
        continue;
      }
      lowest = energy;
      halvings = 0;
      if (newton_.assemble(near_) || !factored) factored = newton_.factor(near_);
      if (!factored) break;
      double error = newton_.step(near_);
      if (friction_) error = std::max(error, 0.3 * friction_.sweep(near_) / (ContactNewton::tolerance * newton_.force().norm() + 1e-30));
      factored = iterations_ < 3 || error < 0.3 * last_error;
      last_error = error;
      if (error <= (!brief ? 1.0 : iterations_ == 1 ? rubbing : slipping)) break;
    }
    iterations_ = std::min(iterations_, max_iterations);
    tick_energy_ = friction_ ? energy_of_forces(true) : lowest < std::numeric_limits<double>::infinity() ? lowest : 0.0;
    return last_error <= (brief ? slipping : acceptable);
  }

  /// Force at a place with the displacement `u` [m]. PointTractions records the stiffness of its points there.
  [[nodiscard]] CoupledNewton::Force law(const Place& p, const Vector3<>& u) noexcept {
    const NearNodes::Tip& tip = near_.tip_of(p);
    const Vector3<> at = nodes_->point(p.node) + u - tip.center;
    const PressedPoints pressed = press_points<false, detail::DoublePack>(p.node, tip, at, layer_of(tip), friction_.points(p, *tip.points));
    CoupledNewton::Force f{.normal = pressed.force, .stiffness = pressed.stiffness, .energy = pressed.energy, .grip = pressed.grip};
    if (friction_) f.traction = friction_.traction_at(p, u - tip.center, f.normal, f.grip);
    return f;
  }

  /// Energy that the forces have stored in the body and in the layers, in shear as well, J. `are_moved`: the places are where these forces
  /// displace them.
  [[nodiscard]] double energy_of_forces(bool are_moved = false) const noexcept {
    double energy = 0.0;
    for (int k = 0; k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      const Vector3<> moved = are_moved ? Vector3<>(p.displacement - p.free) : near_.displacement(k);
      energy += p.layer_energy + 0.5 * (p.force + p.traction).dot(moved);
      if (friction_) energy += friction_.energy(p);
    }
    return energy;
  }

  /// Whether the work of the motions over a `part` of the tick accounts for the change of the energy since its begin. The work lies between
  /// those of the first and of the last forces. Contact that snaps dissipates and `may_drop`, and so does friction; another solution, with
  /// the tips deep in the body, has too much. After forces that were not found the balance is rough.
  [[nodiscard]] bool is_balanced(const Equilibrium& before, double part, bool may_drop) const noexcept {
    double first = 0.0, last = 0.0, rubbed = 0.0;
    for (int k = 0; k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      const Vector3<> way = part * near_.way(p);
      last -= (p.force + p.traction).dot(way);
      const Equilibrium::State* const s = before.find(p);
      if (s == nullptr) continue;
      first -= (s->force + s->traction).dot(way);
      rubbed += 0.5 * (p.traction + s->traction).norm() * (p.displacement - s->displacement - part * near_.tip_of(p).last_move).norm();
    }
    const double allowed = (found_ ? unaccounted : 1.0) * (before.energy + std::abs(std::max(first, last)));
    const double change = energy_of_forces() - before.energy;
    return change <= std::max(first, last) + allowed && (may_drop || change >= std::min(first, last) - rubbed - allowed);
  }

  /// Release the places out of contact.
  void release_untouched() noexcept {
    for (int k = near_.engaged() - 1; k >= 0; --k)
      if (near_.place(k).stiffness == 0.0) near_.disengage(k);
    for (int k = 0; k < near_.engaged(); ++k) near_.set_clearance(k, 0.0, Vector3<>::Zero());
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
    if (!friction_ || iterations_ == 1)                        // afterwards friction has moved them
      for (int k = 0; k < near_.engaged(); ++k) move_node(k);  // a loop of its own: the processor works on several nodes at once
    for (int k = near_.engaged() - 1; k >= 0; --k) {
      energy += press_node(k);
      const Place& p = near_.place(k);
      if (p.stiffness == 0.0 && p.force.squaredNorm() == 0.0) near_.disengage(k);
    }
    for (int k = near_.engaged(); k < near_.count(); ++k) {
      if ((!thorough && near_.certainly_clear(k, iterations_ > 1)) || near_.tip_of(near_.place(k)).lost) continue;
      move_node(k);
      const double pressed = press_node(k);
      if (near_.place(k).barred) continue;
      energy += pressed;
      if (near_.place(k).stiffness > 0.0) near_.engage(k);
    }
    return energy;
  }

  /// Position of a place relative to its tip, m.
  [[nodiscard]] Vector3<> position(const Place& p) const noexcept {
    return nodes_->point(p.node) + p.displacement - near_.tip_of(p).center;
  }
  /// Distance of a place's patch from its tip, m, with the place at the position `at`.
  [[nodiscard]] double gap(const Place& p, const Vector3<>& at) const noexcept {
    const NearNodes::Tip& tip = near_.tip_of(p);
    return tip.shape.distance(at) - tip.points->reach(p.node);
  }

  void move_node(int k) noexcept { near_.place(k).displacement = near_.place(k).free + near_.displacement(k); }

  /// Evaluate the resultant and the stiffness of a node's points. Return the energy of its force and its points.
  double press_node(int k) noexcept {
    Place& p = near_.place(k);
    const NearNodes::Tip& tip = near_.tip_of(p);
    const Vector3<> at = position(p);
    double clear = 0.0;
    if (k >= near_.engaged()) {
      if (near_.still_clear(k, at)) return 0.0;
      clear = gap(p, at);
    }
    const PressedPoints pressed = clear > 0.0 ? PressedPoints{.clearance = clear}
                                              : press_points<false>(p.node, tip, at, layer_of(tip), friction_.points(p, *tip.points));
    p.target = pressed.force;
    p.stiffness = pressed.stiffness;
    p.grip = pressed.grip;
    p.layer_energy = pressed.energy;
    near_.set_clearance(k, std::max(pressed.clearance, 0.0), at);
    return p.layer_energy + 0.5 * p.force.dot(p.displacement - p.free);
  }

  /// Creep of the layer under a tip, or null.
  [[nodiscard]] LayerCreep* layer_of(const NearNodes::Tip& tip) noexcept {
    LayerCreep& layer = layers_[tip.points == &patches_->flat ? 1 : 0];
    return layer.active() ? &layer : nullptr;
  }

  /// Record the creep of a place's layer at the end of the period.
  void settle_layer(Place& p) noexcept {
    const NearNodes::Tip& tip = near_.tip_of(p);
    LayerCreep* const layer = layer_of(tip);
    if (layer == nullptr) return;
    p.layer_energy = press_points<true>(p.node, tip, position(p), layer).energy;
    layer->mark(p.node);
  }

  /// Find out whether a tip is inside the body at rest without contact; keep that until it is outside and clear of the surface.
  void check_inside(int t, bool first) noexcept {
    NearNodes::Tip& tip = near_.tip(t);
    if (tip.lost) {
      const int nearest = near_.nearest(t, false);
      if (nearest < 0 ? !first : !(height_over(near_.place(nearest).node, tip) > 0.0 && clear_of_rest(t))) return;
      tip.lost = false;
    }
    if (near_.engaged(t) > 0) return;
    std::int32_t node = -1;
    if (const int nearest = near_.nearest(t, false); nearest >= 0)
      node = near_.place(nearest).node;
    else if (first)
      node = nodes_->nearest(tip.center, std::numeric_limits<float>::max());
    tip.lost = node >= 0 && height_over(node, tip) < -max_sunk * tip.shape.radius && is_under(node, tip);
  }

  /// Whether a tip's center lies under the patch of a node. Beside a body that is touched on its top alone a tip may be lower than that,
  /// too.
  [[nodiscard]] bool is_under(std::int32_t node, const NearNodes::Tip& tip) const noexcept {
    const double aside = (tip.center - near_.present_point(node)).cross(nodes_->normal(node)).norm();
    return aside < std::max(tip.shape.radius, 1.5 * tip.points->reach(node));  // the corners of a patch are farther than its points
  }

  /// Whether no point of the body is in a tip that does not touch it.
  [[nodiscard]] bool clear_of_rest(int t) noexcept {
    for (int k = 0; k < near_.count(); ++k) {
      if (near_.place(k).tip != t) continue;
      move_node(k);
      press_node(k);
      if (near_.place(k).stiffness > 0.0) return false;
    }
    return true;
  }

  /// Height of a tip's center over the point of a node's patch nearest to it, at rest. Unlike the node's mean normal at a corner, the
  /// point's normal is that of its face.
  [[nodiscard]] double height_over_patch(std::int32_t node, const NearNodes::Tip& tip) const noexcept {
    const Vector3<> center = tip.center - near_.free_point(node);
    const PatchPoints& points = *tip.points;
    double least = std::numeric_limits<double>::infinity(), height = center.dot(nodes_->normal(node));
    for (std::size_t q = points.begin(node); q < points.end(node); ++q) {
      if (points.coordinate(6)[q] == 0.0F) continue;
      const Vector3<> away = center - Vector3<>(points.coordinate(0)[q], points.coordinate(1)[q], points.coordinate(2)[q]);
      if (away.squaredNorm() >= least) continue;
      least = away.squaredNorm();
      height = away.dot(Vector3<>(points.coordinate(3)[q], points.coordinate(4)[q], points.coordinate(5)[q]));
    }
    return height;
  }

  [[nodiscard]] double height_over(std::int32_t node, const NearNodes::Tip& tip) const noexcept {
    return (tip.center - near_.present_point(node)).dot(nodes_->normal(node));
  }

  /// Release the body from tips that have been pushed through. Their centers are below the surface at rest, those of flat ends by a quarter
  /// of the radius. Either the body pulls such a tip in, since it touches the tip's back alone. Or the tip's force has halved in this tick,
  /// and the energy has dropped by more than the tips' work less that of friction (energy_dropped).
  void check_pushed_through(bool jump) noexcept {
    const bool dropped = !jump && energy_dropped();
    bool released = false;
    for (int t = 0; t < near_.tip_count(); ++t) {
      NearNodes::Tip& tip = near_.tip(t);
      const bool fell = dropped && tip.force.squaredNorm() <= 0.25 * results_[at(t)].force.squaredNorm();
      if (!fell && !is_pulled_in(t)) continue;
      const int nearest = near_.nearest(t, true);
      const double sunk = tip.shape.shape == TipGeometry::Shape::capsule ? 0.0 : 0.25 * tip.shape.radius;
      if (nearest < 0 || height_over_patch(near_.place(nearest).node, tip) > -sunk) continue;
      if (!fell && !is_under(near_.place(nearest).node, tip)) continue;
      tip.lost = released = true;
      near_.release(t);
      if (near_.tip_count() == 1) tick_energy_ = 0.0;
    }
    if (!released) return;
    for (int k = 0; k < near_.engaged(); ++k) move_node(k);
    sum_forces();
  }

  /// Whether the energy has dropped in this tick by more than the tips' work less that of friction: by a tenth more, or by a half on a body
  /// with motion, whose tick has an energy of its own.
  [[nodiscard]] bool energy_dropped() const noexcept {
    double work = 0.0;
    for (int t = 0; t < near_.tip_count(); ++t) work += 0.5 * near_.tip(t).last_move.dot(near_.tip(t).force - results_[at(t)].force);
    const double drop = last_energy_ + work - rubbed() - tick_energy_, allowed = motion_ ? 0.5 : 0.1;
    return last_energy_ > 0.0 && drop > allowed * (last_energy_ + std::abs(work));
  }

  /// Whether a tip pulls the nodes that it touches along their outward normals at rest.
  [[nodiscard]] bool is_pulled_in(int t) const noexcept {
    double outward = 0.0;
    for (int k = 0; k < near_.engaged(); ++k)
      if (near_.place(k).tip == t) outward += near_.place(k).force.dot(nodes_->normal(near_.place(k).node));
    return outward > 0.0;
  }

  /// Bound on the energy that friction dissipates in this tick, J.
  [[nodiscard]] double rubbed() const noexcept {
    double work = 0.0;
    for (int k = 0; friction_ && k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      if (p.rubs) work += p.traction.norm() * (p.displacement - near_.tip_of(p).center - p.last_relative).norm();
    }
    return work;
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
    if (!friction_ && !motion_) return;
    if (friction_) friction_.finish(near_);
    double layers = 0.0;
    BodyMotion::Period period{.nodes = load_node_.data(), .forces = loads_.data()};
    for (int k = 0; k < near_.engaged(); ++k) {
      if (!friction_) move_node(k);
      Place& p = near_.place(k);
      const Vector3<> force = node_force(k);
      period.compliance_work += force.dot(p.displacement - p.free);
      period.free_work += force.dot(p.free - held_at(p.node));
      settle_layer(p);
      layers += p.layer_energy + friction_.stored_energy(p);
    }
    for (const LayerCreep& layer : layers_) layers += layer.delayed_energy();
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
      result.sliding = friction_ && friction_.sliding(t);
    }
    for (int k = 0; k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      ContactResult& result = results_[at(p.tip)];
      const double size = p.force.norm();
      total[at(p.tip)] += size;
      ++result.nodes;
      result.friction -= p.traction;
      if (friction_ || !near_.tip_of(p).shape.is_sphere()) result.moment -= lever(p, size).cross(p.force + p.traction);
      result.deflection += size * p.displacement;
      if (p.stiffness > 0.0) result.deflection += (size / p.stiffness) * p.force;
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
    return position(p);
  }

  static constexpr double max_sunk = 0.3;  // of the radius: depth of the center below the nearest node's tangent plane

  template <class T>
  using Rows = std::array<T, static_cast<std::size_t>(capacity)>;

  ContactNewton newton_;
  CoupledNewton coupled_;
  const SurfaceNodes* nodes_;
  const ContactPatches* patches_;
  std::unique_ptr<BodyMotion> motion_;
  SupportOffset* offset_ = nullptr;
  NearNodes near_;
  LayerFriction friction_;
  std::array<LayerCreep, 2> layers_;              // of the round and the flat points, or empty
  double last_energy_ = 0.0, tick_energy_ = 0.0;  // minimum of the tick's energy: last tick, this tick, J
  double stored_energy_ = 0.0;                    // of body and layers at the end of the tick, J
  std::array<PlacedTip, static_cast<std::size_t>(max_tips)> placed_{};
  std::array<ContactResult, static_cast<std::size_t>(max_tips)> results_{};
  Rows<Vector3<>> loads_{};
  Equilibrium start_, part_;  // at the end of the last tick, of a part of this one
  int iterations_ = 0, tick_ = 0;
  Rows<std::int32_t> load_node_{};
  bool started_ = false;
  bool found_ = true;        // the forces of the last tick on a flexible body
  bool taken_over_ = false;  // since the last step
  bool crowded_ = false;     // more places in contact than CoupledNewton takes
};

}  // namespace palpate::deformable
