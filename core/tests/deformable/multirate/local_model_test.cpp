// Friction on local models, and their updates by a slow solver.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <palpate/deformable/multirate/local_model_slip.hpp>
#include <palpate/deformable/multirate/local_newton.hpp>
#include <palpate/deformable/multirate/multirate_coupling.hpp>
#include <random>
#include <vector>

namespace {

using palpate::deformable::FullCompliance, palpate::deformable::LocalModel, palpate::deformable::LocalModelSlip;
using palpate::deformable::TipPair, palpate::math::Matrix3, palpate::math::Vector3;

/// Local model of a flat square of side x side nodes, z up, whose compliance falls off with the distance of two nodes.
LocalModel flat_model(int side, double self, long version) {
  LocalModel model;
  std::vector<Vector3<>> points;
  for (int i = 0; i < side * side; ++i) points.emplace_back(2e-3 * (i % side), 2e-3 * (i / side), 0.0);
  const std::size_t n = points.size();
  model.nodes = palpate::deformable::SurfaceNodes(points, std::vector<Vector3<>>(n, Vector3<>::UnitZ()), std::vector<double>(n, 4e-6));
  model.compliance_matrix.assign(LocalModel::capacity * LocalModel::capacity, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    model.node_ids[i] = static_cast<std::int32_t>(i);
    model.displacement[i].setZero();
    model.inner[i] = true;
    for (std::size_t j = 0; j < n; ++j)
      model.compliance_matrix[i * LocalModel::capacity + j] = self * std::exp(-(points[i] - points[j]).norm() / 3e-3);
  }
  model.version = version;
  model.round();
  return model;
}

/// Drag of one pressed node with much friction. At rest the body yields three times as much along x as along y.
struct Drag {
  static constexpr double poisson = 0.4, layer = 2e3, yield = 1.0 / (layer * 2.0 * (1.0 - poisson) / (2.0 - poisson));
  LocalModelSlip slip{{5.0, 5.0}, at_rest(), poisson};

  static Matrix3<> self() { return Vector3<>(3e-3, 1e-3, 2e-3).asDiagonal(); }
  static FullCompliance at_rest() {
    std::vector<float> full(300 * 300);
    for (std::size_t node = 0; node < 100; ++node)
      for (std::size_t a = 0; a < 3; ++a) full[301 * (3 * node + a)] = static_cast<float>(self()(static_cast<int>(a), static_cast<int>(a)));
    return {100, full.data()};
  }

  static constexpr double tolerance =
      2e-3;  // of a length, where the compliance is not isotropic: PartialSlip iterates to 1e-3 of the force

  /// Force after a motion of the tip, when the iteration has come to its end.
  Vector3<> settle(const LocalModel& model, const Vector3<>& outward, std::int32_t node, const Vector3<>& tip_motion) {
    step(model, outward, node, tip_motion);
    for (int tick = 0; tick < 4; ++tick) step(model, outward, node, Vector3<>::Zero());
    return slip.force(node);
  }

