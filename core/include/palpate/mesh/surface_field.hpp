#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/force_shading.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Interpolation of the stiffness over a mesh.
enum class FieldKind {
  discrete,    ///< one value per face (thesis, chapter 5); the force is discontinuous at edges
  continuous,  ///< continuously differentiable; the force is the gradient of a potential
};

/// Material of a surface. Stiffness and damping have one value, one per triangle or one per vertex.
struct Surface {
  std::vector<double> stiffness{1000.0};  ///< normal stiffness, N/m
  std::vector<double> damping{};          ///< normal damping, N*s/m; empty: none
  double tangential = -1.0;               ///< tangential stiffness, N/m; negative: equal to the normal stiffness
  double static_friction = 0.0;           ///< coefficient; infinity: never slides
  double dynamic_friction = 0.0;          ///< coefficient, at most static_friction
  double viscous = 0.0;                   ///< viscous friction of the sliding proxy, N*s/m
  FieldKind field = FieldKind::discrete;
  double shading = 0.0;  ///< crease angle of force shading, rad; 0: off
  double period = 1e-3;  ///< servo period, s; used by damping and viscous friction
};

/// Material properties evaluated on one mesh during a servo tick.
///
/// The field of an unusable mesh or an invalid surface is not usable(), and proxies on it touch
/// nothing.
class SurfaceField {
 public:
  /// Stiffness at a point and its gradient along the surface.
  struct LocalStiffness {
    double stiffness = 0.0;               ///< N/m
    Vector3<> slope = Vector3<>::Zero();  ///< gradient, N/m per m
  };

  /// Construct the field of the default Surface, which has one stiffness and fits every mesh.
  SurfaceField() { surface_.damping = {0.0}; }

  /// Return whether `s` can be used on `mesh`.
  ///
  /// Lists have one value, one per triangle or one per vertex. Values are finite and not negative.
  [[nodiscard]] static bool is_valid(const Surface& s, const TriangleMesh& mesh) {
    const auto valid = [&](const std::vector<double>& list, bool may_be_empty) {
      const bool length = list.size() == 1 || list.size() == static_cast<std::size_t>(mesh.size()) ||
                          list.size() == mesh.vertices().size() || (may_be_empty && list.empty());
      return length && std::all_of(list.begin(), list.end(), [](double x) { return x >= 0.0 && std::isfinite(x); });
    };
    return valid(s.stiffness, false) && valid(s.damping, true) && s.static_friction >= 0.0 && s.dynamic_friction >= 0.0 &&
           s.dynamic_friction <= s.static_friction && s.viscous >= 0.0 && std::isfinite(s.viscous) && std::isfinite(s.tangential) &&
           s.period > 0.0 && std::isfinite(s.period) && s.shading >= 0.0 && s.shading < 1.5;
  }

  SurfaceField(Surface s, const TriangleMesh& mesh) : surface_(std::move(s)) {
    usable_ = mesh.usable() && is_valid(surface_, mesh);
    if (!usable_) {
      surface_ = Surface{};
      surface_.stiffness = surface_.damping = {0.0};
      return;
    }
    if (surface_.damping.empty()) surface_.damping = {0.0};
    const auto faces = static_cast<std::size_t>(mesh.size());
    per_face_ = surface_.stiffness.size() == faces;
    damping_per_face_ = surface_.damping.size() == faces;
    if (surface_.field == FieldKind::continuous && per_face_ && faces > 1) average_to_vertices(mesh);
    uniform_ = surface_.stiffness.size() == 1;
    if (surface_.shading > 0.0) shading_ = ForceShading(mesh, surface_.shading);
  }

  SurfaceField(Surface s, const TriangleMesh&& mesh) = delete;

  /// Return whether proxies can touch this surface.
  [[nodiscard]] bool usable() const noexcept { return usable_; }
  [[nodiscard]] const Surface& surface() const noexcept { return surface_; }
  [[nodiscard]] const ForceShading& shading() const noexcept { return shading_; }

  /// Update the shading after the mesh has moved.
  void refit(const TriangleMesh& mesh) noexcept {
    if (shading_.enabled()) shading_.refit(mesh);
  }

  /// Update the shading of the faces [first, last) after they have moved.
  template <class Iterator>
  void refit(const TriangleMesh& mesh, Iterator first, Iterator last) noexcept {
    if (!shading_.enabled()) return;
    for (; first != last; ++first) shading_.refit(mesh, *first);
  }

  /// Return the stiffness at the point `x` [m] of face `f`.
  [[nodiscard]] LocalStiffness stiffness_at(const TriangleMesh& mesh, std::int32_t f, const Vector3<>& x) const noexcept {
    if (uniform_) return {surface_.stiffness[0]};
    if (per_face_) return {surface_.stiffness[static_cast<std::size_t>(f)]};
    const Face& face = mesh.face(f);
    if (surface_.field == FieldKind::continuous) return clough_tocher(face, x);
    const Vector3<> b = barycentric(face, x);
    double k = 0.0;
    for (int i = 0; i < 3; ++i) k += b[i] * vertex_stiffness(face, i);
    return {k};
  }

