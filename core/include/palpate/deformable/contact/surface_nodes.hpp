#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Rigid tip that indents a body: a sphere, or the flat end of a cylindrical rod.
struct Tip {
  enum class Kind { sphere, flat };
  Kind kind = Kind::sphere;
  double radius = 5e-3;                    ///< m
  Vector3<> center = Vector3<>::Zero();    ///< of the sphere or of the flat end, m
  Vector3<> outward = Vector3<>::UnitZ();  ///< unit vector out of the body; the rod's axis
  bool continued = true;                   ///< whether a cone may continue the sphere along `outward`, see depth_in_sphere()
};

/// Contact nodes of a body's surface in the undeformed state, in a uniform grid. The cost of a query does not grow with the body.
class SurfaceNodes {
 public:
  /// Contact geometry between the tip and one node.
  struct NodeContact {
    std::int32_t node = 0;
    double depth = 0.0;                               ///< penetration along the node's inward normal, m
    Vector3<> depth_gradient = Vector3<>::Zero();     ///< of `depth` by the tip center
    double coverage = 1.0;                            ///< fraction of the node's patch that is covered, in (0, 1]
    Vector3<> coverage_gradient = Vector3<>::Zero();  ///< of `coverage` by the tip center, 1/m
  };

  SurfaceNodes() = default;

  /// Build from positions [m], outward unit normals and patch areas [m^2], one of each per node.
  SurfaceNodes(std::vector<Vector3<>> points, std::vector<Vector3<>> normals, const std::vector<double>& areas)
      : points_(std::move(points)), normals_(std::move(normals)), tangent_bases_(normals_.size()), patch_widths_(areas.size()) {
    for (std::size_t i = 0; i < normals_.size(); ++i) {
      const Vector3<> one = normals_[i].unitOrthogonal();
      tangent_bases_[i] << one, normals_[i].cross(one);
    }
    double total = 0.0;
    for (std::size_t i = 0; i < areas.size(); ++i) {
      patch_widths_[i] = std::sqrt(areas[i]);
      total += areas[i];
    }
    if (points_.empty()) return;
    max_patch_width_ = *std::max_element(patch_widths_.begin(), patch_widths_.end());
    grid_min_ = points_[0];
    Vector3<> box_max = points_[0];
    for (const Vector3<>& p : points_) {
      grid_min_ = grid_min_.cwiseMin(p);
      box_max = box_max.cwiseMax(p);
    }
    cell_size_ = 2.0 * std::sqrt(total / static_cast<double>(points_.size()));
    for (int a = 0; a < 3; ++a) {
      // At most a million cells: a long thin body has few nodes in a large bounding box.
      cell_size_ = std::max(cell_size_, (box_max[a] - grid_min_[a]) / 100.0);
    }
    for (int a = 0; a < 3; ++a) grid_size_[a] = static_cast<std::int32_t>((box_max[a] - grid_min_[a]) / cell_size_) + 1;
    const std::size_t cells =
        static_cast<std::size_t>(grid_size_[0]) * static_cast<std::size_t>(grid_size_[1]) * static_cast<std::size_t>(grid_size_[2]);
    std::vector<std::int32_t> count(cells, 0), next(cells, 0);
    for (const Vector3<>& p : points_) ++count[cell_of(p)];
    group_of_cell_.assign(cells + 1, 0);
    std::int32_t at = 0;
    for (std::size_t c = 0; c < cells; ++c) {
      group_of_cell_[c + 1] = group_of_cell_[c] + (count[c] > 0 ? 1 : 0);
      if (count[c] == 0) continue;
      Group g;
      g.begin = next[c] = at;
      g.end = at += count[c];
      groups_.push_back(g);
    }
    records_.resize(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const std::size_t c = cell_of(points_[i]);
      Group& g = groups_[static_cast<std::size_t>(group_of_cell_[c])];
      const bool one = next[c] == g.begin;
      g.box_min = one ? points_[i] : Vector3<>(g.box_min.cwiseMin(points_[i]));
      g.box_max = one ? points_[i] : Vector3<>(g.box_max.cwiseMax(points_[i]));
      records_[static_cast<std::size_t>(next[c]++)] = {points_[i], normals_[i], patch_widths_[i], static_cast<std::int32_t>(i)};
    }
    for (Group& g : groups_) compute_normal_cone(g);
  }

