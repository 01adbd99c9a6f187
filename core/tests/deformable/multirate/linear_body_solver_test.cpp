// Linear bodies at two rates: against the same bodies at one rate, and the energy balance of the tips.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <palpate/deformable/linear/compliance.hpp>
#include <palpate/deformable/linear/viscoelastic_solid.hpp>
#include <palpate/deformable/multirate/linear_body_solver.hpp>
#include <palpate/deformable/multirate/linear_local_slip.hpp>
#include <palpate/object/multirate_object.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/mass_spring_cube.hpp"
#include "support/modal_bodies.hpp"

namespace linear_two_rates {
namespace {

using palpate::deformable::Compliance, palpate::deformable::ContactResult, palpate::deformable::MassSpringModel, palpate::deformable::Modal,
    palpate::deformable::StandardLinearSolid, palpate::deformable::SurfaceNodes, palpate::deformable::Tip, palpate::math::Vector3;

template <class Model>
using TwoRates = palpate::object::MultirateObject<palpate::deformable::LinearBodySolver<Model>, palpate::deformable::LinearLocalSlip>;

constexpr double period = 1e-3;

struct StaticKind {
  using Model = Compliance;
  Nine body;
  double radius = 5e-3, middle = 0.0, aside = 1.2e-3, depth = 1.2e-3;
  [[nodiscard]] const SurfaceNodes& nodes() const { return body.at; }
  [[nodiscard]] Model make(double /*tick*/) const { return {body.at, body.full.data()}; }
};
struct CreepKind : StaticKind {
  using Model = StandardLinearSolid;
  [[nodiscard]] Model make(double tick) const { return {Compliance(body.at, body.full.data()), 3.0, 0.3, tick}; }
};
struct ModalKind : StaticKind {
  using Model = Modal;
  [[nodiscard]] Model make(double tick) const { return {body.at, body.full.data(), body.waves.data(), body.frequencies, tick, 40.0, 1e-3}; }
};
struct SpringKind {
  using Model = MassSpringModel;
  Cube body{3};
  double radius = 8e-3, middle = 7.5e-3, aside = 2.5e-3, depth = 1.5e-3;
  [[nodiscard]] const SurfaceNodes& nodes() const { return body.nodes; }
  [[nodiscard]] Model make(double tick) const { return body.model(tick, 10.0, 2e-3); }
  [[nodiscard]] static double top() { return 15e-3; }
};
/// Springs that harden to four times their stiffness.
struct HardeningKind : SpringKind {
  explicit HardeningKind(double strain = 0.05) { body.data.law = {palpate::deformable::SpringLaw::Kind::cubic, strain, 4.0}; }
};

template <class Kind>
double top_of(const Kind& kind) {
  if constexpr (requires { kind.top(); }) return kind.top();
  return 0.0;
}

template <class Kind>
Tip tip_at(const Kind& kind, double x, double y, double depth) {
  Tip tip;
  tip.radius = kind.radius;
  tip.center = {kind.middle + x, kind.middle + y, top_of(kind) + kind.radius - depth};
  return tip;
}

/// Body of a kind at two rates, stepped as by a servo in virtual time.
template <class Kind>
struct Servo {
  TwoRates<typename Kind::Model> object;
  bool started = false;

