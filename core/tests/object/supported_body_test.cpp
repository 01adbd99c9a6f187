// Supports that change while a tip presses a body: dense static elimination, and the energy account of grasp and release.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <palpate/object/supported_body.hpp>
#include <random>
#include <vector>

#include "support/supported_bodies.hpp"

namespace supported_bodies {
namespace {

using palpate::deformable::ContactResult;

template <class Phase>
class SupportedBodyTest : public testing::Test {};
using Phases = testing::Types<NormalContactPhase, SignedDistancePhase>;
TYPED_TEST_SUITE(SupportedBodyTest, Phases);

Eigen::MatrixXd dense() {
  const auto s = surface();
  const auto n = static_cast<Eigen::Index>(3 * s->size());
  return Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(s->compliance.data(), n, n).cast<double>();
}

std::vector<Eigen::Index> rows_of(const std::vector<std::int32_t>& nodes) {
  std::vector<Eigen::Index> rows;
  for (const std::int32_t node : nodes)
    for (Eigen::Index a = 0; a < 3; ++a) rows.push_back(3 * node + a);
  return rows;
}

/// Press over `steps` steps to `deep` and return the last result.
template <class Body>
ContactResult press(Body& body, double deep, int steps = 20, double from = 0.0, double x = 0.0) {
  ContactResult last;
  for (int k = 1; k <= steps; ++k) last = body.step(sphere(from + (deep - from) * k / steps, x));
  return last;
}

TEST(SupportPhase, HeldRowsAreStruckFromTheStiffness) {
  const SupportNodes nodes = held_beyond(4e-3);
  const palpate::deformable::SupportPhase phase(surface(), nodes);
  ASSERT_TRUE(phase.definite());
  const Eigen::MatrixXd stiffness = dense().inverse();
  const auto rows = rows_of(nodes.touched);
  const Eigen::MatrixXd expected = stiffness(rows, rows).inverse();
  const auto m = static_cast<Eigen::Index>(rows.size());
  const Eigen::MatrixXd found =
      Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(phase.compliance().data(), m, m)
          .cast<double>();
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-6 * expected.cwiseAbs().maxCoeff());
  EXPECT_EQ((found - found.transpose()).cwiseAbs().maxCoeff(), 0.0);
}

TEST(SupportPhase, NodesWhoseComplianceIsSingularAreRefused) {
  auto twice = std::make_shared<CondensedSurface>(*surface());
  const std::size_t row = 3 * twice->size();
  for (std::size_t a = 0; a < 3; ++a)  // node 1 moves as node 0
    for (std::size_t c = 0; c < row; ++c) twice->compliance[(3 + a) * row + c] = twice->compliance[a * row + c];
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t r = 0; r < row; ++r) twice->compliance[r * row + 3 + a] = twice->compliance[r * row + a];
  EXPECT_FALSE(palpate::deformable::SupportPhase(twice, {{0, 1}, {2}}).definite());
  EXPECT_TRUE(palpate::deformable::SupportPhase(twice, {{0}, {2}}).definite());
}

TYPED_TEST(SupportedBodyTest, AGraspUnderATipChangesNeitherForceNorEnergyNorDisplacement) {
  const auto body = make<TypeParam>({{0, free()}, {30, held_beyond(4e-3)}});
  press(*body, 1e-3, 29);
  const ContactResult before = body->step(sphere(1e-3));
  std::vector<double> displaced(3 * body->size()), after(displaced.size());
  body->displacement(displaced.data());
  const ContactResult grasped = body->step(sphere(1e-3));
  body->displacement(after.data());
  EXPECT_EQ(body->changes(), 1);
  EXPECT_GT(before.energy, 0.0);
  EXPECT_NEAR(grasped.energy, before.energy, 1e-5 * before.energy);
  EXPECT_LT((grasped.force - before.force).norm(), 1e-4 * before.force.norm());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_NEAR(after[i], displaced[i], 1e-3 * 1e-3);
}

