// Modal model, elastic and viscoelastic: closed forms and passivity.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/creep_motion.hpp>
#include <palpate/deformable/linear/modal.hpp>
#include <palpate/deformable/linear/modal_motion.hpp>
#include <random>

#include "support/modal_bodies.hpp"
#include "support/rounds.hpp"

namespace {

// Under-, critically and overdamped: step response of a mass on a spring and damper, at any period.
TEST(Modal, StepResponseIsTheClosedForm) {
  const Oscillator o;
  for (const double ratio : {0.05, 1.0, 4.0}) {
    for (const double period : {1e-4, 1e-3, 2e-2}) {
      palpate::deformable::Modal modal = o.modal(period, 2.0 * ratio * o.frequency, 0.0);
      const std::int32_t node = 0;
      const double force = 0.5;
      for (int k = 1; k <= 100; ++k) {
        const double found = modal.free_displacement(0) + modal.compliance(0, 0) * force, t = k * period, w = o.frequency;
        double expected = 0.0;
        if (ratio < 1.0) {
          const double n = w * std::sqrt(1.0 - ratio * ratio);
          expected = 1.0 - std::exp(-ratio * w * t) * (std::cos(n * t) + ratio * w / n * std::sin(n * t));
        } else if (ratio == 1.0) {
          expected = 1.0 - std::exp(-w * t) * (1.0 + w * t);
        } else {
          const double n = std::sqrt(ratio * ratio - 1.0), a = w * (ratio - n), b = w * (ratio + n);
          expected = 1.0 - (b * std::exp(-a * t) - a * std::exp(-b * t)) / (b - a);
        }
        expected *= force / (o.mass * w * w);
        ASSERT_NEAR(found, expected, 2e-6 * force / (o.mass * w * w));
        modal.advance(&node, &force, 1);
      }
    }
  }
}

// The static correction acts immediately; the static limit is the full compliance.
TEST(Modal, StaticLimitIsTheFullCompliance) {
  const Oscillator o;
  const double extra = 3e-3, force = 0.2, period = 1e-3;
  palpate::deformable::Modal modal = o.modal(period, 40.0, 0.0, extra);
  const std::int32_t node = 0;
  EXPECT_NEAR(modal.compliance(0, 0), extra, 0.1 * extra);
  for (int k = 0; k < 2000; ++k) modal.advance(&node, &force, 1);
  EXPECT_NEAR(modal.free_displacement(0) + modal.compliance(0, 0) * force, (extra + 1.0 / (o.mass * o.frequency * o.frequency)) * force,
              1e-6);
}

// Random indentation: at every tick the work of the tip is at least the energy of the body.
TEST(Modal, EnergyDoesNotExceedTheWorkOfTheTip) {
  const Oscillator o;
  for (const auto& [extra, alpha] : {std::pair{0.0, 0.0}, std::pair{2e-3, 0.0}, std::pair{2e-3, 60.0}}) {
    palpate::deformable::Modal modal = o.modal(1e-3, alpha, 0.0, extra);
    palpate::deformable::TipContact<palpate::deformable::Modal> contact(o.nodes, modal);
    palpate::deformable::Tip tip;
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    double in = 0.0, before = 0.0, depth = 0.0;
    int pressed = 0;
    for (int k = 0; k < 20000; ++k) {
      depth = 0.98 * depth + 4e-4 * normal(random);
      tip.center = {0, 0, tip.radius - depth};
      const double rest = modal.free_displacement(0);
      const palpate::deformable::ContactResult& a = contact.step(tip);
      const double now = a.touching ? depth : rest, f = a.force.z();
      in += f * (now - before);
      before = now;
      pressed += a.touching ? 1 : 0;
      const double single = 1e-7 * static_cast<double>(o.full(extra)[0]) * f * f;  // single precision of the compliance
      ASSERT_NEAR(a.energy, modal.energy() + 0.5 * extra * f * f, single);
      ASSERT_LE(modal.energy() + 0.5 * extra * f * f, in + 1e-6 * (std::abs(in) + 1e-6)) << k;
    }
    EXPECT_GT(pressed, 300);
    EXPECT_LT(pressed, 19000);
  }
}

/// Return the matrix exponential by its series, with scaling and squaring.
Eigen::Matrix3d exponential(Eigen::Matrix3d a) {
  int squarings = 0;
  for (; a.cwiseAbs().maxCoeff() > 0.1; ++squarings) a *= 0.5;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity(), term = sum;
  for (int k = 1; k <= 12; ++k) {
    term = (term * a / k).eval();
    sum += term;
  }
  for (int k = 0; k < squarings; ++k) sum = (sum * sum).eval();
  return sum;
}

// Mass on a standard linear solid: step response from the matrix exponential of its equations of motion.
TEST(Modal, ViscoelasticStepResponseIsTheClosedForm) {
  const Oscillator o;
  const double instantaneous_ratio = 2.5, force = 0.5, w = o.frequency;
  for (const double retardation_time : {2e-3, 0.05, 2.0})
    for (const double alpha : {0.0, 30.0, 300.0})
      for (const double period : {1e-4, 1e-3, 2e-2}) {
        palpate::deformable::Modal modal = o.modal(period, alpha, 1e-5, 0.0, instantaneous_ratio, retardation_time);
        Eigen::Matrix3d a;
        a << 0.0, 1.0, 0.0, -w * w * instantaneous_ratio, -alpha - 1e-5 * w * w, w * w * (instantaneous_ratio - 1.0),
            instantaneous_ratio / retardation_time, 0.0, -instantaneous_ratio / retardation_time;
        const Eigen::Vector3d at_last = Eigen::Vector3d(1.0, 0.0, 1.0) * (force / (o.mass * w * w));
        const Eigen::Matrix3d over_period = exponential(a * period);
        Eigen::Vector3d distance = -at_last;
        const std::int32_t node = 0;
        for (int k = 1; k <= 100; ++k) {
          const double found = modal.free_displacement(0) + modal.compliance(0, 0) * force;
          distance = (over_period * distance).eval();
          ASSERT_NEAR(found, at_last[0] + distance[0], 3e-6 * at_last[0]) << retardation_time << " " << alpha << " " << period << " " << k;
          modal.advance(&node, &force, 1);
        }
      }
}

// Against 2,000 Runge-Kutta steps per period under a varying force, including the static correction.
TEST(Modal, ViscoelasticResponseMatchesNumericalIntegration) {
  const Oscillator o;
  const double instantaneous_ratio = 3.0, retardation_time = 0.02, period = 1e-3, extra = 2e-3, w = o.frequency, alpha = 20.0;
  palpate::deformable::Modal modal = o.modal(period, alpha, 0.0, extra, instantaneous_ratio, retardation_time);
  Eigen::Vector4d x = Eigen::Vector4d::Zero();  // displacement, velocity, dashpot, creep of the static correction
  double force = 0.0;
  const auto rate = [&](const Eigen::Vector4d& s) {
    return Eigen::Vector4d(s[1], force / o.mass - alpha * s[1] - w * w * (s[0] + (instantaneous_ratio - 1.0) * (s[0] - s[2])),
                           instantaneous_ratio / retardation_time * (s[0] - s[2]),
                           ((1.0 - 1.0 / instantaneous_ratio) * extra * force - s[3]) / retardation_time);
  };
  std::mt19937 random(14);
  std::normal_distribution<double> normal;
  const std::int32_t node = 0;
  for (int k = 0; k < 100; ++k) {
    force = 0.8 * force + 0.1 * std::abs(normal(random));
    const double found = modal.free_displacement(0) + modal.compliance(0, 0) * force;
    const double h = period / 2000.0;
    for (int s = 0; s < 2000; ++s) {
      const Eigen::Vector4d a = rate(x), b = rate(x + 0.5 * h * a), c = rate(x + 0.5 * h * b), d = rate(x + h * c);
      x += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
    ASSERT_NEAR(found, x[0] + x[3] + extra * force / instantaneous_ratio, 3e-8);
    modal.advance(&node, &force, 1);
  }
}

// Random closed paths: at no time is the work negative or less than the stored energy.
TEST(Modal, ViscoelasticBodyIsPassiveOverClosedPaths) {
  const Oscillator o;
  palpate::deformable::Modal modal = o.modal(1e-3, 0.0, 0.0, 1e-3, 3.0, 0.02);
  palpate::deformable::TipContact<palpate::deformable::Modal> contact(o.nodes, modal);
  palpate::deformable::Tip tip;
  std::mt19937 random(16);
  std::normal_distribution<double> normal;
  double lost = 0.0, most = 0.0;
  int pressed = 0;
  for (int path = 0; path < 1000 * rounds(); ++path) {
    contact.reset();
    const double a = 1e-3 * normal(random), b = 1e-3 * normal(random), c = 5e-4 * normal(random);
    double in = 0.0, before = 0.0;
    const int ticks = 100;
    for (int k = 1; k <= ticks; ++k) {
      const double s = 2.0 * M_PI * k / ticks, depth = a * (1.0 - std::cos(s)) + b * std::sin(s) + c * std::sin(3.0 * s);
      tip.center = {0, 0, tip.radius - depth};
      const double rest = modal.free_displacement(0);
      const palpate::deformable::ContactResult& answer = contact.step(tip);
      const double now = answer.touching ? depth : rest;
      in += answer.force.z() * (now - before);
      before = now;
      most = std::max(most, in);
      pressed += answer.touching ? 1 : 0;
      ASSERT_GE(answer.energy, modal.energy());
      ASSERT_GE(in, (1.0 - 1e-6) * answer.energy - 1e-6 * most) << path << " " << k;
    }
    lost += in;
  }
  EXPECT_GT(lost, 0.0);
  EXPECT_GT(pressed, 10000 * rounds());
  EXPECT_LT(pressed, 90000 * rounds());
}

// The bounds on free displacements do not change the contact.
TEST(Modal, BoundsDoNotChangeTheContact) {
  const int side = 13, modes = 90;
  const double width = 1e-3;
  std::vector<palpate::math::Vector3<>> points;
  for (int i = 0; i < side * side; ++i) points.emplace_back(width * (i % side - 6), width * (i / side - 6), 0.0);
  const std::size_t n = points.size();
  std::vector<float> full(9 * n * n, 0.0F), shapes(3 * n * modes);
  std::vector<double> frequencies;
  for (int k = 0; k < modes; ++k) frequencies.push_back(100.0 + 20.0 * k);
  for (std::size_t i = 0; i < n; ++i)
    for (int k = 0; k < modes; ++k)
      shapes[(3 * i + 2) * modes + static_cast<std::size_t>(k)] =
          static_cast<float>(std::cos(200.0 * (k % 10) * points[i].x()) * std::cos(200.0 * (k / 10) * points[i].y()));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      double c = 1e-5 / ((points[i] - points[j]).norm() + 0.3 * width);
      for (std::size_t k = 0; k < modes; ++k)
        c += static_cast<double>(shapes[(3 * i + 2) * modes + k] * shapes[(3 * j + 2) * modes + k]) / (frequencies[k] * frequencies[k]);
      full[(3 * i + 2) * 3 * n + 3 * j + 2] = static_cast<float>(c);
    }
  const palpate::deformable::SurfaceNodes nodes(points, std::vector<palpate::math::Vector3<>>(n, palpate::math::Vector3<>::UnitZ()),
                                                std::vector<double>(n, width * width));
  /// The same model without bounds.
  struct Asked {
    palpate::deformable::Modal modal;
    [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const { return modal.compliance(i, j); }
    [[nodiscard]] double free_displacement(std::int32_t i) { return modal.free_displacement(i); }
    void advance(const std::int32_t* which, const double* forces, int count) { modal.advance(which, forces, count); }
    void reset() { modal.reset(); }
  };
  palpate::deformable::Modal modal(nodes, full.data(), shapes.data(), frequencies, 1e-3, 20.0, 1e-5);
  Asked asked{modal};
  palpate::deformable::TipContact<palpate::deformable::Modal> quick(nodes, modal);
  palpate::deformable::TipContact<Asked> slow(nodes, asked);
  palpate::deformable::Tip tip;
  int skipped = 0, looked = 0, spared = 0;
  for (int k = 0; k < 3000; ++k) {
    tip.center = {3e-3 * std::sin(0.01 * k), 2e-3 * std::cos(0.017 * k), tip.radius - 1e-3 * std::sin(0.05 * k)};
    nodes.query_tip(tip, [&](std::int32_t node, double depth) {
      skipped += modal.free_displacement_at_least(node, depth) ? 1 : 0;
      ++looked;
      ASSERT_TRUE(!modal.free_displacement_at_least(node, depth) || modal.free_displacement(node) >= depth - 1e-9);
    });
    for (std::size_t g = 0; k % 10 == 0 && g < nodes.group_count(); ++g) {
      const double place = 1e-3 * std::sin(0.7 * static_cast<double>(g) + 0.03 * k);
      if (!modal.group_free_displacement_at_least(g, place)) continue;
      ++spared;
      palpate::deformable::Modal copy = modal;
      nodes.for_each_in_group(g, [&](std::int32_t node) { ASSERT_GE(copy.free_displacement(node), place); });
    }
    ASSERT_EQ(quick.step(tip).force, slow.step(tip).force);
  }
  EXPECT_GT(skipped, looked / 5);
  EXPECT_GT(spared, 1000);
}

// Undamped modes lose energy only through force steps on the massless correction: half of f.C f of each step. Modes, energy and work are
// computed independently in closed form.
TEST(Modal, UndampedLossIsThatOfForceSteps) {
  const Nine nine;
  const double period = 1e-3;
  palpate::deformable::Modal modal(nine.at, nine.full.data(), nine.waves.data(), nine.frequencies, period, 0.0, 0.0);
  Eigen::ArrayXd q = Eigen::ArrayXd::Zero(Nine::modes), v = q;
  const Eigen::ArrayXd w = Eigen::Map<const Eigen::ArrayXd>(nine.frequencies.data(), Nine::modes), cos = (w * period).cos(),
                       sin = (w * period).sin();
  Eigen::VectorXd place = Eigen::VectorXd::Zero(Nine::nodes), before = place;
  double work = 0.0, steps = 0.0, most = 0.0;
  int pressed = 0;
  dance(nine.at, modal, 3000, [&](const Eigen::VectorXd& f, const palpate::deformable::ContactResult& a) {
    const Eigen::ArrayXd rest = (nine.shapes.transpose() * f).array() / w.square(), from = q - rest;
    q = rest + from * cos + v / w * sin;
    v = (v * cos - from * w * sin).eval();
    const Eigen::VectorXd now = nine.shapes * q.matrix() + nine.left * f;
    work += f.dot(now - place);
    steps += 0.5 * (f - before).dot(nine.left * (f - before));
    most = std::max(most, a.energy);
    pressed += a.nodes;
    place = now;
    before = f;
    ASSERT_NEAR(a.energy, 0.5 * (v.square() + (w * q).square()).sum() + 0.5 * f.dot(nine.left * f), 1e-5 * most);
    ASSERT_NEAR(work - steps, a.energy, 2e-5 * most);
  });
  EXPECT_GT(pressed, 3000);
  EXPECT_GT(most, 1e-5);
}

// Elastic and viscoelastic: the static limit stores the energy of the full compliance.
TEST(Modal, StaticLimitStoresTheEnergyOfTheFullCompliance) {
  const Nine nine;
  for (const double instantaneous_ratio : {1.0, 3.0}) {
    palpate::deformable::Modal modal(nine.at, nine.full.data(), nine.waves.data(), nine.frequencies, 1e-3, 100.0, 1e-3, instantaneous_ratio,
                                     0.02);
    palpate::deformable::TipContact<palpate::deformable::Modal> contact(nine.at, modal);
    palpate::deformable::Tip tip;
    tip.center = {0.3e-3, 0.2e-3, tip.radius - 3e-3};
    for (int k = 0; k < 1000; ++k) contact.step(tip);
    const palpate::deformable::ContactResult& a = contact.last();
    Eigen::VectorXd force = Eigen::VectorXd::Zero(Nine::nodes);
    for (int c = 0; c < a.nodes; ++c) force[contact.contact_nodes()[c]] = contact.forces()[c];
    ASSERT_GT(a.nodes, 3);
    EXPECT_NEAR(a.energy, 0.5 * force.dot(nine.whole() * force), 1e-5 * a.energy);
  }
}

// Law: a mode that moves along any direction follows its equation of motion, and the energy is that of mass, springs and correction.
TEST(ModalMotion, FollowsTheEquationOfMotionOfItsMode) {
  const double w = 60.0, period = 1e-3, alpha = 5.0, beta = 1e-3, retardation_time = 0.02, extra = 2e-3;
  const palpate::deformable::SurfaceNodes nodes({{0, 0, 0}}, {{0, 0, 1}}, {1e-6});
  const std::vector<float> shape{4.0F, 0.0F, 5.0F};
  const palpate::math::Vector3<> phi(4.0, 0.0, 5.0);
  const Eigen::Matrix3d whole = extra * Eigen::Matrix3d::Identity() + phi * phi.transpose() / (w * w);
  std::vector<float> full;
  for (int i = 0; i < 9; ++i) full.push_back(static_cast<float>(whole(i / 3, i % 3)));
  const palpate::deformable::ModalData modes{shape.data(), {w}, alpha, beta};
  for (const double ratio : {1.0, 2.5}) {
    const auto compliance = palpate::deformable::ModalMotion::period_compliance(full.data(), 1, modes, period, ratio, retardation_time);
    palpate::deformable::ModalMotion motion(nodes, modes, period, ratio, retardation_time, 1.0);
    Eigen::Matrix3d rate, c;
    rate << 0.0, 1.0, 0.0, -w * w * ratio, -alpha - beta * w * w, w * w * (ratio - 1.0), ratio / retardation_time, 0.0,
        -ratio / retardation_time;
    for (int i = 0; i < 9; ++i) c(i / 3, i % 3) = static_cast<double>(compliance[static_cast<std::size_t>(i)]);
    const Eigen::Matrix3d over = exponential(rate * period);
    Eigen::Vector3d state = Eigen::Vector3d::Zero();  // displacement, velocity, dashpot
    double most = 0.0;
    const std::int32_t node = 0;
    for (int k = 0; k < 300; ++k) {
      const palpate::math::Vector3<> force(0.3 * std::sin(0.05 * k), 0.1, k < 150 ? 0.4 : 0.0);
      const Eigen::Vector3d limit = Eigen::Vector3d(1.0, 0.0, 1.0) * (phi.dot(force) / (w * w));
      state = (limit + over * (state - limit)).eval();
      const palpate::math::Vector3<> free = motion.free_displacement(0), moved = c * force;
      ASSERT_LT((free + moved - phi * state[0] - extra * force).norm(), 1e-7) << ratio << ' ' << k;
      const double found = motion.advance({&node, &force, 1, force.dot(moved), force.dot(free)});
      const double expected = 0.5 * (state[1] * state[1] + w * w * state[0] * state[0] + extra * force.squaredNorm() +
                                     (ratio - 1.0) * w * w * std::pow(state[0] - state[2], 2));
      most = std::max(most, expected);
      ASSERT_NEAR(found, expected, 1e-5 * most) << ratio << ' ' << k;
    }
  }
}

// Law: a standard linear solid without mass moves and stores energy as its springs: S (f / r + q) with the delayed forces q of all nodes.
TEST(CreepMotion, MovesAndStoresEnergyAsItsSprings) {
  constexpr int n = 3;
  const palpate::deformable::SurfaceNodes nodes({{0, 0, 0}, {1e-3, 0, 0}, {0, 1e-3, 0}}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}},
                                                {1e-6, 1e-6, 1e-6});
  std::mt19937 random(21);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(3 * n, 3 * n, [&] { return normal(random); });
  const Eigen::MatrixXd whole = 1e-3 * a.lazyProduct(a.transpose());
  const palpate::deformable::Creep creep = palpate::deformable::creep_law(3.0, 0.02, 1e-3);
  std::vector<float> full;
  for (int i = 0; i < 9 * n * n; ++i) full.push_back(static_cast<float>(creep.period_ratio * whole(i / (3 * n), i % (3 * n))));
  const palpate::deformable::FullCompliance compliance(nodes, full.data());
  Eigen::MatrixXd s(3 * n, 3 * n);
  for (int i = 0; i < 3 * n; ++i)
    for (int j = 0; j < 3 * n; ++j) s(i, j) = static_cast<double>(compliance.block(i / 3, j / 3)[3 * (i % 3) + j % 3]) / creep.period_ratio;
  palpate::deformable::CreepMotion motion(compliance, creep);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(3 * n);
  double most = 0.0;
  for (int k = 0; k < 200; ++k) {
    const std::array<std::int32_t, 2> pressed{k % n, (k + 1) % n};
    std::array<palpate::math::Vector3<>, 2> forces;
    Eigen::VectorXd f = Eigen::VectorXd::Zero(3 * n);
    for (std::size_t c = 0; c < 2; ++c) {
      for (int axis = 0; axis < 3; ++axis) forces[c][axis] = normal(random);
      f.segment(3 * pressed[c], 3) = forces[c];
    }
    const Eigen::VectorXd free = creep.decay * (s * q), moved = creep.period_ratio * (s * f);
    for (int i = 0; i < n; ++i) ASSERT_LT((motion.free_displacement(i) - free.segment(3 * i, 3)).norm(), 1e-12) << k;
    const double found = motion.advance({pressed.data(), forces.data(), 2, f.dot(moved), f.dot(free)});
    q = (creep.decay * q + creep.gain * f).eval();
    const double expected = f.dot(s * f) / 6.0 + 0.75 * q.dot(s * q);  // 1 / r = 1 / 3, 1 - 1 / r = 2 / 3
    most = std::max(most, expected);
    ASSERT_NEAR(found, expected, 1e-9 * most) << k;
    for (int i = 0; i < n; ++i)
      ASSERT_LT((motion.next_free(i, free.segment<3>(3 * i), moved.segment<3>(3 * i)) - motion.free_displacement(i)).norm(), 1e-12) << k;
  }
}

// Law: a delayed force counts until it is 1e-6 of the largest.
TEST(CreepMotion, KeepsTheDelayedForcesOfWeaklyPressedNodes) {
  const palpate::deformable::SurfaceNodes nodes({{0, 0, 0}, {1e-3, 0, 0}}, {{0, 0, 1}, {0, 0, 1}}, {1e-6, 1e-6});
  std::vector<float> full(36, 0.0F);
  for (std::size_t i = 0; i < 6; ++i) full[7 * i] = 1.0F;
  palpate::deformable::CreepMotion motion(palpate::deformable::FullCompliance(nodes, full.data()),
                                          palpate::deformable::creep_law(3.0, 0.02, 1e-3));
  const std::array<std::int32_t, 2> pressed{0, 1};
  const std::array<palpate::math::Vector3<>, 2> forces{palpate::math::Vector3<>(0, 0, -1.0), palpate::math::Vector3<>(0, 0, -1e-5)};
  motion.advance({pressed.data(), forces.data(), 2, 0.0, 0.0});
  EXPECT_LT(motion.free_displacement(0).z(), 0.0);
  EXPECT_NEAR(motion.free_displacement(1).z(), 1e-5 * motion.free_displacement(0).z(), 1e-15);
}

}  // namespace
