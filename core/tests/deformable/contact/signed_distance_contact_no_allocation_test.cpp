// A step of a contact by signed distance does not allocate: sliding, over edges, pushed through, from the first step on.
#include <gtest/gtest.h>

#include <array>
#include <palpate/deformable/contact/signed_distance_contact.hpp>
#include <palpate/deformable/linear/creep_motion.hpp>
#include <palpate/deformable/linear/modal_motion.hpp>
#include <vector>

#include "support/allocations.hpp"
#include "support/contact_bodies.hpp"

namespace {

using palpate::deformable::SignedDistanceContact, palpate::deformable::TipGeometry, palpate::math::Vector3;

TEST(SignedDistanceContactNoAllocation, InAnyStep) {
  const contact_bodies::SurfaceBody body = contact_bodies::soft(shapes::box({10e-3, 10e-3, 10e-3}, 5), 1e4, 6e-3, 4e-3);
  for (const TipGeometry& tip : {TipGeometry::sphere(4e-3), TipGeometry::capsule(3e-3, 4e-3, Vector3<>::UnitX()),
                                 TipGeometry::cylinder(4e-3, 1e-3, Vector3<>::UnitZ())}) {
    SignedDistanceContact contact(body.nodes, body.compliance, body.patches);
    const double above = tip.shape == TipGeometry::Shape::cylinder ? 10e-3 : 10e-3 + tip.radius;
    int touching = 0;
    const long before = allocations;
    for (int k = 0; k < 500; ++k) {
      const double s = 0.06 * k;
      touching += contact.step(tip, {9e-3 * std::sin(s), 9e-3 * std::cos(0.7 * s), above - 2e-3 * std::sin(0.3 * s)}).touching ? 1 : 0;
    }
    for (int k = 0; k < 500; ++k) contact.step(tip, {0.0, 0.0, above - 3e-5 * k});
    contact.reset();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 100);
    EXPECT_LT(touching, 470);
  }
}

// A body on a soft spring, whose forces CoupledNewton finds.
TEST(SignedDistanceContactNoAllocation, OnAFlexibleBody) {
  const contact_bodies::SurfaceBody body = contact_bodies::sprung(shapes::box({10e-3, 10e-3, 10e-3}, 5), 0.8);
  for (const double friction : {0.0, 0.4}) {
    SignedDistanceContact contact(body.nodes, body.compliance, body.patches, {friction, friction});
    int touching = 0;
    const long before = allocations;
    for (int k = 0; k < 500; ++k) {
      const double s = 0.06 * k;
      const Vector3<> center(9e-3 * std::sin(s), 9e-3 * std::cos(0.7 * s), 14e-3 - 2e-3 * std::sin(0.3 * s));
      touching += contact.step(TipGeometry::sphere(4e-3), center).touching ? 1 : 0;
    }
    contact.reset();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 100);
  }
}

// Two tips with friction on a body that creeps, and on one that vibrates.
TEST(SignedDistanceContactNoAllocation, WithFrictionMemoryAndTwoTips) {
  const contact_bodies::SurfaceBody body = contact_bodies::soft(shapes::box({10e-3, 10e-3, 10e-3}, 5), 1e4, 6e-3, 4e-3);
  const palpate::deformable::Creep creep = palpate::deformable::creep_law(2.0, 0.05, 1e-3);
  const palpate::deformable::ContactPatches patches(body.surface, creep);
  const std::vector<float> shapes(3 * static_cast<std::size_t>(body.nodes.size()), 1.0F);
  const palpate::deformable::ModalData mode{shapes.data(), {200.0}, 5.0, 1e-4};
  std::array<std::unique_ptr<palpate::deformable::BodyMotion>, 2> motions{
      std::make_unique<palpate::deformable::CreepMotion>(body.compliance, creep),
      std::make_unique<palpate::deformable::ModalMotion>(body.nodes, mode, 1e-3, 2.0, 0.05, 1.0)};
  for (auto& motion : motions) {
    SignedDistanceContact contact(body.nodes, body.compliance, patches, {0.5, 0.4}, std::move(motion), 2);
    int touching = 0;
    double energy = 0.0;
    const long before = allocations;
    for (int k = 0; k < 500; ++k) {
      const double s = 0.06 * k;
      const std::array<SignedDistanceContact::PlacedTip, 2> tips{
          {{TipGeometry::sphere(4e-3), {9e-3 * std::sin(s), 6e-3 * std::cos(0.7 * s), 14e-3 - 2e-3 * std::sin(0.3 * s)}},
           {TipGeometry::cylinder(4e-3, 1e-3, Vector3<>::UnitZ()), {-5e-3 * std::sin(s), 0.0, 10e-3 - 1e-3 * std::sin(0.2 * s)}}}};
      touching += contact.step(tips.data()).touching && contact.last(1).touching ? 1 : 0;
      energy = std::max(energy, contact.last().energy);
    }
    contact.reset();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 60);
    EXPECT_TRUE(std::isfinite(energy) && energy > 0.0);
  }
}

}  // namespace