  /// Number of groups (nonempty grid cells); for_each_in_group() calls visit(node) for the nodes of one.
  [[nodiscard]] std::size_t group_count() const noexcept { return groups_.size(); }
  template <class Visit>
  void for_each_in_group(std::size_t number, Visit visit) const {
    for (std::int32_t k = groups_[number].begin; k < groups_[number].end; ++k) visit(records_[static_cast<std::size_t>(k)].node);
  }

  [[nodiscard]] std::int32_t size() const noexcept { return static_cast<std::int32_t>(points_.size()); }
  [[nodiscard]] const Vector3<>& point(std::int32_t i) const noexcept { return points_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const Vector3<>& normal(std::int32_t i) const noexcept { return normals_[static_cast<std::size_t>(i)]; }

  /// Orthonormal basis of a node's tangent plane, in columns.
  [[nodiscard]] const Eigen::Matrix<double, 3, 2>& tangent_basis(std::int32_t i) const noexcept {
    return tangent_bases_[static_cast<std::size_t>(i)];
  }

  /// Call `visit(node, depth)` for each node below or near the tip surface; contact_at() defines which nodes take part. `last_depth` is the
  /// penetration of the previous step [m]: it extends the search, so that nodes behind the tip are not lost. Groups for which
  /// `skip(group, depth)` returns true are not visited; `depth` is an upper bound of the penetration of their nodes.
  template <class Skip, class Visit>
  void query_tip(const Tip& tip, double last_depth, Skip skip, Visit visit) const noexcept {
    const bool flat = tip.kind == Tip::Kind::flat;
    const double reach = flat ? tip.radius + 0.5 * max_patch_width_ : tip.radius + 0.5 * last_depth;
    for_each_group(tip.center, tip.center + last_depth * tip.outward, reach, [&](std::size_t number) {
      const Group& g = groups_[number];
      if (skip(number, flat ? max_depth_under_flat(tip, g) : max_depth_in_sphere(tip, g))) return;
      for (std::int32_t k = g.begin; k < g.end; ++k) {
        const NodeRecord& record = records_[static_cast<std::size_t>(k)];
        const Vector3<> away = record.point - tip.center;
        const double alignment = record.normal.dot(tip.outward);
        if (!flat) {
          if (alignment < min_facing) continue;
          const double height = away.dot(record.normal),
                       below = lower_surface(tip.radius, std::max(away.squaredNorm() - height * height, 0.0));
          if (height + below < -max_height * tip.radius) continue;
          if (height > below && PassedFraction(tip, away, alignment, height - below).value <= min_fraction) continue;
          visit(record.node, height + below);
        } else {
          if (alignment < cos_max_angle) continue;
          const double height = away.dot(tip.outward);
          const double distance = std::sqrt(std::max(away.squaredNorm() - height * height, 0.0));
          if (edge_fraction(tip, record.width, distance) > min_fraction) visit(record.node, height / alignment);
        }
      }
    });
  }
  template <class Visit>
  void query_tip(const Tip& tip, Visit visit) const noexcept {
    query_tip(tip, 0.0, [](std::size_t, double) { return false; }, visit);
  }

  /// Same for nodes displaced by `inward(node)` [m] along their inward normals by present forces: `depth` is the penetration without these
  /// forces. Tests every node, so no node is lost whatever its displacement; meant for small node sets.
  template <class Inward, class Visit>
  void query_tip_all(const Tip& tip, Inward inward, Visit visit) const noexcept {
    for (const NodeRecord& record : records_) {
      const Vector3<> away = record.point - tip.center;
      const double alignment = record.normal.dot(tip.outward);
      if (alignment < cos_max_angle) continue;
      if (tip.kind == Tip::Kind::sphere) {
        const double along = away.dot(record.normal), aside = std::max(away.squaredNorm() - along * along, 0.0);
        const double height = along + inward(record.node);
        if (height > tip.radius) {  // no wider than the cone at this height
          const Vector3<> free = away + inward(record.node) * record.normal;
          const double wide = (tip.radius + cos_max_angle * height) / sin_max_angle;
          if ((free - free.dot(tip.outward) * tip.outward).squaredNorm() >= wide * wide) continue;
        }
        visit(record.node, height + lower_surface(tip.radius, aside));
      } else {
        const double height = away.dot(tip.outward);
        const double distance = std::sqrt(std::max(away.squaredNorm() - height * height, 0.0));
        if (edge_fraction(tip, record.width, distance) > min_fraction) visit(record.node, height / alignment + inward(record.node));
      }
    }
  }

  /// Call `visit(node)` for each node within `reach` [m] of the box from `low` to `high` [m].
  template <class Visit>
  void query_box(const Vector3<>& low, const Vector3<>& high, double reach, Visit visit) const noexcept {
    const double most = reach * reach;
    for_each_group(low, high, reach, [&](std::size_t number) {
      const Group& g = groups_[number];
      if ((low - g.box_max).cwiseMax(g.box_min - high).cwiseMax(0.0).squaredNorm() > most) return;
      for (std::int32_t k = g.begin; k < g.end; ++k) {
        const NodeRecord& record = records_[static_cast<std::size_t>(k)];
        if ((low - record.point).cwiseMax(record.point - high).cwiseMax(0.0).squaredNorm() <= most) visit(record.node);
      }
    });
  }

  /// Return the node nearest to `place` [m] within about `reach` [m], or -1.
  [[nodiscard]] std::int32_t nearest(const Vector3<>& place, double reach) const noexcept {
    std::int32_t found = -1;
    double min_square = 0.0;
    for_each_group(place, place, reach, [&](std::size_t number) {
      if (found >= 0 && squared_distance_to(place, groups_[number]) >= min_square) return;
      for (std::int32_t k = groups_[number].begin; k < groups_[number].end; ++k) {
        const double square = (records_[static_cast<std::size_t>(k)].point - place).squaredNorm();
        if (found >= 0 && square >= min_square) continue;
        found = records_[static_cast<std::size_t>(k)].node;
        min_square = square;
      }
    });
    return found;
  }

  /// Return the node nearest to `place` [m]; -1 without nodes. Tests every node; meant for small node sets.
  [[nodiscard]] std::int32_t nearest(const Vector3<>& place) const noexcept {
    const auto found = std::min_element(records_.begin(), records_.end(), [&](const NodeRecord& a, const NodeRecord& b) {
      return (a.point - place).squaredNorm() < (b.point - place).squaredNorm();
    });
    return found == records_.end() ? -1 : found->node;
  }

  /// Contact geometry of a node. A sphere acts on the nodes below or inside it.
  ///
  /// A node beyond the upper side of the sphere stays in contact only if the sphere passed over it: its normal must be within 53 degrees of
  /// `tip.outward` and its distance from the tip axis at most one radius. For other nodes (flanks, far side of a thin body) `coverage`
  /// fades to zero towards the upper side, so no node leaves with a finite force. For fixed `tip.outward` the result depends on the tip
  /// position only, not on the path.
  [[nodiscard]] NodeContact contact_at(const Tip& tip, std::int32_t node) const noexcept {
    NodeContact contact = contact_at_without_fade(tip, node);
    if (tip.kind == Tip::Kind::flat) return contact;
    const Vector3<>& n = normal(node);
    const Vector3<> away = point(node) - tip.center;
    const double beyond = 2.0 * away.dot(n) - contact.depth;  // height above the sphere's upper side, m
    if (!(beyond > -fade_width * tip.radius)) return contact;
    const PassedFraction passed(tip, away, n.dot(tip.outward), beyond);
    if (passed.value >= 1.0) return contact;
    const double p = std::max(passed.value, min_fraction);
    contact.coverage = p * p * (3.0 - 2.0 * p);
    contact.coverage_gradient = 6.0 * p * (1.0 - p) * (passed.d_beyond * (-2.0 * n - contact.depth_gradient) + passed.d_center);
    return contact;
  }

  /// Contact geometry without the fade for nodes beyond the tip's upper side.
  [[nodiscard]] NodeContact contact_at_without_fade(const Tip& tip, std::int32_t node) const noexcept {
    NodeContact contact;
    contact.node = node;
    const Vector3<>& n = normal(node);
    const Vector3<> away = point(node) - tip.center;
    if (tip.kind == Tip::Kind::sphere) {
      // Distance along the node's normal to the lower side of the sphere.
      const double height = away.dot(n);
      const Vector3<> aside = away - height * n;
      const double square = aside.squaredNorm(), below = lower_surface(tip.radius, square);
      contact.depth = height + below;
      contact.depth_gradient = -n + aside * (square < sin_max_angle * sin_max_angle * tip.radius * tip.radius
                                                 ? 1.0 / below
                                                 : sin_max_angle / (cos_max_angle * std::sqrt(square)));
      return contact;
    }
    // Distance to the plane of the flat end; `coverage` fades over the width of the node's patch.
    const double alignment = n.dot(tip.outward), height = away.dot(tip.outward);
    const Vector3<> aside = away - height * tip.outward;
    const double distance = aside.norm(), p = edge_fraction(tip, patch_widths_[static_cast<std::size_t>(node)], distance);
    contact.depth = height / alignment;
    contact.depth_gradient = -tip.outward / alignment;
    if (p < 1.0) {
      contact.coverage = p * p * (3.0 - 2.0 * p);
      if (distance > 0.0)  // an end that is smaller than the patch has no direction at its middle
        contact.coverage_gradient = (6.0 * p * (1.0 - p) / (patch_widths_[static_cast<std::size_t>(node)] * distance)) * aside;
    }
    return contact;
  }

 private:
  /// Weight of a node at height `beyond` [m] above a sphere's upper side, with derivatives by `beyond` and by the tip center.
  struct PassedFraction {
    PassedFraction(const Tip& tip, const Vector3<>& away, double alignment, double beyond) noexcept {
      const double width = fade_width * tip.radius;
      const double before = std::clamp(-beyond / width, 0.0, 1.0);
      const double same = std::clamp((alignment - 0.6) / 0.2, 0.0, 1.0);
      const Vector3<> aside = away - away.dot(tip.outward) * tip.outward;
      const double distance = aside.norm();
      const double within = 1.0 + (tip.radius - distance) / width;
      const double over = same * std::clamp(within, 0.0, 1.0);
      value = before + (1.0 - before) * over;
      if (before > 0.0) d_beyond = -(1.0 - over) / width;
      if (within > 0.0 && within < 1.0) d_center = ((1.0 - before) * same / (width * distance)) * aside;
    }
    double value = 1.0, d_beyond = 0.0;
    Vector3<> d_center = Vector3<>::Zero();
  };

  /// Data of a node that a query reads: one cache line.
  struct alignas(64) NodeRecord {
    Vector3<> point = Vector3<>::Zero();
    Vector3<> normal = Vector3<>::Zero();
    double width = 0.0;
    std::int32_t node = 0;
  };
  /// Nodes of one grid cell, contiguous, with bounding box and normal cone.
  struct Group {
    Vector3<> box_min = Vector3<>::Zero(), box_max = Vector3<>::Zero();
    std::int32_t begin = 0, end = 0;
    Vector3<> mean_normal = Vector3<>::Zero();  // mean of the unit normals
    double normal_spread = 0.0;                 // largest distance of a normal from the mean
    double max_offset = 0.0;                    // largest offset of a node along its normal from the box center, m
  };

  void compute_normal_cone(Group& g) const {
    for (std::int32_t k = g.begin; k < g.end; ++k) g.mean_normal += records_[static_cast<std::size_t>(k)].normal;
    g.mean_normal /= g.end - g.begin;
    const Vector3<> middle = 0.5 * (g.box_min + g.box_max);
    for (std::int32_t k = g.begin; k < g.end; ++k) {
      const NodeRecord& record = records_[static_cast<std::size_t>(k)];
      g.normal_spread = std::max(g.normal_spread, (record.normal - g.mean_normal).norm());
      g.max_offset = std::max(g.max_offset, (record.point - middle).dot(record.normal));
    }
  }

  /// Call `visit(g)` for each group in the grid cells within `reach` [m] of the box spanned by two points.
  template <class Visit>
  void for_each_group(const Vector3<>& one, const Vector3<>& other, double reach, Visit visit) const noexcept {
    if (points_.empty()) return;
    std::int32_t from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      const double first = (std::min(one[a], other[a]) - reach - grid_min_[a]) / cell_size_;
      const double last = (std::max(one[a], other[a]) + reach - grid_min_[a]) / cell_size_;
      if (!(last >= 0.0) || !(first < grid_size_[a])) return;
      from[a] = static_cast<std::int32_t>(std::max(first, 0.0));
      to[a] = static_cast<std::int32_t>(std::min(last, grid_size_[a] - 1.0));
    }
    for (std::int32_t x = from[0]; x <= to[0]; ++x)
      for (std::int32_t y = from[1]; y <= to[1]; ++y) {
        const std::size_t row = (static_cast<std::size_t>(x) * static_cast<std::size_t>(grid_size_[1]) + static_cast<std::size_t>(y)) *
                                static_cast<std::size_t>(grid_size_[2]);
        const auto end = static_cast<std::size_t>(group_of_cell_[row + static_cast<std::size_t>(to[2]) + 1]);
        for (auto g = static_cast<std::size_t>(group_of_cell_[row + static_cast<std::size_t>(from[2])]); g < end; ++g) visit(g);
      }
  }

