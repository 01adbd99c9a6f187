// Friction on modal and mass-spring models: closed forms, Coulomb's cone, passivity.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <palpate/deformable/linear/modal.hpp>
#include <random>
#include <vector>

#include "support/mass_spring_cube.hpp"
#include "support/rounds.hpp"

namespace {

using palpate::deformable::ContactResult, palpate::deformable::TipContact, palpate::deformable::SurfaceNodes, palpate::deformable::Tip,
    palpate::math::Vector3;

/// One node, massless along its normal, with one mode along each of x and y on top of the compliance `extra`.
struct OneMode {
  double frequency = 60.0, mass = 0.02, normal = 1e-3, extra = 1e-4;
  SurfaceNodes nodes{{{0, 0, 0}}, {{0, 0, 1}}, {1e-6}};

  [[nodiscard]] double along() const { return extra + 1.0 / (mass * frequency * frequency); }
  [[nodiscard]] palpate::deformable::Modal modal(double period, double alpha, double instantaneous_ratio = 1.0,
                                                 double retardation_time = 1.0) const {
    const auto x = static_cast<float>(along()), z = static_cast<float>(normal);
    const auto one = static_cast<float>(1.0 / std::sqrt(mass));
    const std::vector<float> full{x, 0, 0, 0, x, 0, 0, 0, z}, shapes{one, 0, 0, one, 0, 0};
    return {nodes, full.data(), shapes.data(), {frequency, frequency}, period, alpha, 0.0, instantaneous_ratio, retardation_time, true};
  }
};

// A tip that moves faster than the node: constant friction mu N, i.e. a force step on a mass and spring.
TEST(ModalFriction, OfAFastTipIsAForceStep) {
  const OneMode o;
  const double depth = 1e-3, mu = 0.4, period = 1e-3, drag = mu * depth / o.normal;
  palpate::deformable::Modal modal = o.modal(period, 0.0);
  TipContact<palpate::deformable::Modal> contact(o.nodes, modal, {mu, mu});
  Tip tip;
  tip.kind = Tip::Kind::flat;
  tip.radius = 1.0;
  tip.center = {0, 0, -depth};
  contact.step(tip);
  for (int k = 1; k <= 200; ++k) {
    tip.center.x() += 2e-3;  // faster than the mass at any time
    const ContactResult& a = contact.step(tip);
    ASSERT_NEAR(a.friction.x(), -drag, 1e-7);
    ASSERT_NEAR(a.force.z(), depth / o.normal, 1e-6);
    ASSERT_TRUE(a.sliding);
    const double expected = o.extra * drag + drag * (o.along() - o.extra) * (1.0 - std::cos(o.frequency * period * k));
    ASSERT_NEAR(a.deflection.x(), expected, 3e-6 * o.along() * drag) << k;
  }
}

// Slow motion with strong damping: elastic up to mu_static N, then mu_dynamic N.
TEST(ModalFriction, OfASlowTipIsASpringUpToTheCone) {
  const OneMode o;
  for (const double instantaneous_ratio : {1.0, 2.0}) {
    palpate::deformable::Modal modal = o.modal(1e-3, 200.0, instantaneous_ratio, 0.01);
    const double depth = 1e-3, press = depth / o.normal;
    TipContact<palpate::deformable::Modal> contact(o.nodes, modal, {0.5, 0.3});
    Tip tip;
    tip.kind = Tip::Kind::flat;
    tip.radius = 1.0;
    tip.center = {0, 0, -depth};
    for (int k = 0; k < 2000; ++k) contact.step(tip);
    const double way = 1e-6, lag = way / 1e-3 * (200.0 / (o.frequency * o.frequency) + (1.0 - 1.0 / instantaneous_ratio) * 0.01);
    int broke = -1;
    for (int k = 1; k < 20000; ++k) {
      tip.center.x() = way * k;
      const ContactResult& a = contact.step(tip);
      if (a.sliding && broke < 0) broke = k;
      ASSERT_LE(-a.friction.x(), (broke < 0 ? 0.5 : 0.51) * press * (1.0 + 1e-6));
      // Additional force of damping and creep at constant velocity.
      if (broke < 0 && k > 500) {
        ASSERT_NEAR(-a.friction.x() * o.along(), tip.center.x() + lag, 2e-6) << k;
      }
    }
    EXPECT_NEAR(broke * way, 0.5 * press * o.along() - lag, 4e-6);
    EXPECT_NEAR(-contact.last().friction.x(), 0.3 * press, 1e-6);
  }
}

/// Sixteen nodes on a spherical cap with random modes and static correction.
struct Cap {
  static constexpr int side = 4, modes = 12;
  std::vector<Vector3<>> points, normals;
  std::vector<double> areas, frequencies;
  std::vector<float> full, shapes;
  SurfaceNodes nodes;

