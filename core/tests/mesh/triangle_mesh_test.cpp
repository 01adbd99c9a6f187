// Mesh defects, adjacency, repair, bounding volume hierarchy and sphere sweeps.
#include <gtest/gtest.h>

#include <limits>
#include <palpate/mesh/mesh_repair.hpp>

#include "support/mesh_shapes.hpp"

namespace {

using palpate::math::Vector3;
using palpate::mesh::MeshFault;
using palpate::mesh::Triangle;
using palpate::mesh::TriangleMesh;
using shapes::Shape;

const std::vector<Vector3<>> corners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
const std::vector<Triangle> tetrahedron = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

MeshFault fault(std::vector<Vector3<>> v, std::vector<Triangle> t, bool open = false) {
  return TriangleMesh(std::move(v), std::move(t), open).fault();
}

TEST(TriangleMesh, DiagnosesEachFault) {
  EXPECT_EQ(fault(corners, tetrahedron), MeshFault::none);
  EXPECT_EQ(fault(corners, {}), MeshFault::empty);
  EXPECT_EQ(fault({}, tetrahedron), MeshFault::empty);
  auto bad = corners;
  bad[1][2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault(bad, tetrahedron), MeshFault::not_finite);
  auto t = tetrahedron;
  t[2][1] = 5;
  EXPECT_EQ(fault(corners, t), MeshFault::index_out_of_range);
  t[2][1] = -1;
  EXPECT_EQ(fault(corners, t), MeshFault::index_out_of_range);
  t = tetrahedron;
  t.push_back({1, 1, 2});
  EXPECT_EQ(fault(corners, t), MeshFault::degenerate);
  EXPECT_EQ(fault({{0, 0, 0}, {1, 0, 0}, {3, 0, 0}}, {{0, 1, 2}}, true), MeshFault::degenerate) << "collinear";
  t = tetrahedron;
  t.push_back({1, 3, 0});
  EXPECT_EQ(fault(corners, t), MeshFault::duplicate);
  t = tetrahedron;
  t.push_back({0, 1, 4});
  EXPECT_EQ(fault(corners, t), MeshFault::non_manifold);
  t = tetrahedron;
  std::swap(t[0][0], t[0][1]);
  EXPECT_EQ(fault(corners, t), MeshFault::mixed_winding);
  t = tetrahedron;
  t.pop_back();
  EXPECT_EQ(fault(corners, t), MeshFault::open);
  EXPECT_EQ(fault(corners, t, true), MeshFault::none) << "open meshes allowed";
}

TEST(TriangleMesh, FaultsDoNotDependOnTheUnit) {
  for (const double scale : {1e-6, 1.0, 1e6}) {
    auto v = corners;
    for (auto& x : v) x *= scale;
    EXPECT_EQ(fault(v, tetrahedron), MeshFault::none) << scale;
    EXPECT_NEAR(TriangleMesh(v, tetrahedron).diagnosis().volume, scale * scale * scale / 6.0, 1e-15 * scale * scale * scale);
  }
}

TEST(TriangleMesh, TwinsAreMutualAndShareTheEdge) {
  const Shape s = shapes::ball(5, 0.5, 0.1);
  const TriangleMesh mesh(s.vertices, s.triangles);
  ASSERT_TRUE(mesh.usable());
  EXPECT_TRUE(mesh.closed());
  EXPECT_EQ(mesh.diagnosis().components, 1);
  for (std::int32_t h = 0; h < 3 * mesh.size(); ++h) {
    const auto i = static_cast<std::size_t>(h % 3);
    const std::int32_t twin = mesh.face(h / 3).neighbor[i];
    const auto j = static_cast<std::size_t>(twin % 3);
    EXPECT_EQ(mesh.face(twin / 3).neighbor[j], h);
    EXPECT_EQ(mesh.face(twin / 3).vertex[j], mesh.face(h / 3).vertex[(i + 1) % 3]);
    EXPECT_EQ(mesh.face(twin / 3).vertex[(j + 1) % 3], mesh.face(h / 3).vertex[i]);
  }
}

TEST(MeshRepair, MakesABrokenMeshUsable) {
  Shape s = shapes::ball(4, 0.5);
  std::mt19937_64 random(1);
  for (std::size_t f = 0; f < s.triangles.size(); ++f)
    if (random() % 2 == 0) std::swap(s.triangles[f][0], s.triangles[f][1]);
  s.triangles.push_back(s.triangles[7]);
  s.triangles.push_back({3, 3, 4});
  EXPECT_NE(fault(s.vertices, s.triangles), MeshFault::none);
  const palpate::mesh::RepairReport report = palpate::mesh::repair_mesh(s.vertices, s.triangles);
  EXPECT_EQ(report.dropped_degenerate, 1);
  EXPECT_EQ(report.dropped_duplicate, 1);
  EXPECT_GT(report.flipped, 0);
  const TriangleMesh mesh(s.vertices, s.triangles);
  EXPECT_EQ(mesh.fault(), MeshFault::none);
  EXPECT_GT(mesh.diagnosis().volume, 0.0);
}

TEST(MeshRepair, FindsSelfIntersections) {
  Shape s = shapes::ball(3, 0.5);
  Shape other = shapes::moved(s, [](const Vector3<>& v) { return Vector3<>(v + Vector3<>(0.4, 0.03, 0.01)); });
  {
    const shapes::World world(s);
    EXPECT_EQ(palpate::mesh::self_intersections(world.mesh, world.tree).count, 0);
  }
  const auto count = static_cast<std::int32_t>(s.vertices.size());
  s.vertices.insert(s.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const Triangle& t : other.triangles) s.triangles.push_back({t[0] + count, t[1] + count, t[2] + count});
  const shapes::World world(s);
  EXPECT_EQ(world.mesh.diagnosis().components, 2);
  EXPECT_GT(palpate::mesh::self_intersections(world.mesh, world.tree).count, 0);
}

TEST(AabbTree, NearestEqualsBruteForce) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (const Shape& s :
       {shapes::ball(8, 0.5, 0.3), shapes::box({0.5, 0.5, 1e-4}, 5), Shape{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}}) {
    const shapes::World world(s, {}, true);
    for (int k = 0; k < 200; ++k) {
      const Vector3<> x(u(random), u(random), u(random));
      const auto near = world.tree.nearest(world.mesh, x);
      EXPECT_NEAR(std::sqrt(near.distance2), shapes::reference_distance(world.mesh, x).distance, 1e-14);
      EXPECT_EQ(world.tree.nearest(world.mesh, x, 0.25 * near.distance2).face, TriangleMesh::none);
    }
  }
}

