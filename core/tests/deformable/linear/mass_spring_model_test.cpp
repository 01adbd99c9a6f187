// Mass-spring model: closed forms, dense algebra, passivity.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <random>

#include "support/linear_solve.hpp"
#include "support/mass_spring_cube.hpp"

namespace mass_spring_tests {

namespace {

using palpate::deformable::padded;
using palpate::deformable::PaddedVector;
using palpate::deformable::SpringLaw;
using palpate::deformable::SpringNetwork;
using palpate::deformable::SpringNetworkData;
using palpate::deformable::vector;
using palpate::math::Vector3;

TEST(SupernodalCholesky, SolvesAsDenseAlgebraDoes) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const int size = 40;
  Eigen::SparseMatrix<double> matrix(size, size);
  for (int i = 0; i < size; ++i) {
    matrix.coeffRef(i, i) += 1.0;
    for (int k = 0; k < 3; ++k) {
      const int j = static_cast<int>(random() % size);
      const double weight = std::abs(normal(random));
      matrix.coeffRef(i, i) += weight;
      matrix.coeffRef(j, j) += weight;
      matrix.coeffRef(i, j) -= weight;
      matrix.coeffRef(j, i) -= weight;
    }
  }
  palpate::math::SupernodalCholesky factor(matrix);
  ASSERT_TRUE(factor.positive_definite());
  Eigen::MatrixXd sides(size, 3);
  for (double& s : sides.reshaped()) s = normal(random);
  const Eigen::MatrixXd expected = linear_solve(Eigen::MatrixXd(matrix), sides);
  for (const double scale : {1.0, 1e-200, 1e200}) {  // single precision, but neither its underflow nor its overflow
    std::vector<PaddedVector> x;
    for (int i = 0; i < size; ++i) x.push_back(padded(scale * sides.row(i).transpose()));
    factor.solve(x.data());
    for (int i = 0; i < size; ++i)
      EXPECT_LT((vector(x[static_cast<std::size_t>(i)]) / scale - expected.row(i).transpose()).norm(), 3e-6 * expected.norm());
  }
  matrix.coeffRef(3, 3) = -1.0;
  EXPECT_FALSE(palpate::math::SupernodalCholesky(matrix).positive_definite());
}

const std::vector<SpringLaw> laws = {
    {}, {SpringLaw::Kind::cubic, 0.1, 4.0}, {SpringLaw::Kind::exponential, 8.0, 4.0}, {SpringLaw::Kind::exponential, -8.0, 4.0}};

/// Energy of a network at `x`, and its forces without dampers.
double forces_at(SpringNetwork& network, const std::vector<Vector3<>>& x, std::vector<Vector3<>>& force) {
  std::vector<PaddedVector> at, still(x.size(), PaddedVector(0.0)), out(x.size());
  for (const Vector3<>& p : x) at.push_back(padded(p));
  const double energy = network.accumulate_forces(at.data(), still.data(), out.data());
  for (std::size_t v = 0; v < x.size(); ++v) force[v] = vector(out[v]);
  return energy;
}

// Central differences of the energy along random directions, at large deformation.
TEST(SpringNetwork, ForceIsTheGradientOfItsEnergy) {
  std::size_t draw = 0;
  for (const double pressure : {2e4, -5e3, 2e4, -5e3, -5e4}) {
    Cube cube(2);
    cube.data.law = laws[draw++ % laws.size()];
    cube.data.pressure.assign(cube.data.pressure.size(), pressure);
    SpringNetwork network(cube.data);
    std::mt19937 random(2);
    std::normal_distribution<double> normal(0.0, 1e-3);
    std::vector<Vector3<>> x = cube.data.rest_positions, along(x.size()), force(x.size()), other(x.size());
    for (Vector3<>& p : x) p += Vector3<>(normal(random), normal(random), normal(random));
    for (Vector3<>& a : along) a = {normal(random), normal(random), normal(random)};
    const auto energy = [&](double s) {
      std::vector<Vector3<>> there = x;
      for (std::size_t v = 0; v < x.size(); ++v) there[v] += s * along[v];
      return forces_at(network, there, other);
    };
    forces_at(network, x, force);
    double expected = 0.0;
    for (std::size_t v = 0; v < x.size(); ++v) expected -= force[v].dot(along[v]);
    EXPECT_NEAR((energy(1e-4) - energy(-1e-4)) / 2e-4, expected, 1e-6 * std::abs(expected));
  }
}

// Law: a network is inverted if, and only if, a tetrahedron has no positive volume; here a vertex is moved through its neighbors.
TEST(SpringNetwork, IsInvertedIfATetrahedronHasNoPositiveVolume) {
  const Cube cube(2);
  SpringNetwork network(cube.data);
  std::vector<Vector3<>> force(cube.data.rest_positions.size());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> share(-1.0, 1.0);
  int inverted = 0;
  for (int draw = 0; draw < 200; ++draw) {
    std::vector<Vector3<>> x = cube.data.rest_positions;
    for (Vector3<>& p : x) p += 2e-3 * Vector3<>(share(random), share(random), share(random));
    double least = 1.0;
    for (const auto& t : cube.data.tetrahedra) {
      const auto vertex = [&](std::size_t i) -> const Vector3<>& { return x[static_cast<std::size_t>(t[i])]; };
      Eigen::Matrix3d edges;
      for (int i = 0; i < 3; ++i) edges.col(i) = vertex(static_cast<std::size_t>(i) + 1) - vertex(0);
      least = std::min(least, edges.determinant());
    }
    forces_at(network, x, force);
    ASSERT_EQ(network.inverted(), !(least > 0.0)) << draw;
    inverted += network.inverted() ? 1 : 0;
  }
  EXPECT_GT(inverted, 20);
  EXPECT_LT(inverted, 180);
  forces_at(network, cube.data.rest_positions, force);
  EXPECT_FALSE(network.inverted());
}

// Law: volumes of negative pressure p release at most |p| V / 2, however far the vertices are from rest, and their forces fall.
TEST(SpringNetwork, NegativePressuresReleaseABoundedEnergy) {
  Cube cube(2);
  cube.data.stiffness.assign(cube.data.stiffness.size(), 0.0);
  cube.data.pressure.assign(cube.data.pressure.size(), -5e3);
  SpringNetwork network(cube.data);
  std::vector<Vector3<>> force(cube.data.rest_positions.size());
  for (const double factor : {-3.0, -1.0, 0.5, 2.0, 100.0}) {
    std::vector<Vector3<>> x = cube.data.rest_positions;
    for (Vector3<>& p : x) p *= factor;
    const double change = std::pow(factor, 3) - 1.0, least = -0.5 * 5e3 * std::pow(0.01, 3);
    EXPECT_NEAR(forces_at(network, x, force), least * change * change / (1.0 + change * change), -1e-9 * least) << factor;
    if (factor == 100.0)
      for (const Vector3<>& f : force) EXPECT_LT(f.norm(), 1e-6);
  }
}

/// Two vertices with a spring of 30 N/m and 10 mm.
SpringNetworkData one_spring(const SpringLaw& law) {
  SpringNetworkData data;
  data.rest_positions = {{0, 0, 0}, {0, 0, 0.01}};
  data.masses = {1e-3, 1e-3};
  data.fixed = {1, 0};
  data.springs = {{0, 1}};
  data.stiffness = {30.0};
  data.pressure = {0.0, 0.0};
  data.law = law;
  return data;
}

// Force of a spring against the formula of its law, and against a line where the tangent stiffness has reached its limit.
TEST(SpringLaw, ForceIsThatOfTheFormula) {
  const auto formula = [](const SpringLaw& law, double e) {
    const double b = law.parameter;
    return law.kind == SpringLaw::Kind::cubic ? e + e * e * e / (b * b) : std::expm1(b * e) / b;
  };
  const auto tangent = [](const SpringLaw& law, double e) {
    const double b = law.parameter;
    return law.kind == SpringLaw::Kind::cubic ? 1.0 + 3.0 * e * e / (b * b) : std::exp(b * e);
  };
  for (const double limit : {2.0, 100.0})
    for (const SpringLaw& law : std::vector<SpringLaw>{{SpringLaw::Kind::cubic, 0.1, limit},
                                                       {SpringLaw::Kind::exponential, 8.0, limit},
                                                       {SpringLaw::Kind::exponential, -8.0, limit}}) {
      SpringNetwork network(one_spring(law));
      const double least = std::min(1.0, tangent(law, 1e9) < 1.0 ? 1.0 / limit : 1.0);
      for (const double e : {1e-9, 1e-4, 0.03, 0.08, 0.3, 0.9})
        for (const double sign : {1.0, -1.0}) {
          double knee = 0.0;  // the strain where the tangent reaches its limit, by bisection
          for (double low = 0.0, high = e, k = 0; k < 100; ++k) {
            knee = 0.5 * (low + high);
            (tangent(law, knee) > limit || tangent(law, knee) < least / 1.0 ? high : low) = knee;
          }
          std::vector<Vector3<>> x = {{0, 0, 0}, {0, 0, 0.01 * (1.0 + sign * e)}}, force(2);
          forces_at(network, x, force);
          const double slope = law.parameter < 0.0 ? 1.0 / limit : limit;
          const double expected = formula(law, knee) + slope * (e - knee);
          EXPECT_NEAR(-sign * force[1][2], 30.0 * 0.01 * expected, 1e-7 * 30.0 * 0.01 * expected) << limit << ' ' << e;
        }
    }
}

// At any deformation: no displacement stores more energy than the bound allows, so no tick of any length creates some.
TEST(SpringNetwork, EnergyOfNonlinearSpringsIsBelowTheBoundAtAnyDeformation) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const SpringLaw& law : laws) {
    Cube cube(2);
    cube.data.tetrahedra.clear();
    cube.data.law = law;
    SpringNetwork network(cube.data);
    const Eigen::MatrixXd bound = network.stiffness_bound();
    std::vector<Vector3<>> x(cube.data.rest_positions.size()), force(x.size()), ignored(x.size());
    for (int trial = 0; trial < 200; ++trial) {
      const double spread = std::pow(10.0, -4.0 + 3.0 * trial / 200.0), move = std::pow(10.0, -6.0 + 5.0 * (trial % 20) / 20.0);
      Eigen::MatrixX3d d(static_cast<Eigen::Index>(x.size()), 3);
      for (std::size_t v = 0; v < x.size(); ++v)
        x[v] = cube.data.rest_positions[v] + spread * Vector3<>(normal(random), normal(random), normal(random));
      const double before = forces_at(network, x, force);
      double work = 0.0;
      for (std::size_t v = 0; v < x.size(); ++v) {
        const Vector3<> step = move * Vector3<>(normal(random), normal(random), normal(random));
        d.row(static_cast<Eigen::Index>(v)) = step;
        x[v] += step;
        work += force[v].dot(step);
      }
      const double after = forces_at(network, x, ignored), allowed = 0.5 * (d.transpose() * bound * d).trace();
      EXPECT_LE(after, before - work + allowed + 1e-12 * before);
    }
  }
}

