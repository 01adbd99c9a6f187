// Passive switching of local models: energy balance of the tank, symmetry of the compliance.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>
#include <palpate/deformable/multirate/passive_model_switch.hpp>
#include <random>
#include <vector>

#include "support/tet_block.hpp"

namespace {

// A soft block, its slow solver, and the servo's side of it.
struct SwitchedBlock {
  TetBlock block;
  palpate::deformable::QuasiStaticSolver<palpate::deformable::NeoHookean, 2> solver;
  std::unique_ptr<palpate::deformable::PassiveModelSwitch::ModelBuffer> models =
      std::make_unique<palpate::deformable::PassiveModelSwitch::ModelBuffer>();
  std::unique_ptr<palpate::deformable::PassiveModelSwitch> servo = std::make_unique<palpate::deformable::PassiveModelSwitch>();

  SwitchedBlock(int nx, int ny, int nz) : block(nx, ny, nz, 8e3, 0.4), solver(block.mesh, block.top(), {.nodes_per_tip = 16}) {}
  SwitchedBlock(int nx, int ny, int nz, palpate::deformable::LayerModulus layer)
      : block(nx, ny, nz, 8e3, 0.4), solver(block.mesh, with_layer(block.top(), layer), {.nodes_per_tip = 16}) {}

  static palpate::deformable::TetSurface with_layer(palpate::deformable::TetSurface surface, palpate::deformable::LayerModulus layer) {
    surface.modulus.assign(surface.point.size(), layer);
    return surface;
  }
};

/// A spring along z in place of a body. Below a depth its force is not found: force and energy are then without meaning.
struct Spring {
  double stiffness = 0.0, known_depth = 1.0;  // N/m, m
  bool has_memory = false;
  double returnable = 0.0;
  double stored = 0.0;  // besides the spring's energy, J; see StoringContact

  [[nodiscard]] bool empty() const { return stiffness == 0.0; }
};
struct SpringContact {
  using Model = Spring;
  palpate::deformable::MultiTipResult result;

