#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/body/blended.hpp"
#include "palpate/body/touched.hpp"
#include "palpate/body/two_rates.hpp"

namespace palpate {

/// A solid under large displacements in a servo loop. In virtual time a slow step lasts `every` ticks: it sees the tip where it is at its
/// first tick, and the servo gets its snapshot after the last.
///
/// `Slow` is that of TwoRates, and
///   std::unique_ptr<Slow> fresh() const   the same at rest, with a state of its own
template <class Slow>
class LoopSolid final : public LoopBody {
 public:
  LoopSolid(std::unique_ptr<Slow> slow, int every) : rates_(std::move(slow)), every_(every) { tips_.count = 1; }

  const BodyAnswer& step(const BodyTip& tip) noexcept override {
    tips_.tip[0] = tip;
    const TipsAnswer& answer = rates_.tick(tips_);
    answer_ = answer.tip[0];
    answer_.solved = answer.solved;
    answer_.energy = rates_.servo().account().potential;
    answer_.saved = rates_.servo().account().saved;
    answer_.nodes = 0;
    rates_.servo().each_pressed(rates_.box(), [this](std::int32_t name, double force, const Vector3<>& push) {
      const auto k = static_cast<std::size_t>(answer_.nodes++);
      pressed_[k] = name;
      forces_[k] = force;
      load_[k] = push;
    });
    return answer_;
  }

  [[nodiscard]] const BodyAnswer& last() const noexcept override { return answer_; }
  [[nodiscard]] const std::int32_t* pressed() const noexcept override { return pressed_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }  ///< along the inward normals, N
  [[nodiscard]] Vector3<> load(int k) const noexcept override { return load_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] Vector3<> outward(const BodyTip& tip) const noexcept override {
    return outward_of(rates_.newest().nodes, tip, answer_.nodes, [this](int k) { return Vector3<>(-load(k)); });
  }
  [[nodiscard]] std::unique_ptr<LoopBody> fresh() const override { return std::make_unique<LoopSolid>(rates_.slow().fresh(), every_); }

  /// The servo has a snapshot from the beginning: that of the body at rest, near the tip.
  void begin(const BodyTip& tip) override {
    tips_.tip[0] = tip;
    rates_.place(tips_);
    rates_.slow_step();
  }

  void in_turn() override {
    if (tick_ % every_ == 0) rates_.compute();
    if (++tick_ % every_ == 0) rates_.hand_over();
  }

  [[nodiscard]] bool slow() const noexcept override { return true; }
  void slow_step() override { rates_.slow_step(); }

  [[nodiscard]] const TwoRates<Slow>& rates() const noexcept { return rates_; }

  void reset() {
    rates_.reset();
    answer_ = {};
    tick_ = 0;
  }

 private:
  static constexpr std::size_t most = 2 * Snapshot::capacity;  // nodes pressed on two snapshots that are blended

  TwoRates<Slow> rates_;
  int every_;
  std::int64_t tick_ = 0;
  BodyTips tips_;
  BodyAnswer answer_;
  std::array<std::int32_t, most> pressed_{};
  std::array<double, most> forces_{};   // N
  std::array<Vector3<>, most> load_{};  // N
};

}  // namespace palpate
