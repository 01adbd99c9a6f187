#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/coupled_newton.hpp"
#include "palpate/deformable/contact/layer_contact.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Equilibrium of the places in contact with a flexible body, followed over the motions of tips and body in a tick, by CoupledNewton. A
/// flexible body may have several equilibria; the one found is that which continues the last one, if the contact does not snap.
class EquilibriumPath {
 public:
  using Place = NearNodes::Place;

  /// Begin a tick: record the places in contact at the end of the last one, with the layer crept to the end of this one. It creeps at once,
  /// whereas tips and body move in parts.
  void begin(NearNodes& near, LayerContact& layer) noexcept {
    for (int k = 0; k < near.engaged(); ++k) {
      Place& p = near.place(k);
      const NearNodes::Tip& tip = near.tip_of(p);
      const Vector3<> center = tip.center - tip.last_move;
      if (!layer.friction()) p.last_relative = p.free - p.free_change + near.displacement(k) - center;
      p.displacement = p.last_relative + center;
      if (layer.creeps()) layer.press_at(near, p, layer.point(p) + p.last_relative);
    }
    record(near, layer, start_);
  }

  /// Find the forces of the tick, at once if a tip jumps. Return false if they are not found; they are then those of the last tick.
  bool find(NearNodes& near, LayerContact& layer, bool jump) noexcept {
    iterations_ = 0;
    crowded_ = near.engaged() > CoupledNewton::capacity;
    if (crowded_) return false;
    newton_.begin_tick();
    return_to(near, start_);
    if (!(jump ? solve_from_forces(near, layer, false) || solve_from_forces(near, layer, true) : follow_motions(near, layer))) {
      keep_start(near, layer);
      return false;
    }
    release_untouched(near);
    return true;
  }

  /// Return to the forces of the last tick, and to its places in contact.
  void keep_start(NearNodes& near, LayerContact& layer) const noexcept {
    for (int k = near.engaged() - 1; k >= 0; --k)
      if (start_.find(near.place(k)) == nullptr) near.disengage(k);
    for (int k = near.engaged(); k < near.count() && near.engaged() < start_.count; ++k)
      if (start_.find(near.place(k)) != nullptr) near.engage(k);
    for (int k = 0; k < near.engaged(); ++k) set_state(near, k, *start_.find(near.place(k)));
    for (int k = 0; k < near.engaged(); ++k) {
      near.move(k);
      near.place(k).grip = layer.law(near, near.place(k), near.place(k).displacement).grip;
    }
  }

  /// Whether the tick's work accounts for the change of the energy, but for what a contact that snaps may dissipate.
  [[nodiscard]] bool has_gained_nothing(const NearNodes& near, const LayerContact& layer) const noexcept {
    return is_balanced(near, layer, start_, 1.0, true);
  }
  /// Record whether the forces of the tick were found.
  void end(bool found) noexcept { found_ = found; }

  /// Whether more places were in contact than CoupledNewton takes.
  [[nodiscard]] bool crowded() const noexcept { return crowded_; }
  /// Number of iterations of the last find().
  [[nodiscard]] int iterations() const noexcept { return iterations_; }

  void reset() noexcept {
    found_ = true;
    newton_.reset();
  }

 private:
  static constexpr int max_rounds = 8;                 // of new places in contact
  static constexpr double smallest_part = 1.0 / 16.0;  // of a tick; a part of it is not halved further
  static constexpr double snap_reach = 0.03;           // of the radius: gap of places that take part where the contact snaps
  static constexpr double unaccounted = 0.02;          // share of energy and work by which an energy may differ from their sum
  static constexpr double rounding = 1e-6;             // of the radius: depth whose energy is not distinguished from rounding

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

  /// Record the places in contact, as many as CoupledNewton takes.
  static void record(const NearNodes& near, const LayerContact& layer, Equilibrium& now) noexcept {
    now.count = std::min(near.engaged(), CoupledNewton::capacity);
    for (int k = 0; k < now.count; ++k) {
      const Place& p = near.place(k);
      now.states[at(k)] = {p.force, p.traction, p.displacement, p.layer_energy, p.stiffness, p.node, p.tip};
    }
    now.energy = layer.energy(near);
  }

  /// Return to the forces of an equilibrium since which places have only come into contact.
  static void return_to(NearNodes& near, const Equilibrium& before) noexcept {
    while (near.engaged() > before.count) near.disengage(near.engaged() - 1);
    for (int k = 0; k < before.count; ++k) set_state(near, k, before.states[at(k)]);
  }

  static void set_state(NearNodes& near, int k, const Equilibrium::State& state) noexcept {
    Place& p = near.place(k);
    p.force = state.force;
    p.traction = state.traction;
    p.layer_energy = state.layer_energy;
    p.stiffness = state.stiffness;
    near.set_force(k);
  }

  /// Solve from the displacements by the present forces on.
  bool solve_from_forces(NearNodes& near, LayerContact& layer, bool damped) noexcept {
    for (int k = 0; k < near.engaged(); ++k) near.move(k);
    return engage_and_solve(near, layer, damped);
  }

