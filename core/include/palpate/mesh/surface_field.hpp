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

/// How stiffness spreads over a mesh.
enum class FieldKind {
  discrete,    ///< each polygon has its own (thesis ch. 5): force steps where two of them meet
  continuous,  ///< smooth over the surface, and the force is the slope of a potential
};

/// How a surface answers. Stiffness and damping are given once, per triangle, or per vertex.
struct Surface {
  std::vector<double> stiffness{1000.0};  ///< along the normal, N/m
  std::vector<double> damping{};          ///< along the normal, N*s/m; empty for none
  double tangential = -1.0;               ///< N/m; negative: as stiff as along the normal, wherever that is
  double static_friction = 0.0;           ///< coefficient; infinity: never slips
  double dynamic_friction = 0.0;          ///< coefficient, not above the static one
  double viscous = 0.0;                   ///< drag on the sliding proxy, N*s/m
  FieldKind field = FieldKind::discrete;
  double shading = 0.0;  ///< edges that turn by less [rad] are not felt; 0 for none
  double period = 1e-3;  ///< of the servo, s; for damping and viscous friction
};

/// A surface laid out over one mesh: what a servo tick reads.
class SurfaceField {
 public:
  /// Stiffness at a point and its slope along the surface.
  struct LocalStiffness {
    double stiffness = 0.0;               ///< N/m
    Vector3<> slope = Vector3<>::Zero();  ///< N/m per m
  };

  SurfaceField() = default;

  /// False if a list has neither one, nor one per triangle, nor one per vertex, or a number is negative or not finite.
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
    if (surface_.damping.empty()) surface_.damping = {0.0};
    const auto faces = static_cast<std::size_t>(mesh.size());
    per_face_ = surface_.stiffness.size() == faces;
    damping_per_face_ = surface_.damping.size() == faces;
    if (surface_.field == FieldKind::continuous && per_face_ && faces > 1) average_to_vertices(mesh);
    uniform_ = surface_.stiffness.size() == 1;
    if (surface_.shading > 0.0) shading_ = ForceShading(mesh, surface_.shading);
  }

  [[nodiscard]] const Surface& surface() const noexcept { return surface_; }
  [[nodiscard]] const ForceShading& shading() const noexcept { return shading_; }

  /// After the mesh has moved.
  void refit(const TriangleMesh& mesh) noexcept {
    if (shading_.enabled()) shading_.refit(mesh);
  }

  /// After only the faces [first, last) have.
  template <class Iterator>
  void refit(const TriangleMesh& mesh, Iterator first, Iterator last) noexcept {
    if (!shading_.enabled()) return;
    for (; first != last; ++first) shading_.refit(mesh, *first);
  }

  /// Stiffness at the point `x` [m] of face `f`.
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

  /// Values per polygon become values per vertex: means weighted by the polygons' angles at the vertex.
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

  /// The face split at its centroid into three cubics (Clough & Tocher 1965) with the vertices' values, no slope at vertices and none
  /// across edges: value and slope are then continuous over the whole mesh, whatever angle its faces make.
  [[nodiscard]] LocalStiffness clough_tocher(const Face& face, const Vector3<>& x) const noexcept {
    const Vector3<> k(vertex_stiffness(face, 0), vertex_stiffness(face, 1), vertex_stiffness(face, 2));
    const Vector3<> centroid = (face.corner[0] + face.corner[1] + face.corner[2]) / 3.0;
    // Bezier ordinate in the middle of each sub-triangle (i, i + 1, centroid): what makes the slope across its edge vanish.
    Vector3<> middle, inner;
    for (int i = 0; i < 3; ++i) {
      const Vector3<>& p = face.corner[static_cast<std::size_t>(i)];
      const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - p;
      const double foot = (centroid - p).dot(e) / e.squaredNorm();
      middle[i] = (1.0 - foot) * k[i] + foot * k[(i + 1) % 3];
    }
    for (int i = 0; i < 3; ++i) inner[i] = (k[i] + middle[i] + middle[(i + 2) % 3]) / 3.0;  // on the way from corner i to the centroid
    const double top = inner.sum() / 3.0;
    const Vector3<> b = barycentric(face, x);
    int farthest = 0;  // the corner farthest from x: x lies in the sub-triangle opposite to it
    for (int i = 1; i < 3; ++i)
      if (b[i] < b[farthest]) farthest = i;
    const int i = (farthest + 1) % 3, j = (farthest + 2) % 3;
    const double w = 3.0 * b[farthest], u = b[i] - b[farthest], v = b[j] - b[farthest];
    // Quadratic ordinates after one step of de Casteljau, by direction.
    const double m = middle[i];
    const double qu = u * u * k[i] + v * v * k[j] + w * w * inner[i] + 2.0 * (u * v * k[i] + u * w * k[i] + v * w * m);
    const double qv = u * u * k[i] + v * v * k[j] + w * w * inner[j] + 2.0 * (u * v * k[j] + u * w * m + v * w * k[j]);
    const double qw = u * u * k[i] + v * v * k[j] + w * w * top + 2.0 * (u * v * m + u * w * inner[i] + v * w * inner[j]);
    LocalStiffness local;
    local.stiffness = u * qu + v * qv + w * qw;
    // Slope: 3 (qu grad u + qv grad v + qw grad w), in the face's plane.
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
  bool uniform_ = true;
  bool per_face_ = false;
  bool damping_per_face_ = false;
};

}  // namespace palpate::mesh
