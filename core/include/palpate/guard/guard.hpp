#pragma once

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::guard {

/// What a guard needs to know of the servo it works in.
template <class Mechanism>
struct Surroundings {
  Mechanism mechanism{};
  math::Joints<Mechanism::dof> encoder_step = math::Joints<Mechanism::dof>::Zero();  ///< per count, rad; 0: exact
  double period = 1e-3;                                                              ///< s
  int delay = 0;  ///< servo periods from the computation of a torque to its application
};

/// A guard acts on the signals of one servo loop in the time domain, behind any object and controller. Scalar loops only; no allocation.
///
/// Required:
///   void prepare(const Surroundings<Mechanism>&) noexcept   // before the first tick
///   void reset() noexcept
/// Optional, in the order of a tick:
///   bool predicts() const noexcept                                            // whether predict() acts
///   Joints predict(const Joints& q, double rate) noexcept                     // angles whose tip is handed to the object
///   void contact(const ContactResult&) noexcept                               // of the object with that tip
///   Vector3<> command(const Joints& q, const Vector3<>& wanted,
///                     const Vector3<>& moved) noexcept                        // tip force in place of the controller's, N
///   double share(const Joints& q, const Joints& torque) noexcept              // share of the limited torque to apply, 0 to 1
///   void commit(const Joints& torque) noexcept                                // torque that acts `delay` periods from now
///   void lose_sample() noexcept                                               // the sample was invalid; commit() follows
///
/// `torque` is that of the command, without gravity compensation.
struct NoGuard {
  static constexpr bool never = true;  ///< the servo contains no guard at all
  template <class Surroundings>
  void prepare(const Surroundings& /*s*/) noexcept {}
  void reset() noexcept {}
};

/// Whether a servo with this type of guard may have one.
template <class Guard>
constexpr bool may_guard = !requires { Guard::never; };

/// Whether a guard hands predicted angles to the object.
template <class Guard>
[[nodiscard]] bool predicts(const Guard& guard) noexcept {
  if constexpr (requires { guard.predicts(); }) return guard.predicts();
  return false;
}

/// Call optional members where a guard has them.
template <class Guard, class Angles>
Angles predict(Guard& guard, const Angles& q, double rate) noexcept {
  if constexpr (requires { guard.predict(q, rate); }) return guard.predict(q, rate);
  return q;
}
template <class Guard>
void contact(Guard& guard, const object::ContactResult& result) noexcept {
  if constexpr (requires { guard.contact(result); }) guard.contact(result);
}
template <class Guard, class Angles>
math::Vector3<> command(Guard& guard, const Angles& q, const math::Vector3<>& wanted, const math::Vector3<>& moved) noexcept {
  if constexpr (requires { guard.command(q, wanted, moved); }) return guard.command(q, wanted, moved);
  return wanted;
}
template <class Guard, class Angles>
double share(Guard& guard, const Angles& q, const Angles& torque) noexcept {
  if constexpr (requires { guard.share(q, torque); }) return guard.share(q, torque);
  return 1.0;
}
template <class Guard, class Angles>
void commit(Guard& guard, const Angles& torque) noexcept {
  if constexpr (requires { guard.commit(torque); }) guard.commit(torque);
}
template <class Guard>
void lose_sample(Guard& guard) noexcept {
  if constexpr (requires { guard.lose_sample(); }) guard.lose_sample();
}

}  // namespace palpate::guard
