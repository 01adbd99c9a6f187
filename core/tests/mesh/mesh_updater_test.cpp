// Local updates of a moving mesh equal a rebuild, and proxies follow the surface.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numeric>
#include <palpate/mesh/mesh_updater.hpp>

#include "support/mesh_shapes.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::Contact;
using palpate::mesh::MeshUpdater;
using palpate::mesh::Proxy;
using palpate::mesh::Surface;
using palpate::mesh::SurfaceAttachment;
using palpate::mesh::TriangleMesh;
using shapes::Shape;
using shapes::World;

std::vector<std::int32_t> all_of(const TriangleMesh& mesh) {
  std::vector<std::int32_t> list(mesh.vertices().size());
  std::iota(list.begin(), list.end(), 0);
  return list;
}

/// Move vertices of the mesh and let the proxy follow.
void move(World& world, MeshUpdater& updater, Proxy& proxy, const std::vector<std::int32_t>& which, const std::vector<Vector3<>>& to) {
  const SurfaceAttachment attachment = proxy.attach();
  ASSERT_EQ(updater.move(world.mesh, world.tree, which.data(), to.data(), which.size()), TriangleMesh::none);
  world.field.refit(world.mesh, updater.affected_faces().begin(), updater.affected_faces().end());
  proxy.reattach(attachment);
}

TEST(MeshUpdater, LocalUpdatesEqualARebuild) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const Shape shape = shapes::ball(8, 0.5, 0.1);
  Surface surface;
  surface.shading = 0.4;
  World world(shape, surface);
  MeshUpdater updater(world.mesh);
  for (int round = 0; round < 20; ++round) {
    std::vector<std::int32_t> which;
    std::vector<Vector3<>> to;
    for (int i = 0; i < 30; ++i) {
      which.push_back(static_cast<std::int32_t>(random() % shape.vertices.size()));
      to.push_back(world.mesh.vertices()[static_cast<std::size_t>(which.back())] + 0.005 * Vector3<>(u(random), u(random), u(random)));
    }
    ASSERT_EQ(updater.move(world.mesh, world.tree, which.data(), to.data(), which.size()), TriangleMesh::none);
    world.field.refit(world.mesh, updater.affected_faces().begin(), updater.affected_faces().end());
    EXPECT_LT(updater.moved_faces().size(), 250U) << "local update";
    const World rebuilt({world.mesh.vertices(), shape.triangles}, surface);
    for (std::size_t v = 0; v < shape.vertices.size(); ++v)
      ASSERT_LT((world.mesh.vertex_normal(static_cast<std::int32_t>(v)) - rebuilt.mesh.vertex_normal(static_cast<std::int32_t>(v))).norm(),
                1e-12);
    for (int k = 0; k < 200; ++k) {
      const Vector3<> x(u(random), u(random), u(random));
      const auto here = world.tree.nearest(world.mesh, x), there = rebuilt.tree.nearest(rebuilt.mesh, x);
      ASSERT_DOUBLE_EQ(here.distance2, there.distance2);
      const Vector3<> foot = here.at.point;
      ASSERT_LT(
          (world.field.shading().normal_at(world.mesh, here.face, foot) - rebuilt.field.shading().normal_at(rebuilt.mesh, here.face, foot))
              .norm(),
          1e-12);
    }
  }
}

TEST(MeshUpdater, RejectsDegenerateFacesWithoutChanges) {
  const Shape shape = shapes::ball(4, 0.5);
  World world(shape);
  MeshUpdater updater(world.mesh);
  const palpate::mesh::Face face = world.mesh.face(17);
  const std::int32_t which[] = {face.vertex[0], face.vertex[1]};
  const Vector3<> to[] = {face.corner[2], Vector3<>(0.5 * (face.corner[0] + face.corner[2]))};
  EXPECT_NE(updater.move(world.mesh, world.tree, which, to, 2), TriangleMesh::none);
  for (std::size_t v = 0; v < shape.vertices.size(); ++v) EXPECT_EQ(world.mesh.vertices()[v], shape.vertices[v]);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(world.mesh.face(17).corner[i], face.corner[i]);
}

