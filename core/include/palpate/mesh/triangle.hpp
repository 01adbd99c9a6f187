#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Where on a face a point lies: inside it, on the edge from corner i to i + 1, or on a corner.
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

/// Whether a feature of face `f` also shares_feature to face `g`.
[[nodiscard]] inline bool shares_feature(const Face& f, Feature feature, const Face& g) noexcept {
  const auto has_vertex = [&g](std::int32_t v) { return g.vertex[0] == v || g.vertex[1] == v || g.vertex[2] == v; };
  if (feature == Feature::inside) return &f == &g;
  const auto i = static_cast<std::size_t>(index_of(feature));
  return has_vertex(f.vertex[i]) && (is_corner(feature) || has_vertex(f.vertex[(i + 1) % 3]));
}

struct NearestPoint {
  Vector3<> point = Vector3<>::Zero();  ///< m
  Feature feature = Feature::inside;
};

/// The point of a face nearest to `x` (Ericson, Real-Time Collision Detection, 5.1.5).
[[nodiscard]] inline NearestPoint nearest_point(const Face& face, const Vector3<>& x) noexcept {
  const Vector3<>&a = face.corner[0], &b = face.corner[1], &c = face.corner[2];
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
  return {x - face.height(x) * face.normal, Feature::inside};
}

/// Where a motion over a face, in its plane, leaves it.
struct Exit {
  int edge = -1;          ///< -1: it stays
  double fraction = 1.0;  ///< of the motion
};

/// The first edge that the motion from `x` crosses outwards; `on_edge(i)` says that `x` lies on edge i, whatever rounding makes of it.
template <class OnEdge>
[[nodiscard]] Exit first_exit(const Face& face, const Vector3<>& x, const Vector3<>& motion, OnEdge on_edge) noexcept {
  Exit exit;
  for (int i = 0; i < 3; ++i) {
    const Vector3<>& a = face.corner[static_cast<std::size_t>(i)];
    const Vector3<> inward = face.normal.cross(face.corner[static_cast<std::size_t>((i + 1) % 3)] - a);
    const double rate = inward.dot(motion);
    if (rate >= 0.0) continue;
    const double distance = on_edge(i) ? 0.0 : std::fmax(inward.dot(x - a), 0.0);
    if (distance < -rate * exit.fraction) exit = {i, distance / -rate};
  }
  return exit;
}

/// Weights of the corners at the point `x` of a face's plane; clamped to the face.
[[nodiscard]] inline Vector3<> barycentric(const Face& face, const Vector3<>& x) noexcept {
  const Vector3<> e1 = face.corner[1] - face.corner[0], e2 = face.corner[2] - face.corner[0], d = x - face.corner[0];
  const double area = face.normal.dot(e1.cross(e2));
  Vector3<> b;
  b[1] = face.normal.dot(d.cross(e2)) / area;
  b[2] = face.normal.dot(e1.cross(d)) / area;
  b[0] = 1.0 - b[1] - b[2];
  b = b.cwiseMax(0.0);
  return b / b.sum();
}

/// Whether the line through `from` along `motion` passes through the face or touches its border: signs of three volumes. Neighbours
/// compute the same volume for their common edge, with opposite signs, so that no line slips through between them.
[[nodiscard]] inline bool line_intersects(const Face& face, const Vector3<>& from, const Vector3<>& motion) noexcept {
  const Vector3<> a = face.corner[0] - from, b = face.corner[1] - from, c = face.corner[2] - from;
  const double u = motion.dot(a.cross(b)), v = motion.dot(b.cross(c)), w = motion.dot(c.cross(a));
  return (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
}

/// First result of a sphere with a face.
struct SweepHit {
  bool hit = false;
  double time = 1.0;                     ///< fraction of the motion
  Vector3<> normal = Vector3<>::Zero();  ///< unit, from the face to the sphere's center
  Vector3<> point = Vector3<>::Zero();   ///< on the face, m
  Feature feature = Feature::inside;     ///< of the face, there
};

/// When a sphere of `radius` that moves by `motion` from `from` meets the face, from either side. A sphere that touches already is
/// stopped only if it moves inwards.
[[nodiscard]] inline SweepHit sweep_sphere(const Face& face, const Vector3<>& from, const Vector3<>& motion, double radius) noexcept {
  SweepHit result;
  const double h0 = face.height(from), rate = face.normal.dot(motion);
  const double side = h0 >= 0.0 ? 1.0 : -1.0;
  if (side * h0 >= radius && side * (h0 + rate) >= radius) return result;
  const double radius2 = radius * radius;
  const NearestPoint nearest = nearest_point(face, from);
  const Vector3<> away = from - nearest.point;
  const double d2 = away.squaredNorm();
  if (d2 <= radius2 * (1.0 + 1e-12)) {
    const double distance = std::sqrt(d2);
    const bool deep = distance < radius * (1.0 - 1e-9);
    if (d2 == 0.0 || (!deep && away.dot(motion) >= -1e-10 * distance * motion.norm())) return result;
    return {true, 0.0, away / distance, nearest.point, nearest.feature};
  }
  // The face is convex, all of it behind the plane through its nearest point: does the sphere come through that plane at all?
  const double descent = away.dot(motion);
  if (descent >= 0.0 || (d2 + descent > 0.0 && (d2 + descent) * (d2 + descent) >= radius2 * d2)) return result;
  // The offset face.
  if (side * h0 >= radius && side * rate < 0.0) {
    const double t = (side * h0 - radius) / (-side * rate);
    const Vector3<> at = from + t * motion - side * radius * face.normal;
    bool inside = true;
    for (int i = 0; i < 3; ++i) {
      const Vector3<>& p = face.corner[static_cast<std::size_t>(i)];
      const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - p;
      if (face.normal.dot(e.cross(at - p)) < 0.0) inside = false;
    }
    if (inside) return {t <= 1.0, t, side * face.normal, at, Feature::inside};
  }
  // Rounded edges and corners.
  const double motion2 = motion.squaredNorm();
  for (int i = 0; i < 3; ++i) {
    const Vector3<>& p = face.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - p, m = from - p;
    const double e2 = e.squaredNorm(), me = m.dot(e), we = motion.dot(e);
    const Vector3<> motion_perpendicular = motion - we / e2 * e, perpendicular = m - me / e2 * e;  // both motion_perpendicular the edge
    const double qa = motion_perpendicular.squaredNorm(), qb = perpendicular.dot(motion_perpendicular),
                 qc = perpendicular.squaredNorm() - radius2;
    double discriminant = qb * qb - qa * qc;
    if (qb < 0.0 && qc >= 0.0 && discriminant >= 0.0 && qa > 0.0) {
      const double t = qc / (-qb + std::sqrt(discriminant));
      const double u = (me + t * we) / e2;
      if (t < result.time && u >= 0.0 && u <= 1.0) {
        const Vector3<> foot = p + u * e;
        result = {true, t, (from + t * motion - foot) / radius, foot, edge(i)};
      }
    }
    const double b = m.dot(motion), c = m.squaredNorm() - radius2;
    discriminant = b * b - motion2 * c;
    if (b < 0.0 && c >= 0.0 && discriminant >= 0.0) {
      const double t = c / (-b + std::sqrt(discriminant));
      if (t < result.time) result = {true, t, (m + t * motion) / radius, p, corner(i)};
    }
  }
  return result;
}

}  // namespace palpate::mesh
