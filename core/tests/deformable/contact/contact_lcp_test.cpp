// Contact LCP: enumeration of all bases, complementarity conditions, warm start.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
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

/// A problem whose rows are edited beside those of a solver.
struct Edited {
  Eigen::MatrixXd c;
  Eigen::VectorXd g;

  void expect_solved_by(ContactLcp& solver) const {
    ASSERT_TRUE(solver.solve());
    const Eigen::VectorXd f = Eigen::VectorXd::NullaryExpr(g.size(), [&](auto a) { return solver.force(static_cast<int>(a)); });
    const Eigen::VectorXd gap = c * f - g;
    const double size = 1e-7 * (1.0 + f.norm() * g.norm());
    ASSERT_GE(f.minCoeff(), 0.0);
    ASSERT_GE(gap.minCoeff(), -size);
    ASSERT_LE(f.cwiseProduct(gap).cwiseAbs().maxCoeff(), size);
  }
};

// Law: rows that are inserted, removed or stiffened between solves leave the solution of the edited problem.
TEST(ContactLcp, EditedRowsGiveTheSolutionOfTheEditedProblem) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const int most = 24;
  const Eigen::MatrixXd whole = random_compliance(most, random);
  std::vector<int> rows = {0, 1, 2, 3, 4, 5};  // of the whole compliance
  std::vector<double> extra(most, 0.0), depth(most);
  for (double& g : depth) g = normal(random);
  const auto problem = [&] {
    const auto n = static_cast<Eigen::Index>(rows.size());
    const auto row = [&](Eigen::Index k) { return static_cast<std::size_t>(rows[static_cast<std::size_t>(k)]); };
    Edited out{Eigen::MatrixXd(n, n), Eigen::VectorXd(n)};
    for (Eigen::Index i = 0; i < n; ++i) {
      out.g[i] = depth[row(i)];
      for (Eigen::Index j = 0; j < n; ++j)
        out.c(i, j) = whole(static_cast<Eigen::Index>(row(i)), static_cast<Eigen::Index>(row(j))) + (i == j ? extra[row(i)] : 0.0);
    }
    return out;
  };
  ContactLcp solver;
  load_lcp(solver, problem().c, problem().g);
  solver.reset(6, [](int) { return true; });
  for (int step = 0; step < 600; ++step) {
    const int size = static_cast<int>(rows.size()), at = static_cast<int>(random() % static_cast<unsigned>(size));
    const unsigned kind = random() % 3;
    if (kind == 0 && size > 2) {
      solver.remove(at);
      rows.erase(rows.begin() + at);
    } else if (kind == 1 && size < most) {
      int fresh = 0;
      while (std::find(rows.begin(), rows.end(), fresh) != rows.end()) ++fresh;
      solver.insert(at);
      rows.insert(rows.begin() + at, fresh);
      const Edited now = problem();
      for (int b = 0; b <= size; ++b) solver.compliance(at, b) = solver.compliance(b, at) = now.c(at, b);
      solver.depth(at) = now.g[at];
    } else {
      const auto row = static_cast<std::size_t>(rows[static_cast<std::size_t>(at)]);
      extra[row] = 0.3 * std::abs(normal(random));
      solver.set_diagonal(at, whole(rows[static_cast<std::size_t>(at)], rows[static_cast<std::size_t>(at)]) + extra[row]);
    }
    for (double& g : depth) g += 0.3 * normal(random);
    const Edited now = problem();
    for (int a = 0; a < static_cast<int>(rows.size()); ++a) solver.depth(a) = now.g[a];
    now.expect_solved_by(solver);
    if (HasFatalFailure()) FAIL() << "step " << step;
  }
}

// Law: of two rows with the same compliance and depth one carries the force; if that one is removed the other does.
TEST(ContactLcp, TheTwinOfARemovedRowTakesItsForce) {
  std::mt19937 random(8);
  Eigen::MatrixXd c = random_compliance(4, random);
  c.row(3) = c.row(1);
  c.col(3) = c.col(1);
  c(3, 3) = c(1, 1);
  const Eigen::VectorXd g = c * Eigen::Vector4d(0.5, 1.0, 0.7, 0.0);
  for (const int gone : {1, 3}) {
    ContactLcp solver;
    load_lcp(solver, c, g);
    solver.reset(4, [](int) { return true; });
    ASSERT_TRUE(solver.solve());
    EXPECT_NEAR(solver.force(1) + solver.force(3), 1.0, 1e-9);
    EXPECT_NEAR(solver.force(0), 0.5, 1e-9);
    solver.remove(gone);
    for (int a = 0, from = 0; from < 4; ++from)
      if (from != gone) solver.depth(a++) = g[from];
    ASSERT_TRUE(solver.solve());
    EXPECT_NEAR(solver.force(gone == 1 ? 2 : 1), 1.0, 1e-9) << gone;
    EXPECT_NEAR(solver.force(0), 0.5, 1e-9);
  }
}

// Law: penetrations of a thousandth of the largest depth and below are removed too.
TEST(ContactLcp, RemovesSmallPenetrations) {
  Eigen::Matrix2d c;
  c << 1.0, 0.5, 0.5, 1.0;
  for (const double small : {1e-2, 1e-4, 1e-6}) {
    ContactLcp solver;
    load_lcp(solver, c, Eigen::Vector2d(1.0, 0.5 + small));
    solver.reset(2, [](int a) { return a == 0; });
    ASSERT_TRUE(solver.solve());
    EXPECT_NEAR(solver.force(1), small / 0.75, 1e-12) << small;
  }
}

}  // namespace
