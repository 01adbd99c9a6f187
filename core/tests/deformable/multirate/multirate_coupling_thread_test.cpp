// Model updates in a thread of their own beside the servo's ticks. Runs under the thread sanitizer if sanitizers are enabled.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>
#include <palpate/deformable/hyperelastic/quasi_static_solver.hpp>
#include <palpate/deformable/multirate/multirate_coupling.hpp>
#include <thread>

#include "support/rounds.hpp"
#include "support/tet_block.hpp"

namespace {

using Solver = palpate::deformable::QuasiStaticSolver<palpate::deformable::NeoHookean, 2>;
using Coupling = palpate::deformable::MultirateCoupling<Solver>;

palpate::deformable::TipPair pressed(double aside, double depth) {
  palpate::deformable::TipPair tips;
  tips.count = 1;
  tips.tip[0].radius = 8e-3;
  tips.tip[0].center = {0.01 + aside, 0.01, 0.01 + tips.tip[0].radius - depth};
  return tips;
}

// Law: however the ticks and the updates interleave, each force is solved and bounded, and a tip that stops feels in the end what it feels
// with updates between the ticks. Twenty ticks or more pass in an update, but the servo waits for late ones: it gives no force to a tip
// that enters the body unseen.
TEST(MultirateCoupling, UpdatesInAThreadEndInTheSameForce) {
  const TetBlock block(4, 4, 2, 8e3, 0.4);
  Coupling coupling(std::make_unique<Solver>(block.mesh, block.top(), palpate::deformable::SolverOptions{.nodes_per_tip = 9}));
  std::atomic<bool> done{false};
  std::atomic<long> updates{0};
  coupling.set_tips(pressed(0.0, 0.0));
  std::thread slow([&] {
    while (!done) {
      coupling.update_model();
      ++updates;
    }
  });
  double largest = 0.0;
  long unsolved = 0;
  const auto tick = [&](const palpate::deformable::TipPair& tips) {
    const palpate::deformable::MultiTipResult& now = coupling.tick(tips);
    largest = std::max(largest, now.tip[0].force.norm());
    unsolved += now.solved ? 0 : 1;
    return now.tip[0].force;
  };
  for (int k = 0; k < 5000 * rounds(); ++k) {
    while (updates < k / 20) std::this_thread::yield();
    tick(pressed(1e-3 * std::sin(0.003 * k), 1e-3 - 1.2e-3 * std::cos(0.01 * k)));
  }
  const palpate::deformable::TipPair still = pressed(0.0, 1e-3);
  for (const long until = updates + 30; updates < until;) tick(still);
  const palpate::math::Vector3<> force = tick(still);
  done = true;
  slow.join();
  ASSERT_TRUE(coupling.settle(still, 100));
  const palpate::math::Vector3<> expected = coupling.model_switch().last().tip[0].force;
  EXPECT_LT((force - expected).norm(), 1e-2 * expected.norm());
  EXPECT_LT(largest, 20.0 * expected.norm());
  EXPECT_EQ(unsolved, 0);
}

}  // namespace
