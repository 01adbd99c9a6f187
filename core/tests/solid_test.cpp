// Solids under large displacements, pressed through snapshots: statics, compliance, and the account of the servo's energy.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>
#include <palpate/deformable/multirate/passive_model_switch.hpp>
#include <random>

#include "solid_blocks.hpp"

namespace {

// Under a load that bends it far, Newton's steps end at rest, the last ones with quadratic speed, and the energy has only fallen.
TEST(Solids, NewtonComesToRestUnderALargeLoad) {
  const SolidBlock block(2, 2, 6, 1e4, 0.4);
  palpate::deformable::HyperelasticModel<palpate::deformable::NeoHookean, 2> solid(block.mesh);
  std::vector<double> load(solid.unknowns(), 0.0);
  for (std::int32_t i = 0; i < solid.free_nodes(); ++i)
    if (block.at(solid.point_of(i)).z() > 6 * block.side - 1e-9) load[3 * static_cast<std::size_t>(i)] = 2e-3;
  double total = 0.0, residual = 0.0;
  for (int k = 0; k < 30; ++k) {
    const auto step = solid.step(load.data(), 1e-4F, 200);
    residual = step.residual;
    double now = solid.energy();
    for (std::size_t i = 0; i < load.size(); ++i) now -= load[i] * solid.displacement()[i];
    ASSERT_LE(now, total + 1e-12);
    total = now;
  }
  EXPECT_LT(residual, 1e-11);
  double far = 0.0;
  for (std::size_t i = 0; i < solid.unknowns(); i += 3) far = std::max(far, solid.displacement()[i]);
  EXPECT_GT(far, 8e-3);
}

// Two tips that dance on it with slow steps in turn: what they put in is the potential and what is saved, neither is negative, and every
// snapshot's compliance is symmetric with a positive diagonal. (Each tick goes half of a random step, for the sum's sake.)
TEST(Solids, TipsGetOutNoMoreThanTheyPutIn) {
  const SolidBlock block(8, 6, 4, 8e3, 0.4);
  palpate::deformable::SolverOptions effort;
  effort.near = 16;
  palpate::deformable::QuasiStaticSolver<palpate::deformable::NeoHookean, 2> slow(block.mesh, block.top(), effort);
  auto box = std::make_unique<palpate::deformable::PassiveModelSwitch::ModelBuffer>();
  auto servo = std::make_unique<palpate::deformable::PassiveModelSwitch>();
  palpate::deformable::TipPair tips;
  tips.count = 2;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::array<palpate::math::Vector3<>, 2> place{palpate::math::Vector3<>(0.012, 0.015, 0.0), palpate::math::Vector3<>(0.028, 0.015, 0.0)},
      way{}, step{};
  double work = 0.0, most = 0.0, error = 0.0;
  long touched = 0;
  palpate::deformable::MultiTipResult last;
  std::array<palpate::math::Vector3<>, 2> before{};
  for (int k = 0; k < 12000; ++k) {
    for (std::size_t t = 0; t < 2; ++t) {
      for (int a = 0; a < 3 && k % 2 == 0; ++a) step[t][a] = 0.01 * (-way[t][a] + 3e-3 * normal(random));
      way[t] += step[t];
      palpate::deformable::Tip& tip = tips.tip[t];
      tip.radius = 7e-3;
      tip.centre = place[t] + 6.0 * way[t] + palpate::math::Vector3<>(0, 0, 0.02 + tip.radius - 1.5e-3 + 4e-3 * std::cos(2e-3 * k));
    }
    if (k % 80 == 0) {
      slow.step(tips, box->write_slot());
      box->publish();
      const palpate::deformable::LocalModel& state = slow.state();
      for (std::int32_t i = 0; i < state.nodes.size(); ++i) {
        ASSERT_GT(state.between(i, i), 0.0);
        for (std::int32_t j = 0; j < i; ++j) ASSERT_EQ(state.between(i, j), state.between(j, i));
      }
    }
    const palpate::deformable::MultiTipResult& now = servo->step(*box, tips);
    ASSERT_TRUE(now.solved);
    ASSERT_GE(servo->account().saved, 0.0);
    ASSERT_GE(now.energy, 0.0);
    for (std::size_t t = 0; t < 2 && k > 0; ++t) work -= 0.5 * (now.tip[t].force + last.tip[t].force).dot(tips.tip[t].centre - before[t]);
    if (now.nodes == 0) work = 0.0;
    error = std::max(error, std::abs(work - now.energy - servo->account().saved));
    most = std::max(most, now.energy);
    touched += now.nodes > 0 ? 1 : 0;
    last = now;
    before = {tips.tip[0].centre, tips.tip[1].centre};
  }
  EXPECT_GT(touched, 2000);
  EXPECT_LT(touched, 12000);
  EXPECT_GT(most, 1e-4);
  EXPECT_LT(error, 0.015 * most);  // the sum of finite steps
}

}  // namespace
