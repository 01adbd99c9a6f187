#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/friction_cone.hpp"
#include "palpate/mesh/single_contact_motion.hpp"
#include "palpate/mesh/sphere_proxy_state.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"
#include "palpate/mesh/two_contact_curve.hpp"

namespace palpate::mesh {

/// The sphere proxy's move. The centre always stays a radius away from every facet. Held by one facet, the sphere rolls over it
/// exactly; held by two, it follows the line on which it touches both; held by three, it rests. Each move is swept, and a facet in its way
/// stops it and joins those that hold it. Every move ends nearer to the tip, and none can pass through the surface.
class SphereProxy {
 public:
  static constexpr int most_steps = 256;
  static constexpr double tolerance = 1e-10;  // of radius and depth

  SphereProxy(const TriangleMesh& mesh, const AabbTree& tree, double radius) noexcept
      : mesh_(&mesh), tree_(&tree), rolling_(mesh, radius), radius_(radius) {}

  /// Where a proxy starts: at the tip, or where a sphere stops that comes to the tip from outside past the nearest facet.
  [[nodiscard]] SphereProxyState start(const Vector3<>& tip) const noexcept {
    SphereProxyState seat;
    seat.centre = tip;
    const AabbTree::Nearest near = tree_->nearest(*mesh_, tip);
    const Face& facet = mesh_->facet(near.facet);
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
    seat.centre = near.at.point + 2.0 * (mesh_->extent() + radius_) * out;
    sweep_to(seat, near.at.point, TriangleMesh::none, TriangleMesh::none);
    return seat;
  }

  /// The seat where the mesh has moved under it: the centre put to `centre` [m] and out of what is there; a free one, as at the start.
  void carry(SphereProxyState& seat, const Vector3<>& centre) const noexcept {
    if (!seat.touching()) {
      seat = start(seat.centre);
      return;
    }
    seat.centre = centre;
    seat.count = 0;
    seat.near.forget();
    for (int turn = 0; turn < most_carries; ++turn) {
      bool out = true;
      tree_->within(seat.centre, radius_ * (1.0 + tolerance), [&](std::int32_t f) {
        SphereProxyState::ContactConstraint s;
        s.facet = f;
        support(s, seat.centre);
        if (!(s.distance <= radius_ * (1.0 + 0.5 * tolerance))) return;
        if (s.distance < radius_ * (1.0 - 0.1 * tolerance)) {
          seat.centre += (radius_ - s.distance) * s.normal;
          out = false;
        } else if (out) {
          add(seat, f);
        }
      });
      if (out) return;
      seat.count = 0;
    }
    seat = start(seat.centre);  // squeezed: as if it came from outside
  }

  /// Moves `seat` towards `tip`; see Walk::follow.
  template <class Cone>
  bool follow(SphereProxyState& seat, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    slip.least = still * (radius_ + (tip - seat.centre).norm());
    bool done = false;
    for (int step = 0; step < most_steps && !done; ++step) {
      Goal goal = nearest_allowed(seat, tip);
      note(seat, goal);
      const double small = tolerance * (radius_ + (goal.point - tip).norm());
      if (goal.active == 0) {
        const bool away = (tip - seat.centre).norm() > small;
        if (!away) seat.centre = tip;
        done = !away || sweep_to(seat, tip, TriangleMesh::none, TriangleMesh::none) == 1.0;
      } else if (goal.active == 1) {
        done = slide_on_one(seat, goal, tip, cone, slip, small);
      } else {
        done = goal.active > 2 || slide_on_two(seat, goal, tip, cone, slip, small);
      }
    }
    if (!done) {  // what there is to say after the last move; the next tick goes on
      Goal goal = nearest_allowed(seat, tip);
      if (goal.active == 0) {
        sweep_to(seat, tip, TriangleMesh::none, TriangleMesh::none);
        goal = nearest_allowed(seat, tip);
      }
      note(seat, goal);
    }
    return done;
  }

 private:
  static constexpr int most_carries = 64;
  static constexpr double still = 1e-7;    // of radius and depth: what slides less in a tick holds
  static constexpr double most_way = 0.3;  // of the radius, in one move round two contacts
  static constexpr double probe = 1e-6;    // of the radius: looked ahead

  /// The point nearest to the tip that the supports' planes allow, and the supports that press there.
  struct Goal {
    Vector3<> point;
    int active = 0;  // that press: 0 to 3
    int one = -1, two = -1;
  };

