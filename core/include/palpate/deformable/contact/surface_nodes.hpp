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

/// The rigid tip that presses a body: a sphere, or the flat end of a rod.
struct Tip {
  enum class Kind { sphere, flat };
  Kind kind = Kind::sphere;
  double radius = 5e-3;                    ///< m
  Vector3<> centre = Vector3<>::Zero();    ///< of the sphere, or of the flat end, m
  Vector3<> outward = Vector3<>::UnitZ();  ///< unit, out of the body where it is pressed; the rod's axis
};

/// The nodes of a body's touchable surface at rest, found by place: a grid of cells, so that a look takes no longer on a larger body.
class SurfaceNodes {
 public:
  /// How far the tip is in at one node.
  struct Near {
    std::int32_t node = 0;
    double depth = 0.0;                         ///< how far the node must give way along its inward normal, m
    Vector3<> slope = Vector3<>::Zero();        ///< of the depth, by the tip's centre
    double cover = 1.0;                         ///< the part of the node's patch that lies under a flat end, above 0
    Vector3<> cover_slope = Vector3<>::Zero();  ///< of `cover`, by the tip's centre, 1/m
  };

  SurfaceNodes() = default;

  /// Places [m], outward unit normals, and areas [m^2] of the patches, one of each per node.
  SurfaceNodes(std::vector<Vector3<>> points, std::vector<Vector3<>> normals, const std::vector<double>& areas)
      : points_(std::move(points)), normals_(std::move(normals)), across_(normals_.size()), widths_(areas.size()) {
    for (std::size_t i = 0; i < normals_.size(); ++i) {
      const Vector3<> one = normals_[i].unitOrthogonal();
      across_[i] << one, normals_[i].cross(one);
    }
    double total = 0.0;
    for (std::size_t i = 0; i < areas.size(); ++i) {
      widths_[i] = std::sqrt(areas[i]);
      total += areas[i];
    }
    if (points_.empty()) return;
    widest_ = *std::max_element(widths_.begin(), widths_.end());
    low_ = points_[0];
    Vector3<> high = points_[0];
    for (const Vector3<>& p : points_) {
      low_ = low_.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    cell_ = 2.0 * std::sqrt(total / static_cast<double>(points_.size()));
    for (int a = 0; a < 3; ++a) {
      // Never more than a million cells: a long thin body has few nodes in a large box.
      cell_ = std::max(cell_, (high[a] - low_[a]) / 100.0);
    }
    for (int a = 0; a < 3; ++a) count_[a] = static_cast<std::int32_t>((high[a] - low_[a]) / cell_) + 1;
    const std::size_t cells =
        static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(count_[2]);
    std::vector<std::int32_t> count(cells, 0), next(cells, 0);
    for (const Vector3<>& p : points_) ++count[cell_of(p)];
    first_.assign(cells + 1, 0);
    std::int32_t at = 0;
    for (std::size_t c = 0; c < cells; ++c) {
      first_[c + 1] = first_[c] + (count[c] > 0 ? 1 : 0);
      if (count[c] == 0) continue;
      Group group;
      group.begin = next[c] = at;
      group.end = at += count[c];
      groups_.push_back(group);
    }
    places_.resize(points_.size());
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const std::size_t c = cell_of(points_[i]);
      Group& group = groups_[static_cast<std::size_t>(first_[c])];
      const bool one = next[c] == group.begin;
      group.low = one ? points_[i] : Vector3<>(group.low.cwiseMin(points_[i]));
      group.high = one ? points_[i] : Vector3<>(group.high.cwiseMax(points_[i]));
      places_[static_cast<std::size_t>(next[c]++)] = {points_[i], normals_[i], widths_[i], static_cast<std::int32_t>(i)};
    }
    for (Group& group : groups_) face(group);
  }

  /// How many groups of neighbours there are, and the nodes of one: calls take(node) for each.
  [[nodiscard]] std::size_t groups() const noexcept { return groups_.size(); }
  template <class Take>
  void group(std::size_t number, Take take) const {
    for (std::int32_t k = groups_[number].begin; k < groups_[number].end; ++k) take(places_[static_cast<std::size_t>(k)].node);
  }

