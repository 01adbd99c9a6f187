#pragma once

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

/// A solid under large displacements in a servo loop, with friction if it has any. In virtual time a slow step lasts `every` ticks: it sees
/// the tip where it is at its first tick, and the servo gets its snapshot after the last.
///
/// `Slow` is that of TwoRates, and
///   std::unique_ptr<Slow> fresh() const   the same at rest, with a state of its own
///   void displacement(double* to) const   of all points, 3 x point + axis, m
template <class Slow>
class HyperelasticObject final : public DeformableObject {
 public:
  HyperelasticObject(std::unique_ptr<Slow> slow, int every, deformable::LocalModelSlip slip = {})
      : rates_(std::move(slow)), every_(every), slip_(std::move(slip)) {
    tips_.count = 1;
  }

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept override {
    tips_.tip[0] = tip;
    const deformable::MultiTipResult& answer = rates_.tick(tips_);
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
    face(tip);
    if (slip_.on()) drag(tip);
    return answer_;
  }

  [[nodiscard]] const deformable::ContactResult& last() const noexcept override { return answer_; }
  [[nodiscard]] const std::int32_t* pressed() const noexcept override { return pressed_.data(); }
  [[nodiscard]] const double* forces() const noexcept { return forces_.data(); }  ///< along the inward normals, N
  [[nodiscard]] Vector3<> load(int k) const noexcept override { return load_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept override {
    return answer_.nodes > 0 ? outward_
                             : deformable::outward_of(rates_.newest().nodes, tip, 0, [](int) { return Vector3<>(Vector3<>::Zero()); });
  }
  [[nodiscard]] std::unique_ptr<DeformableObject> fresh() const override {
    return std::make_unique<HyperelasticObject>(rates_.slow().fresh(), every_, at_rest());
  }

  /// The servo has a snapshot from the beginning: that of the body at rest, near the tip.
  void begin(const deformable::Tip& tip) override {
    tips_.tip[0] = tip;
    rates_.place(tips_);
    slow_step();
  }

  void in_turn() override {
    if (tick_ % every_ == 0) {
      rates_.compute();
      show();
    }
    if (++tick_ % every_ == 0) rates_.hand_over();
  }

  [[nodiscard]] bool slow() const noexcept override { return true; }
  void slow_step() override {
    rates_.slow_step();
    show();
  }

  void watch(LatestValue<DeformationFrame>* drawn) noexcept override { drawn_ = drawn; }

  [[nodiscard]] const deformable::MultirateCoupling<Slow>& rates() const noexcept { return rates_; }

  /// Lets the body come to rest under a tip that is held, in at most so many slow steps, and steps there. Whether it did.
  bool settle(const deformable::Tip& tip, int most) {
    tips_.tip[0] = tip;
    tick_ = 0;
    const bool rests = rates_.settle(tips_, most);
    step(tip);
    return rests;
  }

  void reset() {
    rates_.reset();
    answer_ = {};
    tick_ = 0;
    slip_.reset();
    placed_ = false;
  }

 private:
  [[nodiscard]] deformable::LocalModelSlip at_rest() const {
    deformable::LocalModelSlip slip = slip_;
    slip.reset();
    return slip;
  }

  /// Tells whoever draws the body where the last slow step left it.
  void show() noexcept {
    if (drawn_ == nullptr) return;
    DeformationFrame& next = drawn_->write_slot();
    next.step = rates_.steps();
    next.tick = rates_.seen();
    rates_.slow().displacement(next.displacement.data());
    drawn_->publish();
  }

  /// As the pressed nodes face.
  void face(const deformable::Tip& tip) noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (int k = 0; k < answer_.nodes; ++k) sum -= load(k);
    const double length = sum.norm();
    outward_ = length > 0.0 ? Vector3<>(sum / length) : tip.outward;
  }

  /// The tip has moved over the surface, and drags it along.
  void drag(const deformable::Tip& tip) noexcept {
    const Vector3<> way = placed_ ? Vector3<>(tip.centre - centre_) : Vector3<>::Zero();
    centre_ = tip.centre;
    placed_ = centre_.allFinite();
    slip_.step(rates_.newest(), tip.kind == deformable::Tip::Kind::flat ? tip.outward : outward_, pressed_.data(), forces_.data(),
               answer_.nodes, way);
    double total = 0.0;
    Vector3<> along = Vector3<>::Zero();
    for (int k = 0; k < answer_.nodes; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const Vector3<> force = slip_.force(pressed_[i]), moved = slip_.moved(pressed_[i]);
      along += forces_[i] * moved;
      total += forces_[i];
      answer_.friction -= force;
      answer_.energy += 0.5 * force.dot(moved);
      load_[i] += force;
    }
    if (total > 0.0) answer_.deflection += along / total;
    answer_.force += answer_.friction;
    answer_.sliding = slip_.sliding();
  }

  static constexpr std::size_t most = 2 * deformable::LocalModel::capacity;  // nodes pressed on two snapshots that are blended

  deformable::MultirateCoupling<Slow> rates_;
  int every_;
  std::int64_t tick_ = 0;
  LatestValue<DeformationFrame>* drawn_ = nullptr;
  deformable::TipPair tips_;
  deformable::ContactResult answer_;
  deformable::LocalModelSlip slip_;
  Vector3<> outward_ = Vector3<>::UnitZ();  // as the pressed nodes face
  bool placed_ = false;                     // the tip has been somewhere before
  Vector3<> centre_ = Vector3<>::Zero();    // where it was, m
  std::array<std::int32_t, most> pressed_{};
  std::array<double, most> forces_{};   // N
  std::array<Vector3<>, most> load_{};  // N
};

}  // namespace palpate::object