  const palpate::deformable::MultiTipResult& solve(const Spring& model, const palpate::deformable::TipPair& tips, double scale) {
    const double depth = std::max(-tips.tip[0].center.z(), 0.0);
    result = {};
    result.solved = result.tip[0].solved = depth < model.known_depth;
    const double stiffness = scale * model.stiffness * (result.solved ? 1.0 : 1e15);  // a stiffened body returns less energy
    result.energy = 0.5 * stiffness * depth * depth;
    result.tip[0].force.z() = stiffness * depth;
    result.nodes = depth > 0.0 ? 1 : 0;
    return result;
  }
  void start_from(const Spring& /*model*/, const SpringContact& /*other*/) {}
  [[nodiscard]] const palpate::deformable::MultiTipResult& last() const { return result; }
};

/// The same with more energy. Its force is that of the state, which a stiffened model keeps.
struct StoringContact : SpringContact {
  const palpate::deformable::MultiTipResult& solve(const Spring& model, const palpate::deformable::TipPair& tips, double scale) {
    SpringContact::solve(model, tips, 1.0);
    result.energy = result.nodes > 0 ? scale * result.energy + model.stored : 0.0;
    return result;
  }
};

// Law: forces that were not found neither supply energy nor fill the tank, in the old model or in the new one.
TEST(PassiveModelSwitch, ForcesThatWereNotFoundSupplyNoEnergy) {
  for (const double first : {1e-3, 1.0})
    for (const double second : {1e-3, 1.0}) {
      palpate::deformable::BasicPassiveModelSwitch<SpringContact> servo;
      decltype(servo)::ModelBuffer models;
      const auto publish = [&](double stiffness, double known) {
        models.write_slot() = {.stiffness = stiffness, .known_depth = known};
        models.publish();
      };
      publish(100.0, first);
      palpate::deformable::TipPair tips;
      tips.count = 1;
      double work = 0.0, force = 0.0, largest = 0.0;
      int not_found = 0;
      for (int k = 0; k <= 1200; ++k) {
        if (k > 0 && k % 100 == 0) publish(k % 200 == 0 ? 100.0 : 130.0, k % 200 == 0 ? first : second);
        const double before = tips.tip[0].center.z();
        tips.tip[0].center.z() = 1e-4 - 1e-3 * (1.0 - std::cos(2.0 * M_PI * k / 1200.0));
        const auto& result = servo.step(models, tips);
        if (k > 0) work -= 0.5 * (force + result.tip[0].force.z()) * (tips.tip[0].center.z() - before);
        force = result.tip[0].force.z();
        largest = std::max(largest, force);
        not_found += result.solved ? 0 : 1;
        ASSERT_LE(servo.tank().potential + servo.tank().level, 1.05 * work + 1e-9) << first << " " << second << " " << k;
        ASSERT_GE(work, -1e-9);
      }
      EXPECT_LE(largest, 0.26);  // 130 N/m at the largest depth
      EXPECT_EQ(not_found > 0, first + second < 2.0);
    }
}

// Law: where each model needs more energy than the one before, the tank is empty, and the forces of an earlier model remain. They count as
// not found from some time on, until the tip has left. work = potential + tank at each tick.
TEST(PassiveModelSwitch, ForcesThatStayBehindForWantOfEnergyAreNotFound) {
  palpate::deformable::BasicPassiveModelSwitch<StoringContact> servo;
  decltype(servo)::ModelBuffer models;
  palpate::deformable::TipPair tips;
  tips.count = 1;
  double work = 0.0, stiffness = 100.0, stored = 0.0;
  palpate::math::Vector3<> force = palpate::math::Vector3<>::Zero();
  int first = -1;
  for (int k = 0; k < 3000; ++k) {
    if (k % 20 == 0) {
      models.write_slot() = {.stiffness = stiffness, .stored = stored};
      models.publish();
      if (k >= 500) {
        stiffness *= 1.004;
        stored += 4e-7;
      }
    }
    const palpate::math::Vector3<> move(k < 250 ? 0.0 : 5e-6, 0.0, k < 250 ? -4e-6 : 0.0);
    tips.tip[0].center += move;
    const auto& result = servo.step(models, tips);
    work -= force.dot(move);
    force = result.tip[0].force;
    if (k < 250) work = result.energy + servo.tank().level;
    ASSERT_NEAR(work, result.energy + servo.tank().level, 1e-6 * work) << k;
    if (first < 0 && !result.solved) first = k;
    ASSERT_EQ(result.solved, first < 0) << k;
    if (first < 0 && k > 250) ASSERT_GT(force.z(), 0.88e-3 * stiffness);
  }
  EXPECT_GT(first, 650);
  EXPECT_LT(force.z(), 0.8e-3 * stiffness);
  tips.tip[0].center.z() = 1e-3;
  EXPECT_TRUE(servo.step(models, tips).solved);
}

// Law: round tips press the layer by its modulus for round tips, in the updates and in the ticks, and flat ends by that for flat ends.
TEST(PassiveModelSwitch, TipsPressTheLayerOfTheirKind) {
  const auto force = [](palpate::deformable::Tip::Kind kind, palpate::deformable::LayerModulus layer) {
    SwitchedBlock body(6, 4, 2, layer);
    palpate::deformable::TipPair tips;
    tips.count = 1;
    palpate::deformable::Tip& tip = tips.tip[0];
    tip.kind = kind;
    tip.radius = 7e-3;
    tip.center = {0.013, 0.011, 0.01 + (kind == palpate::deformable::Tip::Kind::flat ? 0.0 : tip.radius) - 1e-3};
    for (int k = 0; k < 10; ++k) body.solver.step(tips, body.models->write_slot());
    body.models->publish();
    return body.servo->step(*body.models, tips).tip[0].force.z();
  };
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    const bool flat = kind == palpate::deformable::Tip::Kind::flat;
    const double own = flat ? 3e4 : 5e3, other = flat ? 5e3 : 3e4, found = force(kind, {5e3, 3e4});
    EXPECT_EQ(found, force(kind, {own, own}));
    EXPECT_GT(std::abs(found - force(kind, {other, other})), 0.05 * std::abs(found));
  }
}

// Two tips in random motion with synchronous model updates: their work equals potential plus tank level, both nonnegative, and each model's
// compliance is symmetric with a positive diagonal. (Each random step takes two ticks, for an accurate sum.)
TEST(PassiveModelSwitch, WorkEqualsPotentialPlusTankLevel) {
  SwitchedBlock body(8, 6, 4);
  auto& [block, solver, models, servo] = body;
  palpate::deformable::TipPair tips;
  tips.count = 2;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::array<palpate::math::Vector3<>, 2> place{palpate::math::Vector3<>(0.012, 0.015, 0.0), palpate::math::Vector3<>(0.028, 0.015, 0.0)},
      way, step;
  double work = 0.0, most = 0.0, error = 0.0;
  long touched = 0;
  palpate::deformable::MultiTipResult last;
  std::array<palpate::math::Vector3<>, 2> before;
  for (auto* vectors : {&way, &step, &before})
    vectors->fill(palpate::math::Vector3<>::Zero());  // braces do not: Eigen leaves them undefined
  for (int k = 0; k < 4000; ++k) {
    for (std::size_t t = 0; t < 2; ++t) {
      for (int a = 0; a < 3 && k % 2 == 0; ++a) step[t][a] = 0.01 * (-way[t][a] + 3e-3 * normal(random));
      way[t] += step[t];
      palpate::deformable::Tip& tip = tips.tip[t];
      tip.radius = 7e-3;
      tip.center = place[t] + 5.0 * way[t] + palpate::math::Vector3<>(0, 0, 0.02 + tip.radius - 1.5e-3 + 4e-3 * std::cos(2e-3 * k));
    }
    if (k % 80 == 0) {
      solver.step(tips, models->write_slot());
      models->publish();
      const palpate::deformable::LocalModel& state = solver.local_model();
      for (std::int32_t i = 0; i < state.nodes.size(); ++i) {
        ASSERT_GT(state.compliance(i, i), 0.0);
        for (std::int32_t j = 0; j < i; ++j) ASSERT_EQ(state.compliance(i, j), state.compliance(j, i));
      }
    }
    const palpate::deformable::MultiTipResult& now = servo->step(*models, tips);
    ASSERT_TRUE(now.solved);
    ASSERT_GE(servo->tank().level, 0.0);
    ASSERT_GE(now.energy, 0.0);
    for (std::size_t t = 0; t < 2 && k > 0; ++t) work -= 0.5 * (now.tip[t].force + last.tip[t].force).dot(tips.tip[t].center - before[t]);
    if (now.nodes == 0) {
      work = 0.0;
      ASSERT_EQ(servo->tank().level, 0.0);  // a free body stores nothing
    }
    error = std::max(error, std::abs(work - now.energy - servo->tank().level));
    most = std::max(most, now.energy);
    touched += now.nodes > 0 ? 1 : 0;
    last = now;
    before = {tips.tip[0].center, tips.tip[1].center};
  }
  EXPECT_GT(touched, 1000);
  EXPECT_LT(touched, 4000);
  EXPECT_GT(most, 1e-4);
  EXPECT_LT(error, 0.015 * most);  // quadrature error of the work
}