TYPED_TEST(SupportedBodyTest, AGraspedBodyObeysTheDenseSolutionWithPrescribedDisplacements) {
  const SupportNodes nodes = held_beyond(3e-3);
  const auto body = make<TypeParam>({{0, free()}, {20, nodes}});
  press(*body, 1.5e-3);
  std::vector<double> grasped(3 * body->size()), found(grasped.size());
  body->displacement(grasped.data());
  press(*body, 0.4e-3, 20, 1.5e-3, -3e-3);
  body->displacement(found.data());
  const Eigen::MatrixXd c = dense();
  const auto s = rows_of(nodes.held);
  const Eigen::VectorXd at = Eigen::Map<const Eigen::VectorXd>(grasped.data(), static_cast<Eigen::Index>(grasped.size()));
  Eigen::VectorXd f = Eigen::VectorXd::Zero(at.size());
  for (int k = 0; k < body->contact_count(); ++k) f.segment<3>(3 * body->contact_nodes()[k]) += body->node_force(k);
  const Eigen::MatrixXd css = c(s, s);
  const Eigen::VectorXd moved = at(s) - c(s, Eigen::all) * f;
  const Eigen::VectorXd reaction = css.ldlt().solve(moved), expected = c * f + c(Eigen::all, s) * reaction;
  const Eigen::VectorXd u = Eigen::Map<const Eigen::VectorXd>(found.data(), at.size());
  EXPECT_GT(at(s).norm(), 0.05e-3);
  EXPECT_LT((u - expected).cwiseAbs().maxCoeff(), 1e-5 * expected.cwiseAbs().maxCoeff());
  EXPECT_LT((u(s) - at(s)).cwiseAbs().maxCoeff(), 1e-5 * at.cwiseAbs().maxCoeff());
  // Stored energy: half the sum of all forces times displacements, and the contact's layer, which is not negative.
  Eigen::VectorXd all = f;
  for (std::size_t k = 0; k < s.size(); ++k) all[s[k]] += reaction[static_cast<Eigen::Index>(k)];
  const double stored = 0.5 * all.dot(expected);
  if constexpr (std::is_same_v<TypeParam, NormalContactPhase>) {
    // The contact counts displacements by its forces along the normals alone; the supports act in all directions.
    EXPECT_NEAR(body->last().energy, stored, 0.02 * stored);
  } else {
    EXPECT_GT(body->last().energy, stored);
    EXPECT_LT(body->last().energy, 1.6 * stored);
  }
}

TYPED_TEST(SupportedBodyTest, ABodyGraspedAtRestIsThatWithTheseSupportsFromTheStart) {
  const auto body = make<TypeParam>({{0, free()}, {5, held_beyond(4e-3)}}), always = make<TypeParam>({{0, held_beyond(4e-3)}});
  for (int k = 0; k < 6; ++k) {
    body->step(sphere(-1e-3));
    always->step(sphere(-1e-3));
  }
  for (int k = 0; k < 40; ++k) {
    const Tip tip = sphere(1e-3 * std::sin(0.1 * k), 1e-3 * std::sin(0.23 * k));
    const ContactResult one = body->step(tip), other = always->step(tip);
    EXPECT_EQ(one.force, other.force);
    EXPECT_EQ(one.energy, other.energy);
  }
  EXPECT_GT(press(*body, 1e-3).force.norm(), 1.02 * press(*make<TypeParam>({{0, free()}}), 1e-3).force.norm());
}

TYPED_TEST(SupportedBodyTest, ChangesThatChangeNothingLeaveTheSameForces) {
  const auto body = make<TypeParam>({{0, free()}, {15, free()}, {31, free()}}), plain = make<TypeParam>({{0, free()}});
  for (int k = 0; k < 60; ++k) {
    const Tip tip = sphere(1e-3 * std::sin(0.1 * k), 1e-3 * std::sin(0.23 * k));
    const ContactResult one = body->step(tip), other = plain->step(tip);
    EXPECT_LT((one.force - other.force).norm(), 2e-4 * (other.force.norm() + 1e-3)) << k;
  }
  EXPECT_EQ(body->changes(), 2);
}

TEST(SupportedBody, WithoutChangesHasTheBitsOfTheBodyWithoutPhases) {
  const auto normal = make<NormalContactPhase>({{0, free()}});
  const auto distance = make<SignedDistancePhase>({{0, free()}});
  const auto s = surface();
  const palpate::deformable::Compliance compliance(half_space().nodes, s->compliance.data());
  palpate::object::LinearBodyObject<palpate::deformable::Compliance> plain_normal(half_space().nodes, compliance);
  palpate::object::SignedDistanceBody plain_distance(
      std::make_shared<const palpate::object::SignedDistanceBody::Data>(half_space().nodes, s->compliance.data(), half_space().surface));
  for (int k = 0; k < 100; ++k) {
    const Tip tip = sphere(1e-3 * std::sin(0.1 * k), 2e-3 * std::sin(0.23 * k));
    EXPECT_EQ(normal->step(tip).force, plain_normal.step(tip).force);
    EXPECT_EQ(normal->last().energy, plain_normal.last().energy);
    EXPECT_EQ(distance->step(tip).force, plain_distance.step(tip).force);
    EXPECT_EQ(distance->last().energy, plain_distance.last().energy);
  }
}

