// Supports that change on a body with inertia: its equations integrated in time, dense, and the energy account.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <palpate/deformable/linear/supported_modes.hpp>
#include <palpate/object/supported_body.hpp>
#include <vector>

#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

using palpate::deformable::ContactResult;
using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The equations of the body: q'' + damping + W^2 q = Phi^T F and u = Phi q + R F, where the forces F include those of supports that yield
/// by `yield` of a node's own compliance. They follow from the displacements of the held nodes at each instant. Damping is Rayleigh's, of
/// the stiffness with the supports. Classical Runge-Kutta method.
class DenseSwing {
 public:
  explicit DenseSwing(int modes) {
    const auto s = massive_surface(modes);
    const auto n = static_cast<Eigen::Index>(3 * s->size());
    c_ = Eigen::Map<const Rows>(s->compliance.data(), n, n).cast<double>();
    shapes_ = Eigen::Map<const Rows>(s->shapes.data(), n, modes).cast<double>();
    stiffness_ = Eigen::Map<const Vector>(s->frequencies.data(), modes).array().square();
    rest_ = c_ - shapes_ * stiffness_.cwiseInverse().asDiagonal() * shapes_.transpose();
    q_ = v_ = Vector::Zero(modes);
    anchor_ = forces_ = Vector::Zero(n);
    hold({});
  }

  /// Hold the nodes where they are; those that were held stay at their anchors.
  void hold(const std::vector<std::int32_t>& nodes) {
    Vector anchor = displacement();
    for (const Eigen::Index row : rows_) anchor[row] = anchor_[row];
    anchor_ = anchor;
    rows_.clear();
    for (const std::int32_t node : nodes)
      for (Eigen::Index a = 0; a < 3; ++a) rows_.push_back(3 * node + a);
    const Vector own = c_.diagonal()(rows_);
    yields_ = Vector::Constant(own.size(), own.size() > 0 ? yield * own.maxCoeff() : 0.0);
    factor_.compute(Matrix(rest_(rows_, rows_)) + Matrix(yields_.asDiagonal()));
  }

