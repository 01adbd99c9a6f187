#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/contact_model.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_contact.hpp"
#include "palpate/deformable/multirate/linear_local_model.hpp"

namespace palpate::deformable {

/// Model with a state that a model of the same body with another period can adopt.
///
///   void take_state(const Model& other)   adopt the state; both are copies, or built from the same data with different periods
template <class Model>
concept HasState = requires(Model& model, const Model& other) { model.take_state(other); };

/// Model update of a linear body (ContactModel) under one tip, at a low rate, for MultirateCoupling.
///
/// An update advances the model to the time of its tip by its own contact, in steps of at most `max_step`, while the tip moves along a
/// straight line since the last update. The servo is at most two intervals less a tick ahead when the next local model is fully blended in.
/// A model of the same body with that time as its period (the look-ahead) adopts the state, and gives free displacements and compliance
/// then. If the model is accurate for short periods only (Model::max_step, s), the look-ahead takes several steps under the forces of the
/// state; its compliance C is the response to small constant forces from rest. Such a model may be nonlinear (Model::linear()): a second
/// look-ahead, under forces larger by a twentieth, gives the tangent compliance as one multiple of C, the ratio of the works of the forces.
/// A body at rest stays there, so its local model is exact. An interval of one tick gives the steps of a body without updates.
///
/// A late update (in a thread of its own) makes up for at most `max_late` intervals; beyond it the body is slowed down.
template <ContactModel Model>
class LinearBodySolver {
 public:
  using Contact = LinearLocalContact;
  struct Report {
    double relative_residual = 0.0;  ///< change of the force in the update, relative to it
    bool advanced = true;            ///< whether the local model is new
  };

  static constexpr double max_step = 1e-3;  ///< period of the steps of an update, s
  static constexpr int max_late = 4;

  /// @param nodes            must outlive the solver
  /// @param make             Model make(double period) returns the body at rest, stepped once per `period` [s]
  /// @param period           of the servo, s
  /// @param update_interval  ticks
  template <class Make>
  LinearBodySolver(const SurfaceNodes& nodes, const Make& make, double period, int update_interval)
      : nodes_(&nodes),
        interval_(update_interval),
        steps_(HasState<Model> ? std::max(static_cast<int>(std::ceil(period * update_interval / max_step - 1e-9)), 1) : 1),
        look_ahead_steps_(steps_of_look_ahead(period * (2 * update_interval - 1))),
        model_(make(period * update_interval / steps_)),
        look_ahead_(HasState<Model> ? make(period * (2 * update_interval - 1) / look_ahead_steps_) : model_),
        compliance_(static_cast<std::size_t>(nodes.size())),
        contact_(nodes, model_) {
    measure_compliance();
    for (std::int32_t i = 0; i < nodes_->size(); ++i) layer_.push_back(layer_compliance(look_ahead_, i, compliance_.compliance(i, i)));
    contact_.reset();
  }
  template <class Make>
  LinearBodySolver(const SurfaceNodes&& nodes, const Make& make, double period, int update_interval) = delete;
  LinearBodySolver(const LinearBodySolver&) = delete;
  LinearBodySolver& operator=(const LinearBodySolver&) = delete;
  LinearBodySolver(LinearBodySolver&&) = delete;
  LinearBodySolver& operator=(LinearBodySolver&&) = delete;
  ~LinearBodySolver() = default;

  [[nodiscard]] Contact make_contact() const { return Contact({nodes_, compliance_, layer_}); }
  [[nodiscard]] std::unique_ptr<LinearBodySolver> clone_at_rest() const {
    return std::unique_ptr<LinearBodySolver>(new LinearBodySolver(*this, AtRest{}));
  }

  void set_clock(std::int64_t tick) noexcept { clock_ = tick; }

  /// Advance to the time of the tip. Write the next local model to `to`.
  Report step(const TipPair& tips, LinearLocalModel& to) {
    const Tip& tip = tips.tip[0];
    const Vector3<> before = contact_.last().force;
    const int steps = steps_ * due_intervals();
    if (!has_last_tip_) last_tip_ = tip;
    for (int k = 1; k <= steps; ++k) contact_.step(between(last_tip_, tip, static_cast<double>(k) / steps));
    if (steps > 0) {
      last_tip_ = tip;
      has_last_tip_ = true;
    }
    Report report{.advanced = steps > 0 || !current_};
    const double size = contact_.last().force.norm();
    if (size > 0.0) report.relative_residual = (contact_.last().force - before).norm() / size;
    if (report.advanced) linearize(to);
    current_ = true;
    return report;
  }

