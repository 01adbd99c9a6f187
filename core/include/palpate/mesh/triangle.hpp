#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Part of a face that contains a point: the interior, the edge from corner i to i + 1, or corner
/// i.
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

/// Return whether `feature` of face `f` is also part of face `g`.
[[nodiscard]] inline bool shares_feature(const Face& f, Feature feature, const Face& g) noexcept {
  const auto has_vertex = [&g](std::int32_t v) { return g.vertex[0] == v || g.vertex[1] == v || g.vertex[2] == v; };
  if (feature == Feature::inside) return &f == &g;
  const auto i = static_cast<std::size_t>(index_of(feature));
  return has_vertex(f.vertex[i]) && (is_corner(feature) || has_vertex(f.vertex[(i + 1) % 3]));
}

/// Point of a face nearest to a query point, and the feature it lies on.
struct NearestPoint {
  Vector3<> point = Vector3<>::Zero();  ///< m
  Feature feature = Feature::inside;
};

/// Return the point of the face nearest to `x` [m] (Ericson, Real-Time Collision Detection, 5.1.5).
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

/// Point at which a motion in the plane of a face leaves the face.
struct Exit {
  int edge = -1;          ///< -1: the motion stays on the face
  double fraction = 1.0;  ///< of the motion, 0 to 1
};

/// Return the first edge that the motion from `x` [m] crosses outwards.
///
/// on_edge(i) states that `x` lies on edge i exactly, regardless of rounding.
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

/// Return the barycentric coordinates of `x` [m] in the plane of the face, clamped to the face.
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

/// Return whether the line through `from` along `direction` intersects the face or its border.
///
/// Compares the signs of three volumes. Neighbors compute the same volume with opposite signs for
/// their common edge, so no line passes between them.
[[nodiscard]] inline bool line_intersects(const Face& face, const Vector3<>& from, const Vector3<>& direction) noexcept {
  const Vector3<> a = face.corner[0] - from, b = face.corner[1] - from, c = face.corner[2] - from;
  const double u = direction.dot(a.cross(b)), v = direction.dot(b.cross(c)), w = direction.dot(c.cross(a));
  return (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
}

/// First contact of a moving sphere with a face.
struct SweepHit {
  bool hit = false;
  double time = 1.0;                     ///< of the motion, 0 to 1
  Vector3<> normal = Vector3<>::Zero();  ///< unit, from the face to the sphere center
  Vector3<> point = Vector3<>::Zero();   ///< contact point on the face, m
  Feature feature = Feature::inside;     ///< part of the face at the contact point
};

/// Return the first contact of a sphere of `radius` [m] that moves by `motion` [m] from `from` [m].
///
/// Both sides of the face count. A sphere already in contact collides only if it moves towards the
/// face.
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
  // The face is convex and lies behind the plane through its nearest point. Skip it unless the
  // sphere crosses that plane.
  const double descent = away.dot(motion);
  if (descent >= 0.0 || (d2 + descent > 0.0 && (d2 + descent) * (d2 + descent) >= radius2 * d2)) return result;
  // Face, offset by the radius.
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
  // Edges and corners, rounded with the radius.
  const double motion2 = motion.squaredNorm();
  for (int i = 0; i < 3; ++i) {
    const Vector3<>& p = face.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - p, m = from - p;
    const double e2 = e.squaredNorm(), me = m.dot(e), we = motion.dot(e);
    const Vector3<> across = motion - we / e2 * e, offset = m - me / e2 * e;  // components perpendicular to the edge
    const double qa = across.squaredNorm(), qb = offset.dot(across), qc = offset.squaredNorm() - radius2;
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