TEST(MeshUpdater, ProxyFollowsARigidMotion) {
  // Property: the force rotates with mesh and tip.
  Surface surface;
  surface.static_friction = 0.6;
  surface.dynamic_friction = 0.4;
  for (const double shading : {0.0, 0.4})
    for (const double radius : {0.0, 0.02}) {
      surface.shading = shading;
      const Shape shape = shapes::ball(6, 0.5, 0.1);
      World still(shape, surface), moving(shape, surface);
      MeshUpdater updater(moving.mesh);
      Proxy one = still.proxy(radius), two = moving.proxy(radius);
      const std::vector<std::int32_t> which = all_of(moving.mesh);
      for (int k = 0; k < 60; ++k) {
        const double a = 0.02 * k;
        const Vector3<> tip =
            (0.43 + 0.015 * std::cos(0.05 * k)) * Vector3<>(std::cos(a), std::sin(a), 0.3 * std::sin(3.0 * a)).normalized();
        const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.004 * k, Vector3<>(1, 2, 3).normalized()).toRotationMatrix();
        const Vector3<> shift(0.001 * k, -0.0005 * k, 0.0);
        std::vector<Vector3<>> to;
        for (const Vector3<>& v : shape.vertices) to.emplace_back(turn * v + shift);
        move(moving, updater, two, which, to);
        const Contact& here = one.step(tip);
        const Contact& there = two.step(turn * tip + shift);
        ASSERT_TRUE(there.touching) << k;
        ASSERT_LT((turn * here.force - there.force).norm(), 1e-9 * here.force.norm()) << k << " " << radius << " " << shading;
      }
    }
}

TEST(MeshUpdater, StickingSurfaceDragsTheTip) {
  // Infinite friction: the spring is stretched by the displacement of the surface.
  Surface surface;
  surface.static_friction = surface.dynamic_friction = std::numeric_limits<double>::infinity();
  surface.tangential = 1000.0;
  for (const double radius : {0.0, 0.05}) {
    const Shape shape = shapes::box({1.0, 1.0, 0.5}, 6);
    World world(shape, surface);
    MeshUpdater updater(world.mesh);
    Proxy proxy = world.proxy(radius);
    proxy.step({0.11, 0.02, 1.0});
    const Vector3<> tip(0.11, 0.02, 0.49 + radius);
    proxy.step(tip);
    std::vector<Vector3<>> to;
    for (const Vector3<>& v : shape.vertices) to.emplace_back(v + Vector3<>(0.03, -0.02, 0.004));
    move(world, updater, proxy, all_of(world.mesh), to);
    const Contact& c = proxy.step(tip);
    EXPECT_LT((c.position - Vector3<>(0.14, 0.0, 0.504 + radius)).norm(), 1e-12) << radius;
    EXPECT_LT((c.force - Vector3<>(30.0, -20.0, 14.0)).norm(), 1e-9) << radius;
  }
}

TEST(MeshUpdater, SurfaceMovingOverTheTipMakesContact) {
  // A ball expands, contracts and undulates around a fixed tip. Contact holds exactly while the tip
  // is inside.
  for (const double shading : {0.0, 0.4})
    for (const double radius : {0.0, 0.02}) {
      Surface surface;
      surface.shading = shading;
      const Shape shape = shapes::ball(5, 0.5);
      World world(shape, surface);
      MeshUpdater updater(world.mesh);
      Proxy proxy = world.proxy(radius);
      const Vector3<> tip(0.3, 0.25, 0.31);
      const std::vector<std::int32_t> which = all_of(world.mesh);
      int in = 0;
      for (int k = 0; k < 160; ++k) {
        std::vector<Vector3<>> to;
        for (const Vector3<>& v : shape.vertices)
          to.emplace_back((1.0 + 0.06 * std::sin(0.05 * k) + 0.01 * std::sin(8.0 * v[0] + 0.3 * k)) * v);
        move(world, updater, proxy, which, to);
        const Contact& c = proxy.step(tip);
        const shapes::ReferenceDistance at = shapes::reference_distance(world.mesh, tip),
                                        center = shapes::reference_distance(world.mesh, c.position);
        const bool inside = at.inside || at.distance < radius;
        if (at.distance > 1e-9 && std::fabs(at.distance - radius) > 1e-9) {
          ASSERT_EQ(c.touching, inside) << k << " " << radius;
        }
        ASSERT_FALSE(center.inside && center.distance > 1e-12) << k;
        if (radius > 0.0) {
          ASSERT_GE(center.distance, radius * (1.0 - 1e-9)) << k;
        }
        in += inside ? 1 : 0;
      }
      EXPECT_GT(in, 20);
      EXPECT_LT(in, 140);
    }
}

}  // namespace
