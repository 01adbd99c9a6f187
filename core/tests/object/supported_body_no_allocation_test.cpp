// A step that changes the supports of a body does not allocate, whether the change is known or requested.
#include <gtest/gtest.h>

#include <cmath>
#include <palpate/object/supported_body.hpp>

#include "support/allocations.hpp"
#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

template <class Phase>
class SupportedBodyNoAllocation : public testing::Test {};
using PhasesOfSteps = testing::Types<NormalContactPhase, SignedDistancePhase>;
TYPED_TEST_SUITE(SupportedBodyNoAllocation, PhasesOfSteps);

TYPED_TEST(SupportedBodyNoAllocation, InAStepThatChangesTheSupports) {
  const auto body = make<TypeParam>({{0, free()}, {50, held_beyond(3e-3)}, {80, held_beyond(-1e-3)}, {120, free()}});
  int touching = 0;
  for (int round = 0; round < 3; ++round) {
    if (round > 0) body->change_supports(held_beyond(2e-3));
    const long before = allocations;
    for (int k = 0; k < 200; ++k) touching += body->step(sphere(1e-3 * std::sin(0.05 * k), 2e-3 * std::sin(0.02 * k))).touching ? 1 : 0;
    EXPECT_EQ(allocations - before, 0);
  }
  EXPECT_EQ(body->changes(), 5);
  EXPECT_GT(touching, 200);
}

}  // namespace
}  // namespace supported_bodies
