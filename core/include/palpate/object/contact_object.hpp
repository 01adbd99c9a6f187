#pragma once

#include <concepts>
#include <limits>

#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::object {

/// The tip at one sample, in the device's frame.
template <class Scalar = double>
struct BasicTipState {
  Vector3<Scalar> position = Vector3<Scalar>::Constant(0.0);  ///< m
  double rate = 0.0;                                          ///< samples per second since the last one, 1/s; 0: first sample
  double time = 0.0;                                          ///< since the first sample, a multiple of the period, s
};
using TipState = BasicTipState<double>;

/// Contact of the tip with an object at one sample, in the device's frame.
template <class Scalar = double>
struct BasicContactResult {
  Vector3<Scalar> force = Vector3<Scalar>::Constant(0.0);       ///< of the tip on the object, N
  Vector3<Scalar> deflection = Vector3<Scalar>::Constant(0.0);  ///< displacement of the touched surface, m
  Vector3<Scalar> normal = Vector3<Scalar>::Constant(0.0);      ///< unit, out of the object; zero: no contact, or no surface
  Scalar depth = 0.0;                                           ///< penetration along the normal, m; negative: outside
  Scalar stiffness = 0.0;                                       ///< along the normal, N/m; zero: not known
  Condition<Scalar> touching = false;
  Vector3<Scalar> axis_stiffness = Vector3<Scalar>::Constant(0.0);  ///< of an object without a normal, per axis, N/m; zero: not known
};
using ContactResult = BasicContactResult<double>;

/// An object that the tip can touch. The servo calls step() once per tick; it must not allocate, lock or throw.
///
/// Required:
///   using Scalar = double;                                          // or a lane scalar (Pack)
///   const BasicContactResult<Scalar>& step(const BasicTipState<Scalar>&) noexcept;
/// Optional:
///   void start(const Vector3<>& tip)      // before the first tick
///   void reset() noexcept                 // back to the state before start()
///   void update()                         // after each tick in virtual time; may allocate
///   int record_width() const              // columns that record() writes
///   void record(double*) const noexcept   // extra columns of a recorded row
template <class T>
concept ContactObject = requires(T object, const BasicTipState<typename T::Scalar>& tip) {
  { object.step(tip) } noexcept -> std::convertible_to<const BasicContactResult<typename T::Scalar>&>;
};

/// Call optional members where an object has them.
template <class Object>
void start(Object& object, const Vector3<>& tip) {
  if constexpr (requires { object.start(tip); }) object.start(tip);
}
template <class Object>
void reset(Object& object) noexcept {
  if constexpr (requires { object.reset(); }) object.reset();
}
template <class Object>
void update(Object& object) {
  if constexpr (requires { object.update(); }) object.update();
}
template <class Object>
[[nodiscard]] int record_width(const Object& object) noexcept {
  if constexpr (requires { object.record_width(); }) return object.record_width();
  return 0;
}
template <class Object>
void record(const Object& object, double* row) noexcept {
  if constexpr (requires { object.record(row); }) object.record(row);
}

}  // namespace palpate::object
