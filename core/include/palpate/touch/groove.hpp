#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/math/vector.hpp"
#include "palpate/touch/mesh.hpp"
#include "palpate/touch/triangle.hpp"

namespace palpate {

/// The curve on which a sphere's centre moves that touches two features at once: planes, lines or points, each taken as endless; how far
/// that holds, a feature's margin tells.
class Groove {
 public:
  /// A face, an edge or a corner of a facet, and the side of the face that is touched.
  struct Bank {
    std::int32_t facet = Mesh::none;
    Feature feature = Feature::inside;
    double side = 1.0;
  };

  Groove(const Mesh& mesh, double radius, const Bank& one, const Bank& two) noexcept
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
      const double cosine = m.dot(n), sine2 = 1.0 - cosine * cosine;
      if (!(sine2 > 1e-14) || !(distance_one > 0.0) || !(distance_two > 0.0)) return false;
      x += (in_one - cosine * in_two) / sine2 * m + (in_two - cosine * in_one) / sine2 * n;
    }
    return false;
  }

  /// Curvature [1/m] of the curve at `x`, where it runs along the unit vector `line`: a vector towards its centre.
  [[nodiscard]] Vector3<> curvature(const Vector3<>& x, const Vector3<>& line) const noexcept {
    const Vector3<> m = away(one_, x).normalized(), n = away(two_, x).normalized();
    const double cosine = m.dot(n), sine2 = 1.0 - cosine * cosine, bend_one = bend(one_, line), bend_two = bend(two_, line);
    return -((bend_one - cosine * bend_two) / sine2) * m - ((bend_two - cosine * bend_one) / sine2) * n;
  }

  [[nodiscard]] bool straight(const Vector3<>& line) const noexcept { return bend(one_, line) == 0.0 && bend(two_, line) == 0.0; }

  /// How far [m] a sphere at `x` is from where it would touch another feature of either mesh's piece first; negative beyond.
  [[nodiscard]] double margin(const Vector3<>& x) const noexcept { return std::fmin(margin(one_, x), margin(two_, x)); }

 private:
  /// From the endless feature to `x`.
  [[nodiscard]] Vector3<> away(const Bank& b, const Vector3<>& x) const noexcept {
    const Facet& facet = mesh_->facet(b.facet);
    if (b.feature == Feature::inside) return facet.height(x) * facet.normal;
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    Vector3<> out = x - facet.corner[i];
    if (is_corner(b.feature)) return out;
    const Vector3<> e = facet.corner[(i + 1) % 3] - facet.corner[i];
    return out - out.dot(e) / e.squaredNorm() * e;
  }

  /// Second derivative of the distance along `line`.
  [[nodiscard]] double bend(const Bank& b, const Vector3<>& line) const noexcept {
    if (b.feature == Feature::inside) return 0.0;
    if (is_corner(b.feature)) return 1.0 / radius_;
    const Facet& facet = mesh_->facet(b.facet);
    const auto i = static_cast<std::size_t>(index_of(b.feature));
    const Vector3<> e = facet.corner[(i + 1) % 3] - facet.corner[i];
    const double u = e.dot(line);
    return std::fmax(1.0 - u * u / e.squaredNorm(), 0.0) / radius_;
  }

  [[nodiscard]] double margin(const Bank& b, const Vector3<>& x) const noexcept {
    const Facet& facet = mesh_->facet(b.facet);
    const auto inward = [&x](const Facet& f, std::size_t i) {  // of x from edge i, in the facet's plane
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
    const std::int32_t v = facet.vertex[i];
    mesh_->around(b.facet, static_cast<int>(i), [&](std::int32_t f) {
      const Facet& other = mesh_->facet(f);
      for (std::size_t k = 0; k < 3; ++k) {
        if (other.vertex[k] == v) continue;
        const Vector3<> e = other.corner[k] - facet.corner[i];
        least = std::fmin(least, -e.dot(x - facet.corner[i]) / e.norm());
      }
    });
    return least;
  }

  const Mesh* mesh_;
  double radius_;  // m
  Bank one_, two_;
};

}  // namespace palpate
