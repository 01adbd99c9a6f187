#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/deformable/multirate/local_model_slip.hpp"
#include "palpate/deformable/multirate/multirate_coupling.hpp"
#include "palpate/deformable/multirate/passive_model_switch.hpp"
#include "palpate/math/latest_value.hpp"
#include "palpate/object/deformable_object.hpp"

namespace palpate::object {

/// Body at two rates in a servo loop, optionally with friction: hyperelastic, or linear (LinearBodySolver with LinearLocalSlip). In virtual
/// time a model update lasts `update_interval` ticks: it uses the tip position of the first tick and is published after the last.
///
/// `Solver` is that of MultirateCoupling, and provides
///   std::unique_ptr<Solver> clone_at_rest() const          copy at rest with its own state
///   Vector3<> normal_near(const Vector3<>& place) const    of the surface, outward; unless its contacts provide outward(tip)
/// and optionally, for an observer,
///   void displacement(double* to) const                    of all points, 3 x point + axis, m
/// `Slip` is the friction on the solver's local models, see LocalModelSlip.
template <class Solver, class Slip = deformable::LocalModelSlip>
class MultirateObject final : public DeformableObject {
 public:
  MultirateObject(std::unique_ptr<Solver> solver, int update_interval, Slip slip = {})
      : coupling_(std::move(solver)), update_interval_(update_interval), slip_(std::move(slip)) {
    tips_.count = 1;
  }

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override {
    tips_.tip[0] = tip;
    adopt(coupling_.tick(tips_), tip);
    if (slip_.enabled()) update_friction(tip);
    return result_;
  }

  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return result_; }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept override { return contact_nodes_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }  ///< along the inward normals, N
  [[nodiscard]] Vector3<> node_force(int k) const noexcept override { return node_forces_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override {
    if constexpr (requires { coupling_.model_switch().current_contact().outward(tip); })
      return coupling_.model_switch().current_contact().outward(tip);
    else if (result_.nodes > 0)
      return outward_;
    else if (const auto& near = coupling_.current_model().nodes; near.size() > 0)
      return near.normal(near.nearest(tip.center));
    else
      return coupling_.solver().normal_near(tip.center);
  }
  [[nodiscard]] std::unique_ptr<DeformableObject> clone_at_rest() const override {
    return std::make_unique<MultirateObject>(coupling_.solver().clone_at_rest(), update_interval_, slip_at_rest());
  }

  /// Provide the first local model: of the body at rest or, if its solver finds equilibria, of the equilibrium under the tip. A tip that
  /// starts in contact is moved in from outside, since a large step may end in another equilibrium.
  void initialize(const deformable::Tip& tip) override {
    tips_.tip[0] = tip;
    if constexpr (deformable::FindsEquilibrium<Solver>) {
      if (!settle(tip, 2)) {  // not at rest at once
        reset();
        deformable::Tip from = tip;
        for (int k = approach_steps - 1; k >= 0; --k) {
          from.center = tip.center + 2.0 * tip.radius * k / approach_steps * tip.outward;
          settle(from, max_starting_updates);
        }
      }
      publish();
    } else {
      coupling_.set_tips(tips_);
      update_model();
    }
  }

  void step_synchronously() override {
    if (tick_ % update_interval_ == 0) {
      coupling_.compute_model();
      publish();
    }
    if (++tick_ % update_interval_ == 0) coupling_.publish_model();
  }

  [[nodiscard]] bool is_multirate() const noexcept override { return true; }
  void update_model() override {
    coupling_.update_model();
    publish();
  }

  void set_observer(LatestValue<DeformationFrame>* observer) noexcept override { observer_ = observer; }

  [[nodiscard]] const deformable::MultirateCoupling<Solver>& coupling() const noexcept { return coupling_; }

  /// Energy of the body and its layer after the last model update, kinetic energy included, J.
  [[nodiscard]] double energy() { return coupling_.solver().energy(); }

  /// Bring the body to equilibrium under a fixed tip, without friction, in at most `max_steps` model updates. Return false if not reached.
  bool settle(const deformable::Tip& tip, int max_steps) {
    tips_.tip[0] = tip;
    tick_ = 0;
    const bool rests = coupling_.settle(tips_, max_steps);
    adopt(coupling_.model_switch().last(), tip);
    return rests;
  }

  void reset() {
    coupling_.reset();
    result_ = {};
    tick_ = 0;
    slip_.reset();
    has_last_center_ = false;
  }

 private:
  static constexpr int max_starting_updates = 100;
  static constexpr int approach_steps = 20;  // from a diameter outside of the start

  [[nodiscard]] Slip slip_at_rest() const {
    Slip slip = slip_;
    slip.reset();
    return slip;
  }

  /// Publish the deformation after a model update to the observer.
  void publish() noexcept {
    if (observer_ == nullptr) return;
    DeformationFrame& next = observer_->write_slot();
    next.step = coupling_.update_count();
    next.tick = coupling_.last_seen_tick();
    if constexpr (requires { coupling_.solver().displacement(next.displacement.data()); })
      coupling_.solver().displacement(next.displacement.data());
    observer_->publish();
  }

  /// Take over what the coupling has found under the tip.
  void adopt(const deformable::MultiTipResult& result, const deformable::Tip& tip) noexcept {
    result_ = result.tip[0];
    result_.solved = result.solved;
    result_.energy = coupling_.model_switch().tank().potential;
    result_.tank_energy = coupling_.model_switch().tank().level;
    result_.nodes = 0;
    coupling_.model_switch().for_each_contact_node([this](std::int32_t node, const deformable::NodePush& push) {
      const auto k = static_cast<std::size_t>(result_.nodes++);
      contact_nodes_[k] = node;
      forces_[k] = push.along;
      node_forces_[k] = push.force;
      layer_stiffness_[k] = push.layer_stiffness;
    });
    update_outward(tip);
  }

  /// Update the outward normal from the contact forces.
  void update_outward(const deformable::Tip& tip) noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (int k = 0; k < result_.nodes; ++k) sum -= node_force(k);
    const double length = sum.norm();
    outward_ = length > 0.0 ? Vector3<>(sum / length) : tip.outward;
  }

