#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/deformable/multirate/passive_model_switch.hpp"
#include "palpate/math/latest_value.hpp"

namespace palpate::deformable {

/// A body that goes on by slow steps, what a servo feels of it between them, and the hand-over of both ways: tips to the slow steps,
/// snapshots to the servo. The slow steps are taken in turn with the ticks, or by one thread of their own.
///
/// `Slow` has
///   Report step(const BodyTips& tips, Snapshot& to)   one slow step; may take memory
///   void reset()                                      back to rest
template <class Slow>
class MultirateCoupling {
 public:
  using Report = decltype(std::declval<Slow&>().step(std::declval<const TipPair&>(), std::declval<LocalModel&>()));

  explicit MultirateCoupling(std::unique_ptr<Slow> slow) : slow_(std::move(slow)) {}

  [[nodiscard]] Slow& slow() noexcept { return *slow_; }
  [[nodiscard]] const Slow& slow() const noexcept { return *slow_; }
  [[nodiscard]] PassiveModelSwitch& servo() noexcept { return *servo_; }
  [[nodiscard]] PassiveModelSwitch::ModelBuffer& box() noexcept { return *box_; }

  /// Where the tips are, for the next slow step; tick() tells it, too.
  void place(const TipPair& tips) noexcept {
    where_->write_slot() = {ticks_, tips};
    where_->publish();
  }

  /// One tick of the servo's, which neither waits nor takes memory.
  const MultiTipResult& tick(const TipPair& tips) noexcept {
    ++ticks_;
    place(tips);
    return servo_->step(*box_, tips);
  }

  /// One slow step with the tips where the servo said last, and its snapshot to the servo.
  void slow_step() {
    compute();
    hand_over();
  }

  /// As slow_step(), but the servo gets the snapshot at the next call of hand_over(), as if the step had taken that long.
  void compute() {
    where_->acquire();
    last_ = slow_->step(where_->value().tips, box_->write_slot());
    ++steps_;
  }
  void hand_over() noexcept { box_->publish(); }

  /// Slow steps with the tips where they are until the body rests under them, at most so many; then the servo begins anew, from there, and
  /// owes nothing. False: it did not come to rest. Not while a thread takes slow steps; the report tells `unrest`.
  bool settle(const TipPair& tips, int most) {
    place(tips);
    int still = 0;  // steps in turn
    for (int k = 0; k < most && still < 2; ++k) {
      compute();
      still = last_.unrest <= rest ? still + 1 : 0;
    }
    servo_ = std::make_unique<PassiveModelSwitch>();
    box_ = std::make_unique<PassiveModelSwitch::ModelBuffer>();
    slow_step();
    servo_->step(*box_, tips);
    return still >= 2;
  }

  /// What the servo took last; not while it runs.
  [[nodiscard]] const LocalModel& newest() const noexcept { return servo_->newest(*box_); }
  [[nodiscard]] const Report& last() const noexcept { return last_; }
  [[nodiscard]] long steps() const noexcept { return steps_; }
  /// Tick of the servo, from 0 on, whose tips the last slow step saw; -1: from before the first.
  [[nodiscard]] std::int64_t seen() const noexcept { return where_->value().tick; }

  /// Everything back to rest; not while a thread takes slow steps.
  void reset() {
    slow_->reset();
    servo_ = std::make_unique<PassiveModelSwitch>();
    box_ = std::make_unique<PassiveModelSwitch::ModelBuffer>();
    where_ = std::make_unique<LatestValue<Where>>();
    steps_ = 0;
    ticks_ = -1;
  }

 private:
  static constexpr double rest = 1e-4;  // of the load

  struct Where {
    std::int64_t tick = -1;
    TipPair tips;
  };

  std::unique_ptr<Slow> slow_;
  std::unique_ptr<PassiveModelSwitch> servo_ = std::make_unique<PassiveModelSwitch>();
  std::unique_ptr<PassiveModelSwitch::ModelBuffer> box_ = std::make_unique<PassiveModelSwitch::ModelBuffer>();
  std::unique_ptr<LatestValue<Where>> where_ = std::make_unique<LatestValue<Where>>();
  std::int64_t ticks_ = -1;  // the servo's last one
  long steps_ = 0;
  Report last_{};
};

}  // namespace palpate::deformable
