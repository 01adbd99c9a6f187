#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/force_shading.hpp"
#include "palpate/mesh/friction_cone.hpp"
#include "palpate/mesh/point_proxy.hpp"
#include "palpate/mesh/sphere_proxy.hpp"
#include "palpate/mesh/surface_field.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Contact of a tip with a mesh.
struct Contact {
  bool touching = false;
  Vector3<> position = Vector3<>::Zero();  ///< of the proxy (center of a sphere), m
  Vector3<> normal = Vector3<>::Zero();    ///< unit, out of the surface; zero without contact
  Vector3<> force = Vector3<>::Zero();     ///< of the surface on the tip, N
  std::int32_t face = TriangleMesh::none;
  double depth = 0.0;      ///< penetration of the tip below the proxy along the normal, m
  double stiffness = 0.0;  ///< normal stiffness at the contact, N/m
};

/// Position of a proxy relative to its face, used to follow a moving mesh.
struct SurfaceAttachment {
  Vector3<> weights = Vector3<>::Zero();  ///< barycentric coordinates of the contact point
  Vector3<> offset = Vector3<>::Zero();   ///< contact point to proxy, in the frame of the face, m
};

/// God-object (Zilles and Salisbury 1995) with a point or spherical proxy (Ruspini, Kolarov and
/// Khatib 1997).
///
/// The proxy follows the tip as far as the surface allows. The spring between proxy and tip
/// generates the force. A step does not allocate or throw, and the number of its iterations is
/// bounded.
///
/// Keeps references to mesh, tree and surface field, which must outlive the proxy. If the mesh or
/// the field is not usable(), the proxy follows the tip and never touches. A radius that is
/// negative or not finite counts as zero.
class Proxy {
 public:
  /// Largest accepted coordinate of the tip, m. Squared distances beyond it overflow.
  static constexpr double max_tip_coordinate = 1e150;

  Proxy(const TriangleMesh& mesh, const AabbTree& tree, const SurfaceField& field, double radius = 0.0) noexcept
      : mesh_(&mesh), field_(&field), point_(mesh, tree), sphere_(mesh, tree, valid_radius(radius)), radius_(valid_radius(radius)) {}

  // Deleted: temporaries would leave dangling references.
  Proxy(const TriangleMesh&& mesh, const AabbTree& tree, const SurfaceField& field, double radius = 0.0) = delete;
  Proxy(const TriangleMesh& mesh, const AabbTree&& tree, const SurfaceField& field, double radius = 0.0) = delete;
  Proxy(const TriangleMesh& mesh, const AabbTree& tree, const SurfaceField&& field, double radius = 0.0) = delete;
  Proxy(const TriangleMesh&& mesh, const AabbTree&& tree, const SurfaceField& field, double radius = 0.0) = delete;
  Proxy(const TriangleMesh&& mesh, const AabbTree& tree, const SurfaceField&& field, double radius = 0.0) = delete;
  Proxy(const TriangleMesh& mesh, const AabbTree&& tree, const SurfaceField&& field, double radius = 0.0) = delete;
  Proxy(const TriangleMesh&& mesh, const AabbTree&& tree, const SurfaceField&& field, double radius = 0.0) = delete;

  /// Advance by one servo tick with the tip at `tip` [m].
  ///
  /// A tip that is not finite, or has a coordinate beyond max_tip_coordinate, counts as invalid
  /// input. The last contact is then returned unchanged.
  const Contact& step(const Vector3<>& tip) noexcept {
    if (!tip.allFinite() || !(tip.cwiseAbs().maxCoeff() <= max_tip_coordinate)) {
      ++invalid_input_count_;
      return contact_;
    }
    if (!mesh_->usable() || !field_->usable()) {
      contact_ = Contact{};
      contact_.position = tip;
      return contact_;
    }
    if (!started_) {
      started_ = true;
      if (radius_ > 0.0) {
        sphere_state_ = sphere_.start(tip);
      } else {
        point_state_ = point_.start(tip);
      }
    }
    SlidingState slip{sliding_};
    Vector3<> shaded = Vector3<>::Zero();
    if (!(field_->shading().enabled() ? move_shaded(tip, slip, shaded) : move(tip, slip))) ++iteration_limit_count_;
    sliding_ = face() != TriangleMesh::none && slip.distance > slip.threshold;
    const Vector3<> spring = position() - tip;
    if (!shaded.isZero()) {
      update_contact_force(tip, face(), position(), spring.dot(shaded) * shaded, true);
    } else if (radius_ > 0.0) {
      update_contact_force(tip, sphere_state_.face, sphere_state_.center, sphere_state_.goal - tip, false);
    } else {
      update_contact_force(tip, point_state_.face, point_state_.point, spring.dot(point_state_.normal) * point_state_.normal, false);
    }
    return contact_;
  }

