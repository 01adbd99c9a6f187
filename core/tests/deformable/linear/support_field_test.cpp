// Supports that change on a standard linear solid: its equations integrated in time, dense, and the energy account.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <palpate/deformable/linear/support_field.hpp>
#include <palpate/object/supported_body.hpp>
#include <vector>

#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

using palpate::deformable::ContactResult;

/// The equations of the solid, u = C (F / r + q) and T q' = (1 - 1 / r) F - q, with prescribed displacements of the held nodes, by the
/// classical Runge-Kutta method.
class DenseSolid {
 public:
  DenseSolid() {
    const auto s = surface();
    const auto n = static_cast<Eigen::Index>(3 * s->size());
    c_ = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(s->compliance.data(), n, n).cast<double>();
    delayed_ = forces_ = Eigen::VectorXd::Zero(n);
    hold({});
  }

  /// Hold the nodes where they are.
  void hold(const std::vector<std::int32_t>& nodes) {
    const Eigen::VectorXd u = displacement();
    rows_.clear();
    for (const std::int32_t node : nodes)
      for (Eigen::Index a = 0; a < 3; ++a) rows_.push_back(3 * node + a);
    held_ = u(rows_);
    factor_.compute(Eigen::MatrixXd(c_(rows_, rows_)));
  }

