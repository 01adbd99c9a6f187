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

/// Motion of a spherical proxy. Its center keeps a distance of one radius from every face.
///
/// With one active face the sphere rolls over it exactly. With two it follows the curve on which it
/// touches both. With three it rests. Every move is swept; a face in its motion stops the move and
/// becomes a constraint. Every move reduces the distance to the tip, and none can pass through the
/// surface.
///
/// Keeps references to mesh and tree, which must outlive it.
class SphereProxy {
 public:
  static constexpr int max_steps = 256;
  static constexpr double tolerance = 1e-10;  // relative to radius and depth

  SphereProxy(const TriangleMesh& mesh, const AabbTree& tree, double radius) noexcept
      : mesh_(&mesh), tree_(&tree), single_contact_(mesh, radius), radius_(radius) {}
  SphereProxy(const TriangleMesh&& mesh, const AabbTree& tree, double radius) = delete;
  SphereProxy(const TriangleMesh& mesh, const AabbTree&& tree, double radius) = delete;
  SphereProxy(const TriangleMesh&& mesh, const AabbTree&& tree, double radius) = delete;

  /// Return the initial state: at the tip, or at the end of a sweep from outside towards the face
  /// nearest to the tip. Without a nearest face (empty tree, invalid tip) the sphere is free.
  [[nodiscard]] SphereProxyState start(const Vector3<>& tip) const noexcept {
    SphereProxyState state;
    state.center = tip;
    const AabbTree::Nearest near = tree_->nearest(*mesh_, tip);
    if (!near.found()) return state;
    const Face& face = mesh_->face(near.face);
    Vector3<> out = tip - near.at.point;
    bool inside = false;
    if (mesh_->closed()) {
      Vector3<> normal = face.normal;
      if (is_corner(near.at.feature)) normal = mesh_->vertex_normal(face.vertex[static_cast<std::size_t>(index_of(near.at.feature))]);
      if (is_edge(near.at.feature)) normal += mesh_->face(face.neighbor[static_cast<std::size_t>(index_of(near.at.feature))] / 3).normal;
      inside = normal.dot(out) < 0.0;
    }
    if (!inside && near.distance2 >= radius_ * radius_) return state;
    out = inside || !(out.norm() > 1e-9 * radius_) ? face.normal : Vector3<>(out.normalized());
    state.center = near.at.point + 2.0 * (mesh_->extent() + radius_) * out;
    sweep_to(state, near.at.point, TriangleMesh::none, TriangleMesh::none);
    return state;
  }

  /// Update the state after the mesh has moved: move the center to `center` [m] and push it out of
  /// the faces there. A free sphere starts anew.
  void reattach(SphereProxyState& state, const Vector3<>& center) const noexcept {
    if (!state.touching()) {
      state = start(state.center);
      return;
    }
    state.center = center;
    state.count = 0;
    state.broad_phase.invalidate();
    for (int iteration = 0; iteration < max_reattach_iterations; ++iteration) {
      bool out = true;
      tree_->overlap_sphere(state.center, radius_ * (1.0 + tolerance), [&](std::int32_t f) {
        SphereProxyState::ContactConstraint s;
        s.face = f;
        update_constraint(s, state.center);
        if (!(s.distance <= radius_ * (1.0 + 0.5 * tolerance))) return;
        if (s.distance < radius_ * (1.0 - 0.1 * tolerance)) {
          state.center += (radius_ - s.distance) * s.normal;
          out = false;
        } else if (out) {
          add_constraint(state, f);
        }
      });
      if (out) return;
      state.count = 0;
    }
    state = start(state.center);  // squeezed between faces: start from outside
  }