  Servo(const Kind& kind, int interval, double tick_period = period)
      : object(std::make_unique<palpate::deformable::LinearBodySolver<typename Kind::Model>>(
                   kind.nodes(), [&kind](double tick) { return kind.make(tick); }, tick_period, interval),
               interval) {}
  ContactResult tick(const Tip& tip) {
    if (!started) object.initialize(tip);
    started = true;
    const ContactResult result = object.step(tip);
    object.step_synchronously();
    return result;
  }
};

/// Difference of the forces at two rates and at one along a path, over the forces at one rate.
struct Difference {
  double largest = 0.0, rms = 0.0;
};
template <class Kind, class Path>
Difference difference(const Kind& kind, int interval, int ticks, Path path, int from = 0) {
  Servo<Kind> servo(kind, interval);
  typename Kind::Model model = kind.make(period);
  palpate::deformable::TipContact<typename Kind::Model> contact(kind.nodes(), model);
  contact.reset();
  double most = 0.0, error = 0.0, squares = 0.0, error_squares = 0.0;
  for (int k = 0; k < ticks; ++k) {
    const Tip tip = path(k);
    const ContactResult one = contact.step(tip), two = servo.tick(tip);
    most = std::max(most, one.force.norm());
    squares += one.force.squaredNorm();
    if (k < from) continue;
    error = std::max(error, (two.force - one.force).norm());
    error_squares += (two.force - one.force).squaredNorm();
  }
  EXPECT_GT(most, 0.01);
  return {error / most, std::sqrt(error_squares / squares)};
}

template <class Kind>
struct LinearBodyTwoRates : testing::Test {
  Kind kind;
  [[nodiscard]] auto slow_path() const {
    return [this](int k) {
      return tip_at(kind, kind.aside * std::sin(0.011 * k), 0.8 * kind.aside * std::cos(0.007 * k), kind.depth * std::sin(0.013 * k));
    };
  }
};
using Kinds = testing::Types<StaticKind, CreepKind, ModalKind, SpringKind, HardeningKind>;
struct Names {
  template <class Kind>
  static std::string GetName(int /*index*/) {
    if (std::is_same_v<Kind, StaticKind>) return "compliance";
    if (std::is_same_v<Kind, CreepKind>) return "viscoelastic";
    if (std::is_same_v<Kind, HardeningKind>) return "hardening";
    return std::is_same_v<Kind, ModalKind> ? "modal" : "mass_spring";
  }
};
TYPED_TEST_SUITE(LinearBodyTwoRates, Kinds, Names);

// Law: an update interval of one tick gives the force of the same body without updates, up to the single precision of the modes.
TYPED_TEST(LinearBodyTwoRates, AnIntervalOfOneTickIsOneRate) {
  EXPECT_LT(difference(this->kind, 1, 3000, this->slow_path()).largest, 2e-5);
}

// Law: under a tip that rests, the force at two rates becomes that at one rate.
TYPED_TEST(LinearBodyTwoRates, AtRestTheForceIsThatOfOneRate) {
  const auto ramp = [this](int k) { return tip_at(this->kind, 0.4e-3, 0.2e-3, this->kind.depth * std::min(1e-2 * k, 1.0)); };
  for (const int interval : {4, 20, 50}) EXPECT_LT(difference(this->kind, interval, 3000, ramp, 2900).largest, 1e-3) << interval;
}

// Law: as the update interval falls, the force converges to that at one rate. A static body has it at any interval.
TYPED_TEST(LinearBodyTwoRates, TheForceConvergesWithTheInterval) {
  double last = 1.0;
  for (const int interval : {32, 16, 8, 4, 2}) {
    const double now = difference(this->kind, interval, 3000, this->slow_path()).rms;
    EXPECT_LT(now, (std::is_same_v<TypeParam, StaticKind> ? 1e-12 : last)) << interval;
    last = now;
  }
}

// Law: at any interval the work of the tip is potential plus tank level, neither is negative, and a tip gains no work on a path from free
// to free. The servo is fast: the force that it holds over a tick while a model is blended in is not part of the balance.
TYPED_TEST(LinearBodyTwoRates, WorkIsPotentialPlusTankLevel) {
  for (const int interval : {20, 160}) {
    Servo<TypeParam> servo(this->kind, interval, 0.125e-3);
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    Vector3<> way = Vector3<>::Zero(), step = Vector3<>::Zero(), before = Vector3<>::Zero();
    ContactResult last;
    double work = 0.0, since_free = 0.0, most = 0.0, error = 0.0, excess = 0.0, start = 0.0;
    long touched = 0, free = 0;
    constexpr int fine = 32;  // ticks of a random step
    for (int k = 0; k < 80'000; ++k) {
      for (int a = 0; a < 3 && k % fine == 0; ++a) step[a] = 0.01 / fine * (-way[a] + this->kind.aside * normal(random));
      way += step;
      const Tip tip = tip_at(this->kind, 3.0 * way[0], 3.0 * way[1], 3.0 * way[2] + this->kind.depth * (0.3 - std::cos(2.5e-4 * k)));
      const ContactResult now = servo.tick(tip);
      ASSERT_TRUE(now.solved);
      ASSERT_GE(now.tank_energy, 0.0);
      ASSERT_GE(now.energy, 0.0);
      if (k > 0) {
        const double more = -0.5 * (now.force + last.force).dot(tip.center - before);
        work += more;
        since_free += more;
      }
      if (now.nodes == 0) {  // the tank keeps at most the energy of the body
        excess = std::max(excess, now.tank_energy - start - since_free);
        start = now.tank_energy;
        since_free = 0.0;
        ++free;
      }
      error = std::max(error, std::abs(start + since_free - now.energy - now.tank_energy));
      most = std::max(most, now.energy);
      touched += now.nodes > 0 ? 1 : 0;
      last = now;
      before = tip.center;
    }
    EXPECT_GT(touched, 10'000);
    EXPECT_GT(free, 4000);
    EXPECT_GT(most, 1e-6);
    EXPECT_GE(work, -1e-3 * most);
    EXPECT_LT(error, 0.02 * most) << interval;  // quadrature of the work
    EXPECT_LT(excess, 0.02 * most) << interval;
  }
}

// Law: the local model of pressed springs is stiffer than at rest if they harden, softer if they soften, and the same if they are linear.
TEST(NonlinearTwoRates, TheLocalModelHasTheTangentCompliance) {
  const auto ratio = [](const auto& kind) {
    Servo<std::decay_t<decltype(kind)>> servo(kind, 20);
    for (int k = 0; k < 1500; ++k) servo.tick(tip_at(kind, 0.4e-3, 0.2e-3, kind.depth * std::min(1e-2 * k, 1.0)));
    return servo.object.coupling().current_model().compliance_ratio;
  };
  SpringKind softening;
  softening.body.data.law = {palpate::deformable::SpringLaw::Kind::exponential, -10.0, 4.0};
  EXPECT_LT(ratio(HardeningKind(0.02)), 0.6);
  EXPECT_GT(ratio(softening), 1.05);
  EXPECT_EQ(ratio(SpringKind()), 1.0);
}

// Law: the tangent compliance reduces the error between updates (0.27 with the compliance at rest).
TEST(NonlinearTwoRates, TheErrorAtTwoRatesIsThatOfTheTangent) {
  const HardeningKind kind(0.02);
  const auto path = [&](int k) {
    return tip_at(kind, kind.aside * std::sin(0.011 * k), 0.8 * kind.aside * std::cos(0.007 * k), kind.depth * std::sin(0.013 * k));
  };
  EXPECT_LT(difference(kind, 20, 3000, path).rms, 0.2);
}

// Law: repeated runs give the same bits.
TYPED_TEST(LinearBodyTwoRates, RepeatedRunsAreIdentical) {
  Servo<TypeParam> one(this->kind, 20);
  const auto copy = one.object.clone_at_rest();
  const auto path = this->slow_path();
  copy->initialize(path(0));
  for (int k = 0; k < 1500; ++k) {
    const Vector3<> force = one.tick(path(k)).force;
    ASSERT_EQ(force, copy->step(path(k)).force) << k;
    copy->step_synchronously();
  }
  one.object.reset();
  one.started = false;
  Servo<TypeParam> other(this->kind, 20);
  for (int k = 0; k < 1500; ++k) ASSERT_EQ(one.tick(path(k)).force, other.tick(path(k)).force) << k;
}

}  // namespace
}  // namespace linear_two_rates