  Vector3<> step(const LocalModel& model, const Vector3<>& outward, std::int32_t node, const Vector3<>& tip_motion,
                 double layer_stiffness = layer) {
    const double force = 1.0;
    slip.step(model, outward, &node, &force, &layer_stiffness, 1, tip_motion);
    return slip.force(node);
  }
};

// Law: a sticking node moves with the tip in the plane across any contact direction, also a node that the local model does not contain.
// Body and layer yield in series.
TEST(LocalModelSlip, ANodeSticksInThePlaneAcrossTheContactDirection) {
  const LocalModel model = flat_model(3, 2e-3, 1);  // along z as at rest
  for (const std::int32_t node : {4, 50})
    for (const Vector3<>& outward : {Vector3<>(0, 0, 1), Vector3<>(1, 0, 0), Vector3<>(0, -1, 0), Vector3<>(0.6, 0, 0.8)}) {
      Drag drag;
      const auto in_plane = [&](const Vector3<>& v) { return Vector3<>(v - outward.dot(v) * outward); };
      const Vector3<> motion(1e-5, 2e-5, -3e-5), force = drag.settle(model, outward, node, motion);
      EXPECT_LT(std::abs(force.dot(outward)), 1e-12);
      EXPECT_LT((in_plane(Drag::self() * force) + Drag::yield * force - in_plane(motion)).norm(), Drag::tolerance * motion.norm());
      EXPECT_LT((drag.slip.displacement(node) - in_plane(motion)).norm(), Drag::tolerance * motion.norm());
    }
}

// Law: the contact as a whole yields as in the model, whether more or less than at rest.
TEST(LocalModelSlip, TheContactYieldsAsInTheModel) {
  for (const double softer : {0.3, 1.0, 5.0}) {
    LocalModel model = flat_model(3, 2e-3, 1);
    model.force[4] = 1.0;
    Matrix3<> whole = softer * Drag::self();
    whole(0, 1) = whole(1, 0) = 0.1 * softer * 1e-3;
    model.contact_compliance = whole;
    Drag drag;
    const Vector3<> motion(1e-5, 2e-5, 0.0), force = drag.settle(model, Vector3<>::UnitZ(), 4, motion);
    EXPECT_LT((whole * force + Drag::yield * force - motion).norm(), Drag::tolerance * motion.norm()) << softer;
  }
}

// Law: with any sequence of models, a tip takes out at most what it has supplied and a thousandth of what went to and fro.
TEST(LocalModelSlip, ModelsThatChangeGenerateNoEnergy) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    Drag drag;
    LocalModel model;
    double supplied = 0.0, exchanged = 0.0;
    Vector3<> way = Vector3<>::Zero();
    for (long tick = 0; tick < 2000; ++tick) {
      if (tick % 4 == 0) model = flat_model(3, 2e-3 * std::pow(5.0, part(random)), 1 + tick / 4);
      const Vector3<> motion = Vector3<>(2e-5 * part(random), 2e-5 * part(random), 0.0) - 0.05 * way;
      way += motion;
      const double work = drag.step(model, Vector3<>::UnitZ(), 4, motion).dot(motion);
      supplied += work;
      exchanged += std::abs(work);
      ASSERT_GE(supplied, drag.slip.energy() - 1e-3 * exchanged) << seed << " " << tick;
    }
  }
}

// Law: the force on a sticking node is an integral over the way of the tip, also if the compliance depends on the way and is known late
// only. Swings to the first point of contact neither drain nor raise it.
TEST(LocalModelSlip, ALateComplianceDoesNotChangeTheForceOfSwings) {
  const double amplitude = 2e-4;
  for (const int interval : {1, 2, 4, 8})
    for (const int axis : {0, 1}) {
      Drag drag;
      LocalModel model;
      double place = 0.0, seen = 0.0;
      int tick = 0;
      const auto move = [&](Vector3<> motion) {
        place += motion[axis];
        if (tick % interval == 0) {
          model = flat_model(3, 2e-3 * (1.0 + 0.3 * seen / amplitude), 1 + tick / interval);
          seen = place;
        }
        ++tick;
        return drag.step(model, Vector3<>::UnitZ(), 4, motion);
      };
      for (int k = 0; k < 60; ++k) move({amplitude / 60.0, 0.0, 0.0});
      Vector3<> before = Vector3<>::Zero(), after = before;
      double last = 0.0, largest = 0.0;
      for (int k = 1; k <= 3100; ++k) {
        const double swing = 0.9 * amplitude * std::sin(2.0 * M_PI * k / 100.0);
        after = move((swing - last) * Vector3<>::Unit(axis));
        last = swing;
        if (k <= 100) before = after;
        largest = std::max(largest, after.norm());
      }
      EXPECT_LT((after - before).norm(), 0.03 * largest) << interval << " " << axis;
    }
}