  /// Move `state` towards `tip` [m]; see PointProxy::follow.
  template <class Cone>
  bool follow(SphereProxyState& state, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    slip.threshold = min_slip_ratio * (radius_ + (tip - state.center).norm());
    bool done = false;
    for (int step = 0; step < max_steps && !done; ++step) {
      Goal goal = nearest_admissible(state, tip);
      store_goal(state, goal);
      const double min_step = tolerance * (radius_ + (goal.point - tip).norm());
      if (goal.active_count == 0) {
        const bool away = (tip - state.center).norm() > min_step;
        if (!away) state.center = tip;
        done = !away || sweep_to(state, tip, TriangleMesh::none, TriangleMesh::none) == 1.0;
      } else if (goal.active_count == 1) {
        done = slide_on_one(state, goal, tip, cone, slip, min_step);
      } else {
        done = goal.active_count > 2 || slide_on_two(state, goal, tip, cone, slip, min_step);
      }
    }
    if (!done) {  // publish the state after the last move; the next tick continues
      Goal goal = nearest_admissible(state, tip);
      if (goal.active_count == 0) {
        sweep_to(state, tip, TriangleMesh::none, TriangleMesh::none);
        goal = nearest_admissible(state, tip);
      }
      store_goal(state, goal);
    }
    return done;
  }

 private:
  static constexpr int max_reattach_iterations = 64;
  static constexpr double min_slip_ratio = 1e-7;   // relative to radius and depth: minimum sliding distance
  static constexpr double max_step_ratio = 0.3;    // of the radius, per move along a curve
  static constexpr double lookahead_ratio = 1e-6;  // of the radius

  /// Point nearest to the tip that the planes of the constraints admit, and the active constraints
  /// there.
  struct Goal {
    Vector3<> point;
    int active_count = 0;  // 0 to 3
    int first = -1, second = -1;
  };

  static void store_goal(SphereProxyState& state, const Goal& goal) noexcept {
    state.goal = goal.point;
    state.active_count = goal.active_count;
    state.face = goal.active_count == 0 ? TriangleMesh::none : state.constraint(goal.first).face;
  }

  /// Stop: constrained in all directions, independent of friction.
  static bool stay_at_center(SphereProxyState& state) noexcept {
    state.goal = state.center;
    return true;
  }

  /// Return the nearest admissible point.
  ///
  /// The planes of all constraints pass through the center, so the admissible set is a cone. One
  /// active plane leaves its plane to slide in, two leave their common line, three or more leave
  /// nothing.
  [[nodiscard]] Goal nearest_admissible(const SphereProxyState& state, const Vector3<>& tip) const noexcept {
    const Vector3<> to_tip = tip - state.center;
    const double rounding = 1e-15 * to_tip.norm();
    std::array<double, SphereProxyState::max_constraints> penetration{};
    int deepest = -1;
    for (int i = 0; i < state.count; ++i) {
      const double p = penetration[static_cast<std::size_t>(i)] = -state.constraint(i).normal.dot(to_tip);
      if (p > 0.0 && (deepest < 0 || p > penetration[static_cast<std::size_t>(deepest)])) deepest = i;
    }
    if (deepest < 0) return {tip};
    const auto admissible = [&](const Vector3<>& motion, int skip_first, int skip_second) {
      const double tolerated = rounding + tolerance * motion.norm();
      for (int i = 0; i < state.count; ++i)
        if (i != skip_first && i != skip_second && state.constraint(i).normal.dot(motion) < -tolerated) return false;
      return true;
    };
    for (int i = 0; i < state.count; ++i) {
      const double p = penetration[static_cast<std::size_t>(i)];
      const Vector3<> motion = to_tip + p * state.constraint(i).normal;
      if (p > 0.0 && admissible(motion, i, i)) return {state.center + motion, 1, i, i};
    }
    for (int i = 0; i < state.count; ++i)
      for (int j = 0; j < i; ++j) {
        const Vector3<>&m = state.constraint(i).normal, &n = state.constraint(j).normal;
        const double p = penetration[static_cast<std::size_t>(i)], q = penetration[static_cast<std::size_t>(j)], c = m.dot(n);
        if (p - c * q < -rounding || q - c * p < -rounding) continue;  // one of them would pull
        Vector3<> line = m.cross(n);
        const double sine = line.norm();
        if (sine < TwoContactCurve::parallel_tolerance) continue;
        line /= sine;
        const Vector3<> motion = to_tip.dot(line) * line;
        if (admissible(motion, i, j)) return {state.center + motion, 2, p > q ? i : j, p > q ? j : i};
      }
    return {state.center, 3, deepest, deepest};
  }