  /// Follow the equilibrium over the tick's motions of tips and body, in parts where Newton's method leads to none or to another one. Only
  /// within the smallest part may the contact snap. Return whether it is found to the end. The tips and the free body are then there.
  bool follow_motions(NearNodes& near, LayerContact& layer) noexcept {
    const Equilibrium* before = &start_;
    double done = 0.0, reached = 1.0, part = 1.0;
    for (bool damped = false;;) {
      move_by(near, done + part - reached);
      reached = done + part;
      for (int k = 0; k < before->count; ++k) {
        Place& p = near.place(k);
        p.displacement = before->states[at(k)].displacement + part * near.tip_of(p).last_move;
      }
      if (engage_and_solve(near, layer, damped) && is_balanced(near, layer, *before, part, damped)) {
        if (reached == 1.0) return true;  // exact: the parts are sums of powers of two
        record(near, layer, part_);
        before = &part_;
        done = reached;
        part = std::min(2.0 * part, 1.0 - done);
        damped = false;
        continue;
      }
      return_to(near, *before);
      if (damped) {
        move_by(near, 1.0 - reached);
        return false;
      }
      damped = part <= smallest_part;
      if (!damped) part *= 0.5;
    }
  }

  /// Move the tips and the free body by a share of this tick's motions.
  static void move_by(NearNodes& near, double share) noexcept {
    if (share == 0.0) return;
    for (int t = 0; t < near.tip_count(); ++t) near.tip(t).center += share * near.tip(t).last_move;
    for (int k = 0; k < near.count(); ++k) near.place(k).free += share * near.place(k).free_change;
  }

  /// Let the places close to their tips take part: where the contact snaps, they hold the body before it is in another equilibrium.
  static void engage_close(NearNodes& near, const LayerContact& layer) noexcept {
    for (int k = near.engaged(); k < near.count() && near.engaged() < CoupledNewton::capacity / 2; ++k) {
      const Place& p = near.place(k);
      const NearNodes::Tip& tip = near.tip_of(p);
      if (p.barred || tip.lost) continue;
      near.move(k);
      if (LayerContact::gap(near, p, layer.position(near, p)) < snap_reach * tip.shape.radius) near.engage(k);
    }
  }

  /// Solve for the places in contact until no other place comes into contact; `damped` lets the contact snap to another equilibrium. Return
  /// whether that ended.
  bool engage_and_solve(NearNodes& near, LayerContact& layer, bool damped) noexcept {
    if (damped) engage_close(near, layer);
    for (int round = 0; round < max_rounds; ++round) {
      const int before = near.engaged();
      for (int k = before; (round > 0 || before == 0) && k < near.count(); ++k) {
        if (near.tip_of(near.place(k)).lost) continue;
        near.move(k);
        layer.press(near, k);
        if (!near.place(k).barred && near.place(k).stiffness > 0.0) near.engage(k);
      }
      if (round > 0 && near.engaged() == before) return true;
      crowded_ = near.engaged() > CoupledNewton::capacity;
      if (crowded_) return false;
      if (!newton_.solve(near, damped, [&](int k, const Vector3<>& u) { return layer.law(near, near.place(k), u); })) return false;
      iterations_ += newton_.iterations();
      if (damped) near.look_on(true);  // a body that snaps may come to other tips
    }
    return false;
  }

  /// Whether the work of the motions over a `part` of the tick accounts for the change of the energy since its begin. The work lies between
  /// those of the first and of the last forces. Contact that snaps dissipates and `may_drop`, and so does friction; another solution, with
  /// the tips deep in the body, has too much. After forces that were not found the balance is rough.
  [[nodiscard]] bool is_balanced(const NearNodes& near, const LayerContact& layer, const Equilibrium& before, double part,
                                 bool may_drop) const noexcept {
    double first = 0.0, last = 0.0, rubbed = 0.0, rounded = 0.0;
    for (int k = 0; k < near.engaged(); ++k) {
      const Place& p = near.place(k);
      const Vector3<> way = part * near.way(p);
      last -= (p.force + p.traction).dot(way);
      rounded += 0.5 * p.stiffness * std::pow(rounding * near.tip_of(p).shape.radius, 2);
      const Equilibrium::State* const s = before.find(p);
      if (s == nullptr) continue;
      first -= (s->force + s->traction).dot(way);
      rubbed += 0.5 * (p.traction + s->traction).norm() * (p.displacement - s->displacement - part * near.tip_of(p).last_move).norm();
    }
    const double allowed = (found_ ? unaccounted : 1.0) * (before.energy + std::abs(std::max(first, last))) + rounded;
    const double change = layer.energy(near) - before.energy;
    return change <= std::max(first, last) + allowed && (may_drop || change >= std::min(first, last) - rubbed - allowed);
  }

  /// Release the places out of contact.
  static void release_untouched(NearNodes& near) noexcept {
    for (int k = near.engaged() - 1; k >= 0; --k)
      if (near.place(k).stiffness == 0.0) near.disengage(k);
    for (int k = 0; k < near.engaged(); ++k) near.set_clearance(k, 0.0, Vector3<>::Zero());
  }

  CoupledNewton newton_;
  Equilibrium start_, part_;  // at the end of the last tick, of a part of this one
  int iterations_ = 0;
  bool found_ = true;  // the forces of the last tick
  bool crowded_ = false;
};

}  // namespace palpate::deformable