  /// Advance by a tick under constant forces of the tip.
  void advance(const Vector& tip) {
    constexpr int steps = 60;
    constexpr double h = 1e-3 / steps;
    const Vector pressed = (rest_ * tip)(rows_);
    for (int k = 0; k < steps; ++k) {
      const Vector a1 = rate(tip, pressed, q_, v_), a2 = rate(tip, pressed, q_ + 0.5 * h * v_, v_ + 0.5 * h * a1),
                   a3 = rate(tip, pressed, q_ + 0.5 * h * v_ + 0.25 * h * h * a1, v_ + 0.5 * h * a2),
                   a4 = rate(tip, pressed, q_ + h * v_ + 0.5 * h * h * a2, v_ + h * a3);
      q_ += h * v_ + h * h / 6.0 * (a1 + a2 + a3);
      v_ += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    forces_ = tip;
    if (!rows_.empty()) forces_(rows_) += reaction(pressed, q_);
  }

  [[nodiscard]] Vector displacement() const { return shapes_ * q_ + rest_ * forces_; }
  [[nodiscard]] double energy() const {
    double twice = v_.squaredNorm() + q_.dot(stiffness_.cwiseProduct(q_)) + forces_.dot(rest_ * forces_);
    if (!rows_.empty()) twice += yields_.dot(Vector(forces_(rows_)).cwiseAbs2());
    return 0.5 * twice;
  }

 private:
  static constexpr double yield = 1e-6;

  [[nodiscard]] Vector reaction(const Vector& pressed, const Vector& q) const {
    return factor_.solve(Vector(anchor_(rows_)) - shapes_(rows_, Eigen::all) * q - pressed);
  }
  [[nodiscard]] Vector rate(const Vector& tip, const Vector& pressed, const Vector& q, const Vector& v) const {
    Vector a = shapes_.transpose() * tip - stiffness_.cwiseProduct(q + swing_beta * v) - swing_alpha * v;
    if (rows_.empty()) return a;
    const Matrix held = shapes_(rows_, Eigen::all);
    return a + held.transpose() * (reaction(pressed, q) - swing_beta * factor_.solve(held * v));
  }

  Matrix c_, shapes_, rest_;
  Vector stiffness_, q_, v_, anchor_, forces_, yields_;
  std::vector<Eigen::Index> rows_;
  Eigen::LLT<Matrix> factor_;
};

std::vector<double> displacement_of(BodyWithSupports& body) {
  std::vector<double> u(3 * body.size());
  body.displacement(u.data());
  return u;
}

TEST(SupportedModes, ObeyTheEquationsOfTheBodyOverAnyChanges) {
  const std::vector<Change> changes{
      {0, free()},  {20, held_beyond(3e-3)}, {60, around(-2e-3, 0.0, 4e-3)}, {80, around(0.0, 2e-3, 5e-3)}, {130, held_beyond(0.0)},
      {220, free()}};
  const auto body = make_swinging(changes);
  DenseSwing swing(20);
  std::size_t next = 1;
  double largest = 0.0, most_energy = 0.0;
  int swinging = 0;
  for (int k = 0; k < 300; ++k) {
    if (next < changes.size() && changes[next].step == k) swing.hold(changes[next++].nodes.held);
    const ContactResult& now = body->step(path(k));
    const std::vector<double> u = displacement_of(*body);
    Vector tip = Vector::Zero(static_cast<Eigen::Index>(u.size()));
    for (int c = 0; c < body->contact_count(); ++c) tip.segment<3>(3 * body->contact_nodes()[c]) += body->node_force(c);
    swing.advance(tip);
    const Vector expected = swing.displacement();
    largest = std::max(largest, expected.cwiseAbs().maxCoeff());
    most_energy = std::max(most_energy, swing.energy());
    const double error = (Eigen::Map<const Vector>(u.data(), expected.size()) - expected).cwiseAbs().maxCoeff();
    EXPECT_LE(error, 5e-5 * largest) << k;
    if (!now.touching) {  // otherwise the contact's layer stores energy too
      EXPECT_NEAR(now.energy, swing.energy(), 5e-5 * most_energy) << k;
      swinging += swing.energy() > 0.05 * most_energy ? 1 : 0;
    }
  }
  EXPECT_EQ(body->changes(), static_cast<int>(changes.size()) - 1);
  EXPECT_GT(largest, 0.8e-3);
  EXPECT_GT(swinging, 20);
}

TEST(SupportedModes, AFreeSwingKeepsItsEnergyOverAGraspAndLosesItOverARelease) {
  const auto body = make_swinging({{0, free()}, {40, held_beyond(3e-3)}, {80, around(0.0, 0.0, 5e-3)}, {120, free()}}, 0.0);
  for (int k = 0; k <= 20; ++k) body->step(sphere(1.5e-3 * k / 20.0));
  body->step(sphere(-20e-3));
  const double swinging = body->step(sphere(-20e-3)).energy;
  EXPECT_GT(swinging, 0.0);
  double energy = swinging;
  for (int k = 23; k < 160; ++k) {
    const double now = body->step(sphere(-20e-3)).energy;
    if (k < 80)
      EXPECT_NEAR(now, swinging, 2e-5 * swinging) << k;  // the second change releases nodes too
    else
      EXPECT_LE(now, energy + 2e-5 * swinging) << k;
    energy = now;
  }
  EXPECT_EQ(body->changes(), 3);
  EXPECT_GT(energy, 0.2 * swinging);
}

TEST(SupportedModes, AGraspUnderARestingTipChangesNeitherForceNorEnergyNorDisplacement) {
  for (const double mu : {0.0, 0.5}) {
    const auto body = make_swinging({{0, free()}, {600, held_beyond(4e-3)}}, 5.0, 20, mu);
    const auto tip = [](int k) { return sphere(1e-3 * std::min(k / 20.0, 1.0), 0.3e-3 * std::clamp((k - 20) / 40.0, 0.0, 1.0)); };
    for (int k = 0; k < 600; ++k) body->step(tip(k));
    const ContactResult before = body->last();
    const std::vector<double> displaced = displacement_of(*body);
    const ContactResult grasped = body->step(tip(600));
    EXPECT_EQ(body->changes(), 1);
    EXPECT_LT((grasped.force - before.force).norm(), 2e-3 * before.force.norm());
    EXPECT_NEAR(grasped.energy, before.energy, 2e-3 * before.energy);
    const std::vector<double> after = displacement_of(*body);
    for (std::size_t i = 0; i < after.size(); ++i) EXPECT_NEAR(after[i], displaced[i], 2e-3 * 1e-3);
  }
}

TEST(SupportedModes, ABodyGraspedAtRestIsThatWithTheseSupportsFromTheStart) {
  const auto body = make_swinging({{0, free()}, {5, held_beyond(4e-3)}}), always = make_swinging({{0, held_beyond(4e-3)}});
  for (int k = 0; k < 100; ++k) {
    const Tip tip = k < 6 ? sphere(-1e-3) : path(k);
    EXPECT_EQ(body->step(tip).force, always->step(tip).force);
    EXPECT_EQ(body->last().energy, always->last().energy);
  }
}

TEST(SupportedModes, WithoutChangesHaveTheBitsOfTheBodyWithoutPhases) {
  const auto body = make_swinging({{0, free()}});
  const auto s = massive_surface(20);
  palpate::object::SignedDistanceOptions options;
  options.modes = {s->shapes.data(), s->frequencies, swing_alpha, swing_beta};
  palpate::object::SignedDistanceBody plain(std::make_shared<const palpate::object::SignedDistanceBody::Data>(
      half_space().nodes, s->compliance.data(), half_space().surface, options));
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(body->step(path(k)).force, plain.step(path(k)).force);
    EXPECT_EQ(body->last().energy, plain.last().energy);
  }
}