  [[nodiscard]] std::int32_t size() const noexcept { return static_cast<std::int32_t>(points_.size()); }
  [[nodiscard]] const Vector3<>& point(std::int32_t i) const noexcept { return points_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const Vector3<>& normal(std::int32_t i) const noexcept { return normals_[static_cast<std::size_t>(i)]; }

  /// Two unit vectors, in columns, that span a node's tangent plane.
  [[nodiscard]] const Eigen::Matrix<double, 3, 2>& across(std::int32_t i) const noexcept { return across_[static_cast<std::size_t>(i)]; }

  /// Calls `take(node, depth)` for each node that lies under the tip, in or before it; see `reached` for which do. `deep` is how deep the
  /// tip was in before [m]: so far out nodes are looked for, and a tip does not lose those that it has passed. Of a group of which
  /// `skip(group, depth)` is true, none of whose nodes is deeper than that, no node is taken.
  template <class Skip, class Take>
  void under(const Tip& tip, double deep, Skip skip, Take take) const noexcept {
    const bool flat = tip.kind == Tip::Kind::flat;
    const double reach = flat ? tip.radius + 0.5 * widest_ : tip.radius + 0.5 * deep;
    visit(tip.centre, tip.centre + deep * tip.outward, reach, [&](std::size_t number) {
      const Group& group = groups_[number];
      if (skip(number, flat ? deepest_before_end(tip, group) : deepest_in_sphere(tip, group))) return;
      for (std::int32_t k = group.begin; k < group.end; ++k) {
        const NodeRecord& place = places_[static_cast<std::size_t>(k)];
        const Vector3<> away = place.point - tip.centre;
        const double facing = place.normal.dot(tip.outward);
        if (!flat) {
          if (facing < least_facing) continue;
          const double height = away.dot(place.normal), below = lower(tip.radius, std::max(away.squaredNorm() - height * height, 0.0));
          if (height + below < -highest * tip.radius) continue;
          if (height > below && Passed(tip, away, facing, height - below).part <= least_part) continue;
          take(place.node, height + below);
        } else {
          if (facing < cosine) continue;
          const double height = away.dot(tip.outward);
          const double distance = std::sqrt(std::max(away.squaredNorm() - height * height, 0.0));
          if (part(tip, place.width, distance) > least_part) take(place.node, height / facing);
        }
      }
    });
  }
  template <class Take>
  void under(const Tip& tip, Take take) const noexcept {
    under(tip, 0.0, [](std::size_t, double) { return false; }, take);
  }

  /// The same of nodes that forces hold where they are, `rise(node)` [m] further in along their normals than without them: how deep the tip
  /// would be in then, wherever a node is now. All are looked at, so that none is lost however far it was pushed: for a few.
  template <class Rise, class Take>
  void under_all(const Tip& tip, Rise rise, Take take) const noexcept {
    for (const NodeRecord& place : places_) {
      const Vector3<> away = place.point - tip.centre;
      const double facing = place.normal.dot(tip.outward);
      if (facing < cosine) continue;
      if (tip.kind == Tip::Kind::sphere) {
        const double along = away.dot(place.normal), aside = std::max(away.squaredNorm() - along * along, 0.0);
        const double height = along + rise(place.node);
        if (height > tip.radius) {  // no wider than the cone there
          const Vector3<> free = away + rise(place.node) * place.normal;
          const double wide = (tip.radius + cosine * height) / sine;
          if ((free - free.dot(tip.outward) * tip.outward).squaredNorm() >= wide * wide) continue;
        }
        take(place.node, height + lower(tip.radius, aside));
      } else {
        const double height = away.dot(tip.outward);
        const double distance = std::sqrt(std::max(away.squaredNorm() - height * height, 0.0));
        if (part(tip, place.width, distance) > least_part) take(place.node, height / facing + rise(place.node));
      }
    }
  }

  /// The node nearest to `place` [m], looked for up to about `reach` [m] away; -1 if there is none.
  [[nodiscard]] std::int32_t nearest(const Vector3<>& place, double reach) const noexcept {
    std::int32_t found = -1;
    double least = 0.0;
    visit(place, place, reach, [&](std::size_t number) {
      if (found >= 0 && square_to(place, groups_[number]) >= least) return;
      for (std::int32_t k = groups_[number].begin; k < groups_[number].end; ++k) {
        const double square = (places_[static_cast<std::size_t>(k)].point - place).squaredNorm();
        if (found >= 0 && square >= least) continue;
        found = places_[static_cast<std::size_t>(k)].node;
        least = square;
      }
    });
    return found;
  }

  /// A node under the tip in full. A sphere presses the nodes that it is in or before. One that it has left behind, so that the node lies
  /// beyond the sphere's upper side, it presses still if it went over it: if the node faces as the tip does, and lies no farther from its
  /// axis than its radius. Of others, on the flanks and the far side of a thin body, the tip has not come from where they face: `cover`
  /// fades towards the upper side, so that none of them leaves with a force. For a given `outward` that is all by the tip's place, none by
  /// its way there.
  [[nodiscard]] Near reached(const Tip& tip, std::int32_t node) const noexcept {
    Near near = at(tip, node);
    if (tip.kind == Tip::Kind::flat) return near;
    const Vector3<>& n = normal(node);
    const Vector3<> away = point(node) - tip.centre;
    const double beyond = 2.0 * away.dot(n) - near.depth;  // the sphere's upper side, m
    if (!(beyond > -fade * tip.radius)) return near;
    const Passed passed(tip, away, n.dot(tip.outward), beyond);
    if (passed.part >= 1.0) return near;
    const double p = std::max(passed.part, least_part);
    near.cover = p * p * (3.0 - 2.0 * p);
    near.cover_slope = 6.0 * p * (1.0 - p) * (passed.by_beyond * (-2.0 * n - near.slope) + passed.by_place);
    return near;
  }

  /// The same wherever it has been left.
  [[nodiscard]] Near at(const Tip& tip, std::int32_t node) const noexcept {
    Near near;
    near.node = node;
    const Vector3<>& n = normal(node);
    const Vector3<> away = point(node) - tip.centre;
    if (tip.kind == Tip::Kind::sphere) {
      // Along the node's inward normal, as far as the lower side.
      const double height = away.dot(n);
      const Vector3<> aside = away - height * n;
      const double square = aside.squaredNorm(), below = lower(tip.radius, square);
      near.depth = height + below;
      near.slope = -n + aside * (square < sine * sine * tip.radius * tip.radius ? 1.0 / below : sine / (cosine * std::sqrt(square)));
      return near;
    }
    // As far as the plane of the end; `cover` fades over the width of the node's patch.
    const double facing = n.dot(tip.outward), height = away.dot(tip.outward);
    const Vector3<> aside = away - height * tip.outward;
    const double distance = aside.norm(), p = part(tip, widths_[static_cast<std::size_t>(node)], distance);
    near.depth = height / facing;
    near.slope = -tip.outward / facing;
    if (p < 1.0) {
      near.cover = p * p * (3.0 - 2.0 * p);
      near.cover_slope = (6.0 * p * (1.0 - p) / (widths_[static_cast<std::size_t>(node)] * distance)) * aside;
    }
    return near;
  }

 private:
  /// How far a node still counts that lies `beyond` [m] the upper side of a sphere, and the slopes of that, by `beyond` and by the tip's
  /// centre.
  struct Passed {
    Passed(const Tip& tip, const Vector3<>& away, double facing, double beyond) noexcept {
      const double width = fade * tip.radius;
      const double before = std::clamp(-beyond / width, 0.0, 1.0);
      const double same = std::clamp((facing - 0.6) / 0.2, 0.0, 1.0);
      const Vector3<> aside = away - away.dot(tip.outward) * tip.outward;
      const double distance = aside.norm();
      const double within = 1.0 + (tip.radius - distance) / width;
      const double over = same * std::clamp(within, 0.0, 1.0);
      part = before + (1.0 - before) * over;
      if (before > 0.0) by_beyond = -(1.0 - over) / width;
      if (within > 0.0 && within < 1.0) by_place = ((1.0 - before) * same / (width * distance)) * aside;
    }
    double part = 1.0, by_beyond = 0.0;
    Vector3<> by_place = Vector3<>::Zero();
  };

  /// A node as a look at it needs it: one line of the cache.
  struct alignas(64) NodeRecord {
    Vector3<> point = Vector3<>::Zero();
    Vector3<> normal = Vector3<>::Zero();
    double width = 0.0;
    std::int32_t node = 0;
  };
  /// The nodes of one cell, side by side, the box around them, and where they face.
  struct Group {
    Vector3<> low = Vector3<>::Zero(), high = Vector3<>::Zero();
    std::int32_t begin = 0, end = 0;
    Vector3<> facing = Vector3<>::Zero();  // mean of the normals
    double spread = 0.0;                   // the most that a normal differs from it
    double rise = 0.0;                     // the most that a node lies along its normal beyond the middle of the box, m
  };

  void face(Group& group) const {
    for (std::int32_t k = group.begin; k < group.end; ++k) group.facing += places_[static_cast<std::size_t>(k)].normal;
    group.facing /= group.end - group.begin;
    const Vector3<> middle = 0.5 * (group.low + group.high);
    for (std::int32_t k = group.begin; k < group.end; ++k) {
      const NodeRecord& place = places_[static_cast<std::size_t>(k)];
      group.spread = std::max(group.spread, (place.normal - group.facing).norm());
      group.rise = std::max(group.rise, (place.point - middle).dot(place.normal));
    }
  }

  /// Calls `take(group)` for each group in the cells that a box reaches: `reach` [m] around two places.
  template <class Take>
  void visit(const Vector3<>& one, const Vector3<>& other, double reach, Take take) const noexcept {
    if (points_.empty()) return;
    std::int32_t from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      const double first = (std::min(one[a], other[a]) - reach - low_[a]) / cell_;
      const double last = (std::max(one[a], other[a]) + reach - low_[a]) / cell_;
      if (!(last >= 0.0) || !(first < count_[a])) return;
      from[a] = static_cast<std::int32_t>(std::max(first, 0.0));
      to[a] = static_cast<std::int32_t>(std::min(last, count_[a] - 1.0));
    }
    for (std::int32_t x = from[0]; x <= to[0]; ++x)
      for (std::int32_t y = from[1]; y <= to[1]; ++y) {
        const std::size_t row = (static_cast<std::size_t>(x) * static_cast<std::size_t>(count_[1]) + static_cast<std::size_t>(y)) *
                                static_cast<std::size_t>(count_[2]);
        const auto end = static_cast<std::size_t>(first_[row + static_cast<std::size_t>(to[2]) + 1]);
        for (auto group = static_cast<std::size_t>(first_[row + static_cast<std::size_t>(from[2])]); group < end; ++group) take(group);
      }
  }