  /// Return the position on the surface. Call before vertices of the mesh move.
  [[nodiscard]] SurfaceAttachment attach() const noexcept {
    SurfaceAttachment attachment;
    if (face() == TriangleMesh::none) return attachment;
    const Face& f = mesh_->face(face());
    const Vector3<> foot = radius_ > 0.0 ? nearest_point(f, sphere_state_.center).point : point_state_.point;
    attachment.weights = barycentric(f, foot);
    attachment.offset = frame(f).transpose() * (position() - foot);
    return attachment;
  }

  /// Follow the surface. Call after vertices of the mesh have moved.
  ///
  /// A free proxy that is now inside a closed mesh moves to its surface.
  void reattach(const SurfaceAttachment& attachment) noexcept {
    if (!started_) return;
    if (radius_ > 0.0) {
      Vector3<> center = sphere_state_.center;
      if (sphere_state_.touching()) {
        const Face& f = mesh_->face(sphere_state_.face);
        center = attachment.weights[0] * f.corner[0] + attachment.weights[1] * f.corner[1] + attachment.weights[2] * f.corner[2] +
                 frame(f) * attachment.offset;
      }
      sphere_.reattach(sphere_state_, center);
    } else {
      point_.reattach(point_state_, attachment.weights);
    }
  }

  /// Release the contact. The next step starts anew.
  void reset() noexcept {
    started_ = sliding_ = false;
    point_state_ = {};
    sphere_state_ = {};
    contact_ = {};
    last_depth_ = 0.0;
  }

  [[nodiscard]] const Contact& contact() const noexcept { return contact_; }

  /// Return the number of tips that were not finite or too large.
  [[nodiscard]] std::int64_t invalid_input_count() const noexcept { return invalid_input_count_; }

  /// Return the number of ticks that reached the iteration limit.
  [[nodiscard]] std::int64_t iteration_limit_count() const noexcept { return iteration_limit_count_; }

  [[nodiscard]] bool sliding() const noexcept { return sliding_; }
  [[nodiscard]] double radius() const noexcept { return radius_; }

 private:
  static constexpr int max_shading_iterations = 8;

  [[nodiscard]] static double valid_radius(double radius) noexcept { return radius > 0.0 && std::isfinite(radius) ? radius : 0.0; }

  /// Return the axes of a face in columns: first edge, perpendicular in the plane, normal.
  [[nodiscard]] static Eigen::Matrix3d frame(const Face& f) noexcept {
    Eigen::Matrix3d axes;
    axes.col(0) = (f.corner[1] - f.corner[0]).normalized();
    axes.col(1) = f.normal.cross(axes.col(0));
    axes.col(2) = f.normal;
    return axes;
  }

  /// Face normal and shaded normal at the proxy; both zero where shading does not apply.
  struct Normals {
    Vector3<> flat = Vector3<>::Zero(), shaded = Vector3<>::Zero();  // unit
  };

  [[nodiscard]] std::int32_t face() const noexcept { return radius_ > 0.0 ? sphere_state_.face : point_state_.face; }
  [[nodiscard]] const Vector3<>& position() const noexcept { return radius_ > 0.0 ? sphere_state_.center : point_state_.point; }

  template <class Cone>
  bool move(const Vector3<>& tip, const Cone& cone, SlidingState& slip) noexcept {
    return radius_ > 0.0 ? sphere_.follow(sphere_state_, tip, cone, slip) : point_.follow(point_state_, tip, cone, slip);
  }
  bool move(const Vector3<>& tip, SlidingState& slip) noexcept {
    return move(tip, [this](std::int32_t f, const Vector3<>& x) { return friction(f, x); }, slip);
  }