  static void note(SphereProxyState& seat, const Goal& goal) noexcept {
    seat.rest = goal.point;
    seat.pressing = goal.active;
    seat.facet = goal.active == 0 ? TriangleMesh::none : seat.support(goal.one).facet;
  }

  /// Held from all sides, friction or not.
  static bool stay(SphereProxyState& seat) noexcept {
    seat.rest = seat.centre;
    return true;
  }

  /// The supports' planes all pass through the centre, so that what they allow is a cone from there: held by one plane, one slides in it;
  /// by two, along their common line; by three or more, nowhere.
  [[nodiscard]] Goal nearest_allowed(const SphereProxyState& seat, const Vector3<>& tip) const noexcept {
    const Vector3<> pull = tip - seat.centre;
    const double rounding = 1e-15 * pull.norm();
    std::array<double, SphereProxyState::most_supports> press{};
    int hardest = -1;
    for (int i = 0; i < seat.count; ++i) {
      const double p = press[static_cast<std::size_t>(i)] = -seat.support(i).normal.dot(pull);
      if (p > 0.0 && (hardest < 0 || p > press[static_cast<std::size_t>(hardest)])) hardest = i;
    }
    if (hardest < 0) return {tip};
    const auto allowed = [&](const Vector3<>& way, int but_one, int but_two) {
      const double is_small = rounding + tolerance * way.norm();
      for (int i = 0; i < seat.count; ++i)
        if (i != but_one && i != but_two && seat.support(i).normal.dot(way) < -is_small) return false;
      return true;
    };
    for (int i = 0; i < seat.count; ++i) {
      const double p = press[static_cast<std::size_t>(i)];
      const Vector3<> way = pull + p * seat.support(i).normal;
      if (p > 0.0 && allowed(way, i, i)) return {seat.centre + way, 1, i, i};
    }
    for (int i = 0; i < seat.count; ++i)
      for (int j = 0; j < i; ++j) {
        const Vector3<>&m = seat.support(i).normal, &n = seat.support(j).normal;
        const double p = press[static_cast<std::size_t>(i)], q = press[static_cast<std::size_t>(j)], c = m.dot(n);
        if (p - c * q < -rounding || q - c * p < -rounding) continue;  // one of them would pull
        Vector3<> line = m.cross(n);
        const double sine = line.norm();
        if (sine < TwoContactCurve::parallel) continue;
        line /= sine;
        const Vector3<> way = pull.dot(line) * line;
        if (allowed(way, i, j)) return {seat.centre + way, 2, p > q ? i : j, p > q ? j : i};
      }
    return {seat.centre, 3, hardest, hardest};
  }

  /// True if the sphere rests.
  template <class Cone>
  bool slide_on_one(SphereProxyState& seat, Goal& goal, const Vector3<>& tip, const Cone& cone, SlidingState& slip,
                    double small) const noexcept {
    const SphereProxyState::ContactConstraint support = seat.support(goal.one);
    const SingleContactMotion::Move move = rolling_.next(seat, support, tip, cone, slip, small);
    if (move.kind == SingleContactMotion::Move::Kind::rest) {
      // On a border it may be the neighbour whose friction holds: then that one is touched.
      if (move.facet != TriangleMesh::none && move.facet != support.facet && !holds(seat, move.facet)) {
        seat.support(goal.one).facet = seat.facet = move.facet;
        this->support(seat.support(goal.one), seat.centre);
      }
      return true;
    }
    if (move.kind == SingleContactMotion::Move::Kind::meet && add(seat, move.facet)) return false;
    if (move.kind == SingleContactMotion::Move::Kind::go && allows(seat, move.by)) {
      const Hit hit = first_on(seat, move.by, support.facet, support.facet);
      if (hit.part == 0.0) {
        if (!meet(seat, goal, hit.facet)) return stay(seat);
        note(seat, goal);
        return slide_on_two(seat, goal, tip, cone, slip, small);
      }
      go(seat, hit, move.by);
      double part = hit.part;
      if (part == 1.0 && move.curved) part = sweep_to(seat, move.to, support.facet, move.facet);
      if (part == 1.0) add(seat, move.facet);
      slip.slid += part * move.slip;
      return false;
    }
    // The rolling would run into another support: straight on, as far as the planes allow.
    const Vector3<> lag = goal.point - seat.centre;
    const double length = lag.norm();
    const double left = cone(seat.facet, goal.point).rest(length, (goal.point - tip).norm(), slip.slid, slip.sliding());
    if (!(length - left > small)) return true;
    const double share = 1.0 - left / length;
    slip.slid += sweep_to(seat, seat.centre + share * lag, support.facet, support.facet) * share * length;
    return false;
  }