  /// Square of the distance from `place` to the box around a group, m^2.
  [[nodiscard]] static double square_to(const Vector3<>& place, const Group& group) noexcept {
    return (group.low - place).cwiseMax(place - group.high).cwiseMax(0.0).squaredNorm();
  }

  /// No node of a group is deeper in a sphere, or its cone, than this, m. If the sphere's centre lies before its tangent plane, a node at a
  /// distance d beyond the radius r is at most -(d^2 - r^2) / 2d deep in the sphere, and in its cone, where that goes on, (r - d sine) /
  /// cosine.
  [[nodiscard]] static double deepest_in_sphere(const Tip& tip, const Group& group) noexcept {
    const double square = square_to(tip.centre, group), more = square - tip.radius * tip.radius;
    const Vector3<> away = 0.5 * (group.low + group.high) - tip.centre;
    const bool before = away.dot(group.facing) + away.norm() * group.spread + group.rise < 0.0;
    if (!(more > 0.0 && before)) return std::numeric_limits<double>::infinity();
    const double distance = std::sqrt(square);
    return std::max(-0.5 * more / distance, (tip.radius - sine * distance) / cosine);
  }

  /// No node of a group is deeper before a flat end than this, m.
  [[nodiscard]] static double deepest_before_end(const Tip& tip, const Group& group) noexcept {
    const Vector3<> half = 0.5 * (group.high - group.low);
    const double height = tip.outward.dot(group.low + half - tip.centre) + tip.outward.cwiseAbs().dot(half);
    return height > 0.0 ? height / cosine : height;
  }

