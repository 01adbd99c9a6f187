#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "palpate/deformable/multirate/energy_tank.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/deformable/multirate/local_model_contact.hpp"
#include "palpate/math/triple_buffer.hpp"

namespace palpate::deformable {

/// What the tips do to a contact node.
struct NodePush {
  double along = 0.0;                   ///< force along the inward normal, N
  Vector3<> force = Vector3<>::Zero();  ///< N
  double layer_stiffness = 0.0;         ///< of the points of the elastic layer in contact, along the normal, N/m; infinite without a layer
};

/// Contact of the servo with a sequence of local models that arrive at a low rate, passive across the model switches.
///
/// From model a to model b the potential is blended as (1 - s) V_a + s V_b. s rises from 0 to 1 in the time that the last model took to
/// arrive. At constant s no closed path gains work. A change ds changes the recoverable energy by ds (V_b - V_a): a decrease fills an
/// energy tank, an increase is taken from it, and s stops while the tank is empty. At every instant
///   work of the tips on the body = V + tank level,  both nonnegative,
/// so the tips never extract more energy than they supplied. A model that needs more energy is first stiffened about its state, by a factor
/// of up to two: the forces at the state stay, the recoverable energy decreases. When the last tip has left the body, the tank keeps at
/// most the energy that the body still has (LocalModel::returnable): nothing for a quasi-static elastic body. With inertia or
/// relaxation this is the energy of the swing or of the overstress, and it bounds what the body returns to a tip.
///
/// The forces of a model lag behind the tips: where the surface turns under a tip, they push it along, and each new model needs more
/// energy. Where the tank cannot supply it, the forces of an earlier model remain. Forces that differ for long from those of the newest
/// model count as not found (check_supply).
///
/// Forces that were not found have an energy without meaning. They fill no tank, and are scaled down so that the tips could have supplied
/// the energy.
///
/// `Contact` is that of the tips with one local model, e.g. LocalModelContact or LinearLocalContact:
///   Model                                             local model, with empty(), has_memory and returnable
///   const MultiTipResult& solve(model, tips, scale)   forces and potential; `scale` multiplies the compliance about the model's state
///   void start_from(model, other)                     start the next solution from the forces of another contact
///   const MultiTipResult& last()                      of the last call of solve()
///   contact_nodes(), forces(), node_force(k)          contact nodes in ascending order, and the forces on them, N
///   layer_stiffness(k)                                of the elastic layer at a contact node, N/m, see NodePush
template <class Contact>
class BasicPassiveModelSwitch {
 public:
  using Model = typename Contact::Model;
  using ModelBuffer = TripleBuffer<Model, 3>;

  BasicPassiveModelSwitch() = default;
  /// `make()` returns a contact.
  template <class Make>
  explicit BasicPassiveModelSwitch(const Make& make)
      : slots_{ModelSlot{0, 1.0, make()}, ModelSlot{1, 1.0, make()}, ModelSlot{2, 1.0, make()}} {}

  /// Advance by one period with the tips at their present positions. Accepts a model from `models` when the last one is fully blended in.
  const MultiTipResult& step(ModelBuffer& models, const TipPair& tips) noexcept {
    const double supplied = work_to(tips);
    const EnergyTank before = tank_;
    if (!is_waiting_) ++ticks_since_model_;
    is_waiting_ = models.has_new();
    if (is_waiting_ && (tank_.blend >= 1.0 || tank_.empty)) accept_model(models, tips);
    const MultiTipResult& b = solve(models, current_, tips);
    if (tank_.blend < 1.0) {
      blend_models(models, tips, solve(models, previous_, tips), b);
    } else {
      result_ = b;
      tank_.empty = false;
    }
    force_scale_ = 1.0;
    if (!result_.solved) limit(tips, before.potential + before.level - tank_.level + 0.5 * supplied);
    tank_.potential = result_.energy;
    check_supply();
    last_tips_ = tips;
    if (result_.nodes == 0)
      leave(current_model(models));
    else
      models_since_contact_ = 0;
    return result_;
  }

