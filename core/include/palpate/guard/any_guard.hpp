#pragma once

#include <utility>
#include <variant>

#include "palpate/guard/energy_bound.hpp"
#include "palpate/guard/guard.hpp"
#include "palpate/guard/half_sample.hpp"
#include "palpate/guard/passivity_controller.hpp"
#include "palpate/guard/sample_estimate_hold.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::guard {

/// Any guard, or none, chosen at run time. A loop has at most one.
template <class Mechanism>
class AnyGuard {
 public:
  using Angles = math::Joints<Mechanism::dof>;

  AnyGuard() = default;
  template <class Guard>
    requires requires(Guard g) {
      std::variant<PassivityController<Mechanism>, EnergyBound<Mechanism>, HalfSample<Mechanism>, SampleEstimateHold<Mechanism>>(g);
    }
  AnyGuard(Guard guard) : guard_(std::move(guard)) {}  // NOLINT(google-explicit-constructor): a guard is one of any kind

  /// Whether there is a guard.
  [[nodiscard]] bool active() const noexcept { return guard_.index() != 0; }
  /// Return the guard if it is a `Guard`, else null.
  template <class Guard>
  [[nodiscard]] const Guard* get_if() const noexcept {
    return std::get_if<Guard>(&guard_);
  }

  void prepare(const Surroundings<Mechanism>& s) noexcept {
    visit([&](auto& one) { one.prepare(s); });
  }
  [[nodiscard]] bool predicts() const noexcept { return std::holds_alternative<HalfSample<Mechanism>>(guard_); }
  Angles predict(const Angles& q, double rate) noexcept {
    return visit([&](auto& one) { return guard::predict(one, q, rate); });
  }
  void contact(const object::ContactResult& result) noexcept {
    visit([&](auto& one) { guard::contact(one, result); });
  }
  math::Vector3<> command(const Angles& q, const math::Vector3<>& wanted, const math::Vector3<>& moved) noexcept {
    return visit([&](auto& one) { return guard::command(one, q, wanted, moved); });
  }
  double share(const Angles& q, const Angles& torque) noexcept {
    return visit([&](auto& one) { return guard::share(one, q, torque); });
  }
  void commit(const Angles& torque) noexcept {
    visit([&](auto& one) { guard::commit(one, torque); });
  }
  void lose_sample() noexcept {
    visit([](auto& one) { guard::lose_sample(one); });
  }
  void reset() noexcept {
    visit([](auto& one) { one.reset(); });
  }

 private:
  /// Call `calls` with the guard. The variant is never empty, so nothing is thrown.
  template <class Calls>
  decltype(auto) visit(Calls calls) noexcept {
    if (auto* one = std::get_if<1>(&guard_)) return calls(*one);
    if (auto* one = std::get_if<2>(&guard_)) return calls(*one);
    if (auto* one = std::get_if<3>(&guard_)) return calls(*one);
    if (auto* one = std::get_if<4>(&guard_)) return calls(*one);
    return calls(*std::get_if<0>(&guard_));
  }

  std::variant<NoGuard, PassivityController<Mechanism>, EnergyBound<Mechanism>, HalfSample<Mechanism>, SampleEstimateHold<Mechanism>>
      guard_;
};

/// Whether a guard acts in its servo.
template <class Guard>
[[nodiscard]] bool active(const Guard& guard) noexcept {
  if constexpr (requires { guard.active(); }) return guard.active();
  return may_guard<Guard>;
}

}  // namespace palpate::guard
