// Contact points of a triangulated surface.
#include <gtest/gtest.h>

#include <palpate/deformable/contact/patch_points.hpp>

#include "support/contact_bodies.hpp"

namespace {

using palpate::deformable::LayerModulus, palpate::deformable::PatchPoints, palpate::math::Vector3;

contact_bodies::SurfaceBody body_on(const shapes::Shape& shape) {
  return contact_bodies::soft(shape, 1e4, 1e-4, 5e-3);
}

struct Point {
  Vector3<> offset, normal;
  double stiffness;
};
Point point(const PatchPoints& points, std::size_t q) {
  const auto at = [&](std::size_t c) { return static_cast<double>(points.coordinate(c)[q]); };
  return {{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, at(6)};
}

/// Area of the patch of each vertex: a third of its triangles, m^2.
std::vector<double> patch_areas(const contact_bodies::SurfaceBody& body) {
  std::vector<double> area(body.surface.vertices.size(), 0.0);
  for (const auto& t : body.surface.triangles)
    for (const std::int32_t v : t)
      area[static_cast<std::size_t>(v)] +=
          (body.vertex(t[1]) - body.vertex(t[0])).cross(body.vertex(t[2]) - body.vertex(t[0])).norm() / 6.0;
  return area;
}

// E* A / (beta b) with the radius b of a circle of the patch's area A, and the modulus of the kind of tip.
TEST(PatchPoints, TheirStiffnessIsThatOfTheLayerOverThePatch) {
  auto body = body_on(shapes::ball(4, 10e-3));
  body.surface.modulus.assign(body.surface.modulus.size(), {1e4, 3e4});
  const std::vector<double> area = patch_areas(body);
  for (const int per_corner : {1, 3}) {
    const bool round = per_corner == 1;
    const PatchPoints points(body.surface, round ? &LayerModulus::round : &LayerModulus::flat, 0.5, per_corner);
    for (std::int32_t i = 0; i < points.size(); ++i) {
      double sum = 0.0;
      for (std::size_t q = points.begin(i); q < points.end(i); ++q) sum += point(points, q).stiffness;
      const double of_node = area[static_cast<std::size_t>(i)];
      EXPECT_NEAR(sum, (round ? 1e4 : 3e4) * of_node / (0.5 * std::sqrt(of_node / M_PI)), 1e-5 * sum);
    }
  }
}

TEST(PatchPoints, LieOnTheSphereThatTheTrianglesApproximate) {
  const double radius = 10e-3;
  const shapes::Shape ball = shapes::ball(4, radius);
  const auto body = body_on(ball);
  double flat = 0.0, curved = 0.0;
  for (const auto& t : body.surface.triangles)
    flat = std::max(flat, radius - ((body.vertex(t[0]) + body.vertex(t[1]) + body.vertex(t[2])) / 3.0).norm());
  for (std::int32_t i = 0; i < body.patches.round.size(); ++i)
    for (std::size_t q = body.patches.round.begin(i); q < body.patches.round.end(i); ++q) {
      const Point p = point(body.patches.round, q);
      if (p.stiffness == 0.0) continue;
      const Vector3<> x = body.vertex(i) + p.offset;
      curved = std::max(curved, std::abs(x.norm() - radius));
      EXPECT_GT(p.normal.dot(x.normalized()), 0.999);
    }
  EXPECT_GT(flat, 0.015 * radius);
  EXPECT_LT(curved, 0.1 * flat);
}

// Along an edge between a hill and a hollow the normals at both ends lean the same way.
TEST(PatchPoints, StayInTheirPatchesOnAnUndulatingSurface) {
  const auto body = body_on(shapes::ball(14, 10e-3, 0.02));
  const std::vector<double> area = patch_areas(body);
  for (const auto* points : {&body.patches.round, &body.patches.flat})
    for (std::int32_t i = 0; i < points->size(); ++i) EXPECT_LT(points->reach(i), 0.7 * std::sqrt(area[static_cast<std::size_t>(i)])) << i;
}

TEST(PatchPoints, StayOnTheFacesOfABoxAndFixedVerticesHaveNone) {
  const shapes::Shape box = shapes::box({10e-3, 8e-3, 6e-3}, 3);
  auto body = body_on(box);
  for (std::int32_t i = 0; i < body.patches.flat.size(); ++i)
    for (std::size_t q = body.patches.flat.begin(i); q < body.patches.flat.end(i); ++q) {
      const Point p = point(body.patches.flat, q);
      if (p.stiffness == 0.0) continue;
      const Vector3<> scaled = (body.vertex(i) + p.offset).cwiseAbs().cwiseQuotient(Vector3<>(10e-3, 8e-3, 6e-3));
      EXPECT_NEAR(scaled.maxCoeff(), 1.0, 1e-6);
      EXPECT_NEAR(p.normal.cwiseAbs().maxCoeff(), 1.0, 1e-6);
    }
  body.surface.node[0] = -1;
  const PatchPoints points(body.surface, &LayerModulus::round, 0.85, 1);
  EXPECT_EQ(points.begin(0), points.end(0));
}

}  // namespace
