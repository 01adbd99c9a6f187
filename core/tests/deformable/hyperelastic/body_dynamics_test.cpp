// Hyperelastic bodies with inertia: frequency, energy and damping of a free swing, also of a standard linear solid, inertia forces, and the
// return to rest.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>
#include <palpate/deformable/hyperelastic/quasi_static_solver.hpp>
#include <palpate/deformable/multirate/multirate_coupling.hpp>
#include <tuple>
#include <vector>

#include "support/tet_block.hpp"

namespace {

using palpate::deformable::BodyDynamics;
using palpate::deformable::DynamicForces;
using palpate::deformable::HyperelasticModel;
using palpate::deformable::Inertia;
using palpate::deformable::LayeredSurface;
using palpate::deformable::LocalModel;
using palpate::deformable::NeoHookean;
using palpate::deformable::Relaxation;
using palpate::deformable::SurfaceContact;
using palpate::deformable::TipPair;
using palpate::math::Vector3;

/// A column on a support, without tips: BodyDynamics and Newton's method alone.
struct SwingingColumn {
  static TetBlock column(bool is_free, double young) {
    TetBlock out(1, 1, 4, young, 0.4);
    if (is_free) std::fill(out.mesh.fixed.begin(), out.mesh.fixed.end(), false);
    return out;
  }

  TetBlock block;
  HyperelasticModel<NeoHookean, 2> model;
  Eigen::VectorXd mass;
  std::vector<std::int32_t> node_of;
  SurfaceContact contact;
  BodyDynamics dynamics;
  std::vector<double> start, force, elastic_force;

  explicit SwingingColumn(double alpha = 0.0, double beta = 0.0, bool is_free = false, const Relaxation& relaxation = {},
                          double young = 5e3)
      : block(column(is_free, young)),
        model(block.mesh, relaxation),
        node_of(block.mesh.points.size()),
        force(model.unknowns()),
        elastic_force(model.unknowns()) {
    const auto surface = block.top();
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(node_of.size()); ++i) node_of[static_cast<std::size_t>(model.point_of(i))] = i;
    const LayeredSurface layer(block.mesh.points, surface.triangles, surface.point, {surface.point.size(), {6e3, 6e3}});
    contact = SurfaceContact(block.mesh.points, layer, node_of, model.free_nodes());
    std::vector<double> by_node;
    for (std::size_t i = 0; i < static_cast<std::size_t>(model.free_nodes()); ++i) by_node.push_back(1000.0 * model.volume_of_node(i));
    mass.resize(static_cast<Eigen::Index>(model.unknowns()));
    for (Eigen::Index k = 0; k < mass.size(); ++k) mass[k] = by_node[static_cast<std::size_t>(k / 3)];
    dynamics = BodyDynamics(Inertia{1000.0, alpha, beta}, by_node, model.nodes());
  }

  /// Set the state: at rest where the model is.
  void rest() {
    const std::vector<double> all(model.displacement(), model.displacement() + 3 * model.nodes());
    model.elastic_forces(elastic_force);
    dynamics.rest_at(all.data(), elastic_force.data());
  }

  /// Vibration modes at rest, as columns, and their frequencies, rad/s, of the long term.
  [[nodiscard]] std::pair<Eigen::VectorXd, Eigen::MatrixXd> modes() const {
    const Eigen::Index n = mass.size();
    Eigen::MatrixXd stiffness(n, n);
    std::vector<float> unit(model.unknowns()), column(unit.size());
    float unused = 0.0F;
    for (Eigen::Index k = 0; k < n; ++k) {
      unit.assign(unit.size(), 0.0F);
      unit[static_cast<std::size_t>(k)] = 1.0F;
      model.tangent().multiply(unit.data(), column.data(), unused);
      for (Eigen::Index i = 0; i < n; ++i) stiffness(i, k) = static_cast<double>(column[static_cast<std::size_t>(i)]);
    }
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(0.5 * (stiffness + stiffness.transpose()), mass.asDiagonal());
    return {solver.eigenvalues().cwiseSqrt(), solver.eigenvectors()};
  }

