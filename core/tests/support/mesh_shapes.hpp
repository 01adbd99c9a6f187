#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <palpate/mesh/proxy.hpp>
#include <random>
#include <tuple>
#include <vector>

namespace shapes {

using palpate::math::Vector3;
using palpate::mesh::Triangle;

struct Shape {
  std::vector<Vector3<>> vertices;
  std::vector<Triangle> triangles;
};

/// Return an icosahedron with `n` divisions per edge, projected to the radius r (1 + bump sin 10x
/// sin 10y sin 10z) in the unit direction (x, y, z).
inline Shape ball(int n, double r, double bump = 0.0) {
  constexpr double p = std::numbers::phi;
  const std::vector<Vector3<>> c = {{-1, p, 0},  {1, p, 0},  {-1, -p, 0}, {1, -p, 0}, {0, -1, p},  {0, 1, p},
                                    {0, -1, -p}, {0, 1, -p}, {p, 0, -1},  {p, 0, 1},  {-p, 0, -1}, {-p, 0, 1}};
  const int faces[20][3] = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                            {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                            {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  Shape s;
  std::map<std::tuple<long, long, long>, int> indices;
  const auto vertex = [&](Vector3<> x) {
    x.normalize();
    const auto key = std::make_tuple(std::lround(x[0] * 1e7), std::lround(x[1] * 1e7), std::lround(x[2] * 1e7));
    const auto [it, is_new] = indices.emplace(key, static_cast<int>(s.vertices.size()));
    if (is_new) s.vertices.push_back(r * (1.0 + bump * std::sin(10 * x[0]) * std::sin(10 * x[1]) * std::sin(10 * x[2])) * x);
    return it->second;
  };
  for (const auto& f : faces)
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n - i; ++j) {
        const auto at = [&](int a, int b) {
          const auto corner = [&](int k) { return c[static_cast<std::size_t>(f[k])]; };
          return vertex((n - a - b) * corner(0) + a * corner(1) + b * corner(2));
        };
        s.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (j < n - i - 1) s.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  return s;
}

/// Return an open sheet z = height(x, y) over [-a, a]^2 with n x n squares.
template <class Height>
Shape sheet(int n, double a, Height height) {
  Shape s;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = a * (2.0 * i / n - 1.0), y = a * (2.0 * j / n - 1.0);
      s.vertices.emplace_back(x, y, height(x, y));
    }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int v = i * (n + 1) + j;
      s.triangles.push_back({v, v + n + 1, v + n + 2});
      s.triangles.push_back({v, v + n + 2, v + 1});
    }
  return s;
}

/// Return a box with half extents `half` and n x n squares per side.
inline Shape box(const Vector3<>& half, int n) {
  Shape s;
  std::map<std::tuple<int, int, int>, int> indices;
  const auto vertex = [&](int x, int y, int z) {
    const auto [it, is_new] = indices.emplace(std::make_tuple(x, y, z), static_cast<int>(s.vertices.size()));
    if (is_new) s.vertices.push_back(half.cwiseProduct(Vector3<>(2.0 * x / n - 1.0, 2.0 * y / n - 1.0, 2.0 * z / n - 1.0)));
    return it->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const int end : {0, n})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto at = [&](int a, int b) {
            int g[3];
            g[axis] = end;
            g[(axis + 1) % 3] = a;
            g[(axis + 2) % 3] = b;
            return vertex(g[0], g[1], g[2]);
          };
          const int p = at(i, j), q = at(i + 1, j), r = at(i + 1, j + 1), t = at(i, j + 1);
          if (end == n) {
            s.triangles.push_back({p, q, r});
            s.triangles.push_back({p, r, t});
          } else {
            s.triangles.push_back({p, r, q});
            s.triangles.push_back({p, t, r});
          }
        }
  return s;
}

template <class Move>
Shape moved(Shape s, Move move) {
  for (Vector3<>& v : s.vertices) v = move(v);
  return s;
}

/// Mesh with the tree and surface field that a proxy needs.
struct World {
  palpate::mesh::TriangleMesh mesh;
  palpate::mesh::AabbTree tree;
  palpate::mesh::SurfaceField field;

  explicit World(const Shape& s, const palpate::mesh::Surface& surface = {}, bool open = false)
      : mesh(s.vertices, s.triangles, open), tree(mesh), field(surface, mesh) {}
  [[nodiscard]] palpate::mesh::Proxy proxy(double radius = 0.0) const { return {mesh, tree, field, radius}; }
};

/// Brute-force distance to the mesh, and whether the point is inside.
struct ReferenceDistance {
  double distance = 1e300;
  bool inside = false;
};
inline ReferenceDistance reference_distance(const palpate::mesh::TriangleMesh& mesh, const Vector3<>& x) {
  ReferenceDistance t;
  double winding = 0.0;  // solid angle (van Oosterom and Strackee 1983)
  for (std::int32_t f = 0; f < mesh.size(); ++f) {
    const palpate::mesh::Face& face = mesh.face(f);
    t.distance = std::min(t.distance, (palpate::mesh::nearest_point(face, x).point - x).norm());
    const Vector3<> a = face.corner[0] - x, b = face.corner[1] - x, c = face.corner[2] - x;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    winding += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  t.inside = winding > std::numbers::pi;
  return t;
}

}  // namespace shapes
