// Hyperelastic model: Newton's method under large deformation.
#include <gtest/gtest.h>

#include <algorithm>
#include <palpate/deformable/hyperelastic/hyperelastic_model.hpp>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>
#include <vector>

#include "support/tet_block.hpp"

namespace {

// Large bending: Newton's method converges quadratically and the total potential never increases.
TEST(HyperelasticModel, NewtonConvergesUnderALargeLoad) {
  const TetBlock block(2, 2, 6, 1e4, 0.4);
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

}  // namespace