// Near rest no displacement stores more energy than the bound.
TEST(SpringNetwork, StiffnessIsBelowItsBound) {
  const Cube cube(2, false);
  SpringNetwork network(cube.data);
  const Eigen::MatrixXd bound = network.stiffness_bound();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<Vector3<>> x(cube.data.rest_positions.size()), force(x.size());
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::MatrixX3d u(static_cast<Eigen::Index>(x.size()), 3);
    for (double& s : u.reshaped()) s = 1e-7 * normal(random);
    for (std::size_t v = 0; v < x.size(); ++v) x[v] = cube.data.rest_positions[v] + u.row(static_cast<Eigen::Index>(v)).transpose();
    EXPECT_LT(forces_at(network, x, force), 0.5 * (u.transpose() * bound * u).trace());
  }
}

// A free body keeps its velocity: the dampers act between vertices only.
TEST(MassSpringModel, FreeBodyKeepsItsVelocity) {
  const Cube cube(1, false);
  auto mass_spring = cube.model(1e-3, 0.0, 5e-3);
  const Vector3<> speed(0.3, -0.2, 0.5);
  const std::vector<Vector3<>> speeds(cube.data.rest_positions.size(), speed);
  mass_spring.set_state(cube.data.rest_positions.data(), speeds.data());
  for (int k = 0; k < 1000; ++k) mass_spring.advance(nullptr, nullptr, 0);
  for (std::size_t v = 0; v < speeds.size(); ++v) EXPECT_LT((mass_spring.position(v) - cube.data.rest_positions[v] - speed).norm(), 1e-9);
}

