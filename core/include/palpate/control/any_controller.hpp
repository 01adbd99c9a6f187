#pragma once

#include <concepts>
#include <memory>
#include <type_traits>
#include <utility>

#include "palpate/control/controller.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/math/polymorphic_value.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

namespace detail {
struct ControllerInterface : math::Cloneable<ControllerInterface> {
  virtual Vector3<> command(const TickInput& input) noexcept = 0;
  virtual void applied(const Vector3<>& force) noexcept = 0;
  virtual void reset() noexcept = 0;
  [[nodiscard]] virtual const Vector3<>* touching() const noexcept = 0;
  [[nodiscard]] virtual int record_width() const noexcept = 0;
  virtual void record(double* row) const noexcept = 0;
};

template <class C>
struct ControllerModel final : math::CloneableModel<ControllerInterface, ControllerModel, C> {
  using math::CloneableModel<ControllerInterface, detail::ControllerModel, C>::CloneableModel;
  Vector3<> command(const TickInput& input) noexcept override { return this->value.command(input); }
  void applied(const Vector3<>& force) noexcept override { control::applied(this->value, force); }
  void reset() noexcept override { control::reset(this->value); }
  [[nodiscard]] const Vector3<>* touching() const noexcept override {
    if constexpr (requires { this->value.touching(); }) return this->value.touching();
    return nullptr;
  }
  [[nodiscard]] int record_width() const noexcept override { return control::record_width(this->value); }
  void record(double* row) const noexcept override { control::record(this->value, row); }
};
}  // namespace detail

/// Any controller, chosen at run time. A copy is an independent controller. A StateSpace is stored inline; every other controller costs
/// two virtual calls per tick.
class AnyController : public math::PolymorphicValue<StateSpace, detail::ControllerInterface, detail::ControllerModel> {
 public:
  using Scalar = double;

  AnyController() = default;
  AnyController(StateSpace linear) : PolymorphicValue(std::move(linear)) {}  // NOLINT(google-explicit-constructor)
  template <Controller C>
    requires(!std::same_as<std::remove_cvref_t<C>, AnyController> && !std::same_as<std::remove_cvref_t<C>, StateSpace> &&
             std::copy_constructible<C>)
  AnyController(C controller)  // NOLINT(google-explicit-constructor): a controller is one of any kind
      : motors_alone_(control::motors_alone(controller)) {
    other_ = std::make_unique<detail::ControllerModel<C>>(std::move(controller));
  }

  [[gnu::always_inline]] Vector3<> command(const TickInput& input) noexcept {
    if (other_) return other_->command(input);
    return inline_.command(input);
  }
  [[gnu::always_inline]] void applied(const Vector3<>& force) noexcept {
    if (other_) return other_->applied(force);
    inline_.applied(force);
  }
  void reset() noexcept {
    if (other_) return other_->reset();
    inline_.reset();
  }
  [[nodiscard]] bool motors_alone() const noexcept { return motors_alone_; }
  [[nodiscard]] const Vector3<>* touching() const noexcept { return other_->touching(); }  ///< only of a controller with motors_alone()
  [[nodiscard]] int record_width() const noexcept { return other_ ? other_->record_width() : 0; }
  void record(double* row) const noexcept {
    if (other_) other_->record(row);
  }

 private:
  bool motors_alone_ = false;
};

}  // namespace palpate::control
