#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/friction_cone.hpp"
#include "palpate/mesh/sphere_proxy_state.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// How a sphere moves that one facet holds: over its face, round its edges and its corners, exactly.
class SingleContactMotion {
 public:
  static constexpr double flat = 1e-9;      // rad: facets that turn less lie in one plane
  static constexpr double clear = 1e-6;     // rad: rounding is about 1e-8 where a sphere just touches
  static constexpr double most_turn = 1.0;  // rad, in one move

  SingleContactMotion(const TriangleMesh& mesh, double radius) noexcept : mesh_(&mesh), radius_(radius) {}

  /// Where the sphere goes next.
  struct Move {
    enum class Kind { rest, meet, go } kind = Kind::rest;
    std::int32_t facet = TriangleMesh::none;  // that holds it there; or, to `meet`, one that touches it and is not among its supports
    bool curved = false;                      // round an edge or a corner: along the tangent to `by`, then down to `to`
    Vector3<> by = Vector3<>::Zero();
    Vector3<> to = Vector3<>::Zero();
    double slip = 0.0;  // m
  };

  /// The move over a facet until its foot comes to the facet's edge, round an edge until it comes to a facet or to the edge's end, round
  /// a corner until it comes to an edge; or less, if friction or the tip says so.
  template <class Cone>
  [[nodiscard]] Move next(const SphereProxyState& seat, const SphereProxyState::ContactConstraint& support, const Vector3<>& tip,
                          const Cone& cone, const SlidingState& slip, double small) const noexcept {
    Contact at{support.facet, support.at.feature, support.at.point, support.normal};
    for (int turn = 0; turn < 16; ++turn) {
      Move move;
      bool again = false;
      if (at.feature == Feature::inside) {
        again = over_facet(at, seat.centre, tip, cone, slip, small, move);
      } else if (is_edge(at.feature)) {
        again = round_edge(at, tip, cone, slip, small, move);
      } else {
        again = round_corner(at, tip, cone, slip, small, move);
      }
      if (again) continue;
      if (move.kind == Move::Kind::rest) move.facet = at.facet;
      return move;
    }
    return {};
  }

 private:
  /// A facet's feature under the sphere, the foot [m], and the unit normal from there to the centre.
  struct Contact {
    std::int32_t facet;
    Feature feature;
    Vector3<> foot;
    Vector3<> normal;
  };

  // Each of these three fills `move`, or returns true if there is no way to go on `at`, which it then sets to the neighbouring feature.

  template <class Cone>
  bool over_facet(Contact& at, const Vector3<>& centre, const Vector3<>& tip, const Cone& cone, const SlidingState& slip, double small,
                  Move& move) const noexcept {
    const Face& facet = mesh_->facet(at.facet);
    const double depth = at.normal.dot(facet.corner[0] - tip) + radius_;
    Vector3<> lag = tip - centre;
    lag -= lag.dot(at.normal) * at.normal;
    const double length = lag.norm(), left = cone(at.facet, at.foot).rest(length, std::fabs(depth), slip.slid, slip.sliding());
    if (!(length - left > small)) return false;
    const Vector3<> way = (1.0 - left / length) * lag;
    const auto [out, part] = first_exit(facet, at.foot, way, [](int) { return false; });
    if (out >= 0 && !(part * (length - left) > small)) {
      at.feature = edge(out);
      return true;
    }
    move = {Move::Kind::go, at.facet, false, centre + part * way, centre + part * way, part * (length - left)};
    return false;
  }

