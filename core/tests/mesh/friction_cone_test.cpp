// Where a sliding proxy stops.
#include <gtest/gtest.h>

#include <limits>
#include <palpate/mesh/friction_cone.hpp>

namespace {

using palpate::mesh::FrictionCone;
using palpate::mesh::SlidingState;

const FrictionCone viscous_cone{.mu_static = 0.5, .mu_dynamic = 0.3, .drag = 0.7};
constexpr double pressed_depth = 2.0;

// Law: a slide ends where the spring holds friction: lag = mu_d depth + drag (distance slid in the tick).
TEST(FrictionCone, ASlideEndsWhereTheSpringHoldsDryAndViscousFriction) {
  for (const double before : {0.0, 1.1})
    for (const double lag : {2.0, 5.0, 40.0}) {
      const double rest = viscous_cone.remaining_lag(lag, pressed_depth, before, true);
      EXPECT_NEAR(rest, 0.3 * pressed_depth + 0.7 * (before + lag - rest), 1e-12);
    }
}

// Law: a slide that is interrupted, as by an edge, ends where the whole slide ends.
TEST(FrictionCone, ASlideInTwoPartsEndsWhereOneEnds) {
  const double whole = viscous_cone.remaining_lag(5.0, pressed_depth, 0.0, true);
  for (const double first : {0.1, 1.0, 2.0}) EXPECT_NEAR(viscous_cone.remaining_lag(5.0 - first, pressed_depth, first, true), whole, 1e-12);
}

// Law: a resting proxy sticks up to static friction, a sliding one stops at dynamic friction; viscous friction never pushes it on.
TEST(FrictionCone, StaticFrictionHoldsAProxyAtRestAndDynamicFrictionASlidingOne) {
  const FrictionCone dry{.mu_static = 0.5, .mu_dynamic = 0.3};
  EXPECT_EQ(dry.remaining_lag(0.99, pressed_depth, 0.0, false), 0.99);
  EXPECT_NEAR(dry.remaining_lag(1.01, pressed_depth, 0.0, false), 0.6, 1e-12);
  EXPECT_NEAR(dry.remaining_lag(0.99, pressed_depth, 0.0, true), 0.6, 1e-12);
  EXPECT_EQ(dry.remaining_lag(0.59, pressed_depth, 0.0, true), 0.59);
  EXPECT_EQ(viscous_cone.remaining_lag(1.0, pressed_depth, 50.0, true), 1.0);
  EXPECT_EQ(FrictionCone{}.remaining_lag(1.0, pressed_depth, 0.0, false), 0.0);
  FrictionCone endless;
  endless.mu_static = endless.mu_dynamic = std::numeric_limits<double>::infinity();
  EXPECT_EQ(endless.remaining_lag(1e9, 1e-9, 0.0, true), 1e9);
}

// Law: a proxy slides if it slid in the last tick, or farther than rounding in this one.
TEST(FrictionCone, RoundingDoesNotChooseTheFriction) {
  EXPECT_FALSE((SlidingState{.distance = 1e-12, .threshold = 1e-9}.sliding()));
  EXPECT_TRUE((SlidingState{.distance = 1e-8, .threshold = 1e-9}.sliding()));
  EXPECT_TRUE((SlidingState{.was_sliding = true}.sliding()));
}

}  // namespace