  /// Start at rest with a displacement of the free nodes [m], reached in a time [s].
  void release(const Eigen::VectorXd& from, double held = palpate::deformable::fully_relaxed) {
    std::vector<double> all(3 * model.nodes(), 0.0);
    std::copy(from.begin(), from.end(), all.begin());
    model.reset();
    model.begin_step(held, all.data());
    model.end_step();
    rest();
  }

  /// Start at rest in the equilibrium under a force on the top to the side, N.
  void bend(double load) {
    std::vector<double> forces(model.unknowns(), 0.0);
    for (const std::int32_t p : block.top().point) forces[3 * static_cast<std::size_t>(node_of[static_cast<std::size_t>(p)])] = load / 4.0;
    model.reset();
    for (int k = 0; k < 30; ++k) model.step(palpate::deformable::DeadLoad{forces.data(), forces.size()}, 1e-4F, 200);
    model.end_step();
    rest();
  }

  /// Advance by a step of length h. Return the energy, J.
  double step(double h) {
    for (int stage = 0; stage < 2; ++stage) {
      minimize(stage, h);
      model.elastic_forces(elastic_force);
      dynamics.end_stage(stage, h, model.displacement(), elastic_force.data());
    }
    model.end_step();
    return model.energy() + dynamics.kinetic_energy();
  }

  void minimize(int stage, double h) {
    const BodyDynamics::Coefficients coefficients = dynamics.begin_stage(stage, h, start);
    DynamicForces forces(contact, dynamics, coefficients, force);
    model.begin_stage(stage, BodyDynamics::gamma, h, start.data(), coefficients.weight);
    contact.update_normals(model.displacement());
    for (int k = 0; k < 6; ++k) {
      forces.linearize(model.displacement());
      model.step(forces, 1e-4F, 200);
    }
  }

  [[nodiscard]] double along(const Eigen::VectorXd& mode) const {
    double sum = 0.0;
    for (Eigen::Index k = 0; k < mass.size(); ++k) sum += mode[k] * mass[k] * dynamics.displacement()[static_cast<std::size_t>(k)];
    return sum;
  }
};

/// Frequency of the lowest mode in steps of length h, rad/s, from the times of its zeros.
double swing_frequency(SwingingColumn& column, const Eigen::VectorXd& mode, double h, int zeros) {
  column.release(1e-5 / mode.cwiseAbs().maxCoeff() * mode);
  double last = column.along(mode), first = -1.0, time = 0.0;
  for (int found = 0, k = 1;; ++k) {
    column.step(h);
    const double now = column.along(mode);
    if ((now < 0.0) != (last < 0.0)) {
      time = h * (k - now / (now - last));
      if (++found == 1) first = time;
      if (found == zeros) return M_PI * (zeros - 1) / (time - first);
    }
    last = now;
  }
}

// The lowest eigenvalue of stiffness and mass at rest, to second order in the step.
TEST(BodyDynamics, SmallSwingsHaveTheLowestFrequencyOfTheBodyToSecondOrder) {
  SwingingColumn column;
  const auto [frequency, mode] = column.modes();
  const double w = frequency[0];
  const double coarse = 1.0 - swing_frequency(column, mode.col(0), 0.5 / w, 21) / w;
  const double fine = 1.0 - swing_frequency(column, mode.col(0), 0.25 / w, 21) / w;
  EXPECT_GT(coarse, 0.0);
  EXPECT_LT(coarse, 0.02);
  EXPECT_NEAR(coarse / fine, 4.0, 0.4);
}

// A mode keeps the part |R(i w h)|^2 of its energy in each step; a large swing never gains energy, and loses less with a shorter step.
TEST(BodyDynamics, AFreeSwingNeverGainsEnergy) {
  SwingingColumn column;
  const auto [frequency, mode] = column.modes();
  const double w = frequency[0], y2 = 0.25, a = std::pow(1.0 - 2.0 * BodyDynamics::gamma, 2), g4 = std::pow(BodyDynamics::gamma, 4);
  column.release(1e-5 / mode.col(0).cwiseAbs().maxCoeff() * mode.col(0));
  const double start = column.model.energy();
  double energy = start;
  for (int k = 0; k < 20; ++k) energy = column.step(0.5 / w);
  EXPECT_NEAR(std::log(energy / start), 20.0 * std::log((1.0 + a * y2) / (1.0 + a * y2 + g4 * y2 * y2)), 1e-4);

  std::array<double, 2> loss{};
  for (std::size_t half = 0; half < 2; ++half) {
    column.bend(5e-4);
    const double before = column.model.energy();
    double last = before;
    for (int k = 0; k < (half == 0 ? 40 : 80); ++k) {
      const double now = column.step((half == 0 ? 0.3 : 0.15) / w);
      EXPECT_LT(now, last * (1.0 + 1e-9));
      last = now;
    }
    loss[half] = 1.0 - last / before;
  }
  EXPECT_LT(loss[0], 0.2);
  EXPECT_LT(loss[1], 0.5 * loss[0]);
}

