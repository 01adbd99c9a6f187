#include <gtest/gtest.h>

#include <palpate/control/stiffness_normalization.hpp>
#include <palpate/object/spring_wall.hpp>

namespace {

using palpate::control::StiffnessNormalization;
using palpate::control::TickInput;
using palpate::math::Vector3;
using palpate::object::ContactResult;

const Vector3<> design(1000.0, 1000.0, 1000.0);
const Vector3<> none = Vector3<>::Zero();

StiffnessNormalization::Forces apply(StiffnessNormalization& normalization, const ContactResult& contact, const Vector3<>& reference) {
  return normalization.apply({reference, contact.force, contact.deflection, none, none, 1e3, 0.0, contact, none.data(), none, 0.0});
}

ContactResult contact_at(double depth, double stiffness, const Vector3<>& normal, const Vector3<>& friction = Vector3<>::Zero()) {
  ContactResult out;
  out.normal = normal;
  out.depth = depth;
  out.stiffness = stiffness;
  out.touching = depth > 0.0;
  if (out.touching) out.force = -stiffness * depth * normal + friction;
  return out;
}

// Law: the scaled object force is the design stiffness times the depth, whatever the stiffness of the tick.
TEST(StiffnessNormalization, ScalesAlongTheNormalAndLeavesFriction) {
  StiffnessNormalization normalization(design);
  const Vector3<> normal(0.0, 0.6, 0.8), friction(0.3, 0.0, 0.0);
  for (const double stiffness : {50.0, 10e3, 700.0}) {
    const auto [reference, object] = apply(normalization, contact_at(1e-3, stiffness, normal, friction), -2.0 * normal);
    EXPECT_LT((object - (-1.0 * normal + friction)).norm(), 1e-12);
    EXPECT_LT((reference - (-2.0 * 1000.0 / stiffness * normal)).norm(), 1e-9);
  }
}

TEST(StiffnessNormalization, ScalesASpringPerAxisAndLeavesAnAxisWithoutStiffness) {
  StiffnessNormalization normalization(design);
  palpate::object::SpringWall spring({.kind = palpate::object::SpringWall::Kind::point, .stiffness = Vector3<>(500.0, 4000.0, 0.0)});
  const ContactResult contact = spring.step({{1e-3, 1e-3, 1e-3}, 1e3});
  const auto [reference, object] = apply(normalization, contact, {1.0, 1.0, 1.0});
  EXPECT_LT((object - Vector3<>(1.0, 1.0, 0.0)).norm(), 1e-12);
  EXPECT_LT((reference - Vector3<>(2.0, 0.25, 1.0)).norm(), 1e-12);
}

// Law: outside a wall the signed depth continues the spring while the reference presses, and only then.
TEST(StiffnessNormalization, ContinuesOutsideAWallWhileTheReferencePresses) {
  StiffnessNormalization normalization(design);
  const Vector3<> normal = Vector3<>::UnitZ();
  const ContactResult outside = contact_at(-2e-3, 4000.0, normal);
  const auto pressed = apply(normalization, outside, {0.0, 0.0, -4.0});
  EXPECT_NEAR(pressed.object[2], 2.0, 1e-12);
  EXPECT_NEAR(pressed.reference[2], -1.0, 1e-12);
  EXPECT_EQ(apply(normalization, outside, none).object, none);
  EXPECT_EQ(apply(normalization, outside, {0.0, 0.0, 1.0}).object, none);
}

TEST(StiffnessNormalization, HoldsTheLastContactAndPassesForcesBeforeTheFirst) {
  StiffnessNormalization normalization(design);
  const Vector3<> pull(1.0, 0.0, -1.0);
  EXPECT_EQ(apply(normalization, ContactResult{}, pull).reference, pull);
  static_cast<void>(apply(normalization, contact_at(1e-3, 500.0, Vector3<>::UnitZ()), pull));
  EXPECT_LT((apply(normalization, ContactResult{}, pull).reference - Vector3<>(1.0, 0.0, -2.0)).norm(), 1e-12);
  normalization.reset();
  EXPECT_EQ(apply(normalization, ContactResult{}, pull).reference, pull);
}

// In contact the deflection is the force over the stiffness, also of a damped force; the depth replaces it outside only.
TEST(StiffnessNormalization, ADampedForceInContactIsScaledAsItIs) {
  StiffnessNormalization normalization(design);
  ContactResult contact = contact_at(1e-3, 200.0, Vector3<>::UnitZ());
  contact.force.z() -= 0.3;
  EXPECT_NEAR(apply(normalization, contact, {0.0, 0.0, -1.0}).object.z(), -0.5 * 1000.0 / 200.0, 1e-12);
}

// A contact that states a normal without a stiffness is scaled by the last one, and after a reset by none.
TEST(StiffnessNormalization, TheLastStiffnessHoldsUntilAReset) {
  StiffnessNormalization normalization(design);
  const Vector3<> reference(0.0, 0.0, -1.0);
  apply(normalization, contact_at(1e-3, 200.0, Vector3<>::UnitZ()), reference);
  ContactResult unknown = contact_at(1e-3, 0.0, Vector3<>::UnitX());
  EXPECT_NEAR(apply(normalization, unknown, reference).reference.z(), -5.0, 1e-12);
  normalization.reset();
  EXPECT_NEAR(apply(normalization, unknown, reference).reference.z(), -1.0, 1e-12);
}

}  // namespace
