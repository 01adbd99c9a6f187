#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Where on a facet a point lies: inside it, on the edge from corner i to i + 1, or on a corner.
enum class Feature : std::uint8_t { edge0, edge1, edge2, corner0, corner1, corner2, inside };

[[nodiscard]] constexpr bool is_edge(Feature f) noexcept {
  return f <= Feature::edge2;
}
[[nodiscard]] constexpr bool is_corner(Feature f) noexcept {
  return f >= Feature::corner0 && f <= Feature::corner2;
}
[[nodiscard]] constexpr int index_of(Feature f) noexcept {
  return static_cast<int>(f) % 3;
}
[[nodiscard]] constexpr Feature edge(int i) noexcept {
  return static_cast<Feature>(i);
}
[[nodiscard]] constexpr Feature corner(int i) noexcept {
  return static_cast<Feature>(3 + i);
}

/// Whether a feature of facet `f` also belongs to facet `g`.
[[nodiscard]] inline bool belongs(const Face& f, Feature feature, const Face& g) noexcept {
  const auto of_g = [&g](std::int32_t v) { return g.vertex[0] == v || g.vertex[1] == v || g.vertex[2] == v; };
  if (feature == Feature::inside) return &f == &g;
  const auto i = static_cast<std::size_t>(index_of(feature));
  return of_g(f.vertex[i]) && (is_corner(feature) || of_g(f.vertex[(i + 1) % 3]));
}

struct NearestPoint {
  Vector3<> point = Vector3<>::Zero();  ///< m
  Feature feature = Feature::inside;
};

/// The point of a facet nearest to `x` (Ericson, Real-Time Collision Detection, 5.1.5).
[[nodiscard]] inline NearestPoint nearest_point(const Face& facet, const Vector3<>& x) noexcept {
  const Vector3<>&a = facet.corner[0], &b = facet.corner[1], &c = facet.corner[2];
  const Vector3<> ab = b - a, ac = c - a, ax = x - a;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax);
  if (d1 <= 0.0 && d2 <= 0.0) return {a, corner(0)};
  const Vector3<> bx = x - b;
  const double d3 = ab.dot(bx), d4 = ac.dot(bx);
  if (d3 >= 0.0 && d4 <= d3) return {b, corner(1)};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return {a + d1 / (d1 - d3) * ab, edge(0)};
  const Vector3<> cx = x - c;
  const double d5 = ab.dot(cx), d6 = ac.dot(cx);
  if (d6 >= 0.0 && d5 <= d6) return {c, corner(2)};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return {a + d2 / (d2 - d6) * ac, edge(2)};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) return {b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b), edge(1)};
  return {x - facet.height(x) * facet.normal, Feature::inside};
}

/// Where a way over a facet, in its plane, leaves it.
struct Exit {
  int edge = -1;      ///< -1: it stays
  double part = 1.0;  ///< of the way
};

/// The first edge that the way from `x` crosses outwards; `on(i)` says that `x` lies on edge i, whatever rounding makes of it.
template <class On>
[[nodiscard]] Exit first_exit(const Face& facet, const Vector3<>& x, const Vector3<>& way, On on) noexcept {
  Exit exit;
  for (int i = 0; i < 3; ++i) {
    const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
    const Vector3<> inward = facet.normal.cross(facet.corner[static_cast<std::size_t>((i + 1) % 3)] - a);
    const double rate = inward.dot(way);
    if (rate >= 0.0) continue;
    const double distance = on(i) ? 0.0 : std::fmax(inward.dot(x - a), 0.0);
    if (distance < -rate * exit.part) exit = {i, distance / -rate};
  }
  return exit;
}

/// Weights of the corners at the point `x` of a facet's plane; clamped to the facet.
[[nodiscard]] inline Vector3<> barycentric(const Face& facet, const Vector3<>& x) noexcept {
  const Vector3<> e1 = facet.corner[1] - facet.corner[0], e2 = facet.corner[2] - facet.corner[0], d = x - facet.corner[0];
  const double area = facet.normal.dot(e1.cross(e2));
  Vector3<> b;
  b[1] = facet.normal.dot(d.cross(e2)) / area;
  b[2] = facet.normal.dot(e1.cross(d)) / area;
  b[0] = 1.0 - b[1] - b[2];
  b = b.cwiseMax(0.0);
  return b / b.sum();
}