// The damping ratio of a mode of w rad/s is (alpha / w + beta w) / 2.
TEST(BodyDynamics, RayleighDampingGivesTheDampingRatio) {
  const auto [frequency, mode] = SwingingColumn().modes();
  const double w = frequency[0], h = 0.1 / w;
  for (const auto& [alpha, beta] : {std::pair(0.2 * w, 0.0), std::pair(0.0, 0.2 / w), std::pair(0.1 * w, 0.1 / w)}) {
    SwingingColumn column(alpha, beta);
    column.release(1e-5 / mode.col(0).cwiseAbs().maxCoeff() * mode.col(0));
    const double ratio = 0.5 * (alpha / w + beta * w), damped = w * std::sqrt(1.0 - ratio * ratio);
    const double start = column.along(mode.col(0));
    double time = 0.0;
    for (int k = 0; k < 100; ++k, time += h) column.step(h);
    const double expected = start * std::exp(-ratio * w * time) * (std::cos(damped * time) + ratio * w / damped * std::sin(damped * time));
    EXPECT_NEAR(column.along(mode.col(0)), expected, 0.02 * start * std::exp(-ratio * w * time));
  }
}

/// Roots of a vibration of the standard linear solid with the long-term frequency w [rad/s] and the damping a + b w^2 [1/s]:
///   s^2 + (a + b w^2) s + w^2 (1 + (r - 1) s / (s + 1 / tau)) = 0,   tau = retardation_time / r.
/// The first one decays without a swing.
Eigen::Vector3cd solid_roots(double w, double damping, const Relaxation& relaxation) {
  const double r = relaxation.instantaneous_ratio, rate = r / relaxation.retardation_time;
  Eigen::Matrix3d companion;
  companion << -(damping + rate), -(damping * rate + w * w * r), -w * w * rate, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  Eigen::Vector3cd roots = companion.eigenvalues();
  std::sort(roots.begin(), roots.end(), [](const auto& a, const auto& b) { return std::abs(a.imag()) < std::abs(b.imag()); });
  return roots;
}

/// Displacement along a mode after a release from 1 at rest, where it was held for long: x'' = -w^2 at first.
double released(const Eigen::Vector3cd& roots, double w, double time) {
  Eigen::Matrix3cd powers;
  for (int k = 0; k < 3; ++k) powers.col(k) << 1.0, roots[k], roots[k] * roots[k];
  const Eigen::Vector3cd parts = powers.partialPivLu().solve(Eigen::Vector3cd(1.0, 0.0, -w * w));
  return (parts.array() * (roots.array() * time).exp()).sum().real();
}

/// Swinging root of values in equal steps of length h: three exponentials through them (Prony).
std::complex<double> swing_root(const std::vector<double>& values, double h) {
  const auto rows = static_cast<Eigen::Index>(values.size()) - 3;
  Eigen::MatrixXd past(rows, 3);
  Eigen::VectorXd next(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) past(i, k) = values[static_cast<std::size_t>(i + 2 - k)];
    next[i] = values[static_cast<std::size_t>(i + 3)];
  }
  Eigen::Matrix3d companion = Eigen::Matrix3d::Zero();
  companion.row(0) = past.colPivHouseholderQr().solve(next).transpose();
  companion(1, 0) = companion(2, 1) = 1.0;
  Eigen::Vector3cd roots = companion.eigenvalues();
  std::sort(roots.begin(), roots.end(), [](const auto& a, const auto& b) { return a.imag() < b.imag(); });
  return std::log(roots[2]) / h;
}