  /// Move to the point where friction admits the spring relative to the shaded normal (after
  /// Ruspini, Kolarov and Khatib 1997, iterated).
  ///
  /// Each iteration slides over the faces by the excess lag relative to the shaded normal. `shaded`
  /// receives that normal, or zero if the face normals decided.
  bool move_shaded(const Vector3<>& tip, SlidingState& slip, Vector3<>& shaded) noexcept {
    if (face() == TriangleMesh::none && !move(tip, slip)) return false;
    for (int pass = 0; pass < max_shading_iterations && face() != TriangleMesh::none; ++pass) {
      const Vector3<> from = position(), to_tip = tip - from;
      const Normals normal = radius_ > 0.0 ? sphere_normals(tip) : point_normals(tip);
      const double depth = -normal.shaded.dot(to_tip);
      if (!(depth > 0.0)) break;
      shaded = normal.shaded;
      const Vector3<> lag = to_tip + depth * shaded;
      const double length = lag.norm(), threshold = 1e-7 * (depth + radius_);
      slip.threshold = threshold;
      const double remaining = friction(face(), from).remaining_lag(length, depth, slip.distance, slip.sliding());
      if (!(length - remaining > threshold)) return true;
      // Aim slightly below the faces: at large depth a motion of the proxy would be shorter than
      // that of the tip.
      const Vector3<> motion = (1.0 - remaining / length) * rotate_between(shaded, normal.flat, lag);
      const double below = std::fmin(depth, std::fmax(0.01 * depth, 0.5 * motion.norm()));
      SlidingState free;
      const bool done = move(from + motion - below * normal.flat, [](std::int32_t, const Vector3<>&) { return FrictionCone{}; }, free);
      const double distance = (position() - from).norm();
      slip.distance += distance;
      if (!done) return false;
      if (!(distance > 1e-3 * threshold)) return true;  // blocked by another face
    }
    if (face() != TriangleMesh::none && !shaded.isZero() && shaded.dot(tip - position()) < 0.0) return true;
    shaded.setZero();
    return move(tip, slip);
  }

  /// Apply to `x` the rotation that maps the unit vector `from` to the unit vector `to`.
  [[nodiscard]] static Vector3<> rotate_between(const Vector3<>& from, const Vector3<>& to, const Vector3<>& x) noexcept {
    const Vector3<> axis = from.cross(to);
    return from.dot(to) * x + axis.cross(x) + axis.dot(x) / (1.0 + from.dot(to)) * axis;
  }

  /// Average the active constraints weighted by penetration. Return zero normals at a crease.
  [[nodiscard]] Normals sphere_normals(const Vector3<>& tip) const noexcept {
    Normals sum;
    for (int i = 0; i < sphere_state_.count; ++i) {
      const SphereProxyState::ContactConstraint& s = sphere_state_.constraint(i);
      const double penetration = s.normal.dot(sphere_state_.center - tip);
      if (penetration <= 0.0) continue;
      if (!field_->shading().is_smooth(*mesh_, s.face, s.at.feature, s.at.point)) return {};
      const double side = s.normal.dot(mesh_->face(s.face).normal) >= 0.0 ? 1.0 : -1.0;
      const Vector3<> shaded = side * field_->shading().normal_at(*mesh_, s.face, s.at.point);
      if (!sum.flat.isZero() && !field_->shading().is_smooth(sum.shaded.normalized(), shaded)) return {};
      sum.shaded += penetration * shaded;
      sum.flat += penetration * s.normal;
    }
    if (sum.flat.isZero() || sum.shaded.isZero()) return {};
    return {sum.flat.normalized(), sum.shaded.normalized()};
  }

