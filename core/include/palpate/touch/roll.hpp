#pragma once

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <cstdint>

#include "palpate/touch/friction_cone.hpp"
#include "palpate/touch/mesh.hpp"
#include "palpate/touch/tree.hpp"
#include "palpate/touch/triangle.hpp"

namespace palpate {

/// A sphere's centre, free or held by facets.
struct Seat {
  static constexpr int most_planes = 12;

  /// A half-space that leaves out everything nearer to `facet` than the radius (a facet is convex), and leaves in the centre.
  struct Plane {
    std::int32_t facet = Mesh::none;
    NearestPoint at{};
    Vector3<> normal = Vector3<>::Zero();  // unit
    double offset = 0.0;                   // normal . x >= offset, m
  };

  Vector3<> centre = Vector3<>::Zero();  ///< m
  Vector3<> rest = Vector3<>::Zero();    ///< where it would be without friction, as far as the planes tell, m
  std::int32_t facet = Mesh::none;       ///< the one that pushes hardest; none: free
  std::array<Plane, most_planes> planes{};
  int count = 0;

  [[nodiscard]] bool touching() const noexcept { return facet != Mesh::none; }
};

/// The sphere proxy's move. The centre always stays a radius away from every facet. Each step takes the planes that separate the
/// centre from the facets near it, finds the point nearest to the tip behind all of them (at most three hold it), and sweeps the
/// sphere there; a facet in the way adds its plane. The planes allow less than the facets do, and allow where the centre is, so
/// every step ends nearer to the tip and no step can pass through the surface.
class Roll {
 public:
  static constexpr int most_steps = 64;
  static constexpr double tolerance = 1e-9;  // of radius and depth

  Roll(const Mesh& mesh, const Tree& tree, double radius) noexcept : mesh_(&mesh), tree_(&tree), radius_(radius) {}

  /// Where a proxy starts: at the tip, or where a sphere stops that comes to the tip from outside past the nearest facet.
  [[nodiscard]] Seat start(const Vector3<>& tip) const noexcept {
    Seat seat;
    seat.centre = tip;
    const Tree::Nearest near = tree_->nearest(*mesh_, tip);
    const Facet& facet = mesh_->facet(near.facet);
    Vector3<> out = tip - near.at.point;
    bool inside = false;
    if (mesh_->closed()) {
      Vector3<> normal = facet.normal;
      if (is_corner(near.at.feature)) normal = mesh_->vertex_normal(facet.vertex[static_cast<std::size_t>(index_of(near.at.feature))]);
      if (is_edge(near.at.feature)) normal += mesh_->facet(facet.neighbour[static_cast<std::size_t>(index_of(near.at.feature))] / 3).normal;
      inside = normal.dot(out) < 0.0;
    }
    if (!inside && near.distance2 >= radius_ * radius_) return seat;
    out = inside || !(out.norm() > 1e-9 * radius_) ? facet.normal : Vector3<>(out.normalized());
    const Vector3<> far = near.at.point + 2.0 * (mesh_->extent() + radius_) * out;
    seat.centre = far;
    sweep_to(seat, near.at.point);
    return seat;
  }

  /// Moves `seat` towards `tip`; see Walk::follow.
  template <class Cone>
  bool follow(Seat& seat, const Vector3<>& tip, const Cone& cone, bool& sliding) const noexcept {
    double slid = 0.0;
    bool was_sliding = sliding, done = false;
    keep_contacts(seat);
    for (int step = 0; step < most_steps && !done; ++step) {
      const Goal goal = nearest_allowed(seat, tip);
      seat.rest = goal.point;
      seat.facet = goal.strongest < 0 ? Mesh::none : seat.planes[static_cast<std::size_t>(goal.strongest)].facet;
      Vector3<> target = goal.point;
      const double depth = (goal.point - tip).norm();
      double slip = 0.0;
      if (goal.strongest >= 0) {
        const Vector3<> lag = goal.point - seat.centre;
        const double length = lag.norm(), left = cone(seat.facet, goal.point).rest(length, depth, slid, was_sliding);
        slip = length - left;
        if (left > 0.0) {
          target = seat.centre + (slip > 0.0 ? slip / length : 0.0) * lag;
        } else if (goal.active == 1) {
          target = round_target(seat, goal, tip, target);
        }
      }
      const Vector3<> way = target - seat.centre;
      if (!(way.norm() > tolerance * (radius_ + depth))) {
        if (!seat.touching()) seat.centre = tip;
        done = true;
        break;
      }
      const double part = sweep_to(seat, target);
      if (slip > tolerance * (radius_ + depth)) was_sliding = true;
      slid += part * slip;
      done = part == 1.0 && !seat.touching();
    }
    if (!done) {  // what there is to say after the last move; the next tick goes on
      Goal goal = nearest_allowed(seat, tip);
      if (goal.strongest < 0) {
        sweep_to(seat, tip);
        goal = nearest_allowed(seat, tip);
      }
      seat.rest = goal.point;
      seat.facet = goal.strongest < 0 ? Mesh::none : seat.planes[static_cast<std::size_t>(goal.strongest)].facet;
    }
    sliding = seat.touching() && slid > 0.0;
    return done;
  }