TEST(AabbTree, SweepVisitsEveryFaceOnASegment) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const shapes::World world(shapes::ball(8, 0.5, 0.3));
  int intersections = 0;
  for (int k = 0; k < 300; ++k) {
    const Vector3<> from(u(random), u(random), u(random)), motion = Vector3<>(u(random), u(random), u(random)) - from;
    std::vector<bool> visited(static_cast<std::size_t>(world.mesh.size()), false);
    world.tree.sweep_sphere(from, motion, 0.0, [&](std::int32_t f, double&) { visited[static_cast<std::size_t>(f)] = true; });
    for (std::int32_t f = 0; f < world.mesh.size(); ++f) {
      const palpate::mesh::Face& face = world.mesh.face(f);
      if (face.height(from) * face.height(from + motion) < 0.0 && palpate::mesh::line_intersects(face, from, motion)) {
        ++intersections;
        EXPECT_TRUE(visited[static_cast<std::size_t>(f)]);
      }
    }
  }
  EXPECT_GT(intersections, 100);
}

TEST(AabbTree, RefitFollowsMovedVertices) {
  const Shape s = shapes::ball(8, 0.5, 0.2);
  TriangleMesh mesh(s.vertices, s.triangles);
  palpate::mesh::AabbTree tree(mesh);
  std::vector<std::int32_t> moved_faces;
  for (std::int32_t f = 0; f < mesh.size(); ++f)
    for (const std::int32_t v : mesh.face(f).vertex)
      if (mesh.vertices()[static_cast<std::size_t>(v)][2] > 0.4) {
        moved_faces.push_back(f);
        break;
      }
  for (std::size_t v = 0; v < s.vertices.size(); ++v)
    if (s.vertices[v][2] > 0.4) mesh.set_vertex(static_cast<std::int32_t>(v), s.vertices[v] + Vector3<>(0.1, 0.2, 0.3));
  for (const std::int32_t f : moved_faces) ASSERT_TRUE(mesh.update_face(f));
  tree.refit(mesh, moved_faces.begin(), moved_faces.end());
  const palpate::mesh::AabbTree rebuilt(mesh);
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (int k = 0; k < 200; ++k) {
    const Vector3<> x(u(random), u(random), u(random));
    EXPECT_EQ(tree.nearest(mesh, x).distance2, rebuilt.nearest(mesh, x).distance2);
  }
}

TEST(SweepSphere, StopsAtADistanceOfOneRadius) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const shapes::World world(Shape{{{0, 0, 0}, {0.5, 0.1, 0}, {0.1, 0.4, 0.2}}, {{0, 1, 2}}}, {}, true);
  const palpate::mesh::Face& face = world.mesh.face(0);
  int hits = 0;
  for (int k = 0; k < 5000; ++k) {
    const Vector3<> from(u(random), u(random), u(random)), motion = 1.5 * Vector3<>(u(random), u(random), u(random));
    const double radius = 0.2;
    const auto distance = [&](double t) {
      return (palpate::mesh::nearest_point(face, from + t * motion).point - (from + t * motion)).norm();
    };
    if (distance(0.0) <= radius) continue;
    const palpate::mesh::SweepHit touch = palpate::mesh::sweep_sphere(face, from, motion, radius);
    const double end = touch.hit ? touch.time : 1.0;
    for (int i = 0; i <= 50; ++i) ASSERT_GE(distance(end * i / 50.0), radius * (1.0 - 1e-9)) << k;
    if (!touch.hit) continue;
    ++hits;
    EXPECT_NEAR(distance(end), radius, 1e-12);
    EXPECT_LT((from + end * motion - radius * touch.normal - touch.point).norm(), 1e-12);
  }
  EXPECT_GT(hits, 200);
}

}  // namespace
