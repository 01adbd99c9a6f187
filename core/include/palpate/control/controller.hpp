#pragma once

#include <concepts>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::control {

/// Signals of one servo tick that a controller may use. Device frame; SI units.
template <class Scalar = double>
struct BasicTickInput {
  const Vector3<Scalar>& reference;                   ///< force the object should feel, N; zero for an impedance display
  const Vector3<Scalar>& object_force;                ///< of the tip on the object, N
  const Vector3<Scalar>& deflection;                  ///< of the touched surface, m
  const Vector3<Scalar>& tip;                         ///< measured position, m
  const Vector3<Scalar>& previous_tip;                ///< at the last tick, m
  double rate;                                        ///< 1 / time since the last tick, 1/s
  double time;                                        ///< since the first tick, s
  const object::BasicContactResult<Scalar>& contact;  ///< of this tick: normal, signed depth, local stiffness
  const Scalar* angles;                               ///< measured joint angles, rad; as many as the mechanism has joints
  const Vector3<Scalar>& gravity_compensation;        ///< constant tip force that the servo adds to the command, N
  Scalar force_limit;                                 ///< of the motors at the tip at this tick, N; infinity: none

  /// Return the tip's velocity by backward difference [m/s].
  [[nodiscard]] Vector3<Scalar> velocity() const noexcept { return (tip - previous_tip) * rate; }
};
using TickInput = BasicTickInput<double>;

/// A controller from the signals of a tick to a force at the tip [N]. Both calls happen once per tick; they must not allocate, lock or
/// throw.
///
/// Required:
///   using Scalar = double;                                     // or a lane scalar (Pack)
///   Vector3<Scalar> command(const BasicTickInput<Scalar>&) noexcept;
/// Optional:
///   void applied(const Vector3<Scalar>& force) noexcept        // force that the drive really gave: anti-windup
///   void reset() noexcept
///   bool motors_alone() const noexcept                         // the reference is the operator's measured force, the command the motors'
///   const Vector3<Scalar>* touching() const noexcept           // position at which the object is touched, m; null: the tip
///   int record_width() const noexcept                          // columns that record() writes
///   void record(double*) const noexcept                        // extra columns of a recorded row
template <class T>
concept Controller = requires(T controller, const BasicTickInput<typename T::Scalar>& input) {
  { controller.command(input) } noexcept -> std::convertible_to<Vector3<typename T::Scalar>>;
};

/// Call optional members where a controller has them.
template <class C, class Scalar>
[[gnu::always_inline]] inline void applied(C& controller, const Vector3<Scalar>& force) noexcept {
  if constexpr (requires { controller.applied(force); }) controller.applied(force);
}
template <class C>
void reset(C& controller) noexcept {
  if constexpr (requires { controller.reset(); }) controller.reset();
}
template <class C>
[[nodiscard, gnu::always_inline]] inline bool motors_alone(const C& controller) noexcept {
  if constexpr (requires { controller.motors_alone(); }) return controller.motors_alone();
  return false;
}
template <class C>
[[nodiscard]] int record_width(const C& controller) noexcept {
  if constexpr (requires { controller.record_width(); }) return controller.record_width();
  return 0;
}
template <class C>
void record(const C& controller, double* row) noexcept {
  if constexpr (requires { controller.record(row); }) controller.record(row);
}

}  // namespace palpate::control
