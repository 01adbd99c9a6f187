#pragma once

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

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
  static constexpr double tolerance = 1e-10;  // of radius and depth
  static constexpr double flat = 1e-9;        // rad: facets that turn less lie in one plane
  static constexpr double clear = 1e-6;       // rad: rounding is about 1e-8 where a sphere just touches
  static constexpr double most_turn = 1.0;    // rad, in one move

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
    Slip slip{sliding, 0.0};
    bool done = false;
    keep_contacts(seat);
    for (int step = 0; step < most_steps && !done; ++step) {
      const Goal goal = nearest_allowed(seat, tip);
      note(seat, goal);
      const double small = tolerance * (radius_ + (goal.point - tip).norm());
      if (goal.strongest < 0) {
        const bool away = (tip - seat.centre).norm() > small;
        if (!away) seat.centre = tip;
        done = !away || sweep_to(seat, tip) == 1.0;
        continue;
      }
      if (goal.active == 1) {
        const Move move = one_contact(seat, seat.planes[static_cast<std::size_t>(goal.strongest)], tip, cone, slip, small);
        if (move.kind == Move::Kind::rest) {
          done = true;
          continue;
        }
        if (move.kind == Move::Kind::meet && add(seat, move.facet)) continue;
        if (move.kind == Move::Kind::go && allows(seat, move.by)) {
          double part = sweep_to(seat, move.by);
          if (part == 1.0 && move.curved) part = sweep_to(seat, move.to);
          if (part == 1.0) add(seat, move.facet);
          slip.sliding = slip.sliding || move.slip > 0.0;
          slip.slid += part * move.slip;
          continue;
        }
      }
      const Vector3<> lag = goal.point - seat.centre;
      const double length = lag.norm();
      const double left = cone(seat.facet, goal.point).rest(length, (goal.point - tip).norm(), slip.slid, slip.sliding);
      if (!(length - left > small)) {
        done = true;
        continue;
      }
      const double share = 1.0 - left / length;
      const double part = sweep_to(seat, share == 1.0 ? goal.point : Vector3<>(seat.centre + share * lag));
      slip.sliding = true;
      slip.slid += part * share * length;
    }
    if (!done) {  // what there is to say after the last move; the next tick goes on
      Goal goal = nearest_allowed(seat, tip);
      if (goal.strongest < 0) {
        sweep_to(seat, tip);
        goal = nearest_allowed(seat, tip);
      }
      note(seat, goal);
    }
    sliding = seat.touching() && slip.slid > 0.0;
    return done;
  }

 private:
  struct Goal {
    Vector3<> point;
    int strongest = -1;  // plane that pushes hardest, -1 if none
    int active = 0;      // planes that push
  };

  struct Slip {
    bool sliding;
    double slid;  // in this tick, m
  };

  /// Where a sphere that one facet holds goes next.
  struct Move {
    enum class Kind { rest, meet, go } kind = Kind::rest;
    std::int32_t facet = Mesh::none;  // that holds it there; or, to `meet`, one that touches it and is not among its planes
    bool curved = false;              // round an edge or a corner: along the tangent to `by`, then down to `to`
    Vector3<> by = Vector3<>::Zero();
    Vector3<> to = Vector3<>::Zero();
    double slip = 0.0;  // m
  };

  static void note(Seat& seat, const Goal& goal) noexcept {
    seat.rest = goal.point;
    seat.facet = goal.strongest < 0 ? Mesh::none : seat.planes[static_cast<std::size_t>(goal.strongest)].facet;
  }

  [[nodiscard]] bool allows(const Seat& seat, const Vector3<>& x) const noexcept {
    const double little = clear * (x - seat.centre).norm() + tolerance * radius_;
    for (int i = 0; i < seat.count; ++i) {
      const Seat::Plane& p = seat.planes[static_cast<std::size_t>(i)];
      if (p.normal.dot(x) < p.offset - little) return false;
    }
    return true;
  }

  /// The move over a facet until its foot comes to the facet's edge, round an edge until it comes to a facet or to the edge's end, round
  /// a corner until it comes to an edge; or less, if friction or the tip says so.
  template <class Cone>
  [[nodiscard]] Move one_contact(const Seat& seat, const Seat::Plane& plane, const Vector3<>& tip, const Cone& cone, const Slip& slip,
                                 double small) const noexcept {
    Contact at{plane.facet, plane.at.feature, plane.at.point, plane.normal};
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
      if (!again) return move;
    }
    return {};
  }

  /// A facet's feature under the sphere, the foot [m], and the unit normal from there to the centre.
  struct Contact {
    std::int32_t facet;
    Feature feature;
    Vector3<> foot;
    Vector3<> normal;
  };

  // Each of these three fills `move`, or returns true if there is no way to go on `at`, which it then sets to the neighbouring feature.

  template <class Cone>
  bool over_facet(Contact& at, const Vector3<>& centre, const Vector3<>& tip, const Cone& cone, const Slip& slip, double small,
                  Move& move) const noexcept {
    const Facet& facet = mesh_->facet(at.facet);
    const double depth = at.normal.dot(facet.corner[0] - tip) + radius_;
    Vector3<> lag = tip - centre;
    lag -= lag.dot(at.normal) * at.normal;
    const double length = lag.norm(), left = cone(at.facet, at.foot).rest(length, std::fabs(depth), slip.slid, slip.sliding);
    if (!(length - left > small)) return false;
    const Vector3<> way = (1.0 - left / length) * lag;
    double part = 1.0;
    int out = -1;
    for (int i = 0; i < 3; ++i) {
      const Vector3<>& a = facet.corner[static_cast<std::size_t>(i)];
      const Vector3<> inward = facet.normal.cross(facet.corner[static_cast<std::size_t>((i + 1) % 3)] - a);
      const double rate = inward.dot(way);
      if (rate >= 0.0) continue;
      const double distance = std::fmax(inward.dot(at.foot - a), 0.0);
      if (distance < -rate * part) {
        part = distance / -rate;
        out = i;
      }
    }
    if (out >= 0 && !(part * (length - left) > small)) {
      at.feature = edge(out);
      return true;
    }
    move = {Move::Kind::go, at.facet, false, centre + part * way, centre + part * way, part * (length - left)};
    return false;
  }

  template <class Cone>
  bool round_edge(Contact& at, const Vector3<>& tip, const Cone& cone, const Slip& slip, double small, Move& move) const noexcept {
    const Facet& facet = mesh_->facet(at.facet);
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
    const double left = cone(at.facet, at.foot).rest(lag, std::fabs(depth), slip.slid, slip.sliding);
    if (!(lag - left > small)) return false;
    const double friction = depth > 0.0 ? left / depth : 0.0;
    const double rest = resting_angle(friction * across_lag / lag, distance, way);
    const double wanted = angle + std::copysign(way - rest, to_go);
    double next = std::fmin(std::fmax(wanted, low), high);
    const bool blocked = next != wanted;
    const std::int32_t beside = wanted > high ? at_high : at_low;
    if (std::fabs(next - angle) > most_turn) next = angle + std::copysign(most_turn, next - angle);
    const double turned = std::fabs(next - angle);
    double shift = 0.0;
    if (!blocked && turned < most_turn) {
      const double keep = friction * std::fabs(lengthwise) / lag * (radius_ - distance * std::cos(rest));
      shift = std::copysign(std::fmax(std::fabs(lengthwise) - std::fmax(keep, 0.0), 0.0), lengthwise);
    }
    const double end = std::fmin(std::fmax(place + shift, 0.0), size);
    if (!(radius_ * turned > small) && !(std::fabs(end - place) > small)) {
      if (blocked) {
        at.facet = beside;
        at.feature = Feature::inside;
        at.normal = std::cos(next) * facet.normal + std::sin(next) * out;
        at.foot = a + place * along;
        return true;
      }
      if (end == place + shift) return false;
      const int k = shift > 0.0 ? (i + 1) % 3 : i;
      at.feature = corner(k);
      at.foot = facet.corner[static_cast<std::size_t>(k)];
      return true;
    }
    const Vector3<> normal = std::cos(next) * facet.normal + std::sin(next) * out, foot = a + end * along;
    move = {Move::Kind::go,
            blocked ? beside : at.facet,
            turned > 0.0,
            foot + radius_ / std::cos(turned) * normal,
            foot + radius_ * normal,
            radius_ * turned + std::fabs(end - place)};
    return false;
  }

  template <class Cone>
  bool round_corner(Contact& at, const Vector3<>& tip, const Cone& cone, const Slip& slip, double small, Move& move) const noexcept {
    const int k = index_of(at.feature);
    const Vector3<> foot = mesh_->facet(at.facet).corner[static_cast<std::size_t>(k)], pull = tip - foot;
    const double up = at.normal.dot(pull), distance = pull.norm();
    Vector3<> tangent = pull - up * at.normal;
    const double lag = tangent.norm(), depth = radius_ - up;
    const double left = cone(at.facet, foot).rest(lag, std::fabs(depth), slip.slid, slip.sliding);
    if (!(lag - left > small)) return false;
    tangent /= lag;
    const double way = std::atan2(lag, up);
    double turned = std::fmin(way - resting_angle(depth > 0.0 ? left / depth : 0.0, distance, way), most_turn);
    // The corner holds the sphere as long as its normal leans along none of the edges that leave it.
    std::int32_t over = Mesh::none;
    int over_edge = 0;
    const auto look = [&](std::int32_t f, int i, double sense) {
      const Facet& facet = mesh_->facet(f);
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
    const std::int32_t start = 3 * at.facet + k;
    std::int32_t h = start;
    do {
      const auto c = static_cast<std::size_t>(h % 3);
      look(h / 3, h % 3, 1.0);
      const std::int32_t next = mesh_->facet(h / 3).neighbour[(c + 2) % 3];
      if (next < 0) look(h / 3, (h % 3 + 2) % 3, -1.0);
      h = next;
    } while (h >= 0 && h != start);
    if (h < 0) {
      h = mesh_->facet(start / 3).neighbour[static_cast<std::size_t>(k)];
      while (h >= 0) {
        const int c = (h % 3 + 1) % 3;
        look(h / 3, c, 1.0);
        h = mesh_->facet(h / 3).neighbour[static_cast<std::size_t>(c)];
      }
    }
    if (!(radius_ * turned > small)) {
      if (over == Mesh::none) return false;
      at.facet = over;
      at.feature = edge(over_edge);
      at.foot = foot;
      return true;
    }
    const Vector3<> normal = std::cos(turned) * at.normal + std::sin(turned) * tangent;
    move = {
        Move::Kind::go,  over == Mesh::none ? at.facet : over, true, foot + radius_ / std::cos(turned) * normal, foot + radius_ * normal,
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

  /// False if the facet is among the planes already.
  bool add(Seat& seat, std::int32_t facet) const noexcept {
    int place = seat.count;
    for (int i = 0; i < seat.count; ++i)
      if (seat.planes[static_cast<std::size_t>(i)].facet == facet) return false;
    if (place < Seat::most_planes) {
      ++seat.count;
    } else {  // in the place of the one farthest away
      double widest = -1.0;
      for (int i = 0; i < Seat::most_planes; ++i) {
        const Seat::Plane& p = seat.planes[static_cast<std::size_t>(i)];
        const double gap = p.normal.dot(seat.centre) - p.offset;
        if (gap > widest) {
          widest = gap;
          place = i;
        }
      }
    }
    Seat::Plane& plane = seat.planes[static_cast<std::size_t>(place)];
    plane.facet = facet;
    support(plane, seat.centre);
    return true;
  }

  /// Planes at the centre as it is now, of the facets that touch the sphere there; what rounding has let in is put out again.
  void keep_contacts(Seat& seat) const noexcept {
    int kept = 0;
    for (int i = 0; i < seat.count; ++i) {
      Seat::Plane plane = seat.planes[static_cast<std::size_t>(i)];
      support(plane, seat.centre);
      seat.centre += std::fmax(plane.offset - plane.normal.dot(seat.centre), 0.0) * plane.normal;
      if (plane.normal.dot(seat.centre) - plane.offset <= tolerance * radius_) seat.planes[static_cast<std::size_t>(kept++)] = plane;
    }
    seat.count = kept;
  }

  /// The point nearest to the tip that the planes allow. All of them pass through the centre, so that what they allow is a cone from
  /// there: held by one plane, one slides in it; by two, along their common line; by three or more, nowhere.
  [[nodiscard]] Goal nearest_allowed(const Seat& seat, const Vector3<>& tip) const noexcept {
    const Vector3<> pull = tip - seat.centre;
    const double rounding = 1e-12 * pull.norm();
    std::array<double, Seat::most_planes> press{};
    int hardest = -1;
    const auto normal = [&](int i) -> const Vector3<>& { return seat.planes[static_cast<std::size_t>(i)].normal; };
    for (int i = 0; i < seat.count; ++i) {
      press[static_cast<std::size_t>(i)] = -normal(i).dot(pull);
      if (press[static_cast<std::size_t>(i)] > 0.0 &&
          (hardest < 0 || press[static_cast<std::size_t>(i)] > press[static_cast<std::size_t>(hardest)]))
        hardest = i;
    }
    if (hardest < 0) return {tip};
    const auto allowed = [&](const Vector3<>& way, int but_one, int but_two) {
      for (int i = 0; i < seat.count; ++i)
        if (i != but_one && i != but_two && normal(i).dot(way) < -rounding) return false;
      return true;
    };
    for (int i = 0; i < seat.count; ++i) {
      const double p = press[static_cast<std::size_t>(i)];
      const Vector3<> way = pull + p * normal(i);
      if (p > 0.0 && allowed(way, i, i)) return {seat.centre + way, i, 1};
    }
    for (int i = 0; i < seat.count; ++i)
      for (int j = 0; j < i; ++j) {
        const double p = press[static_cast<std::size_t>(i)], q = press[static_cast<std::size_t>(j)], c = normal(i).dot(normal(j));
        if (p - c * q < -rounding || q - c * p < -rounding) continue;  // one of them would pull
        Vector3<> line = normal(i).cross(normal(j));
        const double sine = line.norm();
        if (sine < 1e-12) continue;
        line /= sine;
        const Vector3<> way = pull.dot(line) * line;
        if (allowed(way, i, j)) return {seat.centre + way, p > q ? i : j, 2};
      }
    return {seat.centre, hardest, 3};
  }

  const Mesh* mesh_;
  const Tree* tree_;
  double radius_;  // m
};

}  // namespace palpate
