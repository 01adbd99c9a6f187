#pragma once

/// The loops that the library palpate::core contains. A program that links it does not compile them again; without the library, this
/// header has no effect.
#if defined(PALPATE_COMPILED)

#include "palpate/control/any_controller.hpp"
#include "palpate/guard/any_guard.hpp"
#include "palpate/mechanism/premium.hpp"
#include "palpate/mechanism/slider.hpp"
#include "palpate/object/any_object.hpp"
#include "palpate/object/spring_wall.hpp"
#include "palpate/servo/loop.hpp"
#include "palpate/servo/servo.hpp"
#include "palpate/servo/simulation.hpp"

namespace palpate::servo {

#if !defined(PALPATE_CORE_SOURCE)
#define PALPATE_EXTERN extern
#else
#define PALPATE_EXTERN  // palpate::core itself
#endif

PALPATE_EXTERN template class Servo<mechanism::Premium, object::SpringWall>;
PALPATE_EXTERN template class Servo<mechanism::Premium, object::AnyObject, control::AnyController, guard::AnyGuard<mechanism::Premium>>;
PALPATE_EXTERN template class Servo<mechanism::Slider, object::AnyObject, control::AnyController, guard::AnyGuard<mechanism::Slider>>;
PALPATE_EXTERN template SimulationOutcome simulate(const SimulationSetup<mechanism::Premium>&, int, const double*, const double*,
                                                   double*) noexcept;
PALPATE_EXTERN template SimulationOutcome simulate(const SimulationSetup<mechanism::Slider>&, int, const double*, const double*,
                                                   double*) noexcept;

#undef PALPATE_EXTERN

}  // namespace palpate::servo

#endif
