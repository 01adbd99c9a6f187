// Updates of a linear body in a thread of their own beside the servo's ticks. Runs under the thread sanitizer if sanitizers are enabled.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <palpate/deformable/multirate/linear_body_solver.hpp>
#include <palpate/deformable/multirate/multirate_coupling.hpp>
#include <thread>

#include "support/mass_spring_cube.hpp"
#include "support/rounds.hpp"

namespace linear_two_rates {
namespace {

using Solver = palpate::deformable::LinearBodySolver<palpate::deformable::MassSpringModel>;

palpate::deformable::TipPair pressed(double aside, double depth) {
  palpate::deformable::TipPair tips;
  tips.count = 1;
  tips.tip[0].radius = 8e-3;
  tips.tip[0].center = {10e-3 + aside, 10e-3, 20e-3 + tips.tip[0].radius - depth};
  return tips;
}

// Law: however the ticks and the updates interleave, a tip that stops feels in the end what it feels at one rate.
TEST(LinearBodySolver, UpdatesInAThreadEndInTheSameForce) {
  const Cube cube(4);
  const auto make = [&cube](double tick) { return cube.model(tick, 20.0, 4e-3); };
  palpate::deformable::MultirateCoupling<Solver> coupling(std::make_unique<Solver>(cube.nodes, make, 1e-3, 10));
  std::atomic<bool> done{false};
  std::atomic<long> updates{0};
  coupling.set_tips(pressed(0.0, 0.0));
  coupling.update_model();
  std::thread slow([&] {
    while (!done) {
      coupling.update_model();
      ++updates;
    }
  });
  long unsolved = 0;
  const auto tick = [&](const palpate::deformable::TipPair& tips) {
    const palpate::deformable::MultiTipResult& now = coupling.tick(tips);
    unsolved += now.solved ? 0 : 1;
    return now.tip[0].force;
  };
  for (int k = 0; k < 4000 * rounds(); ++k) {
    while (updates < k / 20) std::this_thread::yield();
    tick(pressed(1e-3 * std::sin(0.003 * k), 1e-3 - 1.2e-3 * std::cos(0.01 * k)));
  }
  const palpate::deformable::TipPair still = pressed(0.0, 1e-3);
  palpate::math::Vector3<> force;
  for (int k = 0; k < 4000; ++k) {
    const long seen = updates;
    force = tick(still);
    if (k % 10 == 0)
      while (updates == seen) std::this_thread::yield();
  }
  done = true;
  slow.join();
  palpate::deformable::MassSpringModel model = make(1e-3);
  palpate::deformable::TipContact<palpate::deformable::MassSpringModel> contact(cube.nodes, model);
  palpate::math::Vector3<> expected;
  for (int k = 0; k < 4000; ++k) expected = contact.step(still.tip[0]).force;
  EXPECT_LT((force - expected).norm(), 2e-3 * expected.norm());
  EXPECT_EQ(unsolved, 0);
}

}  // namespace
}  // namespace linear_two_rates
