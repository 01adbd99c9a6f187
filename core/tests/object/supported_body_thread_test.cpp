// A thread asks for changes of the supports while another steps the body.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <palpate/object/supported_body.hpp>
#include <thread>

#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

TEST(SupportedBodyThread, RequestsAndStepsDoNotWaitForEachOther) {
  const auto body = make<NormalContactPhase>({{0, free()}});
  std::atomic<bool> ended{false};
  std::thread asking([&] {
    for (int k = 0; k < 8; ++k) EXPECT_TRUE(body->change_supports(k % 2 == 0 ? held_beyond(3e-3) : free()));
    ended = true;
  });
  int steps = 0;
  double largest = 0.0;
  for (; steps < 200 || !ended; ++steps) largest = std::max(largest, body->step(sphere(1e-3 * std::sin(0.05 * steps))).force.norm());
  asking.join();
  body->step(sphere(0.5e-3));
  EXPECT_GE(body->changes(), 1);
  EXPECT_LE(body->changes(), 8);
  EXPECT_GT(largest, 0.0);
  const auto plain = make<NormalContactPhase>({{0, free()}});  // the last request releases
  plain->step(sphere(0.5e-3));
  EXPECT_LT((body->last().force - plain->last().force).norm(), 1e-4 * plain->last().force.norm());
}

}  // namespace
}  // namespace supported_bodies
