#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Return the vector in the plane of the unit vectors `m` and `n` with the components `component_m`
/// and `component_n` along them. `m` and `n` must not be parallel.
[[nodiscard]] inline Vector3<> solve_in_plane(const Vector3<>& m, const Vector3<>& n, double component_m, double component_n) noexcept {
  const double cosine = m.dot(n), sine2 = 1.0 - cosine * cosine;
  return (component_m - cosine * component_n) / sine2 * m + (component_n - cosine * component_m) / sine2 * n;
}

/// Return whether the unit vectors are parallel or antiparallel within `min_angle` [rad].
[[nodiscard]] inline bool nearly_parallel(const Vector3<>& m, const Vector3<>& n, double min_angle) noexcept {
  const double cosine = m.dot(n);
  return !(1.0 - cosine * cosine > min_angle * min_angle);
}

/// Curve of the centers of a sphere that touches two features at once.
///
/// Features are extended to infinite planes, lines or points. margin() returns how far this is
/// valid. Keeps a reference to the mesh, which must outlive it.
class TwoContactCurve {
 public:
  static constexpr double parallel_tolerance = 1e-7;  // rad: smaller angles between normals leave no line

  /// Interior, edge or corner of a face.
  struct ContactFeature {
    std::int32_t face = TriangleMesh::none;
    Feature feature = Feature::inside;
  };

  TwoContactCurve(const TriangleMesh& mesh, double radius, const ContactFeature& one, const ContactFeature& two) noexcept
      : mesh_(&mesh), radius_(radius), one_(one), two_(two) {}
  TwoContactCurve(const TriangleMesh&& mesh, double radius, const ContactFeature& one, const ContactFeature& two) = delete;

  /// Move `x` [m] onto the curve by Newton's method. Return false if it does not converge.
  bool project(Vector3<>& x) const noexcept {
    const double tolerance = 1e-14 * radius_ + 1e-15 * mesh_->max_coordinate();
    for (int iteration = 0; iteration < 10; ++iteration) {
      const Vector3<> out_one = from_feature(one_, x), out_two = from_feature(two_, x);
      const double distance_one = out_one.norm(), distance_two = out_two.norm();
      const double in_one = radius_ - distance_one, in_two = radius_ - distance_two;
      if (std::fmax(std::fabs(in_one), std::fabs(in_two)) <= tolerance) return true;
      const Vector3<> m = out_one / distance_one, n = out_two / distance_two;
      if (!(distance_one > 0.0) || !(distance_two > 0.0) || nearly_parallel(m, n, parallel_tolerance)) return false;
      x += solve_in_plane(m, n, in_one, in_two);
    }
    return false;
  }

  /// Return the curvature vector [1/m] at `x`, where the curve runs along the unit vector `line`.
  [[nodiscard]] Vector3<> curvature(const Vector3<>& x, const Vector3<>& line) const noexcept {
    const Vector3<> m = from_feature(one_, x).normalized(), n = from_feature(two_, x).normalized();
    return -solve_in_plane(m, n, distance_curvature(one_, line), distance_curvature(two_, line));
  }

  [[nodiscard]] bool is_straight(const Vector3<>& line) const noexcept {
    return distance_curvature(one_, line) == 0.0 && distance_curvature(two_, line) == 0.0;
  }

  /// Return the distance [m] of a sphere at `x` to the position where it would touch another
  /// feature first; negative beyond it.
  [[nodiscard]] double margin(const Vector3<>& x) const noexcept { return std::fmin(margin(one_, x), margin(two_, x)); }

 private:
  /// Return the vector from the extended feature to `x` [m].
  [[nodiscard]] Vector3<> from_feature(const ContactFeature& b, const Vector3<>& x) const noexcept {
    const Face& face = mesh_->face(b.face);
    if (b.feature == Feature::inside) return face.height(x) * face.normal;
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    Vector3<> out = x - face.corner[i];
    if (is_corner(b.feature)) return out;
    const Vector3<> e = face.corner[(i + 1) % 3] - face.corner[i];
    return out - out.dot(e) / e.squaredNorm() * e;
  }

  /// Return the second derivative of the distance along `line` [1/m].
  [[nodiscard]] double distance_curvature(const ContactFeature& b, const Vector3<>& line) const noexcept {
    if (b.feature == Feature::inside) return 0.0;
    if (is_corner(b.feature)) return 1.0 / radius_;
    const Face& face = mesh_->face(b.face);
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    const Vector3<> e = face.corner[(i + 1) % 3] - face.corner[i];
    const double u = e.dot(line);
    return std::fmax(1.0 - u * u / e.squaredNorm(), 0.0) / radius_;
  }

  [[nodiscard]] double margin(const ContactFeature& b, const Vector3<>& x) const noexcept {
    const Face& face = mesh_->face(b.face);
    const auto inward_distance = [&x](const Face& f, std::size_t i) {  // distance of x from edge i in the plane of the face
      const Vector3<> e = f.corner[(i + 1) % 3] - f.corner[i];
      return f.normal.cross(e).dot(x - f.corner[i]) / e.norm();
    };
    if (b.feature == Feature::inside)
      return std::fmin(inward_distance(face, 0), std::fmin(inward_distance(face, 1), inward_distance(face, 2)));
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    if (is_edge(b.feature)) {
      const Vector3<> e = face.corner[(i + 1) % 3] - face.corner[i];
      const double size = e.norm(), position = (x - face.corner[i]).dot(e) / size;
      double smallest = std::fmin(std::fmin(position, size - position), -inward_distance(face, i));
      const std::int32_t h = face.neighbor[i];
      if (h >= 0) smallest = std::fmin(smallest, -inward_distance(mesh_->face(h / 3), static_cast<std::size_t>(h % 3)));
      return smallest;
    }
    double smallest = std::numeric_limits<double>::infinity();
    mesh_->for_each_face_around(b.face, static_cast<int>(i), [&](std::int32_t f, int corner) {
      const Face& other = mesh_->face(f);
      for (const int k : {(corner + 1) % 3, (corner + 2) % 3}) {
        const Vector3<> e = other.corner[static_cast<std::size_t>(k)] - face.corner[i];
        smallest = std::fmin(smallest, -e.dot(x - face.corner[i]) / e.norm());
      }
    });
    return smallest;
  }

  const TriangleMesh* mesh_;
  double radius_;  // m
  ContactFeature one_, two_;
};

}  // namespace palpate::mesh