  /// Move with one active constraint. Return true if the sphere rests.
  template <class Cone>
  bool slide_on_one(SphereProxyState& state, Goal& goal, const Vector3<>& tip, const Cone& cone, SlidingState& slip,
                    double min_step) const noexcept {
    const SphereProxyState::ContactConstraint constraint = state.constraint(goal.first);
    const SingleContactMotion::Move move = single_contact_.next(state, constraint, tip, cone, slip, min_step);
    if (move.kind == SingleContactMotion::Move::Kind::stop) {
      // On an edge the friction of the neighbor can be the one that sticks; make it the constraint.
      if (move.face != TriangleMesh::none && move.face != constraint.face && !is_constrained_by(state, move.face)) {
        state.constraint(goal.first).face = state.face = move.face;
        update_constraint(state.constraint(goal.first), state.center);
      }
      return true;
    }
    if (move.kind == SingleContactMotion::Move::Kind::new_contact && add_constraint(state, move.face)) return false;
    if (move.kind == SingleContactMotion::Move::Kind::move && is_admissible(state, move.via)) {
      const Hit hit = first_hit(state, move.via, constraint.face, constraint.face);
      if (hit.fraction == 0.0) {
        if (!add_second_constraint(state, goal, hit.face)) return stay_at_center(state);
        store_goal(state, goal);
        return slide_on_two(state, goal, tip, cone, slip, min_step);
      }
      apply_move(state, hit, move.via);
      double fraction = hit.fraction;
      if (fraction == 1.0 && move.curved) fraction = sweep_to(state, move.to, constraint.face, move.face);
      if (fraction == 1.0) add_constraint(state, move.face);
      slip.distance += fraction * move.slip;
      return false;
    }
    // The exact motion would run into another constraint: move straight, as far as the planes
    // admit.
    const Vector3<> lag = goal.point - state.center;
    const double length = lag.norm();
    const double remaining = cone(state.face, goal.point).remaining_lag(length, (goal.point - tip).norm(), slip.distance, slip.sliding());
    if (!(length - remaining > min_step)) return true;
    const double ratio = 1.0 - remaining / length;
    slip.distance += sweep_to(state, state.center + ratio * lag, constraint.face, constraint.face) * ratio * length;
    return false;
  }

  /// Add a face that blocks the motion although the planes admit it to rounding. Return false if it
  /// touches where the first one does.
  bool add_second_constraint(SphereProxyState& state, Goal& goal, std::int32_t face) const noexcept {
    add_constraint(state, face);
    for (int i = 0; i < state.count; ++i)
      if (state.constraint(i).face == face) goal.second = i;
    const Vector3<> line = state.constraint(goal.first).normal.cross(state.constraint(goal.second).normal);
    const double sine2 = line.squaredNorm();
    if (!(sine2 > TwoContactCurve::parallel_tolerance * TwoContactCurve::parallel_tolerance)) return false;
    goal.point = state.center + (goal.point - state.center).dot(line) / sine2 * line;
    return true;
  }

  [[nodiscard]] bool is_admissible(const SphereProxyState& state, const Vector3<>& x) const noexcept {
    const Vector3<> motion = x - state.center;
    const double tolerated = SingleContactMotion::valley_tolerance * motion.norm() + tolerance * radius_;
    for (int i = 0; i < state.count; ++i)
      if (state.constraint(i).normal.dot(motion) < -tolerated) return false;
    return true;
  }