  /// Start under tips at rest, one tick before the first step, with the energy that the body holds beyond the potential in the tank.
  void start(ModelBuffer& models, const TipPair& tips) noexcept {
    last_tips_.count = 0;
    step(models, tips);
    ticks_since_model_ = -1;
    if (current_model(models).has_memory) tank_.level = std::max(current_model(models).returnable - tank_.potential, 0.0);
  }

  [[nodiscard]] const MultiTipResult& last() const noexcept { return result_; }
  [[nodiscard]] const EnergyTank& tank() const noexcept { return tank_; }

  /// Call visit(node, NodePush) for each contact node, ascending.
  template <class Visit>
  void for_each_contact_node(Visit visit) const noexcept {
    const double s = tank_.blend;
    ContactCursor one(slots_[static_cast<std::size_t>(previous_)], force_scale_ * (1.0 - s));
    ContactCursor two(slots_[static_cast<std::size_t>(current_)], force_scale_ * s);
    while (one || two) {
      const std::int32_t node = !two || (one && one.node() < two.node()) ? one.node() : two.node();
      NodePush push;
      for (ContactCursor* cursor : {&one, &two})
        if (*cursor && cursor->node() == node) cursor->add(push);
      visit(node, push);
    }
  }

  [[nodiscard]] const Model& current_model(ModelBuffer& models) const noexcept {
    return models.read_slot(slots_[static_cast<std::size_t>(current_)].slot);
  }
  [[nodiscard]] const Contact& current_contact() const noexcept { return slots_[static_cast<std::size_t>(current_)].contact; }

 private:
  struct ModelSlot {
    int slot = 0;
    double compliance_scale = 1.0;  // of the model's compliance
    Contact contact;
  };

  /// Iterates over the contact nodes of a model slot with blend weight `weight`.
  class ContactCursor {
   public:
    ContactCursor(const ModelSlot& slot, double weight) noexcept
        : contact_(&slot.contact), weight_(weight), count_(weight > 0.0 ? contact_->last().nodes : 0) {}
    explicit operator bool() const noexcept { return at_ < count_; }
    [[nodiscard]] std::int32_t node() const noexcept { return contact_->contact_nodes()[at_]; }
    void add(NodePush& to) noexcept {
      to.along += weight_ * contact_->forces()[at_];
      to.force += weight_ * contact_->node_force(at_);
      to.layer_stiffness += weight_ * contact_->layer_stiffness(at_);
      ++at_;
    }

   private:
    const Contact* contact_;
    double weight_;
    int count_, at_ = 0;
  };

  /// Work of the tips on the body from the last tick to this one under the present forces, J.
  [[nodiscard]] double work_to(const TipPair& tips) const noexcept {
    double work = 0.0;
    for (std::size_t t = 0; t < static_cast<std::size_t>(std::min(tips.count, last_tips_.count)); ++t)
      work -= result_.tip[t].force.dot(tips.tip[t].center - last_tips_.tip[t].center);
    return work;
  }

  /// Scale the forces down if they have more energy than `available` [J] and half the work of this tick under them.
  void limit(const TipPair& tips, double available) noexcept {
    const double missing = result_.energy - 0.5 * work_to(tips);
    if (last_tips_.count == 0 || missing <= available) return;
    force_scale_ = std::isfinite(missing) ? std::max(available, 0.0) / missing : 0.0;
    for (std::size_t t = 0; t < static_cast<std::size_t>(tips.count); ++t) {
      ContactResult& tip = result_.tip[t];
      tip.force = force_scale_ > 0.0 ? Vector3<>(force_scale_ * tip.force) : Vector3<>::Zero();
      tip.energy = force_scale_ > 0.0 ? force_scale_ * tip.energy : 0.0;
    }
    result_.energy = force_scale_ > 0.0 ? force_scale_ * result_.energy : 0.0;
  }

  [[nodiscard]] bool is_solved(int slot) const noexcept { return slots_[static_cast<std::size_t>(slot)].contact.last().solved; }

