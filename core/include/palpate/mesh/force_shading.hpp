#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Interpolated normals that hide the facets of a mesh (force shading: Morgenbesser and Srinivasan
/// 1996).
///
/// Each corner has the angle-weighted mean normal of the faces around it up to the next crease.
/// Normals are interpolated between corners. They are continuous across all edges except creases.
class ForceShading {
 public:
  ForceShading() = default;

  /// Edges with a dihedral deviation above `crease` [rad] stay sharp.
  ForceShading(const TriangleMesh& mesh, double crease)
      : crease_cosine_(std::cos(crease)), normals_(static_cast<std::size_t>(mesh.size())) {
    refit(mesh);
  }
  ForceShading(const TriangleMesh&& mesh, double crease) = delete;

  [[nodiscard]] bool enabled() const noexcept { return !normals_.empty(); }

  /// Return whether the angle between two unit normals is below the crease angle.
  [[nodiscard]] bool is_smooth(const Vector3<>& a, const Vector3<>& b) const noexcept { return a.dot(b) >= crease_cosine_; }

  /// Recompute all normals after the mesh has moved.
  void refit(const TriangleMesh& mesh) noexcept {
    for (std::int32_t f = 0; f < mesh.size(); ++f) refit(mesh, f);
  }
  void refit(const TriangleMesh& mesh, std::int32_t f) noexcept {
    for (int k = 0; k < 3; ++k) normals_[static_cast<std::size_t>(f)][static_cast<std::size_t>(k)] = corner_normal(mesh, f, k);
  }

  /// Return whether all faces that share `feature` of face `f` have the same shaded normal at `x`
  /// [m], i.e. there is no crease.
  [[nodiscard]] bool is_smooth(const TriangleMesh& mesh, std::int32_t f, Feature feature, const Vector3<>& x) const noexcept {
    if (feature == Feature::inside) return true;
    const Vector3<> normal = normal_at(mesh, f, x);
    const auto same_normal = [&](std::int32_t g) { return (normal_at(mesh, g, x) - normal).squaredNorm() <= 1e-12; };
    const int i = index_of(feature);
    if (is_edge(feature)) {
      const std::int32_t h = mesh.face(f).neighbor[static_cast<std::size_t>(i)];
      return h >= 0 && same_normal(h / 3);
    }
    bool all = true;
    mesh.for_each_face_around(f, i, [&](std::int32_t g, int) { all = all && same_normal(g); });
    return all;
  }

  /// Return the unit shaded normal at the point `x` [m] of face `f`.
  [[nodiscard]] Vector3<> normal_at(const TriangleMesh& mesh, std::int32_t f, const Vector3<>& x) const noexcept {
    const Vector3<> b = barycentric(mesh.face(f), x);
    const auto& n = normals_[static_cast<std::size_t>(f)];
    return (b[0] * n[0] + b[1] * n[1] + b[2] * n[2]).normalized();
  }

  /// Return the gradient, at depth `depth` [m] below `x`, of a field with gradient `along` on face
  /// `f`.
  ///
  /// Below the surface the foot point moves faster than the tip, because the normals converge. To
  /// first order foot = tip + depth * normal(foot).
  [[nodiscard]] Vector3<> slope_at_depth(const TriangleMesh& mesh, std::int32_t f, const Vector3<>& x, double depth,
                                         const Vector3<>& along) const noexcept {
    const Face& face = mesh.face(f);
    const Vector3<> b = barycentric(face, x);
    const auto& n = normals_[static_cast<std::size_t>(f)];
    const Vector3<> sum = b[0] * n[0] + b[1] * n[1] + b[2] * n[2];
    const double length = sum.norm();
    const Vector3<> e1 = face.corner[1] - face.corner[0], e2 = face.corner[2] - face.corner[0];
    const Vector3<> u = e1.normalized(), v = face.normal.cross(u);
    // The columns of the inverse of (e1, e2) are the derivatives of the weights of corners 1 and 2
    // along u and v.
    const double e1u = e1.dot(u), e2u = e2.dot(u), e2v = e2.dot(v);
    const Vector3<> by1 = (n[1] - n[0]) / length, by2 = (n[2] - n[0]) / length;
    const Vector3<> turn_u = by1 / e1u, turn_v = (by2 - e2u / e1u * by1) / e2v;
    Eigen::Matrix2d foot;  // derivative of the tip position by the foot position
    foot << 1.0 - depth * u.dot(turn_u), -depth * u.dot(turn_v), -depth * v.dot(turn_u), 1.0 - depth * v.dot(turn_v);
    const double determinant = foot.determinant();
    if (!(determinant > 0.05)) return along;  // beyond the point where the normals intersect
    const Eigen::Vector2d slope = foot.inverse().transpose() * Eigen::Vector2d(along.dot(u), along.dot(v));
    return slope[0] * u + slope[1] * v;
  }

 private:
  [[nodiscard]] bool is_smooth(const TriangleMesh& mesh, std::int32_t f, std::int32_t twin) const noexcept {
    return twin >= 0 && is_smooth(mesh.face(f).normal, mesh.face(twin / 3).normal);
  }

  [[nodiscard]] Vector3<> corner_normal(const TriangleMesh& mesh, std::int32_t f, int k) const noexcept {
    Vector3<> sum = TriangleMesh::angle_weighted_normal(mesh.face(f), static_cast<std::size_t>(k));
    const std::int32_t start = 3 * f + k;
    // Counterclockwise to the next crease or border, or once around; then clockwise.
    for (std::int32_t h = start;;) {
      const std::int32_t next = mesh.face(h / 3).neighbor[static_cast<std::size_t>((h % 3 + 2) % 3)];
      if (!is_smooth(mesh, h / 3, next)) break;
      if (next == start) return sum.normalized();
      sum += TriangleMesh::angle_weighted_normal(mesh.face(next / 3), static_cast<std::size_t>(next % 3));
      h = next;
    }
    for (std::int32_t h = start;;) {
      const std::int32_t twin = mesh.face(h / 3).neighbor[static_cast<std::size_t>(h % 3)];
      if (!is_smooth(mesh, h / 3, twin)) break;
      h = 3 * (twin / 3) + (twin % 3 + 1) % 3;
      sum += TriangleMesh::angle_weighted_normal(mesh.face(h / 3), static_cast<std::size_t>(h % 3));
    }
    return sum.normalized();
  }

  double crease_cosine_ = 1.0;
  std::vector<std::array<Vector3<>, 3>> normals_;  // per face and corner, unit
};

}  // namespace palpate::mesh
