// Invalid meshes, surfaces and tips are ignored without undefined behavior, and temporaries do not compile.
#include <gtest/gtest.h>

#include <limits>
#include <palpate/mesh/mesh_updater.hpp>
#include <palpate/mesh/proxy.hpp>
#include <type_traits>

#include "support/mesh_shapes.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::AabbTree;
using palpate::mesh::Contact;
using palpate::mesh::ForceShading;
using palpate::mesh::MeshUpdater;
using palpate::mesh::PointProxy;
using palpate::mesh::Proxy;
using palpate::mesh::SphereProxy;
using palpate::mesh::Surface;
using palpate::mesh::SurfaceField;
using palpate::mesh::Triangle;
using palpate::mesh::TriangleMesh;
using shapes::Shape;

// Types that keep a reference, or are useless without the object they are built from, reject temporaries.
using Mesh = const TriangleMesh&;
using Tree = const AabbTree&;
using Field = const SurfaceField&;
static_assert(std::is_constructible_v<Proxy, Mesh, Tree, Field, double>);
static_assert(!std::is_constructible_v<Proxy, TriangleMesh, Tree, Field, double>);
static_assert(!std::is_constructible_v<Proxy, Mesh, AabbTree, Field, double>);
static_assert(!std::is_constructible_v<Proxy, Mesh, Tree, SurfaceField, double>);
static_assert(!std::is_constructible_v<Proxy, Mesh, Tree, SurfaceField>);
static_assert(!std::is_constructible_v<Proxy, TriangleMesh, AabbTree, SurfaceField, double>);
static_assert(!std::is_constructible_v<Proxy, const TriangleMesh, Tree, Field, double>);
static_assert(std::is_constructible_v<PointProxy, Mesh, Tree>);
static_assert(!std::is_constructible_v<PointProxy, TriangleMesh, Tree>);
static_assert(!std::is_constructible_v<PointProxy, Mesh, AabbTree>);
static_assert(!std::is_constructible_v<PointProxy, TriangleMesh, AabbTree>);
static_assert(std::is_constructible_v<SphereProxy, Mesh, Tree, double>);
static_assert(!std::is_constructible_v<SphereProxy, TriangleMesh, Tree, double>);
static_assert(!std::is_constructible_v<SphereProxy, Mesh, AabbTree, double>);
static_assert(std::is_constructible_v<AabbTree, Mesh>);
static_assert(!std::is_constructible_v<AabbTree, TriangleMesh>);
static_assert(std::is_constructible_v<SurfaceField, Surface, Mesh>);
static_assert(!std::is_constructible_v<SurfaceField, Surface, TriangleMesh>);
static_assert(std::is_constructible_v<MeshUpdater, Mesh>);
static_assert(!std::is_constructible_v<MeshUpdater, TriangleMesh>);
static_assert(!std::is_constructible_v<ForceShading, TriangleMesh, double>);

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

Shape tetrahedron_shape() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

std::vector<Shape> unusable_shapes() {
  std::vector<Shape> list(12, tetrahedron_shape());
  list[0] = {};
  list[1].triangles.clear();
  list[2].vertices.clear();
  list[3].vertices[1][2] = not_a_number;
  list[4].vertices[4][0] = -infinite;
  list[5].triangles[2][1] = 5;
  list[6].triangles[2][1] = -1;
  list[7].triangles.push_back({1, 1, 2});
  list[8].triangles.push_back({1, 3, 0});
  list[9].triangles.push_back({0, 1, 4});
  std::swap(list[10].triangles[0][0], list[10].triangles[0][1]);
  list[11].triangles.pop_back();
  return list;
}

void expect_untouched(Proxy& proxy) {
  const Vector3<> tips[] = {{0.2, 0.2, 2.0}, {0.2, 0.2, 0.2}, {0.2, 0.2, -0.1}, {1e149, 0.0, 0.0}};
  for (const Vector3<>& tip : tips) {
    const Contact& c = proxy.step(tip);
    EXPECT_FALSE(c.touching);
    EXPECT_EQ(c.face, TriangleMesh::none);
    EXPECT_EQ(c.position, tip);
    EXPECT_TRUE(c.force.isZero());
    proxy.reattach(proxy.attach());
  }
  EXPECT_EQ(proxy.invalid_input_count(), 0);
}

TEST(InvalidInput, UnusableMeshIsNeverTouched) {
  int number = 0;
  for (const Shape& s : unusable_shapes()) {
    SCOPED_TRACE(number++);
    TriangleMesh mesh(s.vertices, s.triangles);
    ASSERT_FALSE(mesh.usable());
    AabbTree tree(mesh);
    EXPECT_TRUE(tree.empty());
    const Vector3<> x(0.2, 0.2, 0.2);
    EXPECT_FALSE(tree.nearest(mesh, x).found());
    EXPECT_EQ(tree.nearest(mesh, x).face, TriangleMesh::none);
    EXPECT_FALSE(tree.overlap_sphere(x, 1.0, [](std::int32_t) { ADD_FAILURE(); }));
    EXPECT_FALSE(tree.sweep_sphere(x, -x, 1.0, [](std::int32_t, double&) { ADD_FAILURE(); }));
    for (const double shading : {0.0, 0.4}) {
      Surface surface;
      surface.shading = shading;
      const SurfaceField field(surface, mesh);
      EXPECT_FALSE(field.usable());
      for (const double radius : {0.0, 0.1}) {
        Proxy proxy(mesh, tree, field, radius);
        expect_untouched(proxy);
      }
    }
    if (s.vertices.empty()) continue;
    MeshUpdater updater(mesh);
    const std::int32_t vertex = 0;
    const Vector3<> to(0.01, 0.02, 0.03);
    updater.move(mesh, tree, &vertex, &to, 1);
  }
}