  /// A facet that the planes do not hold against, but for rounding, holds too. False if it touches where the first one does.
  bool meet(SphereProxyState& seat, Goal& goal, std::int32_t facet) const noexcept {
    add(seat, facet);
    for (int i = 0; i < seat.count; ++i)
      if (seat.support(i).facet == facet) goal.two = i;
    const Vector3<> line = seat.support(goal.one).normal.cross(seat.support(goal.two).normal);
    const double sine2 = line.squaredNorm();
    if (!(sine2 > TwoContactCurve::parallel * TwoContactCurve::parallel)) return false;
    goal.point = seat.centre + (goal.point - seat.centre).dot(line) / sine2 * line;
    return true;
  }

  [[nodiscard]] bool allows(const SphereProxyState& seat, const Vector3<>& x) const noexcept {
    const Vector3<> way = x - seat.centre;
    const double is_small = SingleContactMotion::clear * way.norm() + tolerance * radius_;
    for (int i = 0; i < seat.count; ++i)
      if (seat.support(i).normal.dot(way) < -is_small) return false;
    return true;
  }

  /// A Newton step along the curve on which the sphere touches both, as far as both stay the features they are. True if the sphere rests.
  template <class Cone>
  bool slide_on_two(SphereProxyState& seat, const Goal& goal, const Vector3<>& tip, const Cone& cone, SlidingState& slip,
                    double small) const noexcept {
    SphereProxyState::ContactConstraint one = seat.support(goal.one), two = seat.support(goal.two);
    const std::int32_t first = one.facet, second = two.facet;
    const Vector3<> from = seat.centre, pull = tip - from;
    Vector3<> line = one.normal.cross(two.normal).normalized();
    double along = pull.dot(line);
    if (along < 0.0) {
      line = -line;
      along = -along;
    }
    const double depth = (pull - along * line).norm();
    const double left = cone(seat.facet, from).rest(along, depth, slip.slid, slip.sliding());
    if (!(along - left > small)) return true;
    // Where a foot is on a border, it counts what it will be on: rounding has no say.
    const double ahead = std::fmin(probe * radius_, along - left);
    Vector3<> x = from + ahead * line;
    if (!put_on(one, two, x)) return true;
    const TwoContactCurve groove(*mesh_, radius_, {one.facet, one.at.feature}, {two.facet, two.at.feature});
    const bool straight = groove.straight(line);
    // How fast the lag shrinks along the curve, and the friction with it.
    double shrink = 1.0;
    if (!straight) {
      shrink -= pull.dot(groove.curvature(from, line));
      if (left > 0.0) shrink -= left * along / (depth * depth) * (1.0 - shrink);
    }
    double length = (along - left) / std::fmax(shrink, 0.2);
    if (!straight) length = std::fmin(length, most_way * radius_);
    const auto at = [&](double way, Vector3<>& target) {
      target = from + way * line;
      return straight || groove.put_on(target);
    };
    Vector3<> target;
    for (int halved = 0; !at(length, target) || !((target - from).dot(tip - target + pull) > 0.0); ++halved) {
      if (halved == 30) return stay(seat);  // as near as numbers can tell
      length *= 0.5;
    }
    // Back to where one of them becomes another feature (regula falsi, Illinois).
    double low = std::fmin(ahead, length), high = length, at_high = groove.margin(target), at_low = groove.margin(x);
    if (at_high < 0.0 && high > low) {
      if (!(at_low > 0.0)) at_low = 1e-3 * probe * radius_;
      int same = 0;
      for (int turn = 0; turn < 60 && high - low > 1e-13 * radius_; ++turn) {
        length = low + (high - low) * at_low / (at_low - at_high);
        if (!at(length, target)) break;
        const double margin = groove.margin(target);
        if (margin < 0.0) {
          high = length;
          at_high = margin;
          if (same > 0) at_low *= 0.5;
          same = 1;
        } else {
          low = length;
          at_low = margin;
          if (same < 0) at_high *= 0.5;
          same = -1;
        }
        if (std::fabs(margin) <= 1e-13 * radius_) break;
      }
      if (high - low <= 1e-12 * radius_) {
        length = low;
        at(length, target);
      }
    }
    // Back to where a third one comes: on the chord that is nearer by a share of the bulge, so again from there, and by secants.
    Hit hit = first_on(seat, target, first, second);
    double last_length = 0.0, last_excess = -1.0;
    for (int turn = 0; turn < 30 && hit.facet != TriangleMesh::none && !straight; ++turn) {
      const double excess = (1.0 - hit.part) * length;
      if (excess <= 1e-13 * radius_ || hit.part == 0.0) break;
      const double slope = last_excess > excess ? (last_excess - excess) / (last_length - length) : 1.0;
      last_length = length;
      last_excess = excess;
      length = std::fmax(length - excess / std::fmin(std::fmax(slope, 0.2), 1.0), 0.5 * hit.part * length);
      if (!at(length, target)) break;
      hit = first_on(seat, target, first, second);
    }
    if (hit.part == 0.0 && holds(seat, hit.facet)) return stay(seat);  // a third one, but for rounding
    go(seat, hit, target);
    slip.slid += (seat.centre - from).norm();
    if (hit.part == 1.0) {
      add(seat, one.facet);
      add(seat, two.facet);
    }
    return false;
  }

