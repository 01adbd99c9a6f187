// Friction of a tip on an elastic surface: Mindlin, Cattaneo, Coulomb, passivity.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <numeric>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/compliance.hpp>
#include <palpate/deformable/linear/viscoelastic_solid.hpp>
#include <random>
#include <type_traits>

#include "support/rounds.hpp"

namespace {

using palpate::deformable::ContactResult, palpate::deformable::TipContact, palpate::deformable::SurfaceNodes, palpate::deformable::Tip,
    palpate::deformable::DryFriction, palpate::math::Vector3;

/// Surface of an elastic half-space, z up, in square patches: Boussinesq's and Cerruti's point forces between patches, and the mean over a
/// patch for itself (1 / r: 2.9730 / w; by symmetry x^2 / r^3: half of that). Independent of finite elements.
struct TangentialHalfSpace {
  double shear, poisson, width;  // Pa; m
  std::vector<Vector3<>> points;
  SurfaceNodes nodes;

  TangentialHalfSpace(int side, double w, double g, double nu) : shear(g), poisson(nu), width(w) {
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) points.emplace_back(w * (i - 0.5 * (side - 1)), w * (j - 0.5 * (side - 1)), 0.0);
    nodes = SurfaceNodes(points, std::vector<Vector3<>>(points.size(), Vector3<>::UnitZ()), std::vector<double>(points.size(), w * w));
  }
  [[nodiscard]] const Vector3<>& at(std::int32_t i) const { return points[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const {
    const double inverse = i == j ? 2.9730 / width : 1.0 / (at(i) - at(j)).norm();
    return (1.0 - poisson) / (2.0 * M_PI * shear) * inverse;
  }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const {
    Eigen::Matrix3d c;
    if (i == j) {
      c = Eigen::Matrix3d::Identity() * ((1.0 - 0.5 * poisson) * 2.9730 / width);
    } else {
      const Vector3<> d = at(i) - at(j);
      const double r = d.norm();
      c = Eigen::Matrix3d::Identity() * ((1.0 - poisson) / r) + (poisson / (r * r * r)) * d * d.transpose();
    }
    return nodes.tangent_basis(i).transpose() * c * nodes.tangent_basis(j) / (2.0 * M_PI * shear);
  }
  [[nodiscard]] static double free_displacement(std::int32_t) { return 0.0; }
  static void advance(const std::int32_t*, const double*, int) {}
  static void reset() {}
};

// Mindlin 1949: a sticking flat end of radius a has the tangential stiffness 8 G a / (2 - nu).
TEST(PartialSlip, StickingFlatEndMatchesMindlin) {
  for (const double poisson : {0.0, 0.3, 0.45}) {
    TangentialHalfSpace space(41, 1e-3, 5e3, poisson);
    Tip tip;
    tip.kind = Tip::Kind::flat;
    tip.radius = 5e-3;
    for (const double aside : {0.0, 0.3e-3}) {
      TipContact<TangentialHalfSpace> contact(space.nodes, space, {50.0, 50.0});
      tip.center = {aside, 0.4 * aside, -1e-3};
      contact.step(tip);
      EXPECT_EQ(contact.last().friction.norm(), 0.0);
      const double way = 1e-5;
      tip.center.x() += way;
      for (int k = 0; k < 20; ++k) contact.step(tip);  // the residual of the sweeps is carried over
      EXPECT_NEAR(-contact.last().friction.x(), 8.0 * 5e3 * tip.radius / (2.0 - poisson) * way, 0.04 * -contact.last().friction.x())
          << poisson << " " << aside;
    }
  }
}

// Cattaneo 1938, Mindlin 1949: a sphere under normal force P slips from the edge inwards. Full sliding begins at the displacement
// 3 mu P (2 - nu) / (16 G a).
TEST(PartialSlip, SphereMatchesCattaneoAndMindlin) {
  const double shear = 5e3, poisson = 0.4, mu = 0.2;
  TangentialHalfSpace space(21, 1.3e-3, shear, poisson);
  TipContact<TangentialHalfSpace> contact(space.nodes, space, {mu, mu});
  Tip tip;
  tip.radius = 60e-3;
  const double depth = 0.5e-3;
  tip.center = {0.2e-3, 0.3e-3, tip.radius - depth};
  const double normal = contact.step(tip).force.z(), a = std::sqrt(tip.radius * depth);
  const double full = 3.0 * mu * normal * (2.0 - poisson) / (16.0 * shear * a);
  const Vector3<> along(0.8, 0.6, 0.0);
  const Vector3<> start = tip.center;
  for (int k = 1; k <= 130; ++k) {
    const double way = full * k / 100.0;
    tip.center = start + way * along;
    const double found = -contact.step(tip).friction.dot(along) / (mu * contact.last().force.z());
    const double expected = way < full ? 1.0 - std::pow(1.0 - way / full, 1.5) : 1.0;
    ASSERT_NEAR(found, expected, 0.03) << k;
    ASSERT_TRUE((k > 90 && k < 110) || contact.last().sliding == (k >= 110)) << k;
  }
  // Mindlin & Deresiewicz 1953: the unloading curve is the loading curve at twice the scale.
  const Vector3<> turn = tip.center;
  for (int k = 1; k <= 220; ++k) {
    const double way = full * k / 100.0;
    tip.center = turn - way * along;
    const double found = -contact.step(tip).friction.dot(along) / (mu * contact.last().force.z());
    ASSERT_NEAR(found, way < 2.0 * full ? 2.0 * std::pow(1.0 - way / (2.0 * full), 1.5) - 1.0 : -1.0, 0.04) << k;
  }
}

// Optimality at every node: no slip inside the cone, slip parallel to the force on it.
TEST(PartialSlip, SatisfiesCoulombsLawAtEveryNode) {
  const double mu = 0.5;
  TangentialHalfSpace space(21, 1e-3, 5e3, 0.45);
  std::mt19937 random(12);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  palpate::deformable::PartialSlip slip({mu, mu}, space.nodes.size(), 1000);
  std::vector<std::int32_t> pressed;
  for (int i = 5; i < 15; ++i)
    for (int j = 6; j < 13; ++j) pressed.push_back(21 * i + j);
  const auto count = static_cast<int>(pressed.size());
  std::vector<double> forces(pressed.size(), 1e-3), covers(pressed.size(), 1.0);
  int held = 0, slid = 0;
  for (int step = 0; step < 60; ++step) {
    for (double& f : forces) f = std::max(1e-5, f + 3e-4 * uniform(random));
    std::vector<Eigen::Vector2d> before;
    before.reserve(pressed.size());
    for (const std::int32_t i : pressed) before.push_back(slip.displacement(i));
    Vector3<> way(1e-4 * uniform(random), 1e-4 * uniform(random), 1e-4 * uniform(random));
    if (step == 0) way.setZero();
    slip.step(space.nodes, space, pressed.data(), forces.data(), covers.data(), count, way);
    for (std::size_t c = 0; c < pressed.size(); ++c) {
      Eigen::Vector2d moved = Eigen::Vector2d::Zero();  // recomputed from the forces
      for (const std::int32_t j : pressed) moved += space.tangential(pressed[c], j) * slip.force(j);
      ASSERT_NEAR((moved - slip.displacement(pressed[c])).norm(), 0.0, 1e-12);
      const Eigen::Vector2d q = slip.force(pressed[c]);
      ASSERT_LE(q.norm(), mu * forces[c] * (1.0 + 1e-9));
      const Eigen::Vector2d lag = space.nodes.tangent_basis(pressed[c]).transpose() * way - (moved - before[c]);
      if (q.norm() < 0.999 * mu * forces[c]) {
        ++held;
        ASSERT_LE(lag.norm(), 2e-7);
      } else {
        ++slid;
        ASSERT_GE(lag.dot(q), -1e-7 * q.norm());
        // Parallel up to the rotation of the force within the step.
        ASSERT_LE(std::abs(lag.x() * q.y() - lag.y() * q.x()), 2e-2 * lag.norm() * q.norm() + 1e-7 * q.norm());
      }
    }
  }
  EXPECT_GT(held, 200);
  EXPECT_GT(slid, 200);
}

// Zero friction is bitwise equal to no friction; friction does not change the normal forces.
TEST(TipContact, FrictionDoesNotChangeTheNormalForces) {
  TangentialHalfSpace space(31, 1e-3, 5e3, 0.45);
  TipContact<TangentialHalfSpace> plain(space.nodes, space), smooth(space.nodes, space, DryFriction{}),
      rough(space.nodes, space, {0.6, 0.4});
  Tip tip;
  tip.radius = 6e-3;
  for (int k = 0; k < 2000; ++k) {
    tip.center = {5e-3 * std::sin(0.01 * k), 4e-3 * std::cos(0.017 * k), tip.radius - 5e-4 - 1e-3 * std::sin(0.05 * k)};
    const ContactResult &a = plain.step(tip), &b = smooth.step(tip), &c = rough.step(tip);
    ASSERT_EQ(a.force, b.force);
    ASSERT_EQ(a.energy, b.energy);
    ASSERT_EQ(a.deflection, b.deflection);
    ASSERT_EQ(a.nodes, c.nodes);
    ASSERT_EQ(a.force.z(), c.force.z());
    ASSERT_LE(c.friction.norm(), 0.6 * c.force.z() * (1.0 + 1e-9));
  }
}

// A resting tip keeps its force. A moving one breaks away at the static coefficient and slides at the dynamic one.
TEST(TipContact, SticksBreaksAwayAndSlides) {
  TangentialHalfSpace space(31, 1e-3, 5e3, 0.45);
  TipContact<TangentialHalfSpace> contact(space.nodes, space, {0.8, 0.5});
  Tip tip;
  tip.radius = 10e-3;
  tip.center = {-3e-3, 0.2e-3, tip.radius - 2e-3};
  contact.step(tip);
  double most = 0.0;
  const auto ratio = [&] { return contact.last().friction.norm() / contact.last().force.z(); };
  for (int k = 0; k < 500; ++k) {
    tip.center.x() += 1e-5;
    contact.step(tip);
    most = std::max(most, ratio());
  }
  EXPECT_NEAR(most, 0.8, 2e-3);
  EXPECT_NEAR(ratio(), 0.5, 1e-3);
  EXPECT_TRUE(contact.last().sliding);
  for (int k = 0; k < 100; ++k) contact.step(tip);
  const Vector3<> force = contact.last().force;
  for (int k = 0; k < 2000; ++k) contact.step(tip);
  EXPECT_LT((contact.last().force - force).norm(), 1e-9 * force.norm());
  EXPECT_FALSE(contact.last().sliding);
  // It breaks away again from there.
  most = 0.0;
  for (int k = 0; k < 300; ++k) {
    tip.center.x() += 1e-5;
    contact.step(tip);
    most = std::max(most, ratio());
  }
  EXPECT_NEAR(most, 0.8, 2e-3);
}

// Sliding in steps of a micrometer: nodes enter and leave without a jump of the friction force.
TEST(TipContact, FrictionIsContinuousAsNodesEnterAndLeave) {
  TangentialHalfSpace space(31, 1e-3, 5e3, 0.45);
  for (const auto kind : {Tip::Kind::sphere, Tip::Kind::flat}) {
    TipContact<TangentialHalfSpace> contact(space.nodes, space, {0.5, 0.5});
    Tip tip;
    tip.kind = kind;
    tip.radius = kind == Tip::Kind::sphere ? 8e-3 : 4e-3;
    const double top = kind == Tip::Kind::sphere ? tip.radius : 0.0;
    Vector3<> before = Vector3<>::Zero();
    double most = 0.0, largest = 0.0;
    int least = 1000, greatest = 0;
    for (int k = 0; k < 2500; ++k) {
      tip.center = {-1e-3 + 1e-6 * k, 0.3e-3, top - 1.5e-3};
      const Vector3<> friction = contact.step(tip).friction;
      if (k > 0) most = std::max(most, (friction - before).norm());
      largest = std::max(largest, friction.norm());
      before = friction;
      least = std::min(least, contact.last().nodes);
      greatest = std::max(greatest, contact.last().nodes);
    }
    // Bound on the change per micrometer: Mindlin's stiffness.
    EXPECT_LT(most, 1.3 * 8.0 * 5e3 * tip.radius / 1.55 * 1e-6);
    EXPECT_GT(largest, 500.0 * most);
    EXPECT_LT(least, greatest);
  }
}

/// Full compliance of a half-space, row 3 x node + axis, without coupling between normal and tangential directions.
std::vector<float> full(const TangentialHalfSpace& space) {
  const std::size_t n = space.points.size();
  std::vector<float> c(9 * n * n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      const auto p = static_cast<std::int32_t>(i), q = static_cast<std::int32_t>(j);
      Eigen::Matrix3d block = space.nodes.tangent_basis(p) * space.tangential(p, q) * space.nodes.tangent_basis(q).transpose();
      block(2, 2) = space.compliance(p, q);
      for (std::size_t x = 0; x < 3; ++x)
        for (std::size_t y = 0; y < 3; ++y)
          c[(3 * i + x) * 3 * n + 3 * j + y] = static_cast<float>(block(static_cast<int>(x), static_cast<int>(y)));
    }
  return c;
}

// Random closed paths (1,000 per round) with sticking, sliding and lift-off: at every tick the work against friction is at least the energy
// stored by it. The normal part is conservative and the same with and without friction.
TEST(TipContact, FrictionIsPassiveOverClosedPaths) {
  const TangentialHalfSpace space(4, 1e-3, 5e3, 0.3);
  palpate::deformable::Compliance plain(space.nodes, full(space).data()), draggable(space.nodes, full(space).data(), true);
  TipContact<palpate::deformable::Compliance> smooth(space.nodes, plain), rough(space.nodes, draggable, {0.7, 0.5});
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  Tip tip;
  tip.radius = 3e-3;
  double lost = 0.0;
  int stuck = 0, slid = 0, free = 0;
  const int paths = 1000 * rounds();
  for (int path = 0; path < paths; ++path) {
    Eigen::Matrix<double, 3, 4> waves;
    for (int i = 0; i < 12; ++i) waves(i % 3, i / 3) = 3e-4 * normal(random);
    smooth.reset();
    rough.reset();
    double in = 0.0;
    Vector3<> before = Vector3<>::Zero();
    const int ticks = 30;
    for (int k = 0; k <= ticks; ++k) {
      const double s = 2.0 * M_PI * k / ticks;
      tip.center = waves * Eigen::Vector4d(std::sin(s), std::cos(s), std::sin(2.0 * s), std::cos(2.0 * s));
      tip.center.z() += tip.radius - 2e-4;
      const ContactResult &a = smooth.step(tip), &b = rough.step(tip);
      if (k > 0) in -= b.friction.dot(tip.center - before);
      before = tip.center;
      ASSERT_GE(in, (1.0 - 1e-6) * (b.energy - a.energy) - 1e-14) << path << " " << k;
      ++(!b.touching ? free : (b.sliding ? slid : stuck));
    }
    lost += in;
  }
  EXPECT_GT(lost, 1e-7 * paths);
  EXPECT_GT(std::min({stuck, slid, free}), paths);
}

// Invariance under rotation of the body, node order and choice of tangent bases.
TEST(TipContact, FrictionIsInvariantUnderRotation) {
  using Block = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  TangentialHalfSpace space(17, 1e-3, 5e3, 0.45);
  const std::size_t n = space.points.size();
  std::mt19937 random(10);
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  const Eigen::Matrix3d turn = Eigen::Quaterniond(0.4, -0.3, 0.7, 0.5).normalized().toRotationMatrix();
  const std::vector<float> here = full(space);
  std::vector<float> there(here.size());
  std::vector<Vector3<>> points, normals;
  const auto block = [n](auto& c, std::size_t i, std::size_t j) {
    return Eigen::Map<std::conditional_t<std::is_const_v<std::remove_reference_t<decltype(c)>>, const Block, Block>, 0,
                      Eigen::OuterStride<>>(c.data() + 9 * i * n + 3 * j, Eigen::OuterStride<>(static_cast<Eigen::Index>(3 * n)));
  };
  for (std::size_t i = 0; i < n; ++i) {
    points.emplace_back(turn * space.points[order[i]]);
    normals.emplace_back(turn * Vector3<>::UnitZ());
    for (std::size_t j = 0; j < n; ++j)
      block(there, i, j) = (turn * block(here, order[i], order[j]).cast<double>() * turn.transpose()).cast<float>();
  }
  const SurfaceNodes other(points, normals, std::vector<double>(n, 1e-6));
  palpate::deformable::Compliance one(space.nodes, here.data(), true), two(other, there.data(), true);
  TipContact<palpate::deformable::Compliance> first(space.nodes, one, {0.6, 0.5}), second(other, two, {0.6, 0.5});
  Tip tip;
  tip.radius = 6e-3;
  for (int k = 0; k < 1000; ++k) {
    tip.outward = Vector3<>::UnitZ();
    tip.center = {2e-3 * std::sin(0.01 * k), 2e-3 * std::cos(0.017 * k), tip.radius - 8e-4 - 3e-4 * std::sin(0.05 * k)};
    const Vector3<> force = first.step(tip).force;
    tip.outward = turn * tip.outward;
    tip.center = (turn * tip.center).eval();
    ASSERT_LT((second.step(tip).force - turn * force).norm(), 2e-3 * force.norm() + 1e-9) << k;
  }
}

// Tangential step on a standard linear solid: the initial force is instantaneous_ratio times the long-term force.
TEST(TipContact, ViscoelasticBodyRelaxesTangentially) {
  const TangentialHalfSpace space(15, 1e-3, 5e3, 0.45);
  palpate::deformable::Compliance elastic(space.nodes, full(space).data(), true);
  palpate::deformable::StandardLinearSolid relaxing(elastic, 3.0, 0.05, 1e-3);
  TipContact<palpate::deformable::Compliance> still(space.nodes, elastic, {20.0, 20.0});
  TipContact<palpate::deformable::StandardLinearSolid> contact(space.nodes, relaxing, {20.0, 20.0});
  Tip tip;
  tip.radius = 8e-3;
  tip.center.z() = tip.radius - 1.5e-3;
  for (int k = 0; k < 500; ++k) contact.step(tip);
  still.step(tip);
  tip.center.x() = 1e-5;
  for (int k = 0; k < 50; ++k) still.step(tip);
  const double first = contact.step(tip).friction.x(), last = still.last().friction.x();
  EXPECT_NEAR(first, 3.0 * last, 0.04 * 3.0 * std::abs(last));
  for (int k = 0; k < 500; ++k) contact.step(tip);
  EXPECT_NEAR(contact.last().friction.x(), last, 1e-3 * std::abs(last));
}

// Flat end whose edge crosses patches: the long-term stiffness is that of the elastic body, normal and tangential.
TEST(TipContact, ViscoelasticBodyUnderAFlatEndHasTheLongTermStiffness) {
  const TangentialHalfSpace space(15, 1e-3, 5e3, 0.45);
  palpate::deformable::Compliance elastic(space.nodes, full(space).data(), true);
  palpate::deformable::StandardLinearSolid relaxing(elastic, 3.0, 0.05, 1e-3);
  TipContact<palpate::deformable::Compliance> still(space.nodes, elastic, {20.0, 20.0});
  TipContact<palpate::deformable::StandardLinearSolid> contact(space.nodes, relaxing, {20.0, 20.0});
  Tip tip;
  tip.kind = Tip::Kind::flat;
  tip.radius = 4.3e-3;
  tip.center = {2e-4, 1e-4, -5e-4};
  for (int k = 0; k < 500; ++k) contact.step(tip);
  still.step(tip);
  ASSERT_NEAR(contact.last().force.z(), still.last().force.z(), 2e-3 * still.last().force.z());
  EXPECT_NEAR(contact.last().energy, 0.5 * contact.last().force.z() * 5e-4, 1e-5 * contact.last().energy);
  const double aside = still.last().force.x();  // at the edge; that of the creeping body differs by the creep of one period
  ASSERT_GT(std::abs(aside), 1e-5 * still.last().force.z());
  EXPECT_NEAR(contact.last().force.x(), aside, 0.05 * std::abs(aside));
  tip.center.x() += 1e-5;
  for (int k = 0; k < 50; ++k) still.step(tip);
  for (int k = 0; k < 500; ++k) contact.step(tip);
  EXPECT_NEAR(contact.last().force.z(), still.last().force.z(), 2e-3 * still.last().force.z());
  EXPECT_NEAR(contact.last().friction.x(), still.last().friction.x(), 5e-3 * std::abs(still.last().friction.x()));
}

// The edge of a flat end on creeping patches: no closed path gains work.
TEST(TipContact, ViscoelasticBodyUnderAFlatEndIsPassive) {
  const TangentialHalfSpace space(13, 1e-3, 5e3, 0.45);
  palpate::deformable::StandardLinearSolid relaxing(palpate::deformable::Compliance(space.nodes, full(space).data(), true), 3.0, 0.05,
                                                    1e-3);
  for (int trial = 0; trial < 8; ++trial) {
    TipContact<palpate::deformable::StandardLinearSolid> contact(space.nodes, relaxing, {0.0, 0.0});
    contact.reset();
    Tip tip;
    tip.kind = Tip::Kind::flat;
    tip.radius = 3.3e-3;
    double work = 0.0, most = 0.0;
    Vector3<> before = Vector3<>::Zero(), force = Vector3<>::Zero();
    const int ticks = 1000;
    for (int k = 0; k <= ticks; ++k) {
      const double t = 2.0 * 3.141592653589793 * k / ticks, turns = 1.0 + trial % 4;
      tip.center = {3e-3 * std::sin(turns * t + trial), 2e-3 * std::sin(2.0 * t) * std::cos(0.7 * trial),
                    1e-4 - 5e-4 * (1.0 - std::cos(t))};
      const Vector3<> next = contact.step(tip).force;
      if (k > 0) work -= 0.5 * (force + next).dot(tip.center - before);
      most = std::max(most, std::abs(work));
      before = tip.center;
      force = next;
    }
    EXPECT_EQ(contact.last().nodes, 0);
    EXPECT_GT(work, -1e-4 * most) << trial;
  }
}

// Law: the state of a standard linear solid is one delayed force per node in all directions, q' = decay q + gain f; its energy is that of
// the springs, (f.C f / r + q.C q / (1 - 1 / r)) / 2.
TEST(StandardLinearSolid, ItsStateIsADelayedForcePerNode) {
  const TangentialHalfSpace space(3, 1e-3, 5e3, 0.3);
  const double ratio = 3.0, late = 1.0 - 1.0 / ratio, decay = std::exp(-1e-3 / 0.02), gain = (1.0 - decay) * late;
  const palpate::deformable::Compliance elastic(space.nodes, full(space).data(), true);
  palpate::deformable::StandardLinearSolid body(elastic, ratio, 0.02, 1e-3);
  constexpr int n = 9;
  Eigen::MatrixXd along(2 * n, 2 * n), across(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      across(i, j) = elastic.compliance(i, j);
      along.block<2, 2>(2 * i, 2 * j) = elastic.tangential(i, j);
    }
  Eigen::VectorXd q = Eigen::VectorXd::Zero(n), t = Eigen::VectorXd::Zero(2 * n);
  std::mt19937 random(13);
  std::uniform_real_distribution<double> uniform(0.2, 1.0);
  double most = 0.0;
  for (int k = 0; k < 400; ++k) {
    const std::vector<std::int32_t> pressed = k < 5 ? std::vector<std::int32_t>{0, 1, 4, 7} : std::vector<std::int32_t>{2, 4, 8};
    std::vector<double> forces;
    std::vector<Eigen::Vector2d> drags;
    Eigen::VectorXd f = Eigen::VectorXd::Zero(n), d = Eigen::VectorXd::Zero(2 * n);
    for (const std::int32_t i : pressed) {
      forces.push_back(f[i] = uniform(random));
      drags.emplace_back(d.segment<2>(2 * i) = Eigen::Vector2d(uniform(random), -uniform(random)));
    }
    body.advance(pressed.data(), forces.data(), drags.data(), static_cast<int>(pressed.size()));
    q = (decay * q + gain * f).eval();
    t = (decay * t + gain * d).eval();
    const double held = f.dot(across * f) + d.dot(along * d), period_ratio = 1.0 / ratio + gain;
    const double energy = 0.5 * held / ratio + 0.5 * (q.dot(across * q) + t.dot(along * t)) / late;
    most = std::max(most, energy);
    ASSERT_NEAR(body.energy(period_ratio * held), energy, 1e-5 * most) << k;
    for (int i = 0; i < n; ++i) {
      ASSERT_NEAR(body.free_displacement(i), decay * across.row(i).dot(q), 1e-5) << k;
      ASSERT_LT((body.free_tangential_displacement(i) - decay * along.middleRows<2>(2 * i) * t).norm(), 1e-5) << k;
    }
  }
}

// Law: after a tip without a position friction begins anew, as in a contact that the tip enters there.
TEST(TipContact, FrictionBeginsAnewAfterATipThatIsNotFinite) {
  TangentialHalfSpace space(15, 1e-3, 5e3, 0.45);
  TipContact<TangentialHalfSpace> contact(space.nodes, space, {0.6, 0.4}), fresh(space.nodes, space, {0.6, 0.4});
  Tip tip;
  tip.radius = 6e-3;
  for (int k = 0; k < 40; ++k) {
    tip.center = {1e-5 * k, 0.0, tip.radius - 5e-4};
    if (k == 20) tip.center = Vector3<>::Constant(std::nan(""));
    const ContactResult& a = contact.step(tip);
    if (k <= 20) continue;
    ASSERT_LT((a.force - fresh.step(tip).force).norm(), 1e-12 * a.force.norm()) << k;
  }
  EXPECT_GT(contact.last().friction.norm(), 1e-3 * contact.last().force.z());
}

// Law: the order of the nodes does not matter, while a flat end slides over creeping patches that it covers in part.
TEST(TipContact, FrictionOfAFlatEndOnCreepingPatchesDoesNotDependOnTheOrderOfTheNodes) {
  TangentialHalfSpace space(13, 1e-3, 5e3, 0.45), other = space;
  std::reverse(other.points.begin(), other.points.end());
  const std::size_t n = space.points.size();
  other.nodes = SurfaceNodes(other.points, std::vector<Vector3<>>(n, Vector3<>::UnitZ()), std::vector<double>(n, 1e-6));
  const auto solid = [](const TangentialHalfSpace& s) {
    return palpate::deformable::StandardLinearSolid(palpate::deformable::Compliance(s.nodes, full(s).data(), true), 3.0, 0.02, 1e-3);
  };
  palpate::deformable::StandardLinearSolid one = solid(space), two = solid(other);
  using Contact = TipContact<palpate::deformable::StandardLinearSolid>;
  Contact first(space.nodes, one, {0.6, 0.5}), second(other.nodes, two, {0.6, 0.5});
  Tip tip;
  tip.kind = Tip::Kind::flat;
  tip.radius = 2.3e-3;
  double largest = 0.0;
  for (int k = 0; k < 400; ++k) {
    tip.center = {3e-3 * std::sin(0.015 * k), 2e-3 * std::cos(0.021 * k), -5e-4 - 2e-4 * std::sin(0.05 * k)};
    const ContactResult &a = first.step(tip), &b = second.step(tip);
    largest = std::max(largest, a.force.norm());
    ASSERT_LT((a.force - b.force).norm(), 2e-3 * largest) << k;
    ASSERT_NEAR(a.energy, b.energy, 2e-3 * a.energy) << k;
  }
}

// Law: full sliding lasts until every node sticks: until then a node that slips has the dynamic coefficient, also beside one that sticks.
TEST(PartialSlip, FullSlidingLastsUntilEveryNodeSticks) {
  const TangentialHalfSpace space(21, 1e-3, 5e3, 0.45);
  palpate::deformable::PartialSlip slip({0.8, 0.4}, space.nodes.size(), 100);
  const std::int32_t pressed[] = {0, 440};
  const double covers[] = {1.0, 1.0}, even[] = {1e-3, 1e-3}, uneven[] = {1e-3, 1e-1};
  const auto ratio = [&](const double* forces, double way) {
    slip.step(space.nodes, space, pressed, forces, covers, 2, Vector3<>(way, 0.0, 0.0));
    return slip.force(0).norm() / forces[0];
  };
  ratio(uneven, 0.0);
  for (int k = 0; k < 5; ++k) ratio(uneven, 1e-4);
  EXPECT_FALSE(slip.sliding());  // partial slip from rest
  EXPECT_NEAR(ratio(uneven, 1e-4), 0.8, 1e-6);
  slip.reset();
  ratio(even, 0.0);
  for (int k = 0; k < 5; ++k) ratio(even, 1e-4);
  EXPECT_TRUE(slip.sliding());
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(ratio(uneven, 1e-4), 0.4, 1e-6) << k;
  EXPECT_LT(slip.force(440).norm(), 0.5 * 0.4 * uneven[1]);  // sticks
  EXPECT_TRUE(slip.sliding());
  ratio(uneven, 0.0);
  EXPECT_FALSE(slip.sliding());
}

}  // namespace
