#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/deformable/multirate/passive_model_switch.hpp"
#include "palpate/math/latest_value.hpp"

namespace palpate::deformable {

namespace detail {
template <class Solver>
struct ContactOf {
  using Type = LocalModelContact;
};
template <class Solver>
  requires requires { typename Solver::Contact; }
struct ContactOf<Solver> {
  using Type = typename Solver::Contact;
};
}  // namespace detail

/// A solver whose updates approach the relaxed equilibrium, without inertia, while it is set to static.
template <class Solver>
concept FindsEquilibrium = requires(Solver& s) { s.set_static(true); };

/// Couples a slow body solver with the servo's contact on local models: tip positions go to the solver, local models to the servo. Model
/// updates run synchronously with the ticks or in one other thread.
///
/// `Solver` provides
///   Report step(const TipPair& tips, LocalModel& to)   one model update; may allocate
///   void reset()                                       return to rest
/// and, if its local models are not LocalModel,
///   Contact                                            of the tips with them, see BasicPassiveModelSwitch
///   Contact make_contact() const
/// and, if the body has inertia or relaxation,
///   void set_clock(std::int64_t tick)                  tick of the tips of the next update
///   void set_static(bool is_static)                    see FindsEquilibrium
/// A Report with a member `advanced` tells whether the model is new; others are published after each update.
template <class Solver>
class MultirateCoupling {
 public:
  using Contact = typename detail::ContactOf<Solver>::Type;
  using Model = typename Contact::Model;
  using Switch = BasicPassiveModelSwitch<Contact>;
  using Report = decltype(std::declval<Solver&>().step(std::declval<const TipPair&>(), std::declval<Model&>()));

  explicit MultirateCoupling(std::unique_ptr<Solver> solver) : solver_(std::move(solver)), model_switch_(make_switch()) {}

  [[nodiscard]] Solver& solver() noexcept { return *solver_; }
  [[nodiscard]] const Solver& solver() const noexcept { return *solver_; }
  [[nodiscard]] Switch& model_switch() noexcept { return *model_switch_; }
  [[nodiscard]] const Switch& model_switch() const noexcept { return *model_switch_; }

  /// Set the tip positions for the next model update; tick() does so too.
  void set_tips(const TipPair& tips) noexcept {
    tip_samples_->write_slot() = {tick_, tips};
    tip_samples_->publish();
  }

  /// One servo tick; does not block or allocate.
  const MultiTipResult& tick(const TipPair& tips) noexcept {
    ++tick_;
    set_tips(tips);
    return model_switch_->step(*models_, tips);
  }

  /// Perform one model update with the latest tip positions and publish the model.
  void update_model() {
    compute_model();
    if constexpr (requires { last_report_.advanced; })
      if (!last_report_.advanced) return;
    publish_model();
  }

  /// Perform one model update without publishing it. publish_model() follows later, as if the update had taken that long.
  void compute_model() {
    tip_samples_->acquire();
    if constexpr (requires(Solver& s, std::int64_t tick) { s.set_clock(tick); }) solver_->set_clock(tip_samples_->value().tick);
    last_report_ = solver_->step(tip_samples_->value().tips, models_->write_slot());
    ++update_count_;
  }
  void publish_model() noexcept { models_->publish(); }

  /// Update the model with fixed tips until equilibrium (at most `max_steps` updates), then restart the servo side there with an empty
  /// energy tank. Return false if equilibrium was not reached (see Report::relative_residual). Not while another thread updates the model.
  bool settle(const TipPair& tips, int max_steps) {
    set_tips(tips);
    set_static(true);
    int steps_at_rest = 0;  // consecutive updates at equilibrium
    for (int k = 0; k < max_steps && steps_at_rest < 2; ++k) {
      compute_model();
      steps_at_rest = last_report_.relative_residual <= rest_tolerance ? steps_at_rest + 1 : 0;
    }
    model_switch_ = make_switch();
    models_ = std::make_unique<typename Switch::ModelBuffer>();
    set_static(false);
    update_model();
    model_switch_->start(*models_, tips);
    return steps_at_rest >= 2;
  }

  /// Local model in use by the servo; only while it does not run.
  [[nodiscard]] const Model& current_model() const noexcept { return model_switch_->current_model(*models_); }
  [[nodiscard]] const Report& last_report() const noexcept { return last_report_; }
  [[nodiscard]] long update_count() const noexcept { return update_count_; }
  /// Servo tick, from 0 on, whose tips the last update used; -1: none.
  [[nodiscard]] std::int64_t last_seen_tick() const noexcept { return tip_samples_->value().tick; }

  /// Return to rest. Not while another thread updates the model.
  void reset() {
    solver_->reset();
    model_switch_ = make_switch();
    models_ = std::make_unique<typename Switch::ModelBuffer>();
    tip_samples_ = std::make_unique<LatestValue<TipSample>>();
    update_count_ = 0;
    tick_ = -1;
  }

 private:
  [[nodiscard]] std::unique_ptr<Switch> make_switch() const {
    if constexpr (requires { typename Solver::Contact; })
      return std::make_unique<Switch>([this] { return solver_->make_contact(); });
    else
      return std::make_unique<Switch>();
  }

  void set_static(bool is_static) {
    if constexpr (FindsEquilibrium<Solver>) solver_->set_static(is_static);
  }

  static constexpr double rest_tolerance = 1e-4;  // relative to the load

  struct TipSample {
    std::int64_t tick = -1;
    TipPair tips;
  };

  std::unique_ptr<Solver> solver_;
  std::unique_ptr<Switch> model_switch_;
  std::unique_ptr<typename Switch::ModelBuffer> models_ = std::make_unique<typename Switch::ModelBuffer>();
  std::unique_ptr<LatestValue<TipSample>> tip_samples_ = std::make_unique<LatestValue<TipSample>>();
  std::int64_t tick_ = -1;  // last servo tick
  long update_count_ = 0;
  Report last_report_{};
};

}  // namespace palpate::deformable