// Law: points that come into contact begin without force, so that the energy does not rise. A load that varies does not drain the force.
TEST(LocalModelSlip, ALoadThatVariesDoesNotDrainTheForce) {
  const LocalModel model = flat_model(3, 2e-3, 1);
  Drag drag;
  const Vector3<> up = Vector3<>::UnitZ(), still = Vector3<>::Zero();
  const Vector3<> force = drag.step(model, up, 4, {1e-4, 0.0, 0.0}), place = drag.slip.displacement(4);
  for (int swing = 0; swing < 5; ++swing) {
    EXPECT_LT((drag.step(model, up, 4, still, 3.0 * Drag::layer) - force).norm(), 1e-9);
    EXPECT_LT((drag.slip.displacement(4) - (3e-3 + Drag::yield / 3.0) * force).norm(), 1e-9);
    EXPECT_LT((drag.step(model, up, 4, still, 0.5 * Drag::layer) - force).norm(), 1e-9);
  }
  EXPECT_LT(force.dot(drag.slip.displacement(4)), force.dot(place));
}

// Law: a compliance that varies to and fro does not drain a force either that was there before, unless it would store much more energy than
// the tip has supplied.
TEST(LocalModelSlip, AComplianceThatVariesDoesNotDrainTheForce) {
  Drag drag;
  const Vector3<> up = Vector3<>::UnitZ(), still = Vector3<>::Zero();
  const Vector3<> force = drag.step(flat_model(3, 2e-3, 1), up, 4, {1e-4, 0.0, 0.0}), place = drag.slip.displacement(4);
  for (long version = 2; version < 12; ++version) {
    const double self = version < 4 || version % 2 == 1 ? 2e-3 : 1e-3;
    EXPECT_LT((drag.step(flat_model(3, self, version), up, 4, still) - force).norm(), 1e-6 * force.norm());
  }
  const Vector3<> less = drag.step(flat_model(3, 32e-3, 12), up, 4, still);
  EXPECT_LT(less.norm(), 0.9 * force.norm());
  EXPECT_NEAR(less.dot(drag.slip.displacement(4)), 4.0 * (1.0 + 1e-3) * force.dot(place), 1e-6 * force.dot(place));
  EXPECT_NEAR(drag.slip.energy(), 0.5 * force.dot(place), 1e-6 * force.dot(place));
}

// Law: a contact that slides in a constant direction keeps its plane; its force is that of friction against the motion. After a change of
// the direction by less than the play it is gradually across the new direction.
TEST(LocalModelSlip, TheForceOfASlidingContactIsInItsPlane) {
  Drag drag;
  drag.slip = LocalModelSlip({0.5, 0.4}, Drag::at_rest(), Drag::poisson);
  const LocalModel model = flat_model(3, 2e-3, 1);
  const Vector3<> way(1e-4, 0.0, 0.0), tilted = Vector3<>(0.03, 0.0, 1.0).normalized();
  for (int tick = 0; tick < 200; ++tick) drag.step(model, Vector3<>::UnitZ(), 4, way);
  EXPECT_TRUE(drag.slip.sliding());
  EXPECT_LT((drag.slip.force(4) - Vector3<>(0.4, 0.0, 0.0)).norm(), 1e-6);
  drag.step(model, tilted, 4, way);
  EXPECT_LT((drag.slip.force(4) - Vector3<>(0.4, 0.0, 0.0)).norm(), 0.4 * 1.1e-3);
  for (int tick = 0; tick < 50; ++tick) drag.step(model, tilted, 4, way);
  EXPECT_LT(std::abs(drag.slip.force(4).dot(tilted)), 1e-6);
}