  /// Squared distance from `place` to the bounding box of a group, m^2.
  [[nodiscard]] static double squared_distance_to(const Vector3<>& place, const Group& g) noexcept {
    return (g.box_min - place).cwiseMax(place - g.box_max).cwiseMax(0.0).squaredNorm();
  }

  /// Upper bound of the penetration of a group's nodes into a sphere or its tangent cone, m. If the sphere's center is in front of the
  /// tangent plane of a node at distance d > r (radius), the penetration is at most -(d^2 - r^2) / 2d into the sphere, and (r - d sin) /
  /// cos into the cone.
  [[nodiscard]] static double max_depth_in_sphere(const Tip& tip, const Group& g) noexcept {
    const double square = squared_distance_to(tip.center, g), more = square - tip.radius * tip.radius;
    const Vector3<> away = 0.5 * (g.box_min + g.box_max) - tip.center;
    const bool before = away.dot(g.mean_normal) + away.norm() * g.normal_spread + g.max_offset < 0.0;
    if (!(more > 0.0 && before)) return std::numeric_limits<double>::infinity();
    const double distance = std::sqrt(square);
    return std::max(-0.5 * more / distance, (tip.radius - sin_max_angle * distance) / cos_max_angle);
  }

  /// Upper bound of the penetration of a group's nodes into a flat end, m.
  [[nodiscard]] static double max_depth_under_flat(const Tip& tip, const Group& g) noexcept {
    const Vector3<> half = 0.5 * (g.box_max - g.box_min);
    const double height = tip.outward.dot(g.box_min + half - tip.center) + tip.outward.cwiseAbs().dot(half);
    return height > 0.0 ? height / cos_max_angle : height;
  }