  /// Count the forces as not found if they have differed from those of the newest model for long, because the tank is empty.
  void check_supply() noexcept {
    const MultiTipResult& newest = slots_[static_cast<std::size_t>(is_refused_ ? spare_ : current_)].contact.last();
    double apart = 0.0, total = 0.0;
    for (std::size_t t = 0; t < result_.tip.size(); ++t) {
      apart += (newest.tip[t].force - result_.tip[t].force).norm();
      total += newest.tip[t].force.norm();
    }
    is_refused_ = is_refused_ && tank_.empty;
    const int most = tolerated_blends * blend_ticks_ + tolerated_ticks, change = tank_.empty && apart > tolerated_lag * total ? 1 : -1;
    lagging_ticks_ = result_.nodes == 0 ? 0 : std::clamp(lagging_ticks_ + change, 0, most + 1);
    if (lagging_ticks_ <= most) return;
    result_.solved = false;
    for (ContactResult& tip : result_.tip) tip.solved = false;
  }

  /// Empty the tank down to the energy of the body. The first model after the contact may still be one of the body in contact.
  void leave(const Model& model) noexcept {
    const double level = models_since_contact_ > 1 ? std::min(tank_.level, model.returnable) : tank_.level;
    tank_ = {};
    if (model.has_memory) tank_.level = std::max(level, 0.0);
  }

  const MultiTipResult& solve(ModelBuffer& models, int slot, const TipPair& tips) noexcept {
    ModelSlot& s = slots_[static_cast<std::size_t>(slot)];
    return s.contact.solve(models.read_slot(s.slot), tips, s.compliance_scale);
  }

  void start_from(ModelBuffer& models, int slot, int other) noexcept {
    ModelSlot& s = slots_[static_cast<std::size_t>(slot)];
    s.contact.start_from(models.read_slot(s.slot), slots_[static_cast<std::size_t>(other)].contact);
  }

  /// Set the compliance scale of a slot and return its energy [J]. Reduces the scale while the energy exceeds `allowed`.
  double fit_energy(ModelBuffer& models, int slot, const TipPair& tips, double scale, double allowed) noexcept {
    double& applied_scale = slots_[static_cast<std::size_t>(slot)].compliance_scale;
    applied_scale = scale;
    double energy = solve(models, slot, tips).energy;
    for (int k = 0; k < 3 && energy > (1.0 + round_off) * allowed && applied_scale > min_compliance_scale; ++k) {
      applied_scale = std::max(0.98 * applied_scale * allowed / energy, min_compliance_scale);
      energy = solve(models, slot, tips).energy;
    }
    return energy;
  }

  /// Accept a new model: blend it in from now on, or, if the tank is empty, let it replace the model being blended if the tank allows.
  void accept_model(ModelBuffer& models, const TipPair& tips) noexcept {
    ++models_since_contact_;
    is_waiting_ = is_refused_ = false;
    ModelSlot& spare = slots_[static_cast<std::size_t>(spare_)];
    if (tank_.blend >= 1.0) {
      std::swap(previous_, current_);
      std::swap(current_, spare_);
      slots_[static_cast<std::size_t>(current_)].slot = models.acquire(slots_[static_cast<std::size_t>(current_)].slot);
      blend_ticks_ = std::clamp(ticks_since_model_, 1, max_blend_ticks);
      ticks_since_model_ = 0;
      const bool first = models.read_slot(slots_[static_cast<std::size_t>(previous_)].slot).empty();
      if (!first) start_from(models, current_, previous_);
      fit_energy(models, current_, tips, 1.0, first ? unlimited : solve(models, previous_, tips).energy + tank_.level);
      tank_.blend = first ? 1.0 : 0.0;
      return;
    }
    spare.slot = models.acquire(spare.slot);
    start_from(models, spare_, current_);
    const double s = tank_.blend, now = solve(models, current_, tips).energy;
    const bool known = is_solved(current_);
    const double blended = (1.0 - s) * solve(models, previous_, tips).energy + s * now;
    const double gain = s * (fit_energy(models, spare_, tips, 1.0, blended + tank_.level) - now);
    is_refused_ = gain > tank_.level;
    if (is_refused_) return;
    if (gain > 0.0 || known) tank_.level -= gain;
    std::swap(current_, spare_);
    ticks_since_model_ = 0;
  }