// Law: a contact that slides on has the force of friction, whatever models come.
TEST(LocalModelSlip, ModelsThatChangeDoNotStopTheFrictionOfASlidingContact) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    Drag drag;
    drag.slip = LocalModelSlip({0.4, 0.4}, Drag::at_rest(), Drag::poisson);
    LocalModel model;
    for (long tick = 0; tick < 1000; ++tick) {
      if (tick % 10 == 0) model = flat_model(3, 2e-3 * std::pow(1.9, part(random)), 1 + tick / 10);
      const double force = drag.step(model, Vector3<>::UnitZ(), 4, {1e-3, 0.0, 0.0}).x();
      if (tick % 10 == 9) ASSERT_NEAR(force, 0.4, 1e-6) << seed << " " << tick;
    }
  }
}

// Law: the plane of a first contact counts, and a reset forgets it.
TEST(LocalModelSlip, AFirstContactYieldsInItsOwnPlane) {
  const LocalModel model = flat_model(3, 2e-3, 1);
  const Vector3<> motion(0.0, 1e-5, 2e-5), aside = Vector3<>::UnitX();
  Drag fresh, used;
  const Vector3<> expected = fresh.step(model, aside, 4, motion);
  const double none = 0.0;
  used.slip.step(model, Vector3<>::UnitZ(), nullptr, &none, &none, 0, motion);
  EXPECT_LT((used.step(model, aside, 4, motion) - expected).norm(), 1e-12);
  used.slip.reset();
  EXPECT_EQ(used.step(model, aside, 4, motion), expected);
}

/// Slow solver whose residual halves at each update.
struct Halving {
  struct Report {
    double relative_residual = 1.0;
  };
  Report report{};
  Report step(const TipPair& /*tips*/, LocalModel& to) {
    to = flat_model(3, 1e-3, ++version);
    report.relative_residual *= 0.5;
    return report;
  }
  void reset() { report = {}; }
  long version = 0;
};

// Law: settling updates until two residuals in a row are at rest, and says whether they were.
TEST(MultirateCoupling, SettlesAtEquilibriumOnly) {
  for (const int updates : {5, 14, 15, 40}) {
    palpate::deformable::MultirateCoupling<Halving> coupling(std::make_unique<Halving>());
    EXPECT_EQ(coupling.settle({}, updates), updates >= 15) << updates;  // 2^-14 < 1e-4 < 2^-13
    EXPECT_EQ(coupling.update_count(), std::min(updates, 15) + 1) << updates;
  }
}

// Law: a Newton step solves (I + s H C) x = r over the nodes that were added, and is zero at the others.
TEST(LocalNewton, SolvesTheSystemOfItsNodes) {
  const LocalModel model = flat_model(3, 1e-3, 1);
  auto newton = std::make_unique<palpate::deformable::LocalNewton>();
  const std::vector<std::int16_t> rows{1, 7, 4, 2};
  const double scale = 0.7;
  double stiffness[9][9] = {};
  const auto couple = [&](std::int16_t a, std::int16_t b, double value) {
    newton->add(a, b, static_cast<float>(value));
    stiffness[a][b] += value;
    if (a != b) stiffness[b][a] += value;
  };
  for (const std::int16_t a : rows) couple(a, a, 900.0 + 300.0 * a);
  couple(1, 7, 800.0);
  couple(4, 2, -700.0);
  couple(7, 2, 1500.0);
  newton->factor(model, static_cast<float>(scale));
  const auto right = [](std::size_t i) { return 0.1F * static_cast<float>(i) - 0.25F; };
  std::array<float, 9> x{};
  newton->solve(right, x);
  for (const std::int16_t a : rows) {
    double sum = x[static_cast<std::size_t>(a)];
    for (const std::int16_t c : rows)
      for (const std::int16_t b : rows) sum += scale * stiffness[a][c] * model.compliance(c, b) * x[static_cast<std::size_t>(b)];
    EXPECT_NEAR(sum, right(static_cast<std::size_t>(a)), 1e-5) << a;
  }
  for (const std::size_t other : {0, 3, 5, 6, 8}) EXPECT_EQ(x[other], 0.0F);
}

}  // namespace