  /// Move with two active constraints: a Newton step along their common curve, up to the end of
  /// either feature. Return true if the sphere rests.
  template <class Cone>
  bool slide_on_two(SphereProxyState& state, const Goal& goal, const Vector3<>& tip, const Cone& cone, SlidingState& slip,
                    double min_step) const noexcept {
    SphereProxyState::ContactConstraint one = state.constraint(goal.first), two = state.constraint(goal.second);
    const std::int32_t first = one.face, second = two.face;
    const Vector3<> from = state.center, to_tip = tip - from;
    Vector3<> line = one.normal.cross(two.normal).normalized();
    double along = to_tip.dot(line);
    if (along < 0.0) {
      line = -line;
      along = -along;
    }
    const double depth = (to_tip - along * line).norm();
    const double remaining = cone(state.face, from).remaining_lag(along, depth, slip.distance, slip.sliding());
    if (!(along - remaining > min_step)) return true;
    // On the border of a feature, use the feature ahead; rounding must not decide.
    const double ahead = std::fmin(lookahead_ratio * radius_, along - remaining);
    Vector3<> x = from + ahead * line;
    if (!project_onto_both(one, two, x)) return true;
    const TwoContactCurve curve(*mesh_, radius_, {one.face, one.at.feature}, {two.face, two.at.feature});
    const bool straight = curve.is_straight(line);
    // Rate at which the lag, and the friction with it, decreases along the curve.
    double shrink = 1.0;
    if (!straight) {
      shrink -= to_tip.dot(curve.curvature(from, line));
      if (remaining > 0.0) shrink -= remaining * along / (depth * depth) * (1.0 - shrink);
    }
    double length = (along - remaining) / std::fmax(shrink, 0.2);
    if (!straight) length = std::fmin(length, max_step_ratio * radius_);
    const auto at = [&](double motion, Vector3<>& target) {
      target = from + motion * line;
      return straight || curve.project(target);
    };
    Vector3<> target;
    for (int halved = 0; !at(length, target) || !((target - from).dot(tip - target + to_tip) > 0.0); ++halved) {
      if (halved == 30) return stay_at_center(state);  // at the limit of rounding
      length *= 0.5;
    }
    // Step back to where one of them becomes another feature (regula falsi, Illinois variant).
    double low = std::fmin(ahead, length), high = length, at_high = curve.margin(target), at_low = curve.margin(x);
    if (at_high < 0.0 && high > low) {
      if (!(at_low > 0.0)) at_low = 1e-3 * lookahead_ratio * radius_;
      int same = 0;
      for (int iteration = 0; iteration < 60 && high - low > 1e-13 * radius_; ++iteration) {
        length = low + (high - low) * at_low / (at_low - at_high);
        if (!at(length, target)) break;
        const double margin = curve.margin(target);
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
    // Step back to the first hit of a third face. The hit is found on the chord, which deviates
    // from the curve, so iterate with secants.
    Hit hit = first_hit(state, target, first, second);
    double last_length = 0.0, last_excess = -1.0;
    for (int iteration = 0; iteration < 30 && hit.face != TriangleMesh::none && !straight; ++iteration) {
      const double excess = (1.0 - hit.fraction) * length;
      if (excess <= 1e-13 * radius_ || hit.fraction == 0.0) break;
      const double slope = last_excess > excess ? (last_excess - excess) / (last_length - length) : 1.0;
      last_length = length;
      last_excess = excess;
      length = std::fmax(length - excess / std::fmin(std::fmax(slope, 0.2), 1.0), 0.5 * hit.fraction * length);
      if (!at(length, target)) break;
      hit = first_hit(state, target, first, second);
    }
    if (hit.fraction == 0.0 && is_constrained_by(state, hit.face)) return stay_at_center(state);  // touches already, to rounding
    apply_move(state, hit, target);
    slip.distance += (state.center - from).norm();
    if (hit.fraction == 1.0) {
      add_constraint(state, one.face);
      add_constraint(state, two.face);
    }
    return false;
  }

  /// Move `x` to where the sphere touches both constraints. A constraint switches to a neighbor
  /// that is nearer. Return false if there is no such point nearby.
  bool project_onto_both(SphereProxyState::ContactConstraint& one, SphereProxyState::ContactConstraint& two, Vector3<>& x) const noexcept {
    for (int iteration = 0; iteration < 12; ++iteration) {
      update_constraint(one, x);
      update_constraint(two, x);
      const double in_one = radius_ - one.distance, in_two = radius_ - two.distance;
      if (std::fmax(std::fabs(in_one), std::fabs(in_two)) <= 1e-13 * radius_ + 1e-15 * mesh_->max_coordinate()) {
        if (!switch_to_nearer_neighbor(one, x, two.face) && !switch_to_nearer_neighbor(two, x, one.face)) return true;
        continue;
      }
      if (nearly_parallel(one.normal, two.normal, TwoContactCurve::parallel_tolerance)) return false;
      x += solve_in_plane(one.normal, two.normal, in_one, in_two);
    }
    return false;
  }

  /// Replace the constraint by the nearest face around its edge or corner. Return false if none is
  /// nearer.
  bool switch_to_nearer_neighbor(SphereProxyState::ContactConstraint& s, const Vector3<>& x, std::int32_t other) const noexcept {
    if (s.at.feature == Feature::inside) return false;
    std::int32_t nearest = TriangleMesh::none;
    double min_distance = s.distance * (1.0 - 1e-14);
    const auto consider_candidate = [&](std::int32_t f) {
      if (f == other) return;
      const double distance = (nearest_point(mesh_->face(f), x).point - x).norm();
      if (distance < min_distance) {
        min_distance = distance;
        nearest = f;
      }
    };
    if (is_edge(s.at.feature)) {
      const std::int32_t twin = mesh_->face(s.face).neighbor[static_cast<std::size_t>(index_of(s.at.feature))];
      if (twin >= 0) consider_candidate(twin / 3);
    } else {
      mesh_->for_each_face_around(s.face, index_of(s.at.feature), [&](std::int32_t f, int) { consider_candidate(f); });
    }
    if (nearest == TriangleMesh::none) return false;
    s.face = nearest;
    return true;
  }

  /// First face in the motion of the sphere.
  struct Hit {
    std::int32_t face = TriangleMesh::none;
    double fraction = 1.0;  // of the motion, 0 to 1
  };

  /// Return the first face between the sphere and `target` [m], excluding the faces `one` and
  /// `two`.
  [[nodiscard]] Hit first_hit(SphereProxyState& state, const Vector3<>& target, std::int32_t one, std::int32_t two) const noexcept {
    Hit hit;
    const Vector3<> from = state.center, motion = target - from;
    state.broad_phase.sweep_sphere(*mesh_, *tree_, from, motion, radius_, [&](std::int32_t f, double& end) {
      if (f == one || f == two) return;
      const Face& face = mesh_->face(f);
      const SweepHit contact = sweep_sphere(face, from, motion, radius_);
      if (!contact.hit || (contact.time >= end && hit.face != TriangleMesh::none)) return;
      // Ignore a face if the remaining motion penetrates its contact plane by no more than
      // rounding.
      const bool deep = contact.time == 0.0 && (from - contact.point).squaredNorm() < (1.0 - 2e-9) * radius_ * radius_;
      if (!deep && -(1.0 - contact.time) * motion.dot(contact.normal) <= tolerance * radius_) return;
      // Ignore a contact on a feature shared with the excluded faces that does not become deeper.
      if (one >= 0 && contact.feature != Feature::inside &&
          (shares_feature(face, contact.feature, mesh_->face(one)) || shares_feature(face, contact.feature, mesh_->face(two))) &&
          (nearest_point(face, target).point - target).norm() > (1.0 - tolerance) * radius_)
        return;
      end = contact.time;
      hit = {f, contact.time};
    });
    return hit;
  }

  void apply_move(SphereProxyState& state, const Hit& hit, const Vector3<>& target) const noexcept {
    state.center = hit.fraction == 1.0 ? target : Vector3<>(state.center + hit.fraction * (target - state.center));
    if (hit.fraction > 0.0) refresh_constraints(state);
    if (hit.face != TriangleMesh::none) add_constraint(state, hit.face);
  }

  /// Sweep the sphere to `target` [m] and add the first face hit to the constraints. Return the
  /// completed fraction of the motion.
  double sweep_to(SphereProxyState& state, const Vector3<>& target, std::int32_t one, std::int32_t two) const noexcept {
    const Hit hit = first_hit(state, target, one, two);
    apply_move(state, hit, target);
    return hit.fraction;
  }

  /// Compute contact point, normal and distance of a constraint for a sphere at `center` [m].
  void update_constraint(SphereProxyState::ContactConstraint& s, const Vector3<>& center) const noexcept {
    const Face& face = mesh_->face(s.face);
    s.at = nearest_point(face, center);
    if (s.at.feature == Feature::inside) {
      const double height = face.height(center);
      s.normal = height >= 0.0 ? face.normal : Vector3<>(-face.normal);
      s.distance = std::fabs(height);
      return;
    }
    const Vector3<> away = center - s.at.point;
    s.distance = away.norm();
    if (s.distance > 0.0) s.normal = away / s.distance;
  }

  [[nodiscard]] static bool is_constrained_by(const SphereProxyState& state, std::int32_t face) noexcept {
    for (int i = 0; i < state.count; ++i)
      if (state.constraint(i).face == face) return true;
    return false;
  }

  /// Add a face to the constraints. Return false if it is one already.
  bool add_constraint(SphereProxyState& state, std::int32_t face) const noexcept {
    if (is_constrained_by(state, face)) return false;
    int slot = state.count;
    if (slot < SphereProxyState::max_constraints) {
      ++state.count;
    } else {  // replace the most distant one
      slot = 0;
      for (int i = 1; i < state.count; ++i)
        if (state.constraint(i).distance > state.constraint(slot).distance) slot = i;
    }
    SphereProxyState::ContactConstraint& s = state.constraint(slot);
    s.face = face;
    update_constraint(s, state.center);
    remove_duplicates(state);
    return true;
  }

  /// Recompute the constraints at the current center, drop faces that no longer touch, and remove
  /// penetration due to rounding.
  void refresh_constraints(SphereProxyState& state) const noexcept {
    int count = 0;
    for (int i = 0; i < state.count; ++i) {
      SphereProxyState::ContactConstraint s = state.constraint(i);
      update_constraint(s, state.center);
      if (s.distance < radius_) {
        state.center += (radius_ - s.distance) * s.normal;
        s.distance = radius_;
      }
      if (s.distance - radius_ <= tolerance * radius_) state.constraint(count++) = s;
    }
    state.count = count;
    remove_duplicates(state);
  }

  /// Keep one of the faces that touch the sphere at a shared point, the one touched on the larger
  /// feature. Otherwise the sphere would seem blocked where it can roll over their edge.
  void remove_duplicates(SphereProxyState& state) const noexcept {
    for (int i = 0; i < state.count; ++i)
      for (int j = 0; j < state.count; ++j) {
        const SphereProxyState::ContactConstraint &s = state.constraint(i), &t = state.constraint(j);
        if (i == j || s.at.feature == Feature::inside || !shares_feature(mesh_->face(s.face), s.at.feature, mesh_->face(t.face))) continue;
        const bool back = t.at.feature != Feature::inside && shares_feature(mesh_->face(t.face), t.at.feature, mesh_->face(s.face));
        if (back && (rank(s) > rank(t) || (rank(s) == rank(t) && i > j))) continue;
        for (int k = i + 1; k < state.count; ++k) state.constraint(k - 1) = state.constraint(k);
        --state.count;
        --i;
        break;
      }
  }

  [[nodiscard]] static int rank(const SphereProxyState::ContactConstraint& s) noexcept {
    return s.at.feature == Feature::inside ? 2 : (is_edge(s.at.feature) ? 1 : 0);
  }

  const TriangleMesh* mesh_;
  const AabbTree* tree_;
  SingleContactMotion single_contact_;
  double radius_;  // m
};

}  // namespace palpate::mesh
