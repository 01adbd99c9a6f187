// Ticks of a linear body at two rates do not allocate, including model switches; model updates may.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <palpate/deformable/multirate/linear_body_solver.hpp>
#include <palpate/deformable/multirate/linear_local_slip.hpp>
#include <palpate/object/multirate_object.hpp>

#include "support/allocations.hpp"
#include "support/mass_spring_cube.hpp"

namespace linear_two_rates {
namespace {

using palpate::deformable::LinearBodySolver, palpate::deformable::LinearLocalSlip, palpate::deformable::MassSpringModel;

TEST(LinearTwoRatesNoAllocation, InATickWithFriction) {
  const Cube cube(4);
  palpate::deformable::TangentialCompliance across(static_cast<std::size_t>(cube.nodes.size()));
  for (std::int32_t i = 0; i < cube.nodes.size(); ++i) across.set(i, i, 0.02 * Eigen::Matrix2d::Identity());
  palpate::object::MultirateObject<LinearBodySolver<MassSpringModel>, LinearLocalSlip> body(
      std::make_unique<LinearBodySolver<MassSpringModel>>(
          cube.nodes, [&cube](double tick) { return cube.model(tick, 10.0, 2e-3); }, 1e-3, 20),
      20, LinearLocalSlip({0.5, 0.4}, cube.nodes, across));
  long counted = 0, pressed = 0, empty = 0;
  double friction = 0.0;
  for (const auto kind : {palpate::deformable::Tip::Kind::sphere, palpate::deformable::Tip::Kind::flat}) {
    palpate::deformable::Tip tip;
    tip.kind = kind;
    tip.radius = 8e-3;
    const double top = kind == palpate::deformable::Tip::Kind::sphere ? 28e-3 : 20e-3;
    body.initialize(tip);
    for (int k = 0; k < 2000; ++k) {
      tip.center = {10e-3 + 4e-3 * std::sin(0.011 * k), 10e-3 + 3e-3 * std::cos(0.017 * k), top - 2e-3 * std::sin(0.05 * k)};
      const long before = allocations;
      const palpate::deformable::ContactResult& now = body.step(tip);
      counted += allocations - before;
      pressed += now.nodes;
      friction += now.friction.norm();
      empty += body.coupling().model_switch().tank().empty ? 1 : 0;
      body.step_synchronously();
    }
  }
  EXPECT_EQ(counted, 0);
  EXPECT_GT(pressed, 2000);
  EXPECT_GT(friction, 1.0);
  EXPECT_GT(empty, 0);  // models that wait, and are fitted
}

}  // namespace
}  // namespace linear_two_rates