  void reset() {
    contact_.reset();
    clock_ = advanced_to_ = no_tick;
    has_last_tip_ = current_ = false;
  }

  /// Energy of the body after the last update, kinetic energy included, J.
  [[nodiscard]] double energy() const noexcept { return contact_.last().energy; }
  /// Contact of the last step.
  [[nodiscard]] const TipContact<Model>& contact() const noexcept { return contact_; }
  [[nodiscard]] const Model& model() const noexcept { return model_; }

 private:
  static constexpr std::int64_t no_tick = INT64_MIN;
  static constexpr double small_displacement = 1e-8;  // m, in the linear range
  static constexpr double force_step = 0.05;          // relative, of the second look-ahead
  static constexpr double max_ratio = 10.0;           // of the tangent compliance to that at rest, or its inverse
  struct AtRest {};

  LinearBodySolver(const LinearBodySolver& of, AtRest /*tag*/)
      : nodes_(of.nodes_),
        interval_(of.interval_),
        steps_(of.steps_),
        look_ahead_steps_(of.look_ahead_steps_),
        model_(of.model_),
        look_ahead_(of.look_ahead_),
        compliance_(of.compliance_),
        layer_(of.layer_),
        contact_(*nodes_, model_) {
    contact_.reset();
  }

  [[nodiscard]] static int steps_of_look_ahead(double horizon) {
    if constexpr (requires { Model::max_step; }) return std::max(static_cast<int>(std::ceil(horizon / Model::max_step - 1e-9)), 1);
    return 1;
  }

  /// Find the compliance of the look-ahead.
  void measure_compliance() {
    for (std::int32_t j = 0; j < nodes_->size(); ++j) {
      if (look_ahead_steps_ == 1) {
        for (std::int32_t i = 0; i <= j; ++i) compliance_.set(i, j, look_ahead_.compliance(i, j));
        continue;
      }
      look_ahead_.reset();
      const double force = small_displacement / look_ahead_.compliance(j, j);
      for (int k = 1; k < look_ahead_steps_; ++k) look_ahead_.advance(&j, &force, 1);
      for (std::int32_t i = 0; i < nodes_->size(); ++i) {
        const double moved = look_ahead_.free_displacement(i) / force + look_ahead_.compliance(i, j);
        compliance_.set(i, j, i < j ? 0.5 * (moved + compliance_.compliance(i, j)) : moved);
      }
    }
    look_ahead_.reset();
  }

  /// Add the displacement of partly covered patches at the state. It stays while the coverage changes: divided by that, it would push a
  /// tip that slides off a patch aside.
  void add_partial_displacement(LinearLocalModel& to) const {
    for (int c = 0; c < contact_.last().nodes; ++c) {
      const auto k = static_cast<std::size_t>(contact_.contact_nodes()[c]);
      const auto [compliance, crept] = contact_.partial_displacement(c);
      double held = compliance, free = 0.0;
      if constexpr (requires { look_ahead_.creep(); }) {
        const Creep now = model_.creep(), then = look_ahead_.creep();
        held *= then.period_ratio / now.period_ratio;
        free = then.decay * crept;
      }
      to.elastic_displacement[k] += held * contact_.forces()[c];
      to.free_displacement[k] += free;
    }
  }

  /// Number of intervals to advance by. The first tick of a servo is one interval after the body was at rest.
  [[nodiscard]] int due_intervals() noexcept {
    if (clock_ == no_tick) return 1;
    if (clock_ < 0) return 0;
    if (advanced_to_ == no_tick) {
      advanced_to_ = clock_;
      return 1;
    }
    const std::int64_t due = (clock_ - advanced_to_) / interval_;
    if (due <= 0) return 0;
    advanced_to_ = due > max_late ? clock_ : advanced_to_ + due * interval_;
    return static_cast<int>(std::min<std::int64_t>(due, max_late));
  }

  [[nodiscard]] static Tip between(const Tip& from, const Tip& to, double part) noexcept {
    Tip out = to;
    if (part < 1.0 && from.center.allFinite()) out.center = from.center + part * (to.center - from.center);
    return out;
  }