  void blend_models(ModelBuffer& models, const TipPair& tips, const MultiTipResult& a, const MultiTipResult& b) noexcept {
    const double more = std::min(1.0 / blend_ticks_, 1.0 - tank_.blend);
    if (more * (b.energy - a.energy) > tank_.level + round_off * b.energy) {
      const bool known = b.solved;
      const double before = b.energy, scale = slots_[static_cast<std::size_t>(current_)].compliance_scale;
      fit_energy(models, current_, tips, scale, (1.0 - tank_.blend) * a.energy + tank_.blend * before + tank_.level);
      if (b.energy < before)
        tank_.level += known ? tank_.blend * (before - b.energy) : 0.0;
      else
        fit_energy(models, current_, tips, scale, unlimited);
    }
    const double rise = b.energy - a.energy;
    tank_.empty = rise > 0.0 && more * rise > tank_.level + round_off * b.energy;
    const double step = tank_.empty ? tank_.level / rise : more;
    if (rise > 0.0 || (a.solved && b.solved)) tank_.level = std::max(tank_.level - step * rise, 0.0);
    tank_.blend += step;
    if (tank_.blend > 1.0 - 1e-9) tank_.blend = 1.0;
    const double s = tank_.blend;
    result_ = b;
    result_.energy = (1.0 - s) * a.energy + s * b.energy;
    result_.nodes = std::max(a.nodes, b.nodes);
    result_.solved = a.solved && b.solved;
    for (std::size_t t = 0; t < static_cast<std::size_t>(tips.count); ++t) {
      const ContactResult &one = a.tip[t], &two = b.tip[t];
      ContactResult& to = result_.tip[t];
      to.touching = one.touching || two.touching;
      to.force = (1.0 - s) * one.force + s * two.force;
      to.deflection = (1.0 - s) * one.deflection + s * two.deflection;
      to.energy = (1.0 - s) * one.energy + s * two.energy;
      to.nodes = std::max(one.nodes, two.nodes);
      to.solved = one.solved && two.solved;
    }
  }

  static constexpr int max_blend_ticks = 100;          // longest blend
  static constexpr double min_compliance_scale = 0.5;  // a model is stiffened by at most its inverse
  static constexpr double unlimited = 1e300;           // J
  static constexpr double round_off = 1e-12;           // of an energy
  // Lag of the forces, see check_supply(): 5 % of those of the newest model, or more for up to so many blends and ticks.
  static constexpr double tolerated_lag = 0.05;
  static constexpr int tolerated_blends = 5, tolerated_ticks = 50;

  std::array<ModelSlot, 3> slots_{ModelSlot{0, 1.0, {}}, ModelSlot{1, 1.0, {}}, ModelSlot{2, 1.0, {}}};
  int previous_ = 0, current_ = 1, spare_ = 2;
  int ticks_since_model_ = 0;  // from the last model's acceptance to the arrival of the next: a late model delays the later ones only once
  bool is_refused_ = false;    // the tank could not supply the newest model, which is the spare one
  int lagging_ticks_ = 0;      // ticks of different forces, less the others since then, see check_supply()
  bool is_waiting_ = false;    // a model has arrived, but the last one is not fully blended in
  int blend_ticks_ = 1;        // duration of the blend
  int models_since_contact_ = 0;
  MultiTipResult result_;
  TipPair last_tips_;         // none before the first step
  double force_scale_ = 1.0;  // of the forces of the last step
  EnergyTank tank_;
};

/// Of the local models of hyperelastic bodies.
using PassiveModelSwitch = BasicPassiveModelSwitch<LocalModelContact>;

}  // namespace palpate::deformable