// After an initial velocity the energy never increases, for any period, stiffness and velocity.
TEST(MassSpringModel, EnergyOfAFreeMotionNeverIncreases) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::size_t draw = 0;
  for (const double period : {1e-4, 1e-3, 2e-2})
    for (const double stiffness : {1.0, 1e4})
      for (const double kick : {0.1, 30.0}) {
        Cube cube(2, true, 5e-3, stiffness);
        cube.data.law = laws[draw++ % laws.size()];
        auto mass_spring = cube.model(period);
        std::vector<Vector3<>> speeds(cube.data.rest_positions.size());
        for (Vector3<>& s : speeds) s = kick * Vector3<>(normal(random), normal(random), normal(random));
        mass_spring.set_state(cube.data.rest_positions.data(), speeds.data());
        double had = mass_spring.energy();
        const double first = had;
        for (int k = 0; k < 500; ++k) {
          mass_spring.advance(nullptr, nullptr, 0);
          ASSERT_LE(mass_spring.energy(), had * (1.0 + 1e-12) + 1e-24 * first) << period << ' ' << stiffness << ' ' << kick << ' ' << k;
          had = mass_spring.energy();
        }
        EXPECT_LT(had, 0.9 * first);
      }
}

// Law: at rest the rounding of the energy neither shortens a step nor slows the body down.
TEST(MassSpringModel, ABodyAtRestTakesWholeSteps) {
  const Cube cube(4);
  auto model = cube.model(1e-3, 10.0, 2e-3);
  for (int k = 0; k < 100; ++k) model.advance(nullptr, nullptr, 0);
  EXPECT_EQ(model.limited_steps(), 0);
  EXPECT_LT(model.energy(), 1e-24);
}