// Decay and frequency are those of the characteristic equation, to second order in the step. The body also creeps back, by the real root:
// a fit of the decay without it is wrong.
TEST(BodyDynamics, ASmallSwingOfASolidThatRelaxesDecaysAsItsCharacteristicEquationToSecondOrder) {
  const auto [frequency, mode] = SwingingColumn().modes();
  const double w = frequency[0];
  for (const auto& [relaxation, alpha, beta] : {std::tuple(Relaxation{2.5, 0.5}, 0.0, 0.0), std::tuple(Relaxation{3.0, 0.1}, 2.0, 4e-3)}) {
    const Eigen::Vector3cd roots = solid_roots(w, alpha + beta * w * w, relaxation);
    std::array<double, 2> decay{}, swing{}, path{};
    for (std::size_t half = 0; half < 2; ++half) {
      SwingingColumn column(alpha, beta, false, relaxation);
      const double h = (half == 0 ? 0.1 : 0.05) / w;
      column.release(1e-5 / mode.col(0).cwiseAbs().maxCoeff() * mode.col(0));
      const double start = column.along(mode.col(0));
      std::vector<double> values{1.0};
      for (int k = 1; k <= (half == 0 ? 150 : 300); ++k) {
        column.step(h);
        values.push_back(column.along(mode.col(0)) / start);
        path[half] = std::max(path[half], std::abs(values.back() - released(roots, w, h * k)));
      }
      const std::complex<double> found = swing_root(values, h);
      decay[half] = std::abs(found.real() - roots[2].real());
      swing[half] = std::abs(found.imag() - std::abs(roots[2].imag()));
    }
    EXPECT_LT(decay[1], 0.005 * std::abs(roots[2].real()));
    EXPECT_LT(swing[1], 0.002 * std::abs(roots[2].imag()));
    EXPECT_NEAR(decay[0] / decay[1], 4.0, 0.6);
    EXPECT_NEAR(swing[0] / swing[1], 4.0, 0.3);
    EXPECT_NEAR(path[0] / path[1], 4.0, 0.6);
  }
}

// Elastic, kinetic and stored energy never grow at small strains, in steps of any length.
TEST(BodyDynamics, AFreeSwingOfASolidThatRelaxesNeverGainsEnergy) {
  const Eigen::MatrixXd modes = SwingingColumn().modes().second;
  const double w = SwingingColumn().modes().first[0];
  const Eigen::VectorXd shape = modes.col(0) + 0.3 * modes.col(3) - 0.2 * modes.col(7);
  for (const double y : {0.05, 0.4, 3.0})
    for (const double held : {0.0, palpate::deformable::fully_relaxed})
      for (const double time : {0.02, 0.5}) {
        SwingingColumn column(0.0, 0.0, false, Relaxation{2.5, time});
        column.release(1e-5 / shape.cwiseAbs().maxCoeff() * shape, held);
        const double start = column.model.energy();
        double last = start;
        for (int k = 0; k < 40; ++k) {
          const double now = column.step(y / w);
          EXPECT_LT(now, last + 1e-7 * start);
          last = now;
        }
        EXPECT_LT(last, start);
      }
}

// A solid that takes for ever to relax is an elastic one of `ratio` times its moduli, and one that relaxes at once is its long term.
TEST(BodyDynamics, ASolidThatRelaxesNeverOrAtOnceSwingsAsAnElasticOne) {
  const auto [frequency, mode] = SwingingColumn().modes();
  const double h = 0.2 / frequency[0];
  for (const auto& [relaxation, young] :
       {std::pair(Relaxation{2.5, 1e15}, 12.5e3), std::pair(Relaxation{2.5, 1e-15}, 5e3), std::pair(Relaxation{1.0, 0.1}, 5e3)}) {
    SwingingColumn solid(0.0, 0.0, false, relaxation), elastic(0.0, 0.0, false, {}, young);
    const Eigen::VectorXd bent = 3e-3 / mode.col(0).cwiseAbs().maxCoeff() * mode.col(0);
    solid.release(bent, 0.0);
    elastic.release(bent);
    const double start = elastic.along(mode.col(0));
    for (int k = 0; k < 40; ++k) {
      solid.step(h);
      elastic.step(h);
      EXPECT_NEAR(solid.along(mode.col(0)), elastic.along(mode.col(0)), 1e-5 * start);
    }
  }
}

