// Contact LCP: enumeration of all bases, complementarity conditions, warm start.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <palpate/deformable/contact/contact_lcp.hpp>
#include <random>
#include <vector>

#include "support/linear_solve.hpp"

namespace {

using palpate::deformable::ContactLcp;

Eigen::MatrixXd random_compliance(int n, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(n, n, [&] { return normal(random); });
  Eigen::MatrixXd c = a.lazyProduct(a.transpose());
  c.diagonal().array() += 0.05;
  return c;
}

void load_lcp(ContactLcp& solver, const Eigen::MatrixXd& c, const Eigen::VectorXd& g) {
  for (int i = 0; i < g.size(); ++i) {
    solver.depth(i) = g[i];
    for (int j = 0; j < g.size(); ++j) solver.compliance(i, j) = c(i, j);
  }
}

// Exactly one of the 2^n bases is feasible, and it is the one found.
TEST(ContactLcp, MatchesEnumerationOfAllBases) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 200; ++trial) {
    const int n = 6;
    const Eigen::MatrixXd c = random_compliance(n, random);
    const Eigen::VectorXd g = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    ContactLcp solver;
    load_lcp(solver, c, g);
    solver.reset(n, [&](int a) { return ((trial >> a) & 1) != 0; });  // arbitrary initial basis
    ASSERT_TRUE(solver.solve());
    int right = 0;
    for (int set = 0; set < (1 << n); ++set) {
      std::vector<int> in;
      for (int a = 0; a < n; ++a)
        if ((set >> a) & 1) in.push_back(a);
      Eigen::VectorXd f = Eigen::VectorXd::Zero(n);
      if (!in.empty()) {
        const auto size = static_cast<Eigen::Index>(in.size());
        const auto row = [&](Eigen::Index k) { return in[static_cast<std::size_t>(k)]; };
        const Eigen::MatrixXd part = Eigen::MatrixXd::NullaryExpr(size, size, [&](auto i, auto j) { return c(row(i), row(j)); });
        const Eigen::MatrixXd some = linear_solve(part, Eigen::MatrixXd::NullaryExpr(size, 1, [&](auto i, auto) { return g[row(i)]; }));
        for (Eigen::Index k = 0; k < size; ++k) f[row(k)] = some(k, 0);
      }
      if (f.minCoeff() < 0.0 || (c * f - g).minCoeff() < -1e-12) continue;
      ++right;
      for (int a = 0; a < n; ++a) EXPECT_NEAR(solver.force(a), f[a], 1e-9 * (1.0 + f.norm()));
    }
    EXPECT_EQ(right, 1);
  }
}

// Complementarity conditions for full-size problems with changing depths and a factor kept between solves.
TEST(ContactLcp, SatisfiesComplementarityWhileDepthsChange) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (const int n : {1, 30, ContactLcp::capacity}) {
    const Eigen::MatrixXd c = random_compliance(n, random);
    Eigen::VectorXd g = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    ContactLcp solver;
    load_lcp(solver, c, g);
    solver.reset(n, [](int) { return false; });
    for (int step = 0; step < 50; ++step) {
      ASSERT_TRUE(solver.solve());
      Eigen::VectorXd f(n);
      for (int a = 0; a < n; ++a) f[a] = solver.force(a);
      const Eigen::VectorXd gap = c * f - g;
      EXPECT_GE(f.minCoeff(), 0.0);
      EXPECT_GE(gap.minCoeff(), -1e-7 * g.norm());
      EXPECT_LE(f.cwiseProduct(gap).cwiseAbs().maxCoeff(), 1e-7 * (1.0 + f.norm() * g.norm()));
      for (int a = 0; a < n; ++a) {
        g[a] += 0.2 * normal(random);
        solver.depth(a) = g[a];
      }
    }
  }
}

// One row that enters or leaves the basis takes one exchange: the second basis is feasible.
TEST(ContactLcp, NeedsTwoIterationsForOneExchange) {
  std::mt19937 random(5);
  const int n = 30;
  const Eigen::MatrixXd c = Eigen::MatrixXd::Identity(n, n) + 1e-3 * random_compliance(n, random);
  ContactLcp solver;
  load_lcp(solver, c, Eigen::VectorXd::Ones(n));
  solver.reset(n, [](int) { return true; });
  ASSERT_TRUE(solver.solve());
  EXPECT_EQ(solver.iterations(), 1);
  for (const double depth : {-1.0, 1.0}) {
    solver.depth(7) = depth;
    ASSERT_TRUE(solver.solve());
    EXPECT_EQ(solver.iterations(), 2);
    EXPECT_EQ(solver.force(7) > 0.0, depth > 0.0);
  }
}

}  // namespace
