// Elastic layer under a tip: force and stiffness are derivatives of its energy, also side by side in single precision.
#include <gtest/gtest.h>

#include <palpate/deformable/contact/float_pack.hpp>
#include <palpate/deformable/contact/layer_point.hpp>
#include <random>

namespace {

using palpate::deformable::LayerPoint, palpate::deformable::PointContact, palpate::deformable::Tip, palpate::math::Vector3;

struct PointCase {
  Tip tip;
  Vector3<> place, normal;
};

// Points in and around both tips, also above the center of the sphere.
PointCase draw_point_case(std::mt19937& random, Tip::Kind kind) {
  std::uniform_real_distribution<double> in(-1.0, 1.0);
  const auto vector = [&] { return Vector3<>(in(random), in(random), in(random)); };
  PointCase out;
  out.tip.kind = kind;
  out.tip.radius = 8e-3;
  out.tip.outward = vector().normalized();
  out.place = 9e-3 * vector();
  out.normal = (out.tip.outward + 0.8 * vector()).normalized();
  return out;
}

const LayerPoint<double> tested_layer{40.0, 2e-3, 1.0 / (0.06 * 2e-3)};

TEST(LayerPoint, TheForceIsTheNegativeGradientOfTheEnergy) {
  std::mt19937 random(3);
  int pressed = 0;
  for (const auto kind : {Tip::Kind::sphere, Tip::Kind::flat})
    for (int k = 0; k < 400; ++k) {
      const PointCase c = draw_point_case(random, kind);
      const auto energy = [&c](const Vector3<>& at) {
        return palpate::deformable::press_point<double>(c.tip, at, c.normal, tested_layer).energy;
      };
      const PointContact<double> contact = palpate::deformable::press_point<double>(c.tip, c.place, c.normal, tested_layer);
      constexpr double step = 1e-8;
      Vector3<> slope;
      for (int a = 0; a < 3; ++a)
        slope[a] = (energy(c.place + step * Vector3<>::Unit(a)) - energy(c.place - step * Vector3<>::Unit(a))) / (2.0 * step);
      const double size = contact.force.norm();
      EXPECT_LT((contact.force + slope).norm(), 1e-4 * size + 1e-9) << k;
      pressed += contact.energy > 0.0 ? 1 : 0;
      EXPECT_GE(contact.stiffness, 0.0);
      const bool missed = contact.stiffness > 0.0 && !palpate::deformable::may_be_in_sphere<double>(c.tip, c.place);
      EXPECT_FALSE(kind == Tip::Kind::sphere && missed);
    }
  EXPECT_GT(pressed, 150);
}

TEST(LayerPoint, PointsSideBySideAreThoseOneByOne) {
  using Pack = palpate::deformable::detail::FloatPack;
  std::mt19937 random(4);
  for (const auto kind : {Tip::Kind::sphere, Tip::Kind::flat})
    for (int k = 0; k < 200; ++k) {
      const PointCase c = draw_point_case(random, kind);
      Vector3<Pack> place, normal;
      std::array<Vector3<>, palpate::deformable::detail::float_lanes> places;
      for (std::size_t l = 0; l < places.size(); ++l) {
        places[l] = draw_point_case(random, kind).place;
        for (int a = 0; a < 3; ++a) {
          place[a].set(l, static_cast<float>(places[l][a]));
          normal[a].set(l, static_cast<float>(c.normal[a]));
        }
      }
      const auto packed = palpate::deformable::press_point<Pack>(
          c.tip, place, normal, {Pack(tested_layer.stiffness), Pack(tested_layer.radius), Pack(tested_layer.inverse)});
      for (std::size_t l = 0; l < places.size(); ++l) {
        const auto one = palpate::deformable::press_point<double>(c.tip, places[l], c.normal, tested_layer);
        EXPECT_NEAR(static_cast<double>(packed.energy[l]), one.energy, 1e-4 * one.energy + 1e-10);
        for (int a = 0; a < 3; ++a) EXPECT_NEAR(static_cast<double>(packed.force[a][l]), one.force[a], 1e-3 * one.force.norm() + 1e-5);
      }
    }
}

// Law: a flat end presses the points within its radius, which grows with the height over the end, and none beyond.
TEST(LayerPoint, AFlatEndReachesBeyondItsRadiusByItsFlare) {
  Tip tip;
  tip.kind = Tip::Kind::flat;
  tip.radius = 8e-3;
  const double height = 3e-3, flare = palpate::deformable::LayerConstants::flare * tested_layer.radius;
  const double edge = tip.radius + palpate::deformable::TipGeometry::flare_slope * flare * height / std::hypot(flare, height);
  for (const double share : {0.5, 0.99, 1.01, 1.5}) {
    const double distance = tip.radius + share * (edge - tip.radius);
    const Vector3<> place(distance, 0.0, height), normal = Vector3<>(1.0, 0.0, -1.0).normalized();
    EXPECT_EQ(palpate::deformable::press_point<double>(tip, place, -normal, tested_layer).energy > 0.0, share < 1.0) << share;
  }
}

}  // namespace