  /// Where the edge of a flat end crosses the patch of a node at `distance` from its axis: 0 outside, 1 and more inside. A pressed patch
  /// reaches past its node: the edge counts an eighth of a patch farther in, so that coarse and fine meshes feel alike.
  [[nodiscard]] static double part(const Tip& tip, double width, double distance) noexcept {
    return (tip.radius - distance) / width + 0.38;
  }

  /// How far the lower side of a sphere lies under its middle, where a node is aside by the root of `square` [m^2]. Short of the
  /// equator, where its side would be a wall, it goes on as the cone that touches it: a sphere deeper than its radius presses what
  /// comes under its cone by and by, and its force has no step.
  [[nodiscard]] static double lower(double radius, double square) noexcept {
    if (square < sine * sine * radius * radius) return std::sqrt(radius * radius - square);
    return (radius - sine * std::sqrt(square)) / cosine;
  }

  static constexpr double least_part = 1e-3;
  static constexpr double fade = 0.4;                  // of a sphere's radius: twice as high as its cone begins
  static constexpr double highest = 0.5;               // before a sphere that a node may be at rest, of the radius: none rises so far
  static constexpr double least_facing = -0.5;         // of a node's normal and a sphere's outward, where it presses the node
  static constexpr double cosine = 0.2;                // of the largest angle between a node's normal and the tip's, 78 degrees
  static constexpr double sine = 0.97979589711327123;  // of the same

  [[nodiscard]] std::size_t cell_of(const Vector3<>& p) const noexcept {
    std::size_t c = 0;
    for (int a = 0; a < 3; ++a) {
      const auto i = std::clamp(static_cast<std::int32_t>((p[a] - low_[a]) / cell_), 0, count_[a] - 1);
      c = c * static_cast<std::size_t>(count_[a]) + static_cast<std::size_t>(i);
    }
    return c;
  }

  std::vector<Vector3<>> points_;   // m
  std::vector<Vector3<>> normals_;  // unit, outward
  std::vector<Eigen::Matrix<double, 3, 2>> across_;
  std::vector<double> widths_;  // square roots of the patches' areas, m
  double widest_ = 0.0;
  Vector3<> low_ = Vector3<>::Zero();  // the grid's corner, m
  double cell_ = 1.0;                  // m
  std::int32_t count_[3] = {1, 1, 1};
  std::vector<std::int32_t> first_;  // group of each cell, or of the next one that has nodes
  std::vector<Group> groups_;        // cells that have nodes
  std::vector<NodeRecord> places_;   // nodes, by cell
};

}  // namespace palpate::deformable