// A body without support resists a tip by its mass alone: its momentum is the impulse of the tip, and stays when the tip is gone.
TEST(BodyDynamics, AFreeBodyTakesUpTheImpulseOfTheTip) {
  SwingingColumn column(0.0, 1e-4, true);
  std::vector<double> rest(3 * column.model.nodes(), 0.0);
  column.dynamics.rest_at(rest.data(), column.model.gradient());  // no forces
  TipPair tips;
  tips.count = 1;
  tips.tip[0].radius = 4e-3;
  const double h = 2e-3, gamma = BodyDynamics::gamma;
  Vector3<> impulse = Vector3<>::Zero(), momentum = Vector3<>::Zero();
  for (int k = 0; k < 20; ++k) {
    for (int stage = 0; stage < 2; ++stage) {
      tips.tip[0].center = {2.5e-3, 2.5e-3, 0.02 + 4e-3 - (k < 10 ? 1e-4 * k : -1.0)};
      column.contact.set_tips(tips);
      const BodyDynamics::Coefficients coefficients = column.dynamics.begin_stage(stage, h, column.start);
      DynamicForces forces(column.contact, column.dynamics, coefficients, column.force);
      column.model.begin_stage(stage, gamma, h, column.start.data(), coefficients.weight);
      column.contact.update_normals(column.model.displacement());
      if (k == 0 && stage == 0) {  // the stiffness alone is singular, and so is its coarse matrix
        column.model.add_mass(forces);
        column.model.set_displacement(column.start.data());
      }
      for (int n = 0; n < 8; ++n) {
        forces.linearize(column.model.displacement());
        column.model.step(forces, 1e-4F, 200);
      }
      column.contact.linearize(column.model.displacement());
      for (std::size_t i = 0; i < column.model.unknowns(); ++i)
        impulse[static_cast<int>(i % 3)] += (stage == 0 ? 1.0 - gamma : gamma) * h * column.contact.force()[i];
      column.model.elastic_forces(column.elastic_force);
      column.dynamics.end_stage(stage, h, column.model.displacement(), column.elastic_force.data());
    }
    momentum = Vector3<>::Zero();
    for (std::size_t i = 0; i < column.model.unknowns(); ++i)
      momentum[static_cast<int>(i % 3)] += column.dynamics.mass(i) * column.dynamics.velocity()[i];
    EXPECT_LT((momentum - impulse).norm(), 1e-4 * impulse.norm() + 1e-15);
  }
  EXPECT_LT(momentum.z(), 0.0);
}

/// A tip on a body with inertia: two rates, synchronously.
struct TouchedBlock {
  using Solver = palpate::deformable::QuasiStaticSolver<NeoHookean, 2>;
  int interval;  // ticks of an update
  TetBlock block{4, 3, 2, 8e3, 0.4};
  palpate::deformable::MultirateCoupling<Solver> coupling;
  TipPair tips;
  int ticks = 0;

  TouchedBlock(int ticks_of_update, double period, const Relaxation& relaxation = {}, const Inertia& inertia = {1000.0, 1.0, 1e-4})
      : interval(ticks_of_update),
        coupling(std::make_unique<Solver>(block.mesh, block.top(),
                                          palpate::deformable::SolverOptions{.nodes_per_tip = 16,
                                                                             .inertia = inertia,
                                                                             .relaxation = relaxation,
                                                                             .tick_period = period,
                                                                             .update_interval = ticks_of_update})) {
    tips.count = 1;
    tips.tip[0].radius = 7e-3;
  }

  const palpate::deformable::MultiTipResult& tick(const Vector3<>& center) {
    tips.tip[0].center = center;
    if (ticks % interval == 0 && ticks > 0) coupling.publish_model();
    const auto& result = coupling.tick(tips);
    if (ticks++ % interval == 0) coupling.compute_model();
    return result;
  }
};

