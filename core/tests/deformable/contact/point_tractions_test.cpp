// Friction by signed distance on a body of a standard linear solid: the shear of the layer creeps as well.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "palpate/deformable/contact/signed_distance_contact.hpp"
#include "palpate/deformable/linear/creep_motion.hpp"
#include "support/contact_bodies.hpp"
#include "support/tip_work.hpp"

using contact_bodies::SurfaceBody, contact_bodies::TipWork;
using palpate::deformable::Creep, palpate::deformable::DryFriction, palpate::deformable::Grip, palpate::deformable::PointTractions,
    palpate::deformable::SignedDistanceContact, palpate::deformable::TipGeometry;
using palpate::math::Vector3;

namespace creeping_friction {

/// Half-space whose long-term modulus is 20 kPa.
struct RelaxingHalfSpace {
  Creep law;
  SurfaceBody lasting, of_period;
  palpate::deformable::ContactPatches patches;

  explicit RelaxingHalfSpace(double ratio, double retardation, int cells = 8)
      : law(palpate::deformable::creep_law(ratio, retardation, 1e-3)),
        lasting(contact_bodies::half_space(cells, 16e-3, 20e3)),
        of_period(contact_bodies::half_space(cells, 16e-3, 20e3 / law.period_ratio)),
        patches(lasting.surface, law) {}

  [[nodiscard]] SignedDistanceContact contact(DryFriction friction) const {
    return {of_period.nodes, of_period.compliance, patches, friction,
            std::make_unique<palpate::deformable::CreepMotion>(of_period.compliance, law)};
  }
};

inline constexpr double radius = 8e-3, depth = 1e-3;

}  // namespace creeping_friction

using creeping_friction::RelaxingHalfSpace;

// Held for 20 retardation times. The slip of the rim depends on the way there.
TEST(CreepingFriction, ATipThatSticksHasTheLongTermForce) {
  using creeping_friction::depth, creeping_friction::radius;
  for (const double ratio : {2.0, 5.0})
    for (const double mu : {0.3, 5.0}) {
      const RelaxingHalfSpace space(ratio, 0.02);
      SignedDistanceContact relaxing = space.contact({mu, mu});
      SignedDistanceContact elastic(space.lasting.nodes, space.lasting.compliance, space.lasting.patches, {mu, mu});
      const TipGeometry tip = TipGeometry::sphere(radius);
      for (SignedDistanceContact* contact : {&relaxing, &elastic}) {
        for (int k = 0; k <= 100; ++k) contact->step(tip, {0.0, 0.0, radius - depth * k / 100.0});
        for (int k = 1; k <= 50; ++k) contact->step(tip, {1e-6 * k, 0.3e-6 * k, radius - depth});
      }
      EXPECT_GT(relaxing.last().friction.norm(), 1.1 * elastic.last().friction.norm());
      for (int k = 0; k < 400; ++k) relaxing.step(tip, {50e-6, 15e-6, radius - depth});
      const double lateral = elastic.last().friction.norm();
      EXPECT_LT((relaxing.last().friction - elastic.last().friction).norm(), (mu > 1.0 ? 0.002 : 0.006) * lateral) << ratio;
      EXPECT_NEAR(relaxing.last().energy / elastic.last().energy, 1.0, 1e-3) << ratio;
    }
}

// Law: a force on a body of a standard linear solid ends as in the long term, however fast the tip has moved: shallow, too, where the
// points carry a part of their friction.
TEST(CreepingFriction, TheLongTermForceDoesNotDependOnTheRate) {
  using creeping_friction::radius;
  for (const double deep : {0.1e-3, 1e-3})
    for (const int ticks : {20, 200, 2000}) {
      const RelaxingHalfSpace space(5.0, 0.02, 16);
      SignedDistanceContact relaxing = space.contact({5.0, 5.0});
      SignedDistanceContact elastic(space.lasting.nodes, space.lasting.compliance, space.lasting.patches, {5.0, 5.0});
      const auto at = [deep](double part) { return Vector3<>(0.1 * deep * part, 0.0, radius - deep * part); };
      for (SignedDistanceContact* contact : {&relaxing, &elastic})
        for (int k = 0; k <= ticks; ++k) contact->step(TipGeometry::sphere(radius), at(static_cast<double>(k) / ticks));
      for (int k = 0; k < 600; ++k) relaxing.step(TipGeometry::sphere(radius), at(1.0));
      const double lateral = elastic.last().friction.norm();
      EXPECT_GT(lateral, 1e-6);
      EXPECT_LT((relaxing.last().friction - elastic.last().friction).norm(), 4e-3 * lateral) << deep << " " << ticks;
    }
}

// Law: the creep of the layer in shear supplies no energy, while points come and go and slip.
TEST(CreepingFriction, TheBodyNeverStoresMoreThanTheTipHasWorked) {
  using creeping_friction::radius;
  for (const double mu : {0.3, 5.0})
    for (const double retardation : {0.01, 0.1}) {
      const RelaxingHalfSpace space(4.0, retardation);
      SignedDistanceContact contact = space.contact({mu, 0.8 * mu});
      TipWork path{{0.0, 0.0, radius + 1e-4}};
      for (int k = 0; k <= 4000; ++k) {
        const double s = 2.0 * M_PI * k / 4000.0;
        const double deep = 0.8e-3 * std::sin(0.5 * s) + 0.3e-3 * std::sin(40.0 * s);
        path.step(contact, TipGeometry::sphere(radius), {0.2e-3 * std::sin(30.0 * s), 0.1e-3 * std::sin(20.0 * s), radius - deep});
      }
      EXPECT_GT(path.largest, 1e-5);
      EXPECT_LT(path.ahead, 1e-3 * path.largest) << mu << " " << retardation;
    }
}

// Law: points of constant stiffness are standard linear solids, however they slip.
TEST(CreepingFriction, APointIsAStandardLinearSolid) {
  const RelaxingHalfSpace space(3.0, 0.02);
  const Creep& law = space.law;
  const std::size_t number = space.patches.round.end(0) - space.patches.round.begin(0);
  const double stiffness = 200.0 * static_cast<double>(number), lasting = stiffness * law.period_ratio;  // N/m
  constexpr double most = 1e-4;                                                                          // slip, m
  const auto slip_at = [](int k) { return Vector3<>(most * std::sin(0.2 * k), most * (std::cos(0.1 * k) - 1.0), 0.0); };
  PointTractions points(space.patches, 1);
  Vector3<> delayed = Vector3<>::Zero();  // slip, m
  for (int k = 0; k < 100; ++k) {
    std::fill_n(points.first(0) + 5 * points.stride(), number, 200.0F);
    Vector3<> carried = Vector3<>::Zero();
    for (std::size_t q = 0; q < number; ++q)
      for (int a = 0; a < 3; ++a) carried[a] += static_cast<double>(points.first(0)[static_cast<std::size_t>(a) * points.stride() + q]);
    EXPECT_LT((carried - stiffness * (slip_at(std::max(k - 1, 0)) - law.decay * delayed)).norm(), 1e-4 * stiffness * most) << k;
    const Vector3<> traction = stiffness * (slip_at(k) - law.decay * delayed);
    const Grip grip = points.share(0, number, {stiffness, carried, 0.0}, traction, false);
    delayed = law.decay * delayed + law.gain / lasting * traction;
    const double energy = law.energy(traction.squaredNorm() / lasting, lasting * delayed.squaredNorm());
    EXPECT_NEAR(0.5 * grip.energy, energy, 1e-3 * stiffness * most * most) << k;
  }
}
