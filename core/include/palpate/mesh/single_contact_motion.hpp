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

/// Exact motion of a sphere in contact with one face: over the face, around its edges and around
/// its corners.
class SingleContactMotion {
 public:
  static constexpr double coplanar_tolerance = 1e-9;  // rad: faces with a smaller angle are coplanar
  static constexpr double valley_tolerance = 1e-6;    // rad: rounding is about 1e-8 where a sphere touches
  static constexpr double max_rotation = 1.0;         // rad, per move

  SingleContactMotion(const TriangleMesh& mesh, double radius) noexcept : mesh_(&mesh), radius_(radius) {}
  SingleContactMotion(const TriangleMesh&& mesh, double radius) = delete;

  /// Next move of the sphere.
  struct Move {
    enum class Kind { stop, new_contact, move } kind = Kind::stop;
    std::int32_t face =
        TriangleMesh::none;  // the face in contact after the move; for `new_contact`, a touching face that is not yet a constraint
    bool curved = false;     // around an edge or corner: tangentially to `via`, then to `to`
    Vector3<> via = Vector3<>::Zero();
    Vector3<> to = Vector3<>::Zero();
    double slip = 0.0;  // sliding distance, m
  };

  /// Return the next move.
  ///
  /// A move over a face ends at an edge of the face. A move around an edge ends at a face or at the
  /// end of the edge. A move around a corner ends at an edge. Friction or the tip can end it
  /// earlier.
  template <class Cone>
  [[nodiscard]] Move next(const SphereProxyState& state, const SphereProxyState::ContactConstraint& constraint, const Vector3<>& tip,
                          const Cone& cone, const SlidingState& slip, double min_step) const noexcept {
    Contact at{constraint.face, constraint.at.feature, constraint.at.point, constraint.normal};
    for (int iteration = 0; iteration < 16; ++iteration) {
      Move move;
      bool retry = false;
      if (at.feature == Feature::inside) {
        retry = move_on_face(at, state.center, tip, cone, slip, min_step, move);
      } else if (is_edge(at.feature)) {
        retry = move_around_edge(at, tip, cone, slip, min_step, move);
      } else {
        retry = move_around_corner(at, tip, cone, slip, min_step, move);
      }
      if (retry) continue;
      if (move.kind == Move::Kind::stop) move.face = at.face;
      return move;
    }
    return {};
  }

 private:
  /// Feature in contact, its contact point [m], and the unit normal from there to the center.
  struct Contact {
    std::int32_t face;
    Feature feature;
    Vector3<> foot;
    Vector3<> normal;
  };

  // Each of the next three functions fills `move`. If no motion is possible on the feature `at`, it
  // sets `at` to the adjacent feature and returns true.

  template <class Cone>
  bool move_on_face(Contact& at, const Vector3<>& center, const Vector3<>& tip, const Cone& cone, const SlidingState& slip, double min_step,
                    Move& move) const noexcept {
    const Face& face = mesh_->face(at.face);
    const double depth = at.normal.dot(face.corner[0] - tip) + radius_;
    Vector3<> lag = tip - center;
    lag -= lag.dot(at.normal) * at.normal;
    const double length = lag.norm(),
                 remaining = cone(at.face, at.foot).remaining_lag(length, std::fabs(depth), slip.distance, slip.sliding());
    if (!(length - remaining > min_step)) return false;
    const Vector3<> motion = (1.0 - remaining / length) * lag;
    const auto [out, fraction] = first_exit(face, at.foot, motion, [](int) { return false; });
    if (out >= 0 && !(fraction * (length - remaining) > min_step)) {
      at.feature = edge(out);
      return true;
    }
    move = {Move::Kind::move, at.face, false, center + fraction * motion, center + fraction * motion, fraction * (length - remaining)};
    return false;
  }