TYPED_TEST(SupportedBodyTest, AReleasedBodyIsThatWithoutSupports) {
  const auto body = make<TypeParam>({{0, free()}, {20, held_beyond(3e-3)}, {40, free()}}), plain = make<TypeParam>({{0, free()}});
  press(*body, 1.5e-3);
  const double held = press(*body, 0.5e-3, 20, 1.5e-3, -3e-3).energy;
  press(*plain, 0.5e-3, 20, 0.0, -3e-3);
  for (int k = 0; k < 3; ++k) body->step(sphere(0.5e-3, -3e-3));
  const ContactResult other = plain->step(sphere(0.5e-3, -3e-3));
  EXPECT_LT((body->last().force - other.force).norm(), 1e-4 * other.force.norm());
  EXPECT_NEAR(body->last().energy, other.energy, 1e-4 * other.energy);
  EXPECT_LT(body->last().energy, held);
}

TYPED_TEST(SupportedBodyTest, ADentThatIsHeldStaysAndIsTouchedWhereItIs) {
  const SupportNodes ring = held_where([](const Vector3<>& p) { return p.head<2>().norm() > 4e-3; });
  const auto body = make<TypeParam>({{0, free()}, {20, ring}});
  press(*body, 2e-3);
  press(*body, -1e-3, 20, 2e-3);
  const double left = body->last().energy;  // of the field that the supports keep
  EXPECT_GT(left, 0.0);
  EXPECT_EQ(body->last().nodes, 0);
  std::vector<double> u(3 * body->size());
  body->displacement(u.data());
  const double dent = -u[3 * 40 + 2];  // of the node in the middle
  ASSERT_GT(dent, 0.1e-3);
  double first = -1.0;
  for (int k = 0; k < 300 && first < 0.0; ++k) {
    const double deep = 1e-5 * k;
    if (body->step(sphere(deep)).touching) first = deep;
  }
  EXPECT_NEAR(first, dent, 0.1e-3);
  EXPECT_FALSE(body->last().lost);
}

/// Press at random places while supports and touched nodes change at random; the tip rests while they change. `make_body` takes the
/// changes.
template <class Make>
void expect_no_supply(Tip::Kind kind, Make make_body, double rounding = 2e-5) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Change> changes{{0, free()}};
  constexpr int every = 25, count = 40;
  for (int c = 1; c <= count; ++c) {
    SupportNodes nodes;
    const Vector3<> held_at(14e-3 * (unit(random) - 0.5), 14e-3 * (unit(random) - 0.5), 0.0);
    const Vector3<> closed_at(14e-3 * (unit(random) - 0.5), 14e-3 * (unit(random) - 0.5), 0.0);
    const double held_radius = 5e-3 * unit(random), closed_radius = 5e-3 * unit(random);
    for (std::int32_t i = 0; i < half_space().nodes.size(); ++i) {
      const Vector3<> p = half_space().nodes.point(i);
      if ((p - held_at).norm() < held_radius)
        nodes.held.push_back(i);
      else if ((p - closed_at).norm() > closed_radius)
        nodes.touched.push_back(i);
    }
    changes.push_back({every * c, nodes});
  }
  const auto body = make_body(changes);
  Tip tip = sphere(0.5e-3);
  tip.kind = kind;
  const double above = kind == Tip::Kind::sphere ? radius : 0.0;
  double scale = 0.0;
  int dissipated = 0;
  Vector3<> target = tip.center, begin = tip.center;
  for (int k = 0; k < every * (count + 1); ++k) {
    const int phase = k % every;
    if (phase == 2) {
      begin = tip.center;
      target = {8e-3 * (unit(random) - 0.5), 8e-3 * (unit(random) - 0.5), above - 2e-3 * unit(random)};
    }
    if (phase >= 2 && phase < every - 3) tip.center = begin + (target - begin) * (phase - 1.0) / (every - 5.0);
    const double before = body->last().energy;
    const ContactResult& now = body->step(tip);
    scale = std::max(scale, now.energy);
    if (phase == 0 && k > 0) {
      EXPECT_LE(now.energy, before + rounding * scale) << "change " << k / every;
      dissipated += now.energy < before - 1e-3 * scale ? 1 : 0;
    }
  }
  EXPECT_EQ(body->changes(), count);
  EXPECT_GT(dissipated, 5);
}