// A tip taps the body ten times on closed paths. Its work equals potential plus tank level, which are not negative, less the energy that
// the body has lost while it swung free: it never gains energy, to 1e-4 of the exchanged energy.
void expect_no_gain_on_closed_paths(const Relaxation& relaxation) {
  TouchedBlock body(100, 1e-4, relaxation);
  Vector3<> before = Vector3<>::Zero(), force = Vector3<>::Zero();
  double work = 0.0, held = 0.0, exchanged = 0.0, error = 0.0, least = 0.0;
  int touched = 0, kept = 0;
  for (int k = 0; k <= 8000; ++k) {
    const double turn = 2.0 * M_PI * k / 8000.0;
    const Vector3<> center(0.011 + 2e-3 * std::sin(3.0 * turn), 0.009 + 2e-3 * std::sin(2.0 * turn),
                           0.01 + 7e-3 + 1e-3 - 2.5e-3 * std::sin(10.0 * turn));
    const auto& now = body.tick(center);
    const auto& tank = body.coupling.model_switch().tank();
    const double done = k > 0 ? -0.5 * (now.tip[0].force + force).dot(center - before) : 0.0, holds = now.energy + tank.level;
    ASSERT_TRUE(now.solved);
    ASSERT_GE(tank.level, 0.0);
    ASSERT_GE(now.energy, 0.0);
    work += done;
    exchanged += std::abs(done);
    least = std::min(least, work);
    if (now.nodes > 0)
      error += done - (holds - held);
    else if (tank.level > 0.0)
      ++kept;
    held = holds;
    touched += now.nodes > 0 ? 1 : 0;
    force = now.tip[0].force;
    before = center;
  }
  EXPECT_GT(touched, 2000);
  EXPECT_GT(kept, 2000);
  EXPECT_LT(std::abs(error), 0.02 * exchanged);  // quadrature error of the work
  EXPECT_GE(least, -1e-4 * exchanged);
  EXPECT_GT(work, 0.0);
}

TEST(BodyDynamics, ClosedPathsOfATipGainNoEnergyFromASwingingBody) {
  expect_no_gain_on_closed_paths({});
}
TEST(BodyDynamics, ClosedPathsOfATipGainNoEnergyFromASwingingBodyThatRelaxes) {
  expect_no_gain_on_closed_paths({2.5, 0.2});
}

// The force on a slowly pressed tip is that of the equilibrium; reset() returns to rest, and the second press equals the first.
TEST(BodyDynamics, ASlowPressIsThatOfTheEquilibriumAndResetReturnsToRest) {
  TouchedBlock body(8, 1e-3);
  std::array<std::vector<double>, 2> force;
  const auto place = [](double depth) { return Vector3<>(0.011, 0.009, 0.01 + 7e-3 - depth); };
  for (auto& felt : force) {
    body.coupling.reset();
    body.ticks = 0;
    for (int k = 0; k < 240; ++k) felt.push_back(body.tick(place(1e-5 * std::min(k, 160))).tip[0].force.z());
  }
  EXPECT_EQ(force[0], force[1]);
  EXPECT_TRUE(body.coupling.settle(body.tips, 100));
  EXPECT_NEAR(force[0].back(), body.coupling.model_switch().last().tip[0].force.z(), 0.01 * force[0].back());
}

// Law: rounding errors of a body that has come to rest after the tip has left cost no iterations, but for one step of Newton's method now
// and then, since a step begins from the rounded velocities of the last one.
TEST(BodyDynamics, ABodyThatHasComeToRestIteratesNoLonger) {
  TouchedBlock body(5, 1e-3, {}, {1000.0, 20.0, 5e-3});
  const auto place = [](int k) { return Vector3<>(0.011, 0.009, 0.01 + 7e-3 - (k < 60 ? 1e-3 : -5e-3)); };
  int pressed = 0, most = 0;
  for (int k = 0; k < 3000; ++k) {
    body.tick(place(k));
    if (k == 59) pressed = body.coupling.last_report().newton.solver_steps;
    if (k >= 2800) most = std::max(most, body.coupling.last_report().newton.solver_steps);
  }
  EXPECT_GT(pressed, 25);
  EXPECT_LT(most, 25);
  EXPECT_EQ(body.coupling.last_report().relative_residual, 0.0);
}

}  // namespace