  /// Signed position of a flat end's edge in a patch at `distance` from the axis: 0 outside, at least 1 inside. A loaded patch reaches past
  /// its node, so the edge is shifted inwards by an eighth of a patch width; stiffness then depends little on the mesh size.
  [[nodiscard]] static double edge_fraction(const Tip& tip, double width, double distance) noexcept {
    return (tip.radius - distance) / width + 0.38;
  }

  /// Height of the sphere's lower side below its center at squared radial distance `square` [m^2]. Beyond 0.98 radii the sphere is
  /// continued by its tangent cone (78 degrees), which avoids a vertical wall at the equator and a force jump as nodes come under it.
  [[nodiscard]] static double lower_surface(double radius, double square) noexcept {
    if (square < sin_max_angle * sin_max_angle * radius * radius) return std::sqrt(radius * radius - square);
    return (radius - sin_max_angle * std::sqrt(square)) / cos_max_angle;
  }

  static constexpr double min_fraction = 1e-3;
  static constexpr double fade_width = 0.4;     // of the sphere's radius: twice the height at which the cone begins
  static constexpr double max_height = 0.5;     // of a node at rest above the sphere's lower side, of the radius: upper bound of any uplift
  static constexpr double min_facing = -0.5;    // smallest normal . outward of a node in contact with a sphere
  static constexpr double cos_max_angle = 0.2;  // of the largest angle between node normal and tip axis, 78 degrees
  static constexpr double sin_max_angle = 0.97979589711327123;  // sine of the same angle

  [[nodiscard]] std::size_t cell_of(const Vector3<>& p) const noexcept {
    std::size_t c = 0;
    for (int a = 0; a < 3; ++a) {
      const auto i = std::clamp(static_cast<std::int32_t>((p[a] - grid_min_[a]) / cell_size_), 0, grid_size_[a] - 1);
      c = c * static_cast<std::size_t>(grid_size_[a]) + static_cast<std::size_t>(i);
    }
    return c;
  }

  std::vector<Vector3<>> points_;   // m
  std::vector<Vector3<>> normals_;  // unit, outward
  std::vector<Eigen::Matrix<double, 3, 2>> tangent_bases_;
  std::vector<double> patch_widths_;  // square roots of the patch areas, m
  double max_patch_width_ = 0.0;
  Vector3<> grid_min_ = Vector3<>::Zero();  // lower corner of the grid, m
  double cell_size_ = 1.0;                  // m
  std::int32_t grid_size_[3] = {1, 1, 1};
  std::vector<std::int32_t> group_of_cell_;  // by cell: index of its group, or of the next nonempty one
  std::vector<Group> groups_;                // nonempty cells
  std::vector<NodeRecord> records_;          // nodes sorted by cell
};

}  // namespace palpate::deformable