  template <class Cone>
  bool move_around_edge(Contact& at, const Vector3<>& tip, const Cone& cone, const SlidingState& slip, double min_step,
                        Move& move) const noexcept {
    const Face& face = mesh_->face(at.face);
    const int i = index_of(at.feature);
    const Vector3<>& a = face.corner[static_cast<std::size_t>(i)];
    Vector3<> along = face.corner[static_cast<std::size_t>((i + 1) % 3)] - a;
    const double size = along.norm();
    along /= size;
    const Vector3<> out = along.cross(face.normal);  // away from the face, in its plane
    const double position = std::fmin(std::fmax((at.foot - a).dot(along), 0.0), size);
    const Vector3<> to_tip = tip - a - position * along;
    // Angles about the edge, from the normal of the face towards `out`: of the sphere, of the
    // neighbor, of the tip.
    double angle = std::atan2(at.normal.dot(out), at.normal.dot(face.normal));
    if (angle < -0.5 * std::numbers::pi) angle += 2.0 * std::numbers::pi;  // just below -pi: the back of the face
    double low = 0.0, high = std::numbers::pi;
    std::int32_t at_low = at.face, at_high = at.face;
    const std::int32_t twin = face.neighbor[static_cast<std::size_t>(i)];
    if (twin >= 0) {
      const Vector3<>& other = mesh_->face(twin / 3).normal;
      const double dihedral = std::atan2(other.dot(out), other.dot(face.normal));
      if (std::fabs(dihedral) < coplanar_tolerance) {
        if (to_tip.dot(out) > 0.0) at.face = twin / 3;
        at.feature = Feature::inside;
        return true;
      }
      (dihedral > 0.0 ? high : low) = dihedral > 0.0 ? dihedral : std::numbers::pi + dihedral;
      (dihedral > 0.0 ? at_high : at_low) = twin / 3;
      if (angle < low - valley_tolerance || angle > high + valley_tolerance) {  // valley: the neighbor touches too
        move = {Move::Kind::new_contact, twin / 3};
        return false;
      }
    }
    angle = std::fmin(std::fmax(angle, low), high);
    const double in_x = to_tip.dot(face.normal), in_y = to_tip.dot(out), lengthwise = to_tip.dot(along);
    const double distance = std::hypot(in_x, in_y);
    const double to_go = std::remainder(std::atan2(in_y, in_x) - angle, 2.0 * std::numbers::pi), angle_to_tip = std::fabs(to_go);
    const double depth = radius_ - distance * std::cos(to_go), across_lag = distance * std::sin(angle_to_tip);
    const double lag = std::hypot(across_lag, lengthwise);
    const double remaining = cone(at.face, at.foot).remaining_lag(lag, std::fabs(depth), slip.distance, slip.sliding());
    if (!(lag - remaining > min_step)) return false;
    const double friction = depth > 0.0 ? remaining / depth : 0.0;
    const double stop = equilibrium_angle(friction * across_lag / lag, distance, angle_to_tip);
    // Full rotation and translation along the edge; then the common fraction of both up to the end
    // of the edge or of its arc.
    const double full_rotation = std::copysign(angle_to_tip - stop, to_go);
    const double keep = friction * std::fabs(lengthwise) / lag * (radius_ - distance * std::cos(stop));
    const double shift = std::copysign(std::fmax(std::fabs(lengthwise) - std::fmax(keep, 0.0), 0.0), lengthwise);
    double fraction = std::fabs(full_rotation) > max_rotation ? max_rotation / std::fabs(full_rotation) : 1.0;
    enum class End { none, arc, length } end_reached = End::none;
    if (full_rotation > 0.0 ? full_rotation * fraction > high - angle : full_rotation * fraction < low - angle) {
      fraction = (full_rotation > 0.0 ? high - angle : low - angle) / full_rotation;
      end_reached = End::arc;
    }
    if (shift > 0.0 ? shift * fraction > size - position : shift * fraction < -position) {
      fraction = (shift > 0.0 ? size - position : -position) / shift;
      end_reached = End::length;
    }
    const std::int32_t next_face = full_rotation > 0.0 ? at_high : at_low;
    const double rotation = fraction * std::fabs(full_rotation);
    double next = angle + fraction * full_rotation, end = position + fraction * shift;
    if (end_reached == End::arc) next = full_rotation > 0.0 ? high : low;
    if (end_reached == End::length) end = shift > 0.0 ? size : 0.0;
    const double slid = fraction * std::hypot(radius_ * full_rotation, shift);
    if (!(slid > min_step)) {
      if (end_reached == End::none) return false;
      if (end_reached == End::arc) {
        at.face = next_face;
        at.feature = Feature::inside;
        at.normal = std::cos(next) * face.normal + std::sin(next) * out;
        at.foot = a + position * along;
        return true;
      }
      const int k = shift > 0.0 ? (i + 1) % 3 : i;
      at.feature = corner(k);
      at.foot = face.corner[static_cast<std::size_t>(k)];
      return true;
    }
    const Vector3<> normal = std::cos(next) * face.normal + std::sin(next) * out, foot = a + end * along;
    move = {Move::Kind::move,        end_reached == End::arc ? next_face : at.face,
            rotation > 0.0,          foot + radius_ / std::cos(rotation) * normal,
            foot + radius_ * normal, slid};
    return false;
  }

