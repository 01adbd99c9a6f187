#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/layer_modulus.hpp"
#include "palpate/deformable/linear/creep.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Triangulated contact surface of a body.
struct ContactSurface {
  std::vector<Vector3<>> vertices;                     ///< at rest, m
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< counterclockwise seen from outside
  std::vector<std::int32_t> node;                      ///< contact node of each vertex; -1: fixed
  std::vector<LayerModulus> modulus;                   ///< of each contact node
  double poisson = 0.45;                               ///< Poisson's ratio nu
};

/// Contact points of the patches of a surface. A patch belongs to a node: the third of each adjacent triangle next to it. Its points move
/// with the node.
///
/// Points lie on a quadratic surface through the edges' ends and normals (after Nagata 2005), not on the flat triangle, unless a triangle
/// at one of its corners deviates from the corner's normal by more than 35 degrees: edges stay sharp.
///
/// Each point carries an elastic layer (Winkler foundation) of the pressure stiffness E* / (beta b), with the radius b of a circle of the
/// patch's area. The layer restores the local compliance that the mesh lacks: a node of quadratic tetrahedra, loaded by linear hat
/// functions, yields by 0.35 to 0.37 / (E* b) under a unit force, but a uniformly loaded circle by 16 / (3 pi^2 E* b) (Johnson 1985,
/// section 3.4), and the rest is the pressure's variation within a patch.
class PatchPoints {
 public:
  static constexpr double sphere_beta = 0.85;  ///< fitted to converged forces of spheres, contact radius 0.3 to 2.8 cells
  static constexpr double flat_beta = 0.5;     ///< same for a flat end of radius 1 to 3.2 cells; the pressure is singular at its edge
  static constexpr int padding = detail::float_lanes;  ///< points per node are a multiple of it, filled up with points of stiffness zero

  PatchPoints() = default;

  /// @param modulus            of the layer, by kind of tip
  /// @param points_per_corner  points on the sixth of a triangle beside each half edge: 1 or 3, i.e. 12 or 36 points per regular node
  PatchPoints(const ContactSurface& surface, double LayerModulus::*modulus, double beta, int points_per_corner) {
    const std::vector<double> area = patch_areas(surface);
    const std::size_t nodes = area.size();
    std::vector<double> stiffness(nodes, 0.0);
    for (std::size_t i = 0; i < nodes; ++i)
      if (area[i] > 0.0) stiffness[i] = surface.modulus[i].*modulus / (beta * std::sqrt(area[i] / M_PI));
    std::vector<std::vector<Point>> points(nodes);
    const std::vector<Vector3<>> normals = smooth_normals(surface);
    for (const auto& t : surface.triangles) add_triangle(surface, normals, stiffness, t, points_per_corner, points);
    store(points);
  }

  /// Mean square root of the area of a node's patch, m.
  [[nodiscard]] static double mean_spacing(const ContactSurface& surface) {
    double sum = 0.0;
    for (const double area : patch_areas(surface)) sum += std::sqrt(area) / static_cast<double>(surface.modulus.size());
    return sum;
  }

  [[nodiscard]] std::int32_t size() const noexcept { return static_cast<std::int32_t>(reach_.size()); }
  [[nodiscard]] std::size_t begin(std::int32_t node) const noexcept { return begin_[at(node)]; }
  [[nodiscard]] std::size_t end(std::int32_t node) const noexcept { return begin_[at(node) + 1]; }
  /// Largest distance of a node's points from it, m.
  [[nodiscard]] double reach(std::int32_t node) const noexcept { return reach_[at(node)]; }
  /// Stiffness of all points of a node, N/m.
  [[nodiscard]] double stiffness(std::int32_t node) const noexcept { return stiffness_[at(node)]; }
  /// Largest reach of all nodes, m.
  [[nodiscard]] double max_reach() const noexcept { return max_reach_; }

  /// Coordinates of the points: offset from the node [m] (0 to 2), outward unit normal (3 to 5), stiffness [N/m] (6).
  [[nodiscard]] const float* coordinate(std::size_t number) const noexcept { return columns_[number].data()->value.data(); }

 private:
  struct Point {
    Vector3<> offset, normal;
    double stiffness;
  };
  static constexpr double min_alignment = 0.82;  // of a corner normal with the triangle's: 35 degrees

  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  [[nodiscard]] static Vector3<> area_vector(const ContactSurface& surface, const std::array<std::int32_t, 3>& t) {
    const Vector3<>&a = surface.vertices[at(t[0])], &b = surface.vertices[at(t[1])], &c = surface.vertices[at(t[2])];
    return 0.5 * (b - a).cross(c - a);
  }

  /// Area of the patch of each node, m^2.
  [[nodiscard]] static std::vector<double> patch_areas(const ContactSurface& surface) {
    std::vector<double> area(surface.modulus.size(), 0.0);
    for (const auto& t : surface.triangles)
      for (const std::int32_t v : t)
        if (surface.node[at(v)] >= 0) area[at(surface.node[at(v)])] += area_vector(surface, t).norm() / 3.0;
    return area;
  }

  /// Unit normals of the vertices; zero where an adjacent triangle deviates by more than 35 degrees: edges stay sharp.
  [[nodiscard]] static std::vector<Vector3<>> smooth_normals(const ContactSurface& surface) {
    std::vector<Vector3<>> normals(surface.vertices.size(), Vector3<>::Zero());
    for (const auto& t : surface.triangles)
      for (const std::int32_t v : t) normals[at(v)] += area_vector(surface, t);
    for (Vector3<>& n : normals) n.normalize();
    std::vector<bool> sharp(normals.size(), false);
    for (const auto& t : surface.triangles)
      for (const std::int32_t v : t)
        if (!(area_vector(surface, t).normalized().dot(normals[at(v)]) > min_alignment)) sharp[at(v)] = true;
    for (std::size_t v = 0; v < normals.size(); ++v)
      if (sharp[v]) normals[v].setZero();
    return normals;
  }