// A mass on a spring of each law against its equation of motion, solved in small steps; the numerical damping is h r / 2.
TEST(MassSpringModel, MassOnANonlinearSpringMovesAsItsEquationOfMotion) {
  const palpate::deformable::SurfaceNodes nodes({{0, 0, 0.01}}, {{0, 0, 1}}, {1e-4});
  const palpate::deformable::PatchWeights patches{{0, 1}, {1}, {1.0}, {Eigen::Matrix3d::Identity()}};
  const double period = 1e-6, mass = 1e-3, k = 30.0, length = 0.01;
  for (const SpringLaw& law : laws) {
    palpate::deformable::MassSpringModel model(nodes, one_spring(law), patches, period, 0.0, 0.0);
    const std::vector<Vector3<>> start = {{0, 0, 0}, {0, 0, 0.01}}, speed = {{0, 0, 0}, {0, 0, 0.3}};
    model.set_state(start.data(), speed.data());
    SpringNetwork network(one_spring(law));
    double x = length, v = 0.3;
    std::vector<Vector3<>> at = start, force(2);
    const double damper = 0.5 * period * law.stiffness_bound() * k;
    for (int tick = 0; tick < 30000; ++tick) {
      model.advance(nullptr, nullptr, 0);
      at[1][2] = x;
      forces_at(network, at, force);
      v += period * (force[1][2] - damper * v) / mass;  // symplectic Euler: of second order for the mean of the speeds
      x += period * v;
    }
    EXPECT_NEAR(model.position(1)[2], x, 2e-3 * length);
  }
}

// A node that is pressed for long: the force is that of the law, whatever the period.
TEST(MassSpringModel, HeldForceGivesTheStretchOfTheLaw) {
  const palpate::deformable::SurfaceNodes nodes({{0, 0, 0.01}}, {{0, 0, 1}}, {1e-4});
  const palpate::deformable::PatchWeights patches{{0, 1}, {1}, {1.0}, {Eigen::Matrix3d::Identity()}};
  for (const SpringLaw& law : laws)
    for (const double period : {1e-4, 1e-3}) {
      palpate::deformable::MassSpringModel model(nodes, one_spring(law), patches, period, 50.0, 0.0);
      const double force = 0.1;
      const std::int32_t node = 0;
      for (int tick = 0; tick < static_cast<int>(3.0 / period); ++tick) model.advance(&node, &force, 1);
      SpringNetwork network(one_spring(law));
      std::vector<Vector3<>> forces(2);
      forces_at(network, {model.position(0), model.position(1)}, forces);
      EXPECT_NEAR(forces[1][2], force, 1e-9 * force);
    }
}

}  // namespace

}  // namespace mass_spring_tests