  /// Advance by a tick under constant forces of the tip.
  void advance(const Eigen::VectorXd& tip) {
    constexpr int steps = 20;
    constexpr double h = 1e-3 / steps;
    for (int k = 0; k < steps; ++k) {
      const Eigen::VectorXd k1 = rate(tip, delayed_), k2 = rate(tip, delayed_ + 0.5 * h * k1), k3 = rate(tip, delayed_ + 0.5 * h * k2),
                            k4 = rate(tip, delayed_ + h * k3);
      delayed_ += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    forces_ = all_forces(tip, delayed_);
  }

  [[nodiscard]] Eigen::VectorXd displacement() const { return c_ * (forces_ / moduli + delayed_); }
  [[nodiscard]] double energy() const {
    return 0.5 * forces_.dot(c_ * forces_) / moduli + 0.5 * delayed_.dot(c_ * delayed_) / (1.0 - 1.0 / moduli);
  }

 private:
  [[nodiscard]] Eigen::VectorXd all_forces(const Eigen::VectorXd& tip, const Eigen::VectorXd& delayed) const {
    Eigen::VectorXd forces = tip;
    if (rows_.empty()) return forces;
    const Eigen::VectorXd missing = held_ - (c_ * (tip / moduli + delayed))(rows_);
    forces(rows_) += moduli * factor_.solve(missing);
    return forces;
  }
  [[nodiscard]] Eigen::VectorXd rate(const Eigen::VectorXd& tip, const Eigen::VectorXd& delayed) const {
    return ((1.0 - 1.0 / moduli) * all_forces(tip, delayed) - delayed) / retardation;
  }

  Eigen::MatrixXd c_;
  Eigen::VectorXd delayed_, forces_, held_;
  std::vector<Eigen::Index> rows_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

SupportNodes only_touched_near(double x) {
  SupportNodes nodes;
  for (std::int32_t i = 0; i < half_space().nodes.size(); ++i)
    if (half_space().nodes.point(i)[0] < x) nodes.touched.push_back(i);
  return nodes;
}

TEST(SupportField, ObeysItsEquationsWithPrescribedDisplacementsOverAnyChanges) {
  const std::vector<Change> changes{{0, free()},
                                    {20, held_beyond(3e-3)},
                                    {45, free()},
                                    {60, around(-2e-3, 0.0, 4e-3)},
                                    {80, around(0.0, 2e-3, 5e-3)},
                                    {130, only_touched_near(1e-3)},
                                    {160, held_beyond(0.0)},
                                    {220, free()}};
  const auto body = make_relaxing(changes);
  DenseSolid solid;
  std::size_t next = 1;
  double largest = 0.0, most_held = 0.0, most_energy = 0.0;
  double layer = 0.0, most_layer = 0.0;  // energy of the contact's layer, which creeps back after the tip has left, J
  bool touched = false;
  std::vector<double> u(3 * body->size());
  const auto size = static_cast<Eigen::Index>(u.size());
  for (int k = 0; k < 300; ++k) {
    const bool changed = next < changes.size() && changes[next].step == k;
    if (changed) solid.hold(changes[next++].nodes.held);
    const ContactResult& now = body->step(path(k));
    Eigen::VectorXd tip = Eigen::VectorXd::Zero(size);
    for (int c = 0; c < body->contact_count(); ++c) tip.segment<3>(3 * body->contact_nodes()[c]) += body->node_force(c);
    solid.advance(tip);
    body->displacement(u.data());
    const Eigen::VectorXd expected = solid.displacement();
    largest = std::max(largest, expected.cwiseAbs().maxCoeff());
    most_energy = std::max(most_energy, solid.energy());
    EXPECT_LE((Eigen::Map<const Eigen::VectorXd>(u.data(), size) - expected).cwiseAbs().maxCoeff(), 2e-5 * largest) << k;
    if (!now.touching) {
      const double left = now.energy - solid.energy(), crept_back = layer * std::exp(-2e-3 / retardation);
      if (touched || changed)  // the layer of nodes that become held gives up its energy
        EXPECT_TRUE(left > -2e-5 * most_energy && (touched || left < crept_back + 2e-5 * most_energy)) << k;
      else
        EXPECT_NEAR(left, crept_back, 2e-5 * most_energy) << k;
      most_layer = std::max(most_layer, layer = left);
      most_held = std::max(most_held, solid.energy());
    }
    touched = now.touching;
  }
  EXPECT_EQ(body->changes(), static_cast<int>(changes.size()) - 1);
  EXPECT_GT(largest, 0.8e-3);
  EXPECT_GT(most_held, 0.1 * most_energy);
  EXPECT_GT(most_layer, 0.05 * most_energy);
  EXPECT_LT(layer, 0.05 * most_layer);
}

TEST(SupportField, AGraspUnderATipChangesNeitherForceNorEnergyNorDisplacement) {
  for (const double mu : {0.0, 0.5}) {
    const auto body = make_relaxing({{0, free()}, {60, held_beyond(5e-3)}}, mu), plain = make_relaxing({{0, free()}}, mu);
    for (int k = 0; k <= 60; ++k)
      for (auto* one : {body.get(), plain.get()}) one->step(sphere(1e-3 * std::min(k / 20.0, 1.0), 0.5e-3 * std::max(k - 20, 0) / 40.0));
    EXPECT_EQ(body->changes(), 1);
    const ContactResult &held = body->last(), &free = plain->last();
    EXPECT_LT((held.force - free.force).norm(), 2e-3 * free.force.norm());
    EXPECT_LT((held.friction - free.friction).norm(), 5e-3 * free.force.norm());
    EXPECT_NEAR(held.energy, free.energy, 2e-3 * free.energy);
  }
}

TEST(SupportField, AGraspedBodyRelaxesToTheElasticOne) {
  const auto relaxing = make_relaxing({{0, free()}, {500, held_beyond(3e-3)}}),
             elastic = make<SignedDistancePhase>({{0, free()}, {500, held_beyond(3e-3)}});
  for (int k = 0; k < 1000; ++k)
    for (auto* body : {relaxing.get(), elastic.get()})
      body->step(sphere(1e-3 * std::min(k / 20.0, 1.0), k < 500 ? 0.0 : -2e-3 * std::min((k - 500) / 50.0, 1.0)));
  EXPECT_LT((relaxing->last().force - elastic->last().force).norm(), 1e-3 * elastic->last().force.norm());
  EXPECT_NEAR(relaxing->last().energy, elastic->last().energy, 1e-3 * elastic->last().energy);
}

TEST(SupportField, ADentThatWasHeldFillsSlowlyAfterItsRelease) {
  // Held for long, the dent has crept in; released, it fills with the retardation time, and a tip meets it meanwhile.
  const SupportNodes around_tip = around(0.0, 0.0, 5e-3);
  const auto body = make_relaxing({{0, free()}, {100, around_tip}, {600, free()}});
  std::vector<double> u(3 * body->size());
  const std::int32_t middle = half_space().nodes.nearest(Vector3<>::Zero(), 1.0);
  const auto depth = [&] {
    body->displacement(u.data());
    return -u[3 * static_cast<std::size_t>(middle) + 2];
  };
  for (int k = 0; k < 600; ++k) body->step(sphere(k < 100 ? 1e-3 * std::min(k / 20.0, 1.0) : -20e-3));
  const double held = depth();
  EXPECT_GT(held, 0.5e-3);
  body->step(sphere(-20e-3));
  const double released = depth();
  EXPECT_NEAR(released, (1.0 - 1.0 / moduli) * held, 0.05 * held);  // the delayed part of the displacement is left
  for (int k = 0; k < 30; ++k) body->step(sphere(-20e-3));
  EXPECT_NEAR(depth(), std::exp(-1.0) * released, 1e-3 * held);
  EXPECT_FALSE(body->step(sphere(0.5 * depth())).touching);  // less deep than the dent
  EXPECT_TRUE(body->step(sphere(0.6e-3)).touching);
}

TEST(SupportField, APathOverGraspAndReleaseExtractsNoEnergy) {
  const SupportNodes side = held_beyond(2e-3);
  for (const double sideways : {1.0, 0.65})
    for (const auto& [first, second] : {std::pair<int, int>{50, 150}, {150, 380}, {20, 320}, {250, 330}}) {
      const auto body = make_relaxing({{0, free()}, {first, side}, {second, free()}}, 0.0, sideways);
      double work = 0.0, largest = 0.0;
      Vector3<> last_force = Vector3<>::Zero(), last_center = sphere(-0.5e-3).center;
      for (int k = 0; k <= 400; ++k) {
        const double s = k / 400.0;
        const Tip tip = sphere(-0.5e-3 + 2.5e-3 * std::sin(M_PI * s), 3e-3 * s);
        const double before = body->last().energy, before_work = work;
        const Vector3<> force = body->step(tip).force;
        work -= 0.5 * (force + last_force).dot(tip.center - last_center);
        last_force = force;
        last_center = tip.center;
        largest = std::max(largest, body->last().energy);
        EXPECT_LE(body->last().energy - before, work - before_work + 2e-3 * largest) << sideways << " " << first << " " << k;
      }
      EXPECT_GT(work - body->last().energy, 0.05 * largest);
    }
}

TEST(SupportField, ACopyAtRestAndAResetBodyRepeatTheRun) {
  expect_repeats(*make_relaxing({{0, free()}, {10, held_beyond(3e-3)}, {25, free()}}), 60);
}

}  // namespace
}  // namespace supported_bodies