TYPED_TEST(SupportedBodyTest, NoChangeSuppliesEnergy) {
  const auto smooth = [](const std::vector<Change>& changes) { return make<TypeParam>(changes); };
  expect_no_supply(Tip::Kind::sphere, smooth);
  expect_no_supply(Tip::Kind::flat, smooth);  // also where patches are partly covered
}

TEST(SupportedBodyWithFriction, NoChangeSuppliesEnergy) {
  for (const double mu : {0.2, 0.8})
    for (const Tip::Kind kind : {Tip::Kind::sphere, Tip::Kind::flat})
      expect_no_supply(kind, [mu](const std::vector<Change>& changes) { return make_rough(changes, mu); }, 1e-4);
}

/// Press by 1 mm, then move aside by `aside` [m], in 40 steps.
ContactResult drag(BodyWithSupports& body, double aside) {
  ContactResult last = press(body, 1e-3);
  for (int k = 1; k <= 20; ++k) last = body.step(sphere(1e-3, aside * k / 20));
  return last;
}

TEST(SupportedBodyWithFriction, AGraspUnderATipThatSticksKeepsForceFrictionAndEnergy) {
  for (const double aside : {0.2e-3, 3e-3}) {  // the tip sticks; it slides
    const auto body = make_rough({{0, free()}, {40, held_beyond(5e-3)}});
    drag(*body, aside);
    const ContactResult before = body->last(), grasped = body->step(sphere(1e-3, aside));
    EXPECT_EQ(body->changes(), 1);
    EXPECT_GT(before.friction.norm(), 0.1 * before.force.norm());
    EXPECT_LT((grasped.force - before.force).norm(), 2e-3 * before.force.norm());
    EXPECT_LT((grasped.friction - before.friction).norm(), 5e-3 * before.friction.norm());
    EXPECT_NEAR(grasped.energy, before.energy, 2e-3 * before.energy);
    EXPECT_EQ(grasped.sliding, before.sliding);
  }
}

TEST(SupportedBodyWithFriction, AStickingTipMeetsTheStiffnessOfTheGraspedBody) {
  // Pulled aside by little after a grasp at rest, the body yields as one that was held from the start, and less than one that is not.
  const auto held = make_rough({{0, free()}, {5, held_beyond(4e-3)}}), always = make_rough({{0, held_beyond(4e-3)}}),
             never = make_rough({{0, free()}});
  for (auto* body : {held.get(), always.get(), never.get()}) {
    for (int k = 0; k < 6; ++k) body->step(sphere(-1e-3));
    drag(*body, 0.1e-3);
  }
  EXPECT_EQ(held->last().force, always->last().force);
  EXPECT_GT(held->last().friction.norm(), 1.02 * never->last().friction.norm());
}

TEST(SupportedBodyWithFriction, AReleasedBodyDraggedOnHasTheFrictionOfOneWithoutSupports) {
  const auto body = make_rough({{0, free()}, {20, held_beyond(3e-3)}, {60, free()}}), plain = make_rough({{0, free()}});
  ContactResult one, other;
  for (int k = 0; k <= 120; ++k) {
    const Tip tip = sphere(1e-3 * std::min(k / 20.0, 1.0), -4e-3 * std::max(k - 20, 0) / 100.0);
    one = body->step(tip);
    other = plain->step(tip);
  }
  EXPECT_TRUE(one.sliding);
  EXPECT_LT((one.force - other.force).norm(), 5e-3 * other.force.norm());
}

