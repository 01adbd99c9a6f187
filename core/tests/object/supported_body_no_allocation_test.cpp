// A step that changes the supports of a body, or moves the tips of a tool, does not allocate.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <palpate/object/body_instance.hpp>
#include <palpate/object/supported_body.hpp>
#include <utility>
#include <vector>

#include "support/allocations.hpp"
#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

template <class Phase>
class SupportedBodyNoAllocation : public testing::Test {};
using PhasesOfSteps = testing::Types<NormalContactPhase, SignedDistancePhase, Swinging>;
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

TEST(MovingToolNoAllocation, InAStepOfAToolThatTurnsAndCloses) {
  using palpate::object::BodyInstance, palpate::object::BodyPlacement, palpate::object::SignedDistanceBody;
  const std::vector<Vector3<>> open = {{-6e-3, 0.0, 0.0}, {6e-3, 0.0, 0.0}}, closed = {{-3e-3, 0.0, 0.0}, {3e-3, 0.0, 0.0}};
  palpate::object::SignedDistanceOptions options;
  options.contact_points = open;
  BodyPlacement placement;
  placement.body = std::make_shared<SignedDistanceBody>(
      std::make_shared<const SignedDistanceBody::Data>(half_space().nodes, surface()->compliance.data(), half_space().surface, options));
  placement.radius = radius;
  placement.tool = {open, closed, {{0.0, {}}, {0.1, {Vector3<>(0.0, 0.1, 0.5), 0.0}}}};
  BodyInstance instance(std::move(placement));
  instance.start(Vector3<>(0.0, 0.0, radius));
  std::vector<double> row(static_cast<std::size_t>(instance.record_width()));
  const long before = allocations;
  int touching = 0;
  for (int k = 0; k < 200; ++k) {
    if (k == 150) instance.set_tool({Vector3<>(0.1, 0.0, 0.0), 0.5});
    touching += instance.step({.position = Vector3<>(0.0, 0.0, radius - 1e-3), .rate = 1e3, .time = 1e-3 * k}).touching ? 1 : 0;
    instance.record(row.data());
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_EQ(touching, 200);
}

}  // namespace
}  // namespace supported_bodies