  template <class Cone>
  bool move_around_corner(Contact& at, const Vector3<>& tip, const Cone& cone, const SlidingState& slip, double min_step,
                          Move& move) const noexcept {
    const int k = index_of(at.feature);
    const Vector3<> foot = mesh_->face(at.face).corner[static_cast<std::size_t>(k)], to_tip = tip - foot;
    const double up = at.normal.dot(to_tip), distance = to_tip.norm();
    Vector3<> tangent = to_tip - up * at.normal;
    const double lag = tangent.norm(), depth = radius_ - up;
    const double remaining = cone(at.face, foot).remaining_lag(lag, std::fabs(depth), slip.distance, slip.sliding());
    if (!(lag - remaining > min_step)) return false;
    tangent /= lag;
    const double angle_to_tip = std::atan2(lag, up);
    double rotation =
        std::fmin(angle_to_tip - equilibrium_angle(depth > 0.0 ? remaining / depth : 0.0, distance, angle_to_tip), max_rotation);
    // The corner stays in contact while the normal has no positive component along an adjacent
    // edge.
    std::int32_t next_face = TriangleMesh::none;
    int next_edge = 0;
    const auto consider_edge = [&](std::int32_t f, int i, double sense) {
      const Face& face = mesh_->face(f);
      const Vector3<> e = sense * (face.corner[static_cast<std::size_t>((i + 1) % 3)] - face.corner[static_cast<std::size_t>(i)]);
      const double rate = tangent.dot(e);
      if (rate <= 0.0) return;
      const double until = std::atan2(std::fmax(-at.normal.dot(e), 0.0), rate);
      if (until < rotation) {
        rotation = until;
        next_face = f;
        next_edge = i;
      }
    };
    mesh_->for_each_face_around(at.face, k, [&](std::int32_t f, int c) {
      consider_edge(f, c, 1.0);
      const int last = (c + 2) % 3;
      if (mesh_->face(f).neighbor[static_cast<std::size_t>(last)] < 0) consider_edge(f, last, -1.0);
    });
    if (!(radius_ * rotation > min_step)) {
      if (next_face == TriangleMesh::none) return false;
      at.face = next_face;
      at.feature = edge(next_edge);
      at.foot = foot;
      return true;
    }
    const Vector3<> normal = std::cos(rotation) * at.normal + std::sin(rotation) * tangent;
    move = {Move::Kind::move,
            next_face == TriangleMesh::none ? at.face : next_face,
            true,
            foot + radius_ / std::cos(rotation) * normal,
            foot + radius_ * normal,
            radius_ * rotation};
    return false;
  }

  /// Return the angle between normal and tip direction at which a sphere on an edge or corner comes
  /// to rest: distance sin a = friction (radius - distance cos a).
  [[nodiscard]] double equilibrium_angle(double friction, double distance, double from) const noexcept {
    if (friction <= 0.0 || distance == 0.0) return 0.0;
    const double sine = friction * radius_ / (distance * std::sqrt(1.0 + friction * friction));
    if (sine >= 1.0) return from;
    return std::fmin(std::fmax(std::asin(sine) - std::atan(friction), 0.0), from);
  }

  const TriangleMesh* mesh_;
  double radius_;  // m
};

}  // namespace palpate::mesh