 private:
  struct Goal {
    Vector3<> point;
    int strongest = -1;  // plane that pushes hardest, -1 if none
    int active = 0;      // planes that push
  };

  /// Sweeps the sphere to `target`; stops at the first facet that it does not touch yet, and adds that one's plane. Returns the part of
  /// the way done.
  double sweep_to(Seat& seat, const Vector3<>& target) const noexcept {
    Touch first;
    std::int32_t hit = Mesh::none;
    const Vector3<> from = seat.centre, way = target - from;
    tree_->along(from, way, radius_, [&](std::int32_t f, double& end) {
      for (int i = 0; i < seat.count; ++i)
        if (seat.planes[static_cast<std::size_t>(i)].facet == f) return;
      const Touch touch = sweep(mesh_->facet(f), from, way, radius_);
      if (touch.hit && (touch.time < end || hit == Mesh::none)) {
        end = touch.time;
        first = touch;
        hit = f;
      }
    });
    const double part = hit == Mesh::none ? 1.0 : first.time;
    seat.centre = hit == Mesh::none ? target : Vector3<>(from + part * way);
    if (part > 0.0) keep_contacts(seat);
    if (hit != Mesh::none) add(seat, hit);
    return part;
  }

  /// The plane that separates the facet from a sphere at `centre`, at the facet's point nearest to it.
  void support(Seat::Plane& plane, const Vector3<>& centre) const noexcept {
    const Facet& facet = mesh_->facet(plane.facet);
    plane.at = nearest_point(facet, centre);
    if (plane.at.feature == Feature::inside) {
      const double side = facet.height(centre) >= 0.0 ? 1.0 : -1.0;
      plane.normal = side * facet.normal;
      plane.offset = plane.normal.dot(facet.corner[0]) + radius_;
      return;
    }
    const Vector3<> away = centre - plane.at.point;
    const double distance = away.norm();
    if (distance > 0.0) plane.normal = away / distance;
    plane.offset = plane.normal.dot(plane.at.point) + radius_;
  }

  void add(Seat& seat, std::int32_t facet) const noexcept {
    int place = seat.count;
    if (place < Seat::most_planes) {
      ++seat.count;
    } else {  // in the place of the one farthest away
      double widest = -1.0;
      for (int i = 0; i < Seat::most_planes; ++i) {
        const double gap =
            seat.planes[static_cast<std::size_t>(i)].normal.dot(seat.centre) - seat.planes[static_cast<std::size_t>(i)].offset;
        if (gap > widest) {
          widest = gap;
          place = i;
        }
      }
    }
    Seat::Plane& plane = seat.planes[static_cast<std::size_t>(place)];
    plane.facet = facet;
    support(plane, seat.centre);
  }

  /// Planes at the centre as it is now, of the facets that touch the sphere there.
  void keep_contacts(Seat& seat) const noexcept {
    int kept = 0;
    for (int i = 0; i < seat.count; ++i) {
      Seat::Plane plane = seat.planes[static_cast<std::size_t>(i)];
      support(plane, seat.centre);
      if (plane.normal.dot(seat.centre) - plane.offset <= tolerance * radius_) seat.planes[static_cast<std::size_t>(kept++)] = plane;
    }
    seat.count = kept;
  }