TEST(SupportedModes, AGraspedBodySwingsOutToTheBodyWithoutInertia) {
  const auto swinging = make_swinging({{0, free()}, {300, held_beyond(3e-3)}, {900, around(2e-3, 0.0, 3e-3)}}, 5.0),
             massless = make<SignedDistancePhase>({{0, free()}, {300, held_beyond(3e-3)}, {900, around(2e-3, 0.0, 3e-3)}});
  for (int k = 0; k < 1500; ++k)
    for (auto* body : {swinging.get(), massless.get()})
      body->step(sphere(1e-3 * std::min(k / 20.0, 1.0), k < 300 ? 0.0 : -2e-3 * std::min((k - 300) / 50.0, 1.0)));
  EXPECT_LT((swinging->last().force - massless->last().force).norm(), 1e-3 * massless->last().force.norm());
  EXPECT_NEAR(swinging->last().energy, massless->last().energy, 2e-3 * massless->last().energy);
}

TEST(SupportedModes, APathOverGraspAndReleaseExtractsNoEnergy) {
  const SupportNodes side = held_beyond(2e-3);
  for (const int modes : {20, 200})  // few, and nearly all
    for (const double sideways : {1.0, 0.65})
      for (const auto& [first, second] : {std::pair<int, int>{50, 150}, {150, 380}, {20, 320}, {250, 330}}) {
        const auto body = make_swinging({{0, free()}, {first, side}, {second, free()}}, 0.0, modes, 0.0, sideways);
        double work = 0.0, largest = 0.0;
        Vector3<> last_center = sphere(-0.5e-3).center;
        for (int k = 0; k <= 400; ++k) {
          const double s = k / 400.0;
          const Tip tip = sphere(-0.5e-3 + 2.5e-3 * std::sin(M_PI * s), 3e-3 * s);
          const Vector3<> force = body->step(tip).force;
          work -= force.dot(tip.center - last_center);  // the force acts over the whole period
          last_center = tip.center;
          largest = std::max(largest, body->last().energy);
          EXPECT_LE(body->last().energy, work + 1e-5 * largest) << modes << " " << sideways << " " << first << " " << k;
        }
        EXPECT_GT(largest, 1e-5);
      }
}

TEST(SupportedModes, NodesWithNearlyAllTheirMassInModesCanBeHeld) {
  // What the modes leave of the compliance is nearly singular at the held nodes.
  const auto body = make_swinging({{0, free()}, {100, held_beyond(3e-3)}}, 1.0, 243);
  ASSERT_TRUE(body->usable());
  for (int k = 0; k < 300; ++k) body->step(path(k));
  const std::vector<double> before = displacement_of(*body);
  for (int k = 300; k < 350; ++k) body->step(path(k));
  const std::vector<double> after = displacement_of(*body);
  double moved = 0.0, held = 0.0;
  for (std::int32_t i = 0; i < half_space().nodes.size(); ++i)
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t row = 3 * static_cast<std::size_t>(i) + a;
      double& most = half_space().nodes.point(i)[0] > 3e-3 ? held : moved;
      most = std::max(most, std::abs(after[row] - before[row]));
    }
  EXPECT_GT(moved, 1e-4);
  EXPECT_LT(held, 1e-3 * moved);
}

TEST(SupportedModes, ACopyAtRestAndAResetBodyRepeatTheRun) {
  expect_repeats(*make_swinging({{0, free()}, {10, held_beyond(3e-3)}, {25, free()}}), 60);
}

}  // namespace
}  // namespace supported_bodies