  /// Moves `x` to where the sphere touches both supports, which change to a neighbour where that one comes nearer. False if there is no
  /// such place close by.
  bool put_on(SphereProxyState::ContactConstraint& one, SphereProxyState::ContactConstraint& two, Vector3<>& x) const noexcept {
    for (int turn = 0; turn < 12; ++turn) {
      support(one, x);
      support(two, x);
      const double in_one = radius_ - one.distance, in_two = radius_ - two.distance;
      if (std::fmax(std::fabs(in_one), std::fabs(in_two)) <= 1e-13 * radius_ + 1e-15 * mesh_->reach()) {
        if (!nearer_neighbour(one, x, two.facet) && !nearer_neighbour(two, x, one.facet)) return true;
        continue;
      }
      if (nearly_parallel(one.normal, two.normal, TwoContactCurve::parallel)) return false;
      x += spanned(one.normal, two.normal, in_one, in_two);
    }
    return false;
  }

  /// Takes, in the support's place, the facet around its edge or corner that the sphere is deepest in; false if there is none.
  bool nearer_neighbour(SphereProxyState::ContactConstraint& s, const Vector3<>& x, std::int32_t other) const noexcept {
    if (s.at.feature == Feature::inside) return false;
    std::int32_t nearest = TriangleMesh::none;
    double least = s.distance * (1.0 - 1e-14);
    const auto look = [&](std::int32_t f) {
      if (f == other) return;
      const double distance = (nearest_point(mesh_->facet(f), x).point - x).norm();
      if (distance < least) {
        least = distance;
        nearest = f;
      }
    };
    if (is_edge(s.at.feature)) {
      const std::int32_t across = mesh_->facet(s.facet).neighbour[static_cast<std::size_t>(index_of(s.at.feature))];
      if (across >= 0) look(across / 3);
    } else {
      mesh_->around(s.facet, index_of(s.at.feature), [&](std::int32_t f, int) { look(f); });
    }
    if (nearest == TriangleMesh::none) return false;
    s.facet = nearest;
    return true;
  }

  /// The first facet in the way of the sphere.
  struct Hit {
    std::int32_t facet = TriangleMesh::none;
    double part = 1.0;  // of the way
  };

  /// The first facet between the sphere and `target`, other than the two that it moves on.
  [[nodiscard]] Hit first_on(SphereProxyState& seat, const Vector3<>& target, std::int32_t one, std::int32_t two) const noexcept {
    Hit hit;
    const Vector3<> from = seat.centre, way = target - from;
    seat.near.along(*mesh_, *tree_, from, way, radius_, [&](std::int32_t f, double& end) {
      if (f == one || f == two) return;
      const Face& facet = mesh_->facet(f);
      const Touch touch = sweep(facet, from, way, radius_);
      if (!touch.hit || (touch.time >= end && hit.facet != TriangleMesh::none)) return;
      // A facet lies behind its plane: what is left of the way leads no deeper into it than rounding.
      const bool deep = touch.time == 0.0 && (from - touch.point).squaredNorm() < (1.0 - 2e-9) * radius_ * radius_;
      if (!deep && -(1.0 - touch.time) * way.dot(touch.normal) <= tolerance * radius_) return;
      // At a point that also belongs to what it moves on, and no deeper on the way: nothing new.
      if (one >= 0 && touch.feature != Feature::inside &&
          (belongs(facet, touch.feature, mesh_->facet(one)) || belongs(facet, touch.feature, mesh_->facet(two))) &&
          (nearest_point(facet, target).point - target).norm() > (1.0 - tolerance) * radius_)
        return;
      end = touch.time;
      hit = {f, touch.time};
    });
    return hit;
  }

