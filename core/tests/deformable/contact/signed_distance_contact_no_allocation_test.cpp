// A step of a contact by signed distance does not allocate: sliding, over edges, pushed through, from the first step on.
#include <gtest/gtest.h>

#include <palpate/deformable/contact/signed_distance_contact.hpp>

#include "support/allocations.hpp"
#include "support/contact_bodies.hpp"

namespace {

using palpate::deformable::SignedDistanceContact, palpate::deformable::TipGeometry, palpate::math::Vector3;

TEST(SignedDistanceContactNoAllocation, InAnyStep) {
  const contact_bodies::SurfaceBody body = contact_bodies::soft(shapes::box({10e-3, 10e-3, 10e-3}, 5), 1e4, 6e-3, 4e-3);
  for (const TipGeometry& tip : {TipGeometry::sphere(4e-3), TipGeometry::capsule(3e-3, 4e-3, Vector3<>::UnitX()),
                                 TipGeometry::cylinder(4e-3, 0.5e-3, Vector3<>::UnitZ())}) {
    SignedDistanceContact contact(body.nodes, body.compliance, body.patches);
    const double above = tip.shape == TipGeometry::Shape::cylinder ? 10e-3 : 10e-3 + tip.radius;
    int touching = 0;
    const long before = allocations;
    for (int k = 0; k < 1500; ++k) {
      const double s = 0.02 * k;
      touching += contact.step(tip, {9e-3 * std::sin(s), 9e-3 * std::cos(0.7 * s), above - 2e-3 * std::sin(0.3 * s)}).touching ? 1 : 0;
    }
    for (int k = 0; k < 500; ++k) contact.step(tip, {0.0, 0.0, above - 3e-5 * k});
    contact.reset();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(touching, 300);
    EXPECT_LT(touching, 1400);
  }
}

}  // namespace