  /// The point nearest to the tip behind all planes: held by none, one, two or three of them.
  [[nodiscard]] Goal nearest_allowed(const Seat& seat, const Vector3<>& tip) const noexcept {
    const int n = seat.count;
    std::array<double, Seat::most_planes> inside{};  // how far the tip is in front of each plane
    bool free = true;
    const double tolerance = 1e-13 * (radius_ + (tip - seat.centre).norm() + mesh_->reach());
    for (int i = 0; i < n; ++i) {
      const Seat::Plane& p = seat.planes[static_cast<std::size_t>(i)];
      inside[static_cast<std::size_t>(i)] = p.offset - p.normal.dot(tip);
      if (inside[static_cast<std::size_t>(i)] > 0.0) free = false;
    }
    if (free) return {tip};
    const auto normal = [&](int i) -> const Vector3<>& { return seat.planes[static_cast<std::size_t>(i)].normal; };
    const auto depth = [&](int i) { return inside[static_cast<std::size_t>(i)]; };
    const auto allowed = [&](const Vector3<>& push) {
      for (int i = 0; i < n; ++i)
        if (normal(i).dot(push) < depth(i) - tolerance) return false;
      return true;
    };
    for (int i = 0; i < n; ++i) {
      if (depth(i) <= 0.0) continue;
      const Vector3<> push = depth(i) * normal(i);
      if (allowed(push)) return {tip + push, i, 1};
    }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < i; ++j) {
        const double c = normal(i).dot(normal(j)), s2 = normal(i).cross(normal(j)).squaredNorm();
        if (s2 < 1e-16) continue;
        const double a = (depth(i) - c * depth(j)) / s2, b = (depth(j) - c * depth(i)) / s2;
        if (a < 0.0 || b < 0.0) continue;
        const Vector3<> push = a * normal(i) + b * normal(j);
        if (allowed(push)) return {tip + push, a > b ? i : j, 2};
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < i; ++j)
        for (int k = 0; k < j; ++k) {
          const Vector3<> jk = normal(j).cross(normal(k)), ki = normal(k).cross(normal(i)), ij = normal(i).cross(normal(j));
          const double volume = normal(i).dot(jk);
          if (std::fabs(volume) < 1e-12) continue;
          const Vector3<> push = (depth(i) * jk + depth(j) * ki + depth(k) * ij) / volume;
          const double a = push.dot(jk) / volume, b = push.dot(ki) / volume, c = push.dot(ij) / volume;
          if (a < 0.0 || b < 0.0 || c < 0.0 || !allowed(push)) continue;
          return {tip + push, a >= b && a >= c ? i : (b >= c ? j : k), 3};
        }
    // Planes so nearly parallel that rounding hides the answer: stay.
    int deepest = 0;
    for (int i = 1; i < n; ++i)
      if (depth(i) > depth(deepest)) deepest = i;
    return {seat.centre, deepest, 4};
  }

  /// On a rounded edge or corner with the tip above it, one goes around the rounding in one step, along the tangent plane, instead of
  /// approaching its end.
  [[nodiscard]] Vector3<> round_target(const Seat& seat, const Goal& goal, const Vector3<>& tip, const Vector3<>& target) const noexcept {
    const Seat::Plane& plane = seat.planes[static_cast<std::size_t>(goal.strongest)];
    if (plane.at.feature == Feature::inside) return target;
    const Facet& facet = mesh_->facet(plane.facet);
    Vector3<> foot = plane.at.point;
    if (is_edge(plane.at.feature)) {
      const int i = index_of(plane.at.feature);
      const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
      const Vector3<> e = facet.corner[static_cast<std::size_t>((i + 1) % 3)] - a;
      const double u = std::fmin(std::fmax((tip - a).dot(e) / e.squaredNorm(), 0.0), 1.0);
      foot = a + u * e;
    }
    const Vector3<> up = tip - foot;
    const double distance = up.norm(), rise = up.dot(plane.normal);
    if (!(rise > 0.3 * distance) || distance == 0.0) return target;
    return foot + (plane.offset - plane.normal.dot(foot)) / rise * up;
  }

  const Mesh* mesh_;
  const Tree* tree_;
  double radius_;  // m
};

}  // namespace palpate