  [[nodiscard]] double damping_at(const TriangleMesh& mesh, std::int32_t f, const Vector3<>& x) const noexcept {
    if (surface_.damping.size() == 1) return surface_.damping[0];
    if (damping_per_face_) return surface_.damping[static_cast<std::size_t>(f)];
    const Face& face = mesh.face(f);
    const Vector3<> b = barycentric(face, x);
    double d = 0.0;
    for (int i = 0; i < 3; ++i) d += b[i] * surface_.damping[static_cast<std::size_t>(face.vertex[static_cast<std::size_t>(i)])];
    return d;
  }

 private:
  [[nodiscard]] double vertex_stiffness(const Face& face, int i) const noexcept {
    return surface_.stiffness[static_cast<std::size_t>(face.vertex[static_cast<std::size_t>(i)])];
  }

  /// Convert values per face to values per vertex: means weighted by the angles of the faces.
  void average_to_vertices(const TriangleMesh& mesh) {
    std::vector<double> sum(mesh.vertices().size(), 0.0), weight(mesh.vertices().size(), 0.0);
    for (std::int32_t f = 0; f < mesh.size(); ++f) {
      const Face& face = mesh.face(f);
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3<> a = face.corner[(i + 1) % 3] - face.corner[i], b = face.corner[(i + 2) % 3] - face.corner[i];
        const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
        const auto v = static_cast<std::size_t>(face.vertex[i]);
        sum[v] += angle * surface_.stiffness[static_cast<std::size_t>(f)];
        weight[v] += angle;
      }
    }
    for (std::size_t v = 0; v < sum.size(); ++v) sum[v] = weight[v] > 0.0 ? sum[v] / weight[v] : 0.0;
    surface_.stiffness = std::move(sum);
    per_face_ = false;
  }

  /// Interpolate with three cubics per face, split at the centroid (Clough and Tocher 1965).
  ///
  /// The vertices have the given values and zero gradient; the derivative across edges is zero.
  /// Value and gradient are continuous over the mesh for any dihedral angle.
  [[nodiscard]] LocalStiffness clough_tocher(const Face& face, const Vector3<>& x) const noexcept {
    const Vector3<> k(vertex_stiffness(face, 0), vertex_stiffness(face, 1), vertex_stiffness(face, 2));
    const Vector3<> centroid = (face.corner[0] + face.corner[1] + face.corner[2]) / 3.0;
    // Bezier ordinate in the middle of each sub-triangle (i, i + 1, centroid), chosen so that the
    // derivative across the edge vanishes.
    Vector3<> middle, inner;
    for (int i = 0; i < 3; ++i) {
      const Vector3<>& p = face.corner[static_cast<std::size_t>(i)];
      const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - p;
      const double foot = (centroid - p).dot(e) / e.squaredNorm();
      middle[i] = (1.0 - foot) * k[i] + foot * k[(i + 1) % 3];
    }
    for (int i = 0; i < 3; ++i) inner[i] = (k[i] + middle[i] + middle[(i + 2) % 3]) / 3.0;  // between corner i and the centroid
    const double top = inner.sum() / 3.0;
    const Vector3<> b = barycentric(face, x);
    int farthest = 0;  // corner farthest from x; x lies in the opposite sub-triangle
    for (int i = 1; i < 3; ++i)
      if (b[i] < b[farthest]) farthest = i;
    const int i = (farthest + 1) % 3, j = (farthest + 2) % 3;
    const double w = 3.0 * b[farthest], u = b[i] - b[farthest], v = b[j] - b[farthest];
    // Quadratic ordinates after one step of de Casteljau's algorithm, per direction.
    const double m = middle[i];
    const double qu = u * u * k[i] + v * v * k[j] + w * w * inner[i] + 2.0 * (u * v * k[i] + u * w * k[i] + v * w * m);
    const double qv = u * u * k[i] + v * v * k[j] + w * w * inner[j] + 2.0 * (u * v * k[j] + u * w * m + v * w * k[j]);
    const double qw = u * u * k[i] + v * v * k[j] + w * w * top + 2.0 * (u * v * m + u * w * inner[i] + v * w * inner[j]);
    LocalStiffness local;
    local.stiffness = u * qu + v * qv + w * qw;
    // Gradient: 3 (qu grad u + qv grad v + qw grad w), in the plane of the face.
    const auto slope_of = [&face](int c) -> Vector3<> {
      const Vector3<> e = face.corner[static_cast<std::size_t>((c + 2) % 3)] - face.corner[static_cast<std::size_t>((c + 1) % 3)];
      const Vector3<> across = face.normal.cross(e);
      return across / across.dot(face.corner[static_cast<std::size_t>(c)] - face.corner[static_cast<std::size_t>((c + 1) % 3)]);
    };
    const Vector3<> g = slope_of(farthest);
    local.slope = 3.0 * (qu * (slope_of(i) - g) + qv * (slope_of(j) - g) + qw * 3.0 * g);
    return local;
  }

  Surface surface_;
  ForceShading shading_;
  bool usable_ = true;
  bool uniform_ = true;
  bool per_face_ = false;
  bool damping_per_face_ = false;
};

}  // namespace palpate::mesh
