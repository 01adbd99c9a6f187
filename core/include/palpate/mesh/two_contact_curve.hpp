#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// The vector in the plane of the unit vectors `m` and `n` that goes `along_m` and `along_n` along them; they must not be parallel.
[[nodiscard]] inline Vector3<> spanned(const Vector3<>& m, const Vector3<>& n, double along_m, double along_n) noexcept {
  const double cosine = m.dot(n), sine2 = 1.0 - cosine * cosine;
  return (along_m - cosine * along_n) / sine2 * m + (along_n - cosine * along_m) / sine2 * n;
}

/// Whether unit vectors are nearer to each other, or to each other's opposite, than `least` [rad].
[[nodiscard]] inline bool nearly_parallel(const Vector3<>& m, const Vector3<>& n, double least) noexcept {
  const double cosine = m.dot(n);
  return !(1.0 - cosine * cosine > least * least);
}

/// The curve on which a sphere's centre moves that touches two features at once: planes, lines or points, each taken as endless; how far
/// that holds, a feature's margin tells.
class TwoContactCurve {
 public:
  static constexpr double parallel = 1e-7;  // rad: normals that differ less leave no line between them

  /// A face, an edge or a corner of a facet.
  struct ContactFeature {
    std::int32_t facet = TriangleMesh::none;
    Feature feature = Feature::inside;
  };

  TwoContactCurve(const TriangleMesh& mesh, double radius, const ContactFeature& one, const ContactFeature& two) noexcept
      : mesh_(&mesh), radius_(radius), one_(one), two_(two) {}

  /// Moves `x` [m] onto the curve by Newton's method. False if it does not get there.
  bool put_on(Vector3<>& x) const noexcept {
    const double enough = 1e-14 * radius_ + 1e-15 * mesh_->reach();
    for (int turn = 0; turn < 10; ++turn) {
      const Vector3<> out_one = away(one_, x), out_two = away(two_, x);
      const double distance_one = out_one.norm(), distance_two = out_two.norm();
      const double in_one = radius_ - distance_one, in_two = radius_ - distance_two;
      if (std::fmax(std::fabs(in_one), std::fabs(in_two)) <= enough) return true;
      const Vector3<> m = out_one / distance_one, n = out_two / distance_two;
      if (!(distance_one > 0.0) || !(distance_two > 0.0) || nearly_parallel(m, n, parallel)) return false;
      x += spanned(m, n, in_one, in_two);
    }
    return false;
  }

  /// Curvature [1/m] of the curve at `x`, where it runs along the unit vector `line`: a vector towards its centre.
  [[nodiscard]] Vector3<> curvature(const Vector3<>& x, const Vector3<>& line) const noexcept {
    const Vector3<> m = away(one_, x).normalized(), n = away(two_, x).normalized();
    return -spanned(m, n, bend(one_, line), bend(two_, line));
  }

  [[nodiscard]] bool straight(const Vector3<>& line) const noexcept { return bend(one_, line) == 0.0 && bend(two_, line) == 0.0; }

  /// How far [m] a sphere at `x` is from where it would touch another feature of either mesh's piece first; negative beyond.
  [[nodiscard]] double margin(const Vector3<>& x) const noexcept { return std::fmin(margin(one_, x), margin(two_, x)); }

 private:
  /// From the endless feature to `x`.
  [[nodiscard]] Vector3<> away(const ContactFeature& b, const Vector3<>& x) const noexcept {
    const Face& facet = mesh_->facet(b.facet);
    if (b.feature == Feature::inside) return facet.height(x) * facet.normal;
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    Vector3<> out = x - facet.corner[i];
    if (is_corner(b.feature)) return out;
    const Vector3<> e = facet.corner[(i + 1) % 3] - facet.corner[i];
    return out - out.dot(e) / e.squaredNorm() * e;
  }

  /// Second derivative of the distance along `line`.
  [[nodiscard]] double bend(const ContactFeature& b, const Vector3<>& line) const noexcept {
    if (b.feature == Feature::inside) return 0.0;
    if (is_corner(b.feature)) return 1.0 / radius_;
    const Face& facet = mesh_->facet(b.facet);
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    const Vector3<> e = facet.corner[(i + 1) % 3] - facet.corner[i];
    const double u = e.dot(line);
    return std::fmax(1.0 - u * u / e.squaredNorm(), 0.0) / radius_;
  }

  [[nodiscard]] double margin(const ContactFeature& b, const Vector3<>& x) const noexcept {
    const Face& facet = mesh_->facet(b.facet);
    const auto inward = [&x](const Face& f, std::size_t i) {  // of x from edge i, in the facet's plane
      const Vector3<> e = f.corner[(i + 1) % 3] - f.corner[i];
      return f.normal.cross(e).dot(x - f.corner[i]) / e.norm();
    };
    if (b.feature == Feature::inside) return std::fmin(inward(facet, 0), std::fmin(inward(facet, 1), inward(facet, 2)));
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    if (is_edge(b.feature)) {
      const Vector3<> e = facet.corner[(i + 1) % 3] - facet.corner[i];
      const double size = e.norm(), place = (x - facet.corner[i]).dot(e) / size;
      double least = std::fmin(std::fmin(place, size - place), -inward(facet, i));
      const std::int32_t h = facet.neighbour[i];
      if (h >= 0) least = std::fmin(least, -inward(mesh_->facet(h / 3), static_cast<std::size_t>(h % 3)));
      return least;
    }
    double least = std::numeric_limits<double>::infinity();
    mesh_->around(b.facet, static_cast<int>(i), [&](std::int32_t f, int corner) {
      const Face& other = mesh_->facet(f);
      for (const int k : {(corner + 1) % 3, (corner + 2) % 3}) {
        const Vector3<> e = other.corner[static_cast<std::size_t>(k)] - facet.corner[i];
        least = std::fmin(least, -e.dot(x - facet.corner[i]) / e.norm());
      }
    });
    return least;
  }

  const TriangleMesh* mesh_;
  double radius_;  // m
  ContactFeature one_, two_;
};

}  // namespace palpate::mesh
