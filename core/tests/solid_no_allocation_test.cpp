// The servo's tick on a solid's snapshots takes no memory, also when a new one comes; the slow steps may.
#include <gtest/gtest.h>

#include <memory>
#include <palpate/body/blended.hpp>
#include <palpate/body/neo_hookean.hpp>

#include "allocations.hpp"
#include "solid_blocks.hpp"

namespace {

TEST(SolidNoAllocation, InATickOfTwoTips) {
  const SolidBlock block(8, 6, 3, 8e3, 0.4);
  palpate::PressedSolid<palpate::NeoHookean, 2> slow(block.mesh, block.top(), {});
  auto box = std::make_unique<palpate::BlendedContact::Box>();
  auto servo = std::make_unique<palpate::BlendedContact>();
  palpate::BodyTips tips;
  tips.count = 2;
  long counted = 0, pressed = 0;
  for (int k = 0; k < 800; ++k) {
    for (std::size_t t = 0; t < 2; ++t)
      tips.tip[t].centre = {0.012 + 0.016 * static_cast<double>(t) + 4e-3 * std::sin(0.01 * k), 0.015, 0.019 + 3e-3 * std::cos(0.02 * k)};
    if (k % 20 == 0) {
      slow.step(tips, box->writing());
      box->publish();
    }
    const long before = allocations;
    pressed += servo->step(*box, tips).nodes;
    counted += allocations - before;
  }
  EXPECT_EQ(counted, 0);
  EXPECT_GT(pressed, 400);
}

}  // namespace