  template <class Cone>
  bool round_edge(Contact& at, const Vector3<>& tip, const Cone& cone, const SlidingState& slip, double small, Move& move) const noexcept {
    const Face& facet = mesh_->facet(at.facet);
    const int i = index_of(at.feature);
    const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
    Vector3<> along = facet.corner[static_cast<std::size_t>((i + 1) % 3)] - a;
    const double size = along.norm();
    along /= size;
    const Vector3<> out = along.cross(facet.normal);  // away from the facet, in its plane
    const double place = std::fmin(std::fmax((at.foot - a).dot(along), 0.0), size);
    const Vector3<> pull = tip - a - place * along;
    // Angles about the edge, from the facet's normal towards `out`: the sphere's, the neighbour's, the tip's.
    double angle = std::atan2(at.normal.dot(out), at.normal.dot(facet.normal));
    if (angle < -0.5 * std::numbers::pi) angle += 2.0 * std::numbers::pi;  // just below -pi: the facet's back
    double low = 0.0, high = std::numbers::pi;
    std::int32_t at_low = at.facet, at_high = at.facet;
    const std::int32_t across = facet.neighbour[static_cast<std::size_t>(i)];
    if (across >= 0) {
      const Vector3<>& other = mesh_->facet(across / 3).normal;
      const double turn = std::atan2(other.dot(out), other.dot(facet.normal));
      if (std::fabs(turn) < flat) {
        if (pull.dot(out) > 0.0) at.facet = across / 3;
        at.feature = Feature::inside;
        return true;
      }
      (turn > 0.0 ? high : low) = turn > 0.0 ? turn : std::numbers::pi + turn;
      (turn > 0.0 ? at_high : at_low) = across / 3;
      if (angle < low - clear || angle > high + clear) {  // a valley: the neighbour touches too
        move = {Move::Kind::meet, across / 3};
        return false;
      }
    }
    angle = std::fmin(std::fmax(angle, low), high);
    const double in_x = pull.dot(facet.normal), in_y = pull.dot(out), lengthwise = pull.dot(along);
    const double distance = std::hypot(in_x, in_y);
    const double to_go = std::remainder(std::atan2(in_y, in_x) - angle, 2.0 * std::numbers::pi), way = std::fabs(to_go);
    const double depth = radius_ - distance * std::cos(to_go), across_lag = distance * std::sin(way);
    const double lag = std::hypot(across_lag, lengthwise);
    const double left = cone(at.facet, at.foot).rest(lag, std::fabs(depth), slip.slid, slip.sliding());
    if (!(lag - left > small)) return false;
    const double friction = depth > 0.0 ? left / depth : 0.0;
    const double rest = resting_angle(friction * across_lag / lag, distance, way);
    // The whole way in angle and along the edge; then the part of it, of both alike, up to where the edge or its turn ends.
    const double turn = std::copysign(way - rest, to_go);
    const double keep = friction * std::fabs(lengthwise) / lag * (radius_ - distance * std::cos(rest));
    const double shift = std::copysign(std::fmax(std::fabs(lengthwise) - std::fmax(keep, 0.0), 0.0), lengthwise);
    double part = std::fabs(turn) > most_turn ? most_turn / std::fabs(turn) : 1.0;
    enum class End { none, turn, length } at_end = End::none;
    if (turn > 0.0 ? turn * part > high - angle : turn * part < low - angle) {
      part = (turn > 0.0 ? high - angle : low - angle) / turn;
      at_end = End::turn;
    }
    if (shift > 0.0 ? shift * part > size - place : shift * part < -place) {
      part = (shift > 0.0 ? size - place : -place) / shift;
      at_end = End::length;
    }
    const std::int32_t beside = turn > 0.0 ? at_high : at_low;
    const double turned = part * std::fabs(turn);
    double next = angle + part * turn, end = place + part * shift;
    if (at_end == End::turn) next = turn > 0.0 ? high : low;
    if (at_end == End::length) end = shift > 0.0 ? size : 0.0;
    const double slid = part * std::hypot(radius_ * turn, shift);
    if (!(slid > small)) {
      if (at_end == End::none) return false;
      if (at_end == End::turn) {
        at.facet = beside;
        at.feature = Feature::inside;
        at.normal = std::cos(next) * facet.normal + std::sin(next) * out;
        at.foot = a + place * along;
        return true;
      }
      const int k = shift > 0.0 ? (i + 1) % 3 : i;
      at.feature = corner(k);
      at.foot = facet.corner[static_cast<std::size_t>(k)];
      return true;
    }
    const Vector3<> normal = std::cos(next) * facet.normal + std::sin(next) * out, foot = a + end * along;
    move = {Move::Kind::go,
            at_end == End::turn ? beside : at.facet,
            turned > 0.0,
            foot + radius_ / std::cos(turned) * normal,
            foot + radius_ * normal,
            slid};
    return false;
  }

  template <class Cone>
  bool round_corner(Contact& at, const Vector3<>& tip, const Cone& cone, const SlidingState& slip, double small,
                    Move& move) const noexcept {
    const int k = index_of(at.feature);
    const Vector3<> foot = mesh_->facet(at.facet).corner[static_cast<std::size_t>(k)], pull = tip - foot;
    const double up = at.normal.dot(pull), distance = pull.norm();
    Vector3<> tangent = pull - up * at.normal;
    const double lag = tangent.norm(), depth = radius_ - up;
    const double left = cone(at.facet, foot).rest(lag, std::fabs(depth), slip.slid, slip.sliding());
    if (!(lag - left > small)) return false;
    tangent /= lag;
    const double way = std::atan2(lag, up);
    double turned = std::fmin(way - resting_angle(depth > 0.0 ? left / depth : 0.0, distance, way), most_turn);
    // The corner holds the sphere as long as its normal leans along none of the edges that leave it.
    std::int32_t over = TriangleMesh::none;
    int over_edge = 0;
    const auto look = [&](std::int32_t f, int i, double sense) {
      const Face& facet = mesh_->facet(f);
      const Vector3<> e = sense * (facet.corner[static_cast<std::size_t>((i + 1) % 3)] - facet.corner[static_cast<std::size_t>(i)]);
      const double rate = tangent.dot(e);
      if (rate <= 0.0) return;
      const double until = std::atan2(std::fmax(-at.normal.dot(e), 0.0), rate);
      if (until < turned) {
        turned = until;
        over = f;
        over_edge = i;
      }
    };
    mesh_->around(at.facet, k, [&](std::int32_t f, int c) {
      look(f, c, 1.0);
      const int last = (c + 2) % 3;
      if (mesh_->facet(f).neighbour[static_cast<std::size_t>(last)] < 0) look(f, last, -1.0);
    });
    if (!(radius_ * turned > small)) {
      if (over == TriangleMesh::none) return false;
      at.facet = over;
      at.feature = edge(over_edge);
      at.foot = foot;
      return true;
    }
    const Vector3<> normal = std::cos(turned) * at.normal + std::sin(turned) * tangent;
    move = {Move::Kind::go,
            over == TriangleMesh::none ? at.facet : over,
            true,
            foot + radius_ / std::cos(turned) * normal,
            foot + radius_ * normal,
            radius_ * turned};
    return false;
  }

  /// Angle between normal and pull at which a sphere on a rounding comes to rest: distance sin a = friction (radius - distance cos a).
  [[nodiscard]] double resting_angle(double friction, double distance, double from) const noexcept {
    if (friction <= 0.0 || distance == 0.0) return 0.0;
    const double sine = friction * radius_ / (distance * std::sqrt(1.0 + friction * friction));
    if (sine >= 1.0) return from;
    return std::fmin(std::fmax(std::asin(sine) - std::atan(friction), 0.0), from);
  }

  const TriangleMesh* mesh_;
  double radius_;  // m
};

}  // namespace palpate::mesh