  explicit Cap(double radius = 20e-3) : areas(side * side, 1e-6) {
    for (int i = 0; i < side * side; ++i) {
      const int column = i % side, row = i / side;
      const double x = 1e-3 * (column - 1.5), y = 1e-3 * (row - 1.5);
      normals.push_back(Vector3<>(x, y, std::sqrt(radius * radius - x * x - y * y)) / radius);
      points.emplace_back(x, y, radius * (normals.back().z() - 1.0));
    }
    nodes = SurfaceNodes(points, normals, areas);
    const Eigen::Index size = 3 * side * side;
    std::mt19937 random(31);
    std::normal_distribution<double> normal;
    Eigen::MatrixXd phi(size, modes), more(size, 6);
    for (double& x : phi.reshaped()) x = 3.0 * normal(random);
    for (double& x : more.reshaped()) x = 0.01 * normal(random);
    Eigen::MatrixXd c = more.lazyProduct(more.transpose());
    c.diagonal().array() += 2e-4;
    for (int k = 0; k < modes; ++k) {
      frequencies.push_back(80.0 + 60.0 * k);
      c += phi.col(k) * phi.col(k).transpose() / (frequencies.back() * frequencies.back());
    }
    for (Eigen::Index i = 0; i < size; ++i) {
      for (Eigen::Index j = 0; j < size; ++j) full.push_back(static_cast<float>(c(i, j)));
      for (int k = 0; k < modes; ++k) shapes.push_back(static_cast<float>(phi(i, k)));
    }
  }
};

/// Random closed path, out of contact at its start and end.
struct Path {
  Eigen::Matrix<double, 3, 4> waves;

