// Contact on bodies that yield much more than the layer of the contact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <palpate/deformable/contact/signed_distance_contact.hpp>
#include <vector>

#include "support/contact_bodies.hpp"

namespace {

using contact_bodies::SurfaceBody;
using palpate::deformable::ContactResult, palpate::deformable::DryFriction, palpate::deformable::SignedDistanceContact,
    palpate::deformable::TipGeometry, palpate::math::Vector3;

SurfaceBody sprung(double give) {
  return contact_bodies::sprung(shapes::box({10e-3, 10e-3, 10e-3}, 5), give);
}

/// Center of a tip that presses, slides over the box and off it.
Vector3<> center_at(int k, double over) {
  const double s = 1e-3 * k;
  return {3e-3 * std::sin(4.0 * s), 12e-3 * s, 10e-3 + over - 1.5e-3 * std::min(1.0, 8.0 * s) + 0.1e-3};
}

class OnASpring : public testing::TestWithParam<double> {};

// A tip at c feels what it feels at c + give F on the same body without the spring, whose force is found by other iterations.
TEST_P(OnASpring, TheForceIsThatOfTheHeldBodyAtTheTipsRelativePosition) {
  const double give = 0.8;
  const SurfaceBody loose = sprung(give), held = sprung(0.0);
  const DryFriction friction{GetParam(), 0.8 * GetParam()};
  for (const TipGeometry& tip : {TipGeometry::sphere(4e-3), TipGeometry::capsule(3e-3, 4e-3, Vector3<>::UnitX()),
                                 TipGeometry::cylinder(4e-3, 1e-3, Vector3<>::UnitZ())}) {
    SignedDistanceContact one(loose.nodes, loose.compliance, loose.patches, friction, nullptr, 1, /*bends=*/true);
    SignedDistanceContact other(held.nodes, held.compliance, held.patches, friction);
    const double over = tip.shape == TipGeometry::Shape::cylinder ? 0.0 : tip.radius;
    double largest = 0.0, error = 0.0;
    for (int k = 0; k < 900; ++k) {
      const Vector3<> c = center_at(k, over);
      const ContactResult a = one.step(tip, c);
      ASSERT_TRUE(a.solved) << k;
      const ContactResult b = other.step(tip, c + give * a.force);
      largest = std::max(largest, a.force.norm());
      error = std::max(error, (a.force - b.force).norm());
    }
    EXPECT_GT(largest, 1e-4);
    EXPECT_LT(error, 0.003 * largest) << static_cast<int>(tip.shape) << " " << tip.length;
  }
}

TEST_P(OnASpring, WorkLessStoredEnergyDoesNotFall) {
  const SurfaceBody loose = sprung(0.8);
  const TipGeometry tip = TipGeometry::sphere(4e-3);
  SignedDistanceContact contact(loose.nodes, loose.compliance, loose.patches, {GetParam(), GetParam()}, nullptr, 1, /*bends=*/true);
  Vector3<> last = center_at(0, tip.radius), force = Vector3<>::Zero();
  double work = 0.0, most = 0.0, fall = 0.0, energy = 0.0;
  for (int k = 0; k < 2400; ++k) {
    const Vector3<> c = center_at(k < 1200 ? k / 2 : (2400 - k) / 2, tip.radius);
    const ContactResult a = contact.step(tip, c);
    work -= 0.5 * (a.force + force).dot(c - last);
    last = c;
    force = a.force;
    most = std::max(most, work - a.energy);
    fall = std::max(fall, most - (work - a.energy));
    energy = std::max(energy, a.energy);
  }
  EXPECT_GT(energy, 1e-7);
  EXPECT_LT(fall, 2e-4 * energy);
}

INSTANTIATE_TEST_SUITE_P(Friction, OnASpring, testing::Values(0.0, 0.3, 0.8));

}  // namespace
