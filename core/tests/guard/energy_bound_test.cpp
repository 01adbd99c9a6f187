#include <gtest/gtest.h>

#include <cmath>
#include <palpate/guard/energy_bound.hpp>
#include <palpate/mechanism/premium.hpp>
#include <palpate/mechanism/slider.hpp>
#include <random>
#include <vector>

#include "support/rounds.hpp"

namespace {

using palpate::guard::EnergyBound;
using palpate::guard::LeastSquareTravel;
using palpate::guard::LeastTravel;
using palpate::math::Joints;
using palpate::mechanism::Premium;
using palpate::mechanism::Slider;

EnergyBound<Slider> slider_bound(double damping, double coulomb, double count = 0.0, int delay = 0) {
  EnergyBound<Slider> out({.damping = Joints<1>(damping), .coulomb = Joints<1>(coulomb)});
  out.prepare({Slider(0.045), Joints<1>(count), 1e-3, delay});
  return out;
}

// Golden: b 0.35 N s/m, T 1 ms, E 10 uJ, no dry friction: sqrt(4 b E/T) = 0.118322 N.
TEST(EnergyBound, AdmitsTheForceOfTheClosedForm) {
  EnergyBound<Slider> bound = slider_bound(0.35, 0.0);
  EXPECT_EQ(bound.share(Joints<1>(0.0), Joints<1>(1.0)), 0.0);
  const double way = std::sqrt(1e-5 * 1e-3 / 0.35);  // b/T way^2 = 10 uJ
  EXPECT_NEAR(bound.share(Joints<1>(way), Joints<1>(1.0)), 0.118322, 5e-7);
  EXPECT_NEAR(bound.energy(), 1e-5, 1e-20);
}

TEST(EnergyBound, AdmitsTheDryFrictionBesides) {
  EnergyBound<Slider> bound = slider_bound(0.35, 0.04);
  EXPECT_DOUBLE_EQ(bound.share(Joints<1>(0.0), Joints<1>(-0.5)), 0.08);
  bound.commit(Joints<1>(0.0));
  const double way = 1e-4, energy = 350.0 * way * way + 0.04 * way;
  EXPECT_NEAR(bound.share(Joints<1>(way), Joints<1>(-1.0)), 0.04 + std::sqrt(1400.0 * energy), 1e-12);
}

struct Wild {
  std::mt19937_64 bits{7};
  std::normal_distribution<double> normal;
  double size(double smallest, double largest) {
    return std::exp(std::uniform_real_distribution<double>(std::log(smallest), std::log(largest))(bits));
  }
};

/// Drive a bound by random motions and torques. Return the least energy that display and friction have absorbed, over its scale.
template <class Mechanism>
double least_energy(int steps, double count, int delay, bool loses_samples = false) {
  constexpr int dof = Mechanism::dof;
  Wild wild;
  Joints<dof> damping, coulomb, step = Joints<dof>::Constant(count);
  for (int i = 0; i < dof; ++i) {
    damping[i] = wild.size(0.01, 1.0);
    coulomb[i] = i == 1 ? 0.0 : wild.size(1e-3, 0.1);
  }
  EnergyBound<Mechanism> bound({damping, coulomb, 0.0});
  bound.prepare({Mechanism(), step, 1e-3, delay});
  std::vector<Joints<dof>> line(static_cast<std::size_t>(delay), Joints<dof>::Zero());
  Joints<dof> q = Joints<dof>::Zero(), held = Joints<dof>::Zero();
  double energy = 0.0, least = 0.0, turnover = 1e-12, drift = 0.0;
  const double largest = wild.size(1e-5, 1e-3);
  for (int k = 0; k < steps; ++k) {
    for (int i = 0; i < dof; ++i) {
      // the motion that takes out the most, a free one, or a slow one within a count
      const double excess = std::max(0.0, std::abs(held[i]) - coulomb[i]);
      const double worst = std::copysign(excess * 1e-3 / (2.0 * damping[i]), held[i]);
      const int kind = std::uniform_int_distribution<int>(0, 3)(wild.bits);
      const double way = kind == 0 ? worst : kind == 1 ? largest * wild.normal(wild.bits) : kind == 2 ? 0.02 * largest : drift;
      const double moved = k == 0 ? 0.37 * largest : way;
      if (k > 0) {
        energy += -held[i] * moved + damping[i] / 1e-3 * moved * moved + coulomb[i] * std::abs(moved);
        turnover += std::abs(held[i] * moved);
      }
      q[i] += moved;
    }
    if (k % 50 == 0) drift = 0.1 * largest * wild.normal(wild.bits);
    least = std::min(least, energy);
    Joints<dof> measured = q, torque;
    for (int i = 0; i < dof; ++i) {
      if (count > 0.0) measured[i] = std::nearbyint(q[i] / count) * count;
      torque[i] = k % 7 == 0 ? 0.0 : wild.size(1e-3, 10.0) * (wild.normal(wild.bits) > 0.0 ? 1.0 : -1.0);
    }
    if (loses_samples && k % 13 == 5) {
      bound.lose_sample();
      torque = 0.5 * held;  // the servo fades the last torque
    } else {
      torque *= bound.share(measured, torque);
    }
    bound.commit(torque);
    line.push_back(torque);
    held = line.front();
    line.erase(line.begin());
  }
  EXPECT_GT(turnover, 1e-6);  // something was rendered
  return least / turnover;
}

// Law: sum h_k dq_{k+1} >= -sum (b/T dq^2 + f_c |dq|) for any motion, of each joint or of all, with counts and with delays.
TEST(EnergyBound, NoMotionTakesOutMoreThanTheFrictionDissipates) {
  const int motions = 7'000 * rounds();
  EXPECT_GE(least_energy<Slider>(motions, 0.0, 0), -1e-12);
  EXPECT_GE(least_energy<Premium>(motions, 0.0, 0), -1e-12);
  EXPECT_GE(least_energy<Premium>(motions, 0.0, 3), -1e-12);
  EXPECT_GE(least_energy<Slider>(motions, 25e-6, 0), -1e-12);
  EXPECT_GE(least_energy<Premium>(motions, 1e-4, 2), -1e-12);
}

// Law: without the bound the same motions take out more, so the test above can fail.
TEST(EnergyBound, IsNeeded) {
  EnergyBound<Slider> bound = slider_bound(0.35, 0.0);
  Joints<1> q(0.0);
  double energy = 0.0;
  for (int k = 0; k < 100; ++k) {
    const Joints<1> torque(k % 2 == 0 ? 1.0 : -1.0);
    const double way = torque[0] * 1e-3 / 0.7;
    energy += -torque[0] * way + 350.0 * way * way;
    q[0] += way;
  }
  EXPECT_LT(energy, -0.05);
  EXPECT_DOUBLE_EQ(bound.loss(Joints<1>(1.0)), 1e-3 / 1.4);
}

// Law: the bound is exact: the motion that takes out the most leaves no energy.
TEST(EnergyBound, TheWorstMotionLeavesNothing) {
  EnergyBound<Premium> bound({Joints<3>(0.05, 0.001, 0.01), Joints<3>(0.01, 0.0, 0.002), 0.0});
  bound.prepare({Premium(), Joints<3>::Zero(), 1e-3, 0});
  bound.share(Joints<3>::Zero(), Joints<3>::Zero());
  bound.commit(Joints<3>::Zero());
  Joints<3> q(2e-3, -1e-3, 3e-3), torque(0.3, 0.1, -0.2);
  const double share = bound.share(q, torque);
  ASSERT_GT(share, 0.0);
  ASSERT_LT(share, 1.0);
  torque *= share;
  bound.commit(torque);
  const Joints<3> b(0.05, 0.001, 0.01), f(0.01, 0.0, 0.002);
  for (int i = 0; i < 3; ++i) q[i] += std::copysign(std::max(0.0, std::abs(torque[i]) - f[i]) * 1e-3 / (2.0 * b[i]), torque[i]);
  bound.share(q, torque);
  EXPECT_NEAR(bound.energy(), 0.0, 1e-17);
}

// Law: an unknown motion takes out the most that it can; the energy known to the guard is never above the true one.
TEST(EnergyBound, AnInvalidSampleCostsTheMostThatItCanTakeOut) {
  EnergyBound<Slider> bound = slider_bound(0.35, 0.0);
  bound.share(Joints<1>(0.0), Joints<1>(0.0));
  bound.commit(Joints<1>(0.0));
  const double share = bound.share(Joints<1>(1e-3), Joints<1>(1.0));
  bound.commit(Joints<1>(0.5 * share));
  const double before = bound.energy(), loss = bound.loss(Joints<1>(0.5 * share));
  bound.lose_sample();
  bound.commit(Joints<1>(0.0));
  bound.share(Joints<1>(-5.0), Joints<1>(0.0));  // wherever it is now
  EXPECT_NEAR(bound.energy(), before - loss, 1e-18);
}

// Law: the shortest path through counts is never longer than the true one, and equals it without counts.
TEST(LeastTravel, IsNeverLongerThanThePath) {
  Wild wild;
  for (const double count : {0.0, 25e-6, 3e-4}) {
    LeastTravel travel(0.5 * count);
    double q = 1e-5, least = 0.0, length = 0.0;
    for (int k = 0; k < 20'000; ++k) {
      const double way = k == 0 ? 0.0 : wild.size(1e-7, 1e-4) * (std::sin(0.003 * k) + 0.3 * wild.normal(wild.bits));
      q += way;
      length += std::abs(way);
      least += travel.move(count > 0.0 ? std::nearbyint(q / count) * count : q);
      ASSERT_LE(least, length * (1.0 + 1e-12) + 1e-12);
    }
    EXPECT_GE(least, (count == 0.0 ? 1.0 - 1e-9 : count == 25e-6 ? 0.2 : 0.0) * length);
  }
}

// Law: the least sum of squares through counts is never above the true one, and equals it without counts.
TEST(LeastSquareTravel, IsNeverAboveTheSumOfSquares) {
  Wild wild;
  for (const double count : {0.0, 25e-6, 3e-4}) {
    LeastSquareTravel least(0.5 * count);
    double q = 1e-5, bound = 0.0, sum = 0.0;
    for (int k = 0; k < 20'000; ++k) {
      const double way = k == 0 ? 0.0 : 1e-5 * (10.0 * std::sin(0.003 * k) + wild.normal(wild.bits));
      q += way;
      sum += way * way;
      bound += least.move(count > 0.0 ? std::nearbyint(q / count) * count : q);
      ASSERT_LE(bound, sum * (1.0 + 1e-12) + 1e-20);
    }
    EXPECT_GE(bound, (count == 0.0 ? 1.0 - 1e-9 : count == 25e-6 ? 0.8 : 0.1) * sum);
  }
}

}  // namespace
