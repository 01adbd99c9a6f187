// A proxy step does not allocate. The allocation functions of this program count every call.
#include <gtest/gtest.h>

#include <palpate/mesh/mesh_updater.hpp>

#include "support/allocations.hpp"
#include "support/mesh_shapes.hpp"

namespace {

TEST(ProxyNoAllocation, StepAndMeshUpdate) {
  palpate::mesh::Surface surface;
  surface.static_friction = 0.5;
  surface.dynamic_friction = 0.3;
  surface.viscous = 0.1;
  surface.damping = {0.1};
  surface.field = palpate::mesh::FieldKind::continuous;
  const shapes::Shape ball = shapes::ball(20, 0.5, 0.2);
  surface.stiffness.assign(ball.triangles.size(), 1000.0);
  for (std::size_t i = 0; i < surface.stiffness.size(); i += 3) surface.stiffness[i] = 300.0;
  for (const double shading : {0.0, 0.5}) {
    surface.shading = shading;
    shapes::World world(ball, surface);
    palpate::mesh::MeshUpdater updater(world.mesh);
    for (const double radius : {0.0, 0.02}) {
      palpate::mesh::Proxy proxy = world.proxy(radius);
      long touching_ticks = 0;
      const long before = allocations;
      for (int k = 0; k < 1000; ++k) {
        const double a = 0.1 * k, b = 0.065 * k;
        const palpate::math::Vector3<> motion(std::cos(a), std::sin(a), 0.8 * std::sin(b));
        touching_ticks += proxy.step((0.48 + 0.1 * std::sin(0.55 * k)) * motion.normalized()).touching ? 1 : 0;
        if (k % 10 > 0) continue;
        const palpate::mesh::SurfaceAttachment attachment = proxy.attach();
        const std::int32_t v = k % static_cast<int>(ball.vertices.size());
        const palpate::math::Vector3<> to = (1.0 + 0.01 * std::sin(a)) * ball.vertices[static_cast<std::size_t>(v)];
        updater.move(world.mesh, world.tree, &v, &to, 1);
        world.field.refit(world.mesh, updater.affected_faces().begin(), updater.affected_faces().end());
        proxy.reattach(attachment);
      }
      EXPECT_EQ(allocations - before, 0);
      EXPECT_GT(touching_ticks, 200);
      EXPECT_LT(touching_ticks, 980);
    }
  }
}

}  // namespace
