#pragma once

#include <concepts>
#include <memory>
#include <type_traits>
#include <utility>

#include "palpate/control/controller.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

/// Any controller, chosen at run time. A copy is an independent controller. A StateSpace is stored inline; every other controller costs
/// two virtual calls per tick.
class AnyController {
 public:
  using Scalar = double;

  AnyController() = default;
  AnyController(StateSpace linear) : linear_(std::move(linear)) {}  // NOLINT(google-explicit-constructor)
  template <Controller C>
    requires(!std::same_as<std::remove_cvref_t<C>, AnyController> && !std::same_as<std::remove_cvref_t<C>, StateSpace> &&
             std::copy_constructible<C>)
  AnyController(C controller)  // NOLINT(google-explicit-constructor): a controller is one of any kind
      : other_(std::make_unique<Model<C>>(std::move(controller))) {}

  AnyController(const AnyController& o) : linear_(o.linear_), other_(o.other_ ? o.other_->clone() : nullptr) {}
  AnyController& operator=(const AnyController& o) { return *this = AnyController(o); }
  AnyController(AnyController&&) noexcept = default;
  AnyController& operator=(AnyController&&) noexcept = default;
  ~AnyController() = default;

  [[gnu::always_inline]] Vector3<> command(const TickInput& input) noexcept {
    if (other_) return other_->command(input);
    return linear_.command(input);
  }
  [[gnu::always_inline]] void applied(const Vector3<>& force) noexcept {
    if (other_) return other_->applied(force);
    linear_.applied(force);
  }
  void reset() noexcept {
    if (other_) return other_->reset();
    linear_.reset();
  }

  /// Return the controller if it is a `C`, else null.
  template <class C>
  [[nodiscard]] C* get_if() noexcept {
    if constexpr (std::same_as<C, StateSpace>)
      return other_ ? nullptr : &linear_;
    else
      return other_ && other_->tag() == &Model<C>::unique ? &static_cast<Model<C>&>(*other_).controller : nullptr;
  }
  template <class C>
  [[nodiscard]] const C* get_if() const noexcept {
    return const_cast<AnyController*>(this)->get_if<C>();
  }

 private:
  struct Interface {
    Interface() = default;
    Interface(const Interface&) = delete;
    Interface& operator=(const Interface&) = delete;
    Interface(Interface&&) = delete;
    Interface& operator=(Interface&&) = delete;
    virtual ~Interface() = default;
    [[nodiscard]] virtual std::unique_ptr<Interface> clone() const = 0;
    [[nodiscard]] virtual const void* tag() const noexcept = 0;
    virtual Vector3<> command(const TickInput& input) noexcept = 0;
    virtual void applied(const Vector3<>& force) noexcept = 0;
    virtual void reset() noexcept = 0;
  };

  template <class C>
  struct Model final : Interface {
    static constexpr char unique = 0;  // its address names the type without run-time type information
    C controller;
    explicit Model(C c) : controller(std::move(c)) {}
    [[nodiscard]] std::unique_ptr<Interface> clone() const override { return std::make_unique<Model>(controller); }
    [[nodiscard]] const void* tag() const noexcept override { return &unique; }
    Vector3<> command(const TickInput& input) noexcept override { return controller.command(input); }
    void applied(const Vector3<>& force) noexcept override { control::applied(controller, force); }
    void reset() noexcept override { control::reset(controller); }
  };

  StateSpace linear_;
  std::unique_ptr<Interface> other_;
};

}  // namespace palpate::control