TEST(InvalidInput, InvalidSurfaceIsNeverTouched) {
  const Shape shape = shapes::ball(3, 0.5);
  const TriangleMesh mesh(shape.vertices, shape.triangles);
  const AabbTree tree(mesh);
  std::vector<Surface> surfaces(9);
  surfaces[0].stiffness = {100.0, 200.0};
  surfaces[1].stiffness.clear();
  surfaces[2].damping = {1.0, 2.0, 3.0};
  surfaces[3].stiffness = {not_a_number};
  surfaces[4].stiffness = {-1.0};
  surfaces[5].dynamic_friction = 0.5;
  surfaces[6].period = 0.0;
  surfaces[7].shading = not_a_number;
  surfaces[8].stiffness.assign(mesh.vertices().size() - 1, 100.0);
  surfaces[8].field = palpate::mesh::FieldKind::continuous;
  for (const Surface& s : surfaces) {
    EXPECT_FALSE(SurfaceField::is_valid(s, mesh));
    const SurfaceField field(s, mesh);
    EXPECT_FALSE(field.usable());
    EXPECT_EQ(field.stiffness_at(mesh, 0, mesh.face(0).corner[0]).stiffness, 0.0);
    EXPECT_EQ(field.damping_at(mesh, 0, mesh.face(0).corner[0]), 0.0);
    for (const double radius : {0.0, 0.1}) {
      Proxy proxy(mesh, tree, field, radius);
      expect_untouched(proxy);
    }
  }
}

TEST(InvalidInput, DefaultFieldFitsEveryMesh) {
  const Shape shape = shapes::ball(3, 0.5);
  const TriangleMesh mesh(shape.vertices, shape.triangles);
  const AabbTree tree(mesh);
  const SurfaceField field;
  Proxy proxy(mesh, tree, field);
  proxy.step({0.0, 0.0, 1.0});
  EXPECT_GT(proxy.step({0.0, 0.0, 0.45}).force[2], 0.0);
}

TEST(InvalidInput, InvalidRadiusCountsAsZero) {
  const shapes::World world(shapes::ball(3, 0.5));
  for (const double radius : {-1.0, not_a_number, infinite}) EXPECT_EQ(world.proxy(radius).radius(), 0.0);
}

TEST(InvalidInput, HugeTipKeepsTheLastContact) {
  for (const bool open : {false, true}) {
    const Shape shape = open ? shapes::sheet(4, 1.0, [](double, double) { return 0.5; }) : shapes::ball(3, 0.5);
    const shapes::World world(shape, {}, open);
    for (const double radius : {0.0, 0.05}) {
      Proxy proxy = world.proxy(radius);
      EXPECT_EQ(proxy.step({0.0, 1e200, 0.0}).face, TriangleMesh::none) << "first tick";
      proxy.step({0.1, 0.05, 1.0});
      const Contact before = proxy.step({0.1, 0.05, 0.4});
      ASSERT_TRUE(before.touching);
      std::int64_t count = 1;
      for (const double huge : {1.1e150, 1e155, 1e200, std::numeric_limits<double>::max(), infinite, not_a_number}) {
        for (const double sign : {-1.0, 1.0}) {
          const Contact& c = proxy.step({0.1, sign * huge, 0.4});
          EXPECT_EQ(c.position, before.position);
          EXPECT_EQ(c.face, before.face);
          EXPECT_EQ(proxy.invalid_input_count(), ++count);
        }
      }
      EXPECT_EQ(proxy.step({0.1, 0.05, 0.4}).force, before.force);
    }
  }
}

TEST(InvalidInput, TipsOfAnyMagnitudeStayInBounds) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> u(-1.0, 1.0), exponent(-20.0, 160.0);
  for (const double radius : {0.0, 0.03, 1e160}) {
    for (const double shading : {0.0, 0.4}) {
      Surface surface;
      surface.static_friction = 0.5;
      surface.shading = shading;
      const shapes::World world(shapes::ball(3, 0.5, 0.2), surface);
      Proxy proxy = world.proxy(radius);
      for (int k = 0; k < 1000; ++k) {
        const double scale = k % 3 == 0 ? std::pow(10.0, exponent(random)) : 1.0;
        const Contact& c = proxy.step(scale * Vector3<>(u(random), u(random), u(random)));
        ASSERT_LT(c.face, world.mesh.size());
        ASSERT_GE(c.face, TriangleMesh::none);
        const Vector3<> x = scale * Vector3<>(u(random), u(random), u(random));
        ASSERT_LT(world.tree.nearest(world.mesh, x).face, world.mesh.size());
        if (k % 100 == 99) proxy.reset();
      }
    }
  }
}

}  // namespace