  /// Displacement of node i by forces on the loaded nodes along the inward normals, m.
  template <class Elastic>
  [[nodiscard]] static double displacement_by(const Elastic& body, std::int32_t i, const std::int32_t* loaded, const double* forces,
                                              int loads) noexcept {
    double sum = 0.0;
    for (int c = 0; c < loads; ++c) sum += body.compliance(i, loaded[c]) * forces[c];
    return sum;
  }

  /// Let the look-ahead adopt the state and step under the forces, but for its last step.
  void step_look_ahead(const std::int32_t* loaded, const double* forces, int loads) {
    if constexpr (HasState<Model>) look_ahead_.take_state(model_);
    for (int k = 1; k < look_ahead_steps_; ++k) look_ahead_.advance(loaded, forces, loads);
  }

  void linearize(LinearLocalModel& to) {
    const auto count = static_cast<std::size_t>(nodes_->size());
    to.free_displacement.resize(count);
    to.elastic_displacement.resize(count);
    to.lowest_free = to.lowest_elastic = 0.0;
    const std::int32_t* const loaded = contact_.contact_nodes();
    const double* const forces = contact_.forces();
    const int loads = contact_.last().nodes;
    step_look_ahead(loaded, forces, loads);
    for (std::int32_t i = 0; i < nodes_->size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double elastic = displacement_by(compliance_, i, loaded, forces, loads);
      to.elastic_displacement[k] = elastic;
      to.free_displacement[k] = look_ahead_.free_displacement(i);
      if (look_ahead_steps_ > 1) to.free_displacement[k] += displacement_by(look_ahead_, i, loaded, forces, loads) - elastic;
      to.lowest_elastic = std::min(to.lowest_elastic, elastic);
      to.lowest_free = std::min(to.lowest_free, to.free_displacement[k]);
    }
    to.compliance_ratio = 1.0;
    if constexpr (requires { model_.linear(); })
      if (look_ahead_steps_ > 1 && !model_.linear()) to.compliance_ratio = tangent_ratio(to, loaded, forces, loads);
    add_partial_displacement(to);
    if constexpr (requires { model_.inverted(); }) to.inverted = model_.inverted();
    to.has_memory = HasState<Model>;
    to.returnable = HasState<Model> ? energy() : 0.0;
    to.version = ++version_;
  }

  /// Ratio of the tangent compliance to C along the forces of the state, whose displacements `to` contains.
  [[nodiscard]] double tangent_ratio(const LinearLocalModel& to, const std::int32_t* loaded, const double* forces, int loads) {
    std::array<double, static_cast<std::size_t>(TipContact<Model>::capacity)> more{};
    for (std::size_t c = 0; c < static_cast<std::size_t>(loads); ++c) more[c] = (1.0 + force_step) * forces[c];
    step_look_ahead(loaded, more.data(), loads);
    double work = 0.0, linear_work = 0.0;
    for (std::size_t c = 0; c < static_cast<std::size_t>(loads); ++c) {
      const auto k = static_cast<std::size_t>(loaded[c]);
      const double displacement =
          look_ahead_.free_displacement(loaded[c]) + displacement_by(look_ahead_, loaded[c], loaded, more.data(), loads);
      work += forces[c] * (displacement - to.free_displacement[k] - to.elastic_displacement[k]);
      linear_work += forces[c] * force_step * to.elastic_displacement[k];
    }
    return linear_work > 0.0 ? std::clamp(work / linear_work, 1.0 / max_ratio, max_ratio) : 1.0;
  }

  const SurfaceNodes* nodes_;
  int interval_;  // ticks
  int steps_;     // of an update
  int look_ahead_steps_;
  Model model_, look_ahead_;
  Compliance compliance_;      // of the look-ahead, along the inward normals, m/N
  std::vector<double> layer_;  // of each node: part of it that a partial coverage of its patch divides, m/N
  TipContact<Model> contact_;
  Tip last_tip_;  // of the last update
  long version_ = 0;
  std::int64_t clock_ = no_tick, advanced_to_ = no_tick;
  bool has_last_tip_ = false;
  bool current_ = false;  // whether the last local model is that of the state
};

}  // namespace palpate::deformable
