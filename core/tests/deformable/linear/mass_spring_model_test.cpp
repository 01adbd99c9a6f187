// Mass-spring model: closed forms, dense algebra, passivity.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <random>

#include "support/linear_solve.hpp"
#include "support/mass_spring_cube.hpp"

namespace {

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
  std::vector<palpate::math::Vector3<>> x;
  x.reserve(size);
  for (int i = 0; i < size; ++i) x.emplace_back(sides.row(i));
  factor.solve(x.data());
  const Eigen::MatrixXd expected = linear_solve(Eigen::MatrixXd(matrix), sides);
  for (int i = 0; i < size; ++i) EXPECT_LT((x[static_cast<std::size_t>(i)] - expected.row(i).transpose()).norm(), 1e-12);
  matrix.coeffRef(3, 3) = -1.0;
  EXPECT_FALSE(palpate::math::SupernodalCholesky(matrix).positive_definite());
}

// Central differences of the energy along random directions, at large deformation.
TEST(SpringNetwork, ForceIsTheGradientOfItsEnergy) {
  const Cube cube(2);
  palpate::deformable::SpringNetwork network(cube.data);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0.0, 1e-3);
  std::vector<palpate::math::Vector3<>> x = cube.data.rest_positions, along(x.size()), force(x.size()), other(x.size());
  for (palpate::math::Vector3<>& p : x) p += palpate::math::Vector3<>(normal(random), normal(random), normal(random));
  for (palpate::math::Vector3<>& a : along) a = {normal(random), normal(random), normal(random)};
  const auto energy = [&](double s) {
    std::vector<palpate::math::Vector3<>> there = x;
    for (std::size_t v = 0; v < x.size(); ++v) there[v] += s * along[v];
    return network.accumulate_forces(there.data(), other.data());
  };
  network.accumulate_forces(x.data(), force.data());
  double expected = 0.0;
  for (std::size_t v = 0; v < x.size(); ++v) expected -= force[v].dot(along[v]);
  EXPECT_NEAR((energy(1e-4) - energy(-1e-4)) / 2e-4, expected, 1e-7 * std::abs(expected));
}

// Near rest no displacement stores more energy than the bound.
TEST(SpringNetwork, StiffnessIsBelowItsBound) {
  const Cube cube(2, false);
  palpate::deformable::SpringNetwork network(cube.data);
  const Eigen::MatrixXd bound = network.stiffness_bound();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<palpate::math::Vector3<>> x(cube.data.rest_positions.size()), force(x.size());
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::MatrixX3d u(static_cast<Eigen::Index>(x.size()), 3);
    for (double& s : u.reshaped()) s = 1e-7 * normal(random);
    for (std::size_t v = 0; v < x.size(); ++v) x[v] = cube.data.rest_positions[v] + u.row(static_cast<Eigen::Index>(v)).transpose();
    EXPECT_LT(network.accumulate_forces(x.data(), force.data()), 0.5 * (u.transpose() * bound * u).trace());
  }
}

// A free body keeps its velocity: the dampers act between vertices only.
TEST(MassSpringModel, FreeBodyKeepsItsVelocity) {
  const Cube cube(1, false);
  auto mass_spring = cube.model(1e-3, 0.0, 5e-3);
  const palpate::math::Vector3<> speed(0.3, -0.2, 0.5);
  const std::vector<palpate::math::Vector3<>> speeds(cube.data.rest_positions.size(), speed);
  mass_spring.set_state(cube.data.rest_positions.data(), speeds.data());
  for (int k = 0; k < 1000; ++k) mass_spring.advance(nullptr, nullptr, 0);
  for (std::size_t v = 0; v < speeds.size(); ++v)
    EXPECT_LT((mass_spring.positions()[v] - cube.data.rest_positions[v] - speed).norm(), 1e-9);
}

// After an initial velocity the energy never increases, for any period, stiffness and velocity.
TEST(MassSpringModel, EnergyOfAFreeMotionNeverIncreases) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (const double period : {1e-4, 1e-3, 2e-2})
    for (const double stiffness : {1.0, 1e4})
      for (const double kick : {0.1, 30.0}) {
        const Cube cube(2, true, 5e-3, stiffness);
        auto mass_spring = cube.model(period);
        std::vector<palpate::math::Vector3<>> speeds(cube.data.rest_positions.size());
        for (palpate::math::Vector3<>& s : speeds) s = kick * palpate::math::Vector3<>(normal(random), normal(random), normal(random));
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

}  // namespace