  explicit Path(std::mt19937& random, double scale = 3e-4) {
    std::normal_distribution<double> normal;
    for (int i = 0; i < 12; ++i) waves(i % 3, i / 3) = scale * normal(random);
  }
  [[nodiscard]] Vector3<> at(double s, double down) const {
    Vector3<> place = waves * Eigen::Vector4d(std::sin(s), std::cos(s), std::sin(2.0 * s), std::cos(2.0 * s));
    place.z() -= down * 0.5 * (1.0 - std::cos(s));
    return place;
  }
};

struct Counts {
  int stuck = 0, slid = 0, free = 0;
  void see(const ContactResult& a) { ++(!a.touching ? free : (a.sliding ? slid : stuck)); }
  [[nodiscard]] int least() const { return std::min({stuck, slid, free}); }
};

/// Move a tip (sphere for even, flat end for odd `number`) along a path on a body without and with friction, from rest. At each tick call
/// see(tip, without, with, in, most): work against friction so far and its maximum, J. Return the final work.
template <class Kind, class See>
double follow(TipContact<Kind>& smooth, TipContact<Kind>& rough, const Path& path, int number, int ticks, See see) {
  Tip tip;
  tip.kind = number % 2 == 0 ? Tip::Kind::sphere : Tip::Kind::flat;
  tip.radius = number % 2 == 0 ? 3e-3 : 1.5e-3;
  smooth.reset();
  rough.reset();
  double in = 0.0, most = 0.0;
  Vector3<> before = Vector3<>::Zero();
  for (int k = 0; k <= ticks; ++k) {
    tip.center = path.at(2.0 * M_PI * k / ticks, 6e-4);
    tip.center.z() += tip.kind == Tip::Kind::sphere ? tip.radius : 0.0;
    const ContactResult &a = smooth.step(tip), &b = rough.step(tip);
    if (k > 0) in -= b.friction.dot(tip.center - before);
    before = tip.center;
    most = std::max(most, in);
    see(tip, a, b, in, most);
  }
  return in;
}

// At every tick the work against friction is at least the tangential energy of the body: its energy minus that of the same body without
// friction. Elastic and viscoelastic.
TEST(ModalFriction, IsPassiveOverClosedPaths) {
  const Cap cap;
  std::mt19937 random(32);
  for (const double instantaneous_ratio : {1.0, 2.5}) {
    const auto make = [&](bool tangential) {
      return palpate::deformable::Modal(cap.nodes, cap.full.data(), cap.shapes.data(), cap.frequencies, 1e-3, 0.0, 0.0, instantaneous_ratio,
                                        0.03, tangential);
    };
    palpate::deformable::Modal plain = make(false), draggable = make(true);
    TipContact<palpate::deformable::Modal> smooth(cap.nodes, plain), rough(cap.nodes, draggable, {0.7, 0.5});
    double lost = 0.0;
    Counts counts;
    for (int number = 0; number < 60 * rounds(); ++number)
      lost += follow(smooth, rough, Path(random), number, 100,
                     [&](const Tip&, const ContactResult& a, const ContactResult& b, double in, double most) {
                       ASSERT_NEAR(a.force.norm(), (b.force - b.friction).norm(), 1e-5 * a.force.norm() + 1e-9);
                       ASSERT_GE(in, b.energy - a.energy - 1e-5 * most - 1e-12) << number;
                       counts.see(b);
                     });
    EXPECT_GT(lost, 2e-5);
    EXPECT_GT(counts.least(), 200);
  }
}

// The work against friction is at least the work done on the nodes, and the body's energy never exceeds the work of all nodal forces.
TEST(MassSpringFriction, IsPassiveOverClosedPaths) {
  const Cube cube(3);
  palpate::deformable::MassSpringModel model = cube.model(1e-3, 0.0, 1e-4);
  TipContact<palpate::deformable::MassSpringModel> contact(cube.nodes, model, {0.7, 0.5});
  std::mt19937 random(34);
  Tip tip;
  tip.radius = 12e-3;
  double lost = 0.0;
  Counts counts;
  std::vector<Vector3<>> before(static_cast<std::size_t>(cube.nodes.size())), after(before.size());
  const auto look = [&](std::vector<Vector3<>>& at) {
    for (std::int32_t i = 0; i < cube.nodes.size(); ++i) at[static_cast<std::size_t>(i)] = model.displacement(i);
  };
  for (int number = 0; number < 30 * rounds(); ++number) {
    const Path path(random, 8e-4);
    contact.reset();
    look(before);
    double in = 0.0, along = 0.0, all = 0.0, most = 0.0;
    Vector3<> place = Vector3<>::Zero();
    const int ticks = 100;
    for (int k = 0; k <= ticks; ++k) {
      tip.center = path.at(2.0 * M_PI * k / ticks, 2e-3) + Vector3<>(7e-3, 8e-3, 15e-3 + tip.radius);
      const ContactResult& a = contact.step(tip);
      look(after);
      for (int c = 0; c < a.nodes; ++c) {
        const std::int32_t node = contact.contact_nodes()[c];
        const Vector3<> moved = after[static_cast<std::size_t>(node)] - before[static_cast<std::size_t>(node)];
        along += contact.tangential_force(node).dot(moved);
        all += (contact.tangential_force(node) - contact.forces()[c] * cube.nodes.normal(node)).dot(moved);
      }
      std::swap(before, after);
      if (k > 0) in -= a.friction.dot(tip.center - place);
      place = tip.center;
      most = std::max(most, std::abs(in));
      ASSERT_GE(in, along - 1e-4 * most - 1e-13) << number << " " << k;  // residual of the friction sweeps
      ASSERT_EQ(a.energy, model.energy());
      ASSERT_LE(model.energy(), all + 1e-6 * std::abs(all) + 1e-15);
      counts.see(a);
    }
    lost += in - along;
  }
  EXPECT_GT(lost, 2e-6);
  EXPECT_GT(counts.least(), 60);
}

}  // namespace