  /// Apply friction for the tip motion since the last step.
  void update_friction(const deformable::Tip& tip) noexcept {
    const Vector3<> tip_motion = has_last_center_ ? Vector3<>(tip.center - last_center_) : Vector3<>::Zero();
    last_center_ = tip.center;
    has_last_center_ = last_center_.allFinite();
    const bool flat = tip.kind == deformable::Tip::Kind::flat;
    for (std::size_t k = 0; flat && k < static_cast<std::size_t>(result_.nodes); ++k)
      forces_[k] = std::max(-node_forces_[k].dot(tip.outward), 0.0);  // without the pressure on the rounded edge
    slip_.step(coupling_.current_model(), flat ? tip.outward : outward_, contact_nodes_.data(), forces_.data(), layer_stiffness_.data(),
               result_.nodes, tip_motion);
    double total = 0.0;
    Vector3<> along = Vector3<>::Zero();
    for (int k = 0; k < result_.nodes; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const Vector3<> force = slip_.force(contact_nodes_[i]), displacement = slip_.displacement(contact_nodes_[i]);
      along += forces_[i] * displacement;
      total += forces_[i];
      result_.friction -= force;
      node_forces_[i] += force;
    }
    result_.energy += slip_.energy();
    if (total > 0.0) result_.deflection += along / total;
    result_.force += result_.friction;
    result_.sliding = slip_.sliding();
  }

  static constexpr std::size_t max_nodes = 2 * deformable::LocalModel::capacity;  // contact nodes of the two models being blended

  deformable::MultirateCoupling<Solver> coupling_;
  int update_interval_;
  std::int64_t tick_ = 0;
  LatestValue<DeformationFrame>* observer_ = nullptr;
  deformable::TipPair tips_;
  deformable::ContactResult result_;
  Slip slip_;
  Vector3<> outward_ = Vector3<>::UnitZ();     // mean normal of the contact forces
  bool has_last_center_ = false;               // false before the first step
  Vector3<> last_center_ = Vector3<>::Zero();  // tip center of the last step, m
  std::array<std::int32_t, max_nodes> contact_nodes_{};
  std::array<double, max_nodes> forces_{};           // N
  std::array<double, max_nodes> layer_stiffness_{};  // N/m
  std::array<Vector3<>, max_nodes> node_forces_{};   // N
};

}  // namespace palpate::object