/// Whether the line through `from` along `way` passes through the facet or touches its border: signs of three volumes. Neighbours
/// compute the same volume for their common edge, with opposite signs, so that no line slips through between them.
[[nodiscard]] inline bool line_meets(const Face& facet, const Vector3<>& from, const Vector3<>& way) noexcept {
  const Vector3<> a = facet.corner[0] - from, b = facet.corner[1] - from, c = facet.corner[2] - from;
  const double u = way.dot(a.cross(b)), v = way.dot(b.cross(c)), w = way.dot(c.cross(a));
  return (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
}

/// First touch of a sphere with a facet.
struct Touch {
  bool hit = false;
  double time = 1.0;                     ///< fraction of the way
  Vector3<> normal = Vector3<>::Zero();  ///< unit, from the facet to the sphere's centre
  Vector3<> point = Vector3<>::Zero();   ///< on the facet, m
  Feature feature = Feature::inside;     ///< of the facet, there
};

/// When a sphere of `radius` that moves by `way` from `from` meets the facet, from either side. A sphere that touches already is
/// stopped only if it moves inwards.
[[nodiscard]] inline Touch sweep(const Face& facet, const Vector3<>& from, const Vector3<>& way, double radius) noexcept {
  Touch touch;
  const double h0 = facet.height(from), rate = facet.normal.dot(way);
  const double side = h0 >= 0.0 ? 1.0 : -1.0;
  if (side * h0 >= radius && side * (h0 + rate) >= radius) return touch;
  const double reach2 = radius * radius;
  const NearestPoint near = nearest_point(facet, from);
  const Vector3<> away = from - near.point;
  const double d2 = away.squaredNorm();
  if (d2 <= reach2 * (1.0 + 1e-12)) {
    const double distance = std::sqrt(d2);
    const bool deep = distance < radius * (1.0 - 1e-9);
    if (d2 == 0.0 || (!deep && away.dot(way) >= -1e-10 * distance * way.norm())) return touch;
    return {true, 0.0, away / distance, near.point, near.feature};
  }
  // The facet is convex, all of it behind the plane through its nearest point: does the sphere come through that plane at all?
  const double descent = away.dot(way);
  if (descent >= 0.0 || (d2 + descent > 0.0 && (d2 + descent) * (d2 + descent) >= reach2 * d2)) return touch;
  // The offset face.
  if (side * h0 >= radius && side * rate < 0.0) {
    const double t = (side * h0 - radius) / (-side * rate);
    const Vector3<> at = from + t * way - side * radius * facet.normal;
    bool inside = true;
    for (int i = 0; i < 3; ++i) {
      const Vector3<>& p = facet.corner[static_cast<std::size_t>(i)];
      const Vector3<> e = facet.corner[static_cast<std::size_t>((i + 1) % 3)] - p;
      if (facet.normal.dot(e.cross(at - p)) < 0.0) inside = false;
    }
    if (inside) return {t <= 1.0, t, side * facet.normal, at, Feature::inside};
  }
  // Rounded edges and corners.
  const double way2 = way.squaredNorm();
  for (int i = 0; i < 3; ++i) {
    const Vector3<>& p = facet.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = facet.corner[static_cast<std::size_t>((i + 1) % 3)] - p, m = from - p;
    const double e2 = e.squaredNorm(), me = m.dot(e), we = way.dot(e);
    const Vector3<> across = way - we / e2 * e, out = m - me / e2 * e;  // both across the edge
    const double qa = across.squaredNorm(), qb = out.dot(across), qc = out.squaredNorm() - reach2;
    double discriminant = qb * qb - qa * qc;
    if (qb < 0.0 && qc >= 0.0 && discriminant >= 0.0 && qa > 0.0) {
      const double t = qc / (-qb + std::sqrt(discriminant));
      const double u = (me + t * we) / e2;
      if (t < touch.time && u >= 0.0 && u <= 1.0) {
        const Vector3<> foot = p + u * e;
        touch = {true, t, (from + t * way - foot) / radius, foot, edge(i)};
      }
    }
    const double b = m.dot(way), c = m.squaredNorm() - reach2;
    discriminant = b * b - way2 * c;
    if (b < 0.0 && c >= 0.0 && discriminant >= 0.0) {
      const double t = c / (-b + std::sqrt(discriminant));
      if (t < touch.time) touch = {true, t, (m + t * way) / radius, p, corner(i)};
    }
  }
  return touch;
}

}  // namespace palpate::mesh