TEST(SupportedBodyWithFriction, APathOverGraspAndReleaseExtractsNoEnergy) {
  const SupportNodes side = held_beyond(2e-3);
  for (const auto& [first, second] : {std::pair<int, int>{50, 150}, {150, 380}, {20, 320}, {250, 330}}) {
    const auto body = make_rough({{0, free()}, {first, side}, {second, free()}}, 0.3);
    double work = 0.0, largest = 0.0;
    Vector3<> last_force = Vector3<>::Zero(), last_center = sphere(-0.5e-3).center;
    for (int k = 0; k <= 400; ++k) {
      const double s = k / 400.0;
      const Tip tip = sphere(-0.5e-3 + 2.5e-3 * std::sin(M_PI * s), 3e-3 * std::sin(2.0 * M_PI * s));
      const Vector3<> force = body->step(tip).force;
      work -= 0.5 * (force + last_force).dot(tip.center - last_center);
      last_force = force;
      last_center = tip.center;
      largest = std::max(largest, body->last().energy);
      EXPECT_GE(work - body->last().energy, -2e-3 * largest) << first << " " << second << " " << k;
    }
    EXPECT_GT(work - body->last().energy, 0.1 * largest);  // friction dissipates
  }
}

TYPED_TEST(SupportedBodyTest, APathOverGraspAndReleaseExtractsNoEnergy) {
  // Grasp, press, release, leave, and each other order: the work of the tip less the energy left in the body is not negative.
  const SupportNodes side = held_beyond(2e-3);
  for (const auto& [first, second] : {std::pair<int, int>{50, 150}, {150, 380}, {20, 320}, {250, 330}}) {
    const auto body = make<TypeParam>({{0, free()}, {first, side}, {second, free()}});
    double work = 0.0, largest = 0.0;
    Vector3<> last_force = Vector3<>::Zero(), last_center = sphere(-0.5e-3).center;
    for (int k = 0; k <= 400; ++k) {  // in by 2 mm, aside by 3 mm, out
      const double s = k / 400.0;
      const Tip tip = sphere(-0.5e-3 + 2.5e-3 * std::sin(M_PI * s), 3e-3 * s);
      const Vector3<> force = body->step(tip).force;
      work -= 0.5 * (force + last_force).dot(tip.center - last_center);
      last_force = force;
      last_center = tip.center;
      largest = std::max(largest, body->last().energy);
    }
    EXPECT_GE(work - body->last().energy, -2e-3 * largest) << first << " " << second;
  }
}

TYPED_TEST(SupportedBodyTest, ANodeThatIsReleasedUnderTheTipIsTouchedOnceTheTipHasLeftIt) {
  const SupportNodes all_but_far = held_where([](const Vector3<>& p) { return p.head<2>().norm() < 6e-3; });
  const auto body = make<TypeParam>({{0, all_but_far}, {20, free()}}), plain = make<TypeParam>({{0, free()}});
  EXPECT_EQ(press(*body, 0.5e-3).force.norm(), 0.0);        // no force acts on held nodes
  EXPECT_EQ(body->step(sphere(0.5e-3)).force.norm(), 0.0);  // released, but inside the tip
  EXPECT_EQ(body->changes(), 1);
  press(*body, -0.5e-3, 10, 0.5e-3);
  press(*plain, -0.5e-3, 10, 0.5e-3);
  const Vector3<> force = press(*body, 0.5e-3, 20, -0.5e-3).force, expected = press(*plain, 0.5e-3, 20, -0.5e-3).force;
  EXPECT_GT(expected.norm(), 0.0);
  EXPECT_LT((force - expected).norm(), 1e-4 * expected.norm());
}

TYPED_TEST(SupportedBodyTest, ARequestedChangeIsThatOfAPlan) {
  const auto planned = make<TypeParam>({{0, free()}, {20, held_beyond(3e-3)}, {30, free()}}), asked = make<TypeParam>({{0, free()}});
  for (int k = 0; k < 50; ++k) {
    if (k == 20) {
      EXPECT_TRUE(asked->change_supports(free()));  // of two requests the last one counts
      EXPECT_TRUE(asked->change_supports(held_beyond(3e-3)));
    }
    if (k == 30) {
      EXPECT_TRUE(asked->change_supports(free()));
    }
    const Tip tip = sphere(1e-3 * std::sin(0.1 * k), 1e-3 * std::sin(0.23 * k));
    EXPECT_EQ(asked->step(tip).force, planned->step(tip).force);
    EXPECT_EQ(asked->last().energy, planned->last().energy);
  }
  EXPECT_EQ(asked->changes(), 2);
}

TYPED_TEST(SupportedBodyTest, ACopyAtRestAndAResetBodyRepeatTheRun) {
  expect_repeats(*make<TypeParam>({{0, free()}, {10, held_beyond(3e-3)}, {25, free()}}), 40);
}

}  // namespace
}  // namespace supported_bodies