  void go(SphereProxyState& seat, const Hit& hit, const Vector3<>& target) const noexcept {
    seat.centre = hit.part == 1.0 ? target : Vector3<>(seat.centre + hit.part * (target - seat.centre));
    if (hit.part > 0.0) settle(seat);
    if (hit.facet != TriangleMesh::none) add(seat, hit.facet);
  }

  /// Sweeps the sphere to `target`; stops at the first facet in its way, other than the two that it moves on, and adds that one. Returns
  /// the part of the way done.
  double sweep_to(SphereProxyState& seat, const Vector3<>& target, std::int32_t one, std::int32_t two) const noexcept {
    const Hit hit = first_on(seat, target, one, two);
    go(seat, hit, target);
    return hit.part;
  }

  /// The facet's point nearest to a sphere at `centre`, and the normal there.
  void support(SphereProxyState::ContactConstraint& s, const Vector3<>& centre) const noexcept {
    const Face& facet = mesh_->facet(s.facet);
    s.at = nearest_point(facet, centre);
    if (s.at.feature == Feature::inside) {
      const double height = facet.height(centre);
      s.normal = height >= 0.0 ? facet.normal : Vector3<>(-facet.normal);
      s.distance = std::fabs(height);
      return;
    }
    const Vector3<> away = centre - s.at.point;
    s.distance = away.norm();
    if (s.distance > 0.0) s.normal = away / s.distance;
  }

  [[nodiscard]] static bool holds(const SphereProxyState& seat, std::int32_t facet) noexcept {
    for (int i = 0; i < seat.count; ++i)
      if (seat.support(i).facet == facet) return true;
    return false;
  }

  /// False if the facet is among the supports already.
  bool add(SphereProxyState& seat, std::int32_t facet) const noexcept {
    if (holds(seat, facet)) return false;
    int place = seat.count;
    if (place < SphereProxyState::most_supports) {
      ++seat.count;
    } else {  // in the place of the one farthest away
      place = 0;
      for (int i = 1; i < seat.count; ++i)
        if (seat.support(i).distance > seat.support(place).distance) place = i;
    }
    SphereProxyState::ContactConstraint& s = seat.support(place);
    s.facet = facet;
    support(s, seat.centre);
    drop_repeated(seat);
    return true;
  }

  /// The supports at the centre as it is now, of the facets that touch the sphere there; what rounding has let in is put out again.
  void settle(SphereProxyState& seat) const noexcept {
    int kept = 0;
    for (int i = 0; i < seat.count; ++i) {
      SphereProxyState::ContactConstraint s = seat.support(i);
      support(s, seat.centre);
      if (s.distance < radius_) {
        seat.centre += (radius_ - s.distance) * s.normal;
        s.distance = radius_;
      }
      if (s.distance - radius_ <= tolerance * radius_) seat.support(kept++) = s;
    }
    seat.count = kept;
    drop_repeated(seat);
  }

  /// Facets that touch the sphere at a point they share count once, or it would look held where it can roll over their edge: the one
  /// stays that is touched on the larger feature.
  void drop_repeated(SphereProxyState& seat) const noexcept {
    for (int i = 0; i < seat.count; ++i)
      for (int j = 0; j < seat.count; ++j) {
        const SphereProxyState::ContactConstraint &s = seat.support(i), &t = seat.support(j);
        if (i == j || s.at.feature == Feature::inside || !belongs(mesh_->facet(s.facet), s.at.feature, mesh_->facet(t.facet))) continue;
        const bool back = t.at.feature != Feature::inside && belongs(mesh_->facet(t.facet), t.at.feature, mesh_->facet(s.facet));
        if (back && (rank(s) > rank(t) || (rank(s) == rank(t) && i > j))) continue;
        for (int k = i + 1; k < seat.count; ++k) seat.support(k - 1) = seat.support(k);
        --seat.count;
        --i;
        break;
      }
  }

  [[nodiscard]] static int rank(const SphereProxyState::ContactConstraint& s) noexcept {
    return s.at.feature == Feature::inside ? 2 : (is_edge(s.at.feature) ? 1 : 0);
  }

  const TriangleMesh* mesh_;
  const AabbTree* tree_;
  SingleContactMotion rolling_;
  double radius_;  // m
};

}  // namespace palpate::mesh