  /// Choose, on an edge or corner, the face that the lag points to. Return zero normals at a
  /// crease.
  [[nodiscard]] Normals point_normals(const Vector3<>& tip) noexcept {
    const Vector3<> x = point_state_.point, shaded = point_state_.side * field_->shading().normal_at(*mesh_, point_state_.face, x);
    if (point_state_.feature != Feature::inside) {
      if (!field_->shading().is_smooth(*mesh_, point_state_.face, point_state_.feature, x)) return {};
      const Vector3<> to_tip = tip - x, lag = to_tip - shaded.dot(to_tip) * shaded;
      const auto consider_candidate = [&](std::int32_t f, Feature feature) {
        const Face& face = mesh_->face(f);
        const auto k = static_cast<std::size_t>(index_of(feature));
        const Vector3<> e = face.corner[(k + 1) % 3] - face.corner[k], g = face.corner[k] - face.corner[(k + 2) % 3];
        if (face.normal.cross(e).dot(lag) < 0.0 || (is_corner(feature) && face.normal.cross(g).dot(lag) < 0.0)) return;
        point_state_.face = f;
        point_state_.feature = feature;
      };
      const Face& here = mesh_->face(point_state_.face);
      const int i = index_of(point_state_.feature);
      if (is_edge(point_state_.feature)) {
        const std::int32_t h = here.neighbor[static_cast<std::size_t>(i)];
        consider_candidate(h / 3, edge(h % 3));
      } else {
        mesh_->for_each_face_around(point_state_.face, i, [&](std::int32_t f, int k) { consider_candidate(f, corner(k)); });
      }
    }
    return {point_state_.side * mesh_->face(point_state_.face).normal, shaded};
  }

  [[nodiscard]] FrictionCone friction(std::int32_t f, const Vector3<>& x) const noexcept {
    const Surface& s = field_->surface();
    if (s.static_friction == 0.0 && s.viscous == 0.0) return {};
    if (s.tangential == 0.0) return {};  // no spring to transmit friction
    const double normal = s.tangential < 0.0 ? 1.0 : field_->stiffness_at(*mesh_, f, x).stiffness;
    const double tangential = s.tangential < 0.0 ? 1.0 : s.tangential;
    const double ratio = normal / tangential;
    FrictionCone cone{s.static_friction * ratio, s.dynamic_friction * ratio, 0.0};
    if (normal == 0.0) cone.mu_static = cone.mu_dynamic = 0.0;  // infinite friction without normal force
    if (s.viscous > 0.0) {
      const double k = s.tangential < 0.0 ? field_->stiffness_at(*mesh_, f, x).stiffness : s.tangential;
      cone.drag = k > 0.0 ? s.viscous / (s.period * k) : 0.0;
    }
    return cone;
  }

  /// Compute the force of a proxy at `at` [m] with the penetration vector `penetration` [m].
  void update_contact_force(const Vector3<>& tip, std::int32_t face, const Vector3<>& at, const Vector3<>& penetration,
                            bool shaded) noexcept {
    contact_.position = at;
    contact_.face = face;
    contact_.touching = face != TriangleMesh::none;
    if (!contact_.touching) {
      contact_ = Contact{};
      contact_.position = at;
      last_depth_ = 0.0;
      return;
    }
    const Surface& s = field_->surface();
    const double depth = penetration.norm();
    const Vector3<> on = radius_ > 0.0 ? Vector3<>(at - radius_ * (depth > 0.0 ? penetration / depth : contact_.normal)) : at;
    const SurfaceField::LocalStiffness local = field_->stiffness_at(*mesh_, face, on);
    if (depth > 0.0) {
      contact_.normal = penetration / depth;
    } else if (radius_ == 0.0) {
      contact_.normal = point_state_.normal;
    }
    double push = local.stiffness * depth;
    const double damping = field_->damping_at(*mesh_, face, on);
    if (damping > 0.0) push = std::fmax(0.0, push + damping * (depth - last_depth_) / s.period);
    last_depth_ = depth;
    const double tangential = s.tangential < 0.0 ? local.stiffness : s.tangential;
    contact_.depth = depth;
    contact_.stiffness = local.stiffness;
    contact_.force = push * contact_.normal + tangential * (at - tip - penetration);
    if (s.field == FieldKind::continuous) {
      const Vector3<> slope =
          shaded && !local.slope.isZero() ? field_->shading().slope_at_depth(*mesh_, face, on, depth - radius_, local.slope) : local.slope;
      contact_.force -= 0.5 * depth * depth * slope;
    }
  }

  const TriangleMesh* mesh_;
  const SurfaceField* field_;
  PointProxy point_;
  SphereProxy sphere_;
  double radius_;  // m
  PointProxyState point_state_{};
  SphereProxyState sphere_state_{};
  Contact contact_{};
  double last_depth_ = 0.0;  // in the last tick, m
  bool started_ = false;
  bool sliding_ = false;
  std::int64_t invalid_input_count_ = 0;
  std::int64_t iteration_limit_count_ = 0;
};

}  // namespace palpate::mesh