// Law: a model is blended in over the time that the last one took to arrive, linearly: the result of a tip that rests is the mean of those
// of both models, its force, energy and deflection alike.
TEST(PassiveModelSwitch, ABlendIsTheMeanOfBothModels) {
  SwitchedBlock body(6, 4, 2);
  palpate::deformable::TipPair tips;
  tips.count = 1;
  tips.tip[0].radius = 7e-3;
  const auto publish = [&](double depth) {
    tips.tip[0].center = {0.013, 0.011, 0.01 + tips.tip[0].radius - depth};
    for (int k = 0; k < 10; ++k) body.solver.step(tips, body.models->write_slot());
    body.models->publish();
  };
  constexpr int ticks = 20;
  publish(1e-3);
  palpate::deformable::ContactResult before, after;
  const double depth = 2e-3;
  const auto step = [&] {
    tips.tip[0].center.z() = 0.01 + tips.tip[0].radius - depth;
    return body.servo->step(*body.models, tips).tip[0];
  };
  for (int k = 0; k < ticks; ++k) before = step();
  publish(3e-3);
  std::vector<palpate::deformable::ContactResult> blend;
  for (int k = 0; k < ticks; ++k) blend.push_back(step());
  for (int k = 0; k < 3; ++k) after = step();
  EXPECT_FALSE(body.servo->tank().empty);
  EXPECT_NEAR(-before.deflection.z(), 0.8 * depth, 0.1 * depth);  // mean under Hertz's pressure: depth - <r^2> / (2 R)
  ASSERT_GT((after.force - before.force).norm(), 5e-3 * before.force.norm());
  ASSERT_GT((after.deflection - before.deflection).norm(), 5e-3 * before.deflection.norm());
  ASSERT_GT(std::abs(after.energy - before.energy), 5e-3 * before.energy);
  for (int k = 0; k < ticks; ++k) {
    const auto mean = [k](const auto& one, const auto& two) { return (1.0 - (k + 1.0) / ticks) * one + (k + 1.0) / ticks * two; };
    const auto& at = blend[static_cast<std::size_t>(k)];
    EXPECT_LT((at.force - mean(before.force, after.force)).norm(), 2e-3 * (after.force - before.force).norm()) << k;
    EXPECT_LT((at.deflection - mean(before.deflection, after.deflection)).norm(), 2e-3 * (after.deflection - before.deflection).norm())
        << k;
    EXPECT_NEAR(at.energy, mean(before.energy, after.energy), 2e-3 * std::abs(after.energy - before.energy)) << k;
  }
}

// Law: models are accepted as they arrive, but for those that follow a late one: its longer blend delays the next ones less and less.
TEST(PassiveModelSwitch, ALateModelDelaysTheLaterOnesOnce) {
  SwitchedBlock body(6, 4, 2);
  palpate::deformable::TipPair tips;
  tips.count = 1;
  tips.tip[0].radius = 7e-3;
  tips.tip[0].center = {0.013, 0.011, 0.01 + 7e-3 - 1e-3};
  for (int k = 0; k < 30; ++k) body.solver.step(tips, body.models->write_slot());
  body.models->publish();
  for (const int interval : {1, 4, 20}) {
    const int late = interval + std::max(interval / 2, 1);
    bool accepted = false;
    for (int model = 0; model < 12; ++model) {
      for (int k = 0; k < (model == 3 ? late : interval); ++k) {
        body.servo->step(*body.models, tips);
        if (k == 0) accepted = body.servo->current_model(*body.models).version == body.solver.local_model().version;
      }
      ASSERT_FALSE(body.servo->tank().empty);
      if (model > 8) {
        EXPECT_TRUE(accepted) << interval << " " << model;
      }
      body.solver.step(tips, body.models->write_slot());
      body.models->publish();
    }
  }
}

}  // namespace
