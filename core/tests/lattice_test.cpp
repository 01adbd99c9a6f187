// Masses and springs: against closed forms and dense algebra, and never giving out energy.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <random>

#include "lattice_cube.hpp"

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
  Eigen::MatrixX3d sides(size, 3);
  for (double& s : sides.reshaped()) s = normal(random);
  std::vector<palpate::math::Vector3<>> x;
  x.reserve(size);
  for (int i = 0; i < size; ++i) x.emplace_back(sides.row(i));
  factor.solve(x.data());
  const Eigen::MatrixX3d expected = Eigen::MatrixXd(matrix).llt().solve(sides);
  for (int i = 0; i < size; ++i) EXPECT_LT((x[static_cast<std::size_t>(i)] - expected.row(i).transpose()).norm(), 1e-12);
  matrix.coeffRef(3, 3) = -1.0;
  EXPECT_FALSE(palpate::math::SupernodalCholesky(matrix).positive_definite());
}

// Forces are the slope of the stored energy at any deformation: central differences along random directions.
TEST(SpringNetwork, ForceIsTheSlopeOfItsEnergy) {
  const Cube cube(2);
  palpate::deformable::SpringNetwork network(cube.parts);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0.0, 1e-3);
  std::vector<palpate::math::Vector3<>> x = cube.parts.places, along(x.size()), force(x.size()), other(x.size());
  for (palpate::math::Vector3<>& p : x) p += palpate::math::Vector3<>(normal(random), normal(random), normal(random));
  for (palpate::math::Vector3<>& a : along) a = {normal(random), normal(random), normal(random)};
  const auto energy = [&](double s) {
    std::vector<palpate::math::Vector3<>> there = x;
    for (std::size_t v = 0; v < x.size(); ++v) there[v] += s * along[v];
    return network.pull(there.data(), other.data());
  };
  network.pull(x.data(), force.data());
  double expected = 0.0;
  for (std::size_t v = 0; v < x.size(); ++v) expected -= force[v].dot(along[v]);
  EXPECT_NEAR((energy(1e-4) - energy(-1e-4)) / 2e-4, expected, 1e-7 * std::abs(expected));
}

// The bound is above the springs' stiffness at any deformation, and above the whole near rest: no direction stores more.
TEST(SpringNetwork, IsNowhereStifferThanItsBound) {
  const Cube cube(2, false);
  palpate::deformable::SpringNetwork network(cube.parts);
  const Eigen::MatrixXd bound = network.bound();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<palpate::math::Vector3<>> x(cube.parts.places.size()), force(x.size());
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::MatrixX3d u(static_cast<Eigen::Index>(x.size()), 3);
    for (double& s : u.reshaped()) s = 1e-7 * normal(random);
    for (std::size_t v = 0; v < x.size(); ++v) x[v] = cube.parts.places[v] + u.row(static_cast<Eigen::Index>(v)).transpose();
    EXPECT_LT(network.pull(x.data(), force.data()), 0.5 * (u.transpose() * bound * u).trace());
  }
}

// With no part held, nothing stops it: dampers act between vertices only.
TEST(MassSpringModel, FliesOnStraight) {
  const Cube cube(1, false);
  auto lattice = cube.lattice(1e-3, 0.0, 5e-3);
  const palpate::math::Vector3<> speed(0.3, -0.2, 0.5);
  const std::vector<palpate::math::Vector3<>> speeds(cube.parts.places.size(), speed);
  lattice.set(cube.parts.places.data(), speeds.data());
  for (int k = 0; k < 1000; ++k) lattice.advance(nullptr, nullptr, 0);
  for (std::size_t v = 0; v < speeds.size(); ++v) EXPECT_LT((lattice.places()[v] - cube.parts.places[v] - speed).norm(), 1e-9);
}

// Left alone after a kick it comes to rest, and at no tick has it more energy; whatever the period, the stiffness and the kick.
TEST(MassSpringModel, OnlyLosesEnergyWhenLeftAlone) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (const double period : {1e-4, 1e-3, 2e-2})
    for (const double stiffness : {1.0, 1e4})
      for (const double kick : {0.1, 30.0}) {
        const Cube cube(2, true, 5e-3, stiffness);
        auto lattice = cube.lattice(period);
        std::vector<palpate::math::Vector3<>> speeds(cube.parts.places.size());
        for (palpate::math::Vector3<>& s : speeds) s = kick * palpate::math::Vector3<>(normal(random), normal(random), normal(random));
        lattice.set(cube.parts.places.data(), speeds.data());
        double had = lattice.energy();
        const double first = had;
        for (int k = 0; k < 500; ++k) {
          lattice.advance(nullptr, nullptr, 0);
          ASSERT_LE(lattice.energy(), had * (1.0 + 1e-12)) << period << ' ' << stiffness << ' ' << kick << ' ' << k;
          had = lattice.energy();
        }
        EXPECT_LT(had, 0.9 * first);
      }
}

}  // namespace