  /// Quadratic coefficient c of an edge curve x(s) = x1 + (d - c) s + c s^2 with the normals n1 and n2 at its ends: along n1 + n2, with
  /// n1.c = n2.c = (n1.d - n2.d) / 2. It equals Nagata's c on a circular arc. Nagata's c has no bound where the surface changes from convex
  /// to concave between the ends.
  [[nodiscard]] static Vector3<> edge_curvature(const Vector3<>& d, const Vector3<>& n1, const Vector3<>& n2) {
    return (n1 - n2).dot(d) / (2.0 + 2.0 * n1.dot(n2)) * (n1 + n2);
  }

  static void add_triangle(const ContactSurface& surface, const std::vector<Vector3<>>& normals, const std::vector<double>& stiffness,
                           const std::array<std::int32_t, 3>& t, int points_per_corner, std::vector<std::vector<Point>>& points) {
    const Vector3<> area = area_vector(surface, t);
    if (!(area.norm() > 0.0)) return;
    const Vector3<> flat = area.normalized();
    bool curved = true;
    for (const std::int32_t v : t) curved = curved && normals[at(v)].squaredNorm() > 0.0;
    Matrix3<> corner, normal, curvature = Matrix3<>::Zero();  // columns
    for (int c = 0; c < 3; ++c) {
      corner.col(c) = surface.vertices[at(t[static_cast<std::size_t>(c)])];
      normal.col(c) = curved ? normals[at(t[static_cast<std::size_t>(c)])] : flat;
    }
    if (curved)
      for (int c = 0; c < 3; ++c) {
        const int next = (c + 1) % 3;
        curvature.col(c) = edge_curvature(corner.col(next) - corner.col(c), normal.col(c), normal.col(next));
      }
    for (int c = 0; c < 3; ++c) {
      const std::int32_t node = surface.node[at(t[static_cast<std::size_t>(c)])];
      if (node < 0) continue;
      for (const int other : {(c + 1) % 3, (c + 2) % 3}) {
        Matrix3<> ends = Matrix3<>::Zero();  // barycentric coordinates of the sixth's corners: vertex, middle of the edge, center
        ends(c, 0) = 1.0;
        ends(c, 1) = ends(other, 1) = 0.5;
        ends.col(2).setConstant(1.0 / 3.0);
        for (int p = 0; p < points_per_corner; ++p) {
          Vector3<> weights = Vector3<>::Constant(points_per_corner == 1 ? 1.0 / 3.0 : 1.0 / 6.0);
          if (points_per_corner > 1) weights[p] = 2.0 / 3.0;
          const Vector3<> l = ends * weights;
          Vector3<> x = corner * l;
          for (int e = 0; e < 3; ++e) x -= (l[e] * l[(e + 1) % 3]) * curvature.col(e);
          points[at(node)].push_back(
              {x - corner.col(c), (normal * l).normalized(), stiffness[at(node)] * area.norm() / (6.0 * points_per_corner)});
        }
      }
    }
  }

  void store(const std::vector<std::vector<Point>>& points) {
    begin_.push_back(0);
    for (const std::vector<Point>& list : points) {
      begin_.push_back(begin_.back() + (list.size() + padding - 1) / padding * padding);
      double reach = 0.0, stiffness = 0.0;
      for (const Point& p : list) {
        reach = std::max(reach, p.offset.norm());
        stiffness += p.stiffness;
      }
      reach_.push_back(reach);
      stiffness_.push_back(stiffness);
      max_reach_ = std::max(max_reach_, reach);
    }
    for (std::vector<detail::FloatLine>& column : columns_) column.resize((begin_.back() + 15) / 16);
    for (std::size_t i = 0; i < points.size(); ++i)
      for (std::size_t k = 0; k < points[i].size(); ++k) {
        const Point& p = points[i][k];
        const std::size_t line = (begin_[i] + k) / 16, lane = (begin_[i] + k) % 16;
        for (int a = 0; a < 3; ++a) {
          columns_[at(a)][line].value[lane] = static_cast<float>(p.offset[a]);
          columns_[at(a + 3)][line].value[lane] = static_cast<float>(p.normal[a]);
        }
        columns_[6][line].value[lane] = static_cast<float>(p.stiffness);
      }
  }

  std::vector<std::size_t> begin_;                         // of each node's points, and the end
  std::vector<double> reach_;                              // by node, m
  std::vector<double> stiffness_;                          // by node, N/m
  double max_reach_ = 0.0;                                 // m
  std::array<std::vector<detail::FloatLine>, 7> columns_;  // see coordinate()
};

/// Contact points of a surface for both kinds of tips.
struct ContactPatches {
  PatchPoints round;         ///< for a capsule or sphere
  PatchPoints flat;          ///< for a cylinder
  double shear_ratio = 1.0;  ///< shear stiffness over normal stiffness of the layer, 2 (1 - nu) / (2 - nu) (Mindlin 1949)
  Creep creep;               ///< of the layer; the points' stiffness is that of a period

  ContactPatches() = default;
  explicit ContactPatches(const ContactSurface& surface, const Creep& law = {})
      : round(surface, &LayerModulus::round, PatchPoints::sphere_beta * law.period_ratio, 1),
        flat(surface, &LayerModulus::flat, PatchPoints::flat_beta * law.period_ratio, 3),
        shear_ratio(2.0 * (1.0 - surface.poisson) / (2.0 - surface.poisson)),
        creep(law) {}
};

}  // namespace palpate::deformable
