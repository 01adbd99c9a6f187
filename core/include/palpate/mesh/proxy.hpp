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

/// Where a tip touches a mesh and how hard.
struct Contact {
  bool touching = false;
  Vector3<> position = Vector3<>::Zero();  ///< of the proxy (a sphere's centre), m
  Vector3<> normal = Vector3<>::Zero();    ///< unit, out of the surface; zero if apart
  Vector3<> force = Vector3<>::Zero();     ///< of the surface on the tip, N
  std::int32_t triangle = TriangleMesh::none;
  double depth = 0.0;      ///< of the tip under the proxy along the normal, m
  double stiffness = 0.0;  ///< there, along the normal, N/m
};

/// The god-object (Zilles & Salisbury 1995), a point or a sphere (Ruspini, Kolarov & Khatib 1997): it follows the tip as far as
/// the surface lets it, and the spring between them is the force. A step takes no memory, throws nothing and ends after a bounded number
/// of moves. Mesh, tree and surface field are the caller's, and outlive the proxy.
class Proxy {
 public:
  Proxy(const TriangleMesh& mesh, const AabbTree& tree, const SurfaceField& field, double radius = 0.0) noexcept
      : mesh_(&mesh), field_(&field), walk_(mesh, tree), roll_(mesh, tree, radius), radius_(radius) {}

  /// One servo tick with the tip at `tip` [m]. A tip that is not finite counts as a fault, and the last contact is held.
  const Contact& step(const Vector3<>& tip) noexcept {
    if (!tip.allFinite()) {
      ++faults_;
      return contact_;
    }
    if (!started_) {
      started_ = true;
      if (radius_ > 0.0) {
        seat_ = roll_.start(tip);
      } else {
        place_ = walk_.start(tip);
      }
    }
    SlidingState slip{sliding_};
    Vector3<> shaded = Vector3<>::Zero();
    if (!(field_->shading().on() ? move_shaded(tip, slip, shaded) : move(tip, slip))) ++unfinished_;
    sliding_ = facet() != TriangleMesh::none && slip.slid > slip.least;
    const Vector3<> spring = position() - tip;
    if (!shaded.isZero()) {
      answer(tip, facet(), position(), spring.dot(shaded) * shaded, true);
    } else if (radius_ > 0.0) {
      answer(tip, seat_.facet, seat_.centre, seat_.rest - tip, false);
    } else {
      answer(tip, place_.facet, place_.point, spring.dot(place_.normal) * place_.normal, false);
    }
    return contact_;
  }

  /// How a proxy sits on its facet, for when the mesh moves.
  struct Grip {
    Vector3<> weights = Vector3<>::Zero();  ///< of the facet's corners, at the point touched
    Vector3<> out = Vector3<>::Zero();      ///< from there to the proxy, along the first edge, across it, and along the normal, m
  };

  /// Before vertices of the mesh move.
  [[nodiscard]] Grip grip() const noexcept {
    Grip grip;
    if (facet() == TriangleMesh::none) return grip;
    const Face& f = mesh_->facet(facet());
    const Vector3<> foot = radius_ > 0.0 ? nearest_point(f, seat_.centre).point : place_.point;
    grip.weights = barycentric(f, foot);
    grip.out = frame(f).transpose() * (position() - foot);
    return grip;
  }

  /// After they have: the proxy rides along. A free one that a closed mesh has come over is put on its surface.
  void carry(const Grip& grip) noexcept {
    if (!started_) return;
    if (radius_ > 0.0) {
      Vector3<> centre = seat_.centre;
      if (seat_.touching()) {
        const Face& f = mesh_->facet(seat_.facet);
        centre = grip.weights[0] * f.corner[0] + grip.weights[1] * f.corner[1] + grip.weights[2] * f.corner[2] + frame(f) * grip.out;
      }
      roll_.carry(seat_, centre);
    } else {
      walk_.carry(place_, grip.weights);
    }
  }

  /// Lets go: the next step starts anew.
  void reset() noexcept {
    started_ = sliding_ = false;
    place_ = {};
    seat_ = {};
    contact_ = {};
    approach_ = 0.0;
  }

  [[nodiscard]] const Contact& contact() const noexcept { return contact_; }
  [[nodiscard]] std::int64_t faults() const noexcept { return faults_; }          ///< tips that were not finite
  [[nodiscard]] std::int64_t unfinished() const noexcept { return unfinished_; }  ///< ticks that reached the bound of moves
  [[nodiscard]] bool sliding() const noexcept { return sliding_; }
  [[nodiscard]] double radius() const noexcept { return radius_; }

 private:
  static constexpr int most_passes = 8;

  /// A facet's own axes, in columns.
  [[nodiscard]] static Eigen::Matrix3d frame(const Face& f) noexcept {
    Eigen::Matrix3d axes;
    axes.col(0) = (f.corner[1] - f.corner[0]).normalized();
    axes.col(1) = f.normal.cross(axes.col(0));
    axes.col(2) = f.normal;
    return axes;
  }

  /// The normal that the facets have where the proxy is, and the shaded one; both zero where shading has no say.
  struct Normals {
    Vector3<> flat = Vector3<>::Zero(), shaded = Vector3<>::Zero();  // unit
  };

  [[nodiscard]] std::int32_t facet() const noexcept { return radius_ > 0.0 ? seat_.facet : place_.facet; }
  [[nodiscard]] const Vector3<>& position() const noexcept { return radius_ > 0.0 ? seat_.centre : place_.point; }

  template <class Cone>
  bool move(const Vector3<>& tip, const Cone& cone, SlidingState& slip) noexcept {
    return radius_ > 0.0 ? roll_.follow(seat_, tip, cone, slip) : walk_.follow(place_, tip, cone, slip);
  }
  bool move(const Vector3<>& tip, SlidingState& slip) noexcept {
    return move(tip, [this](std::int32_t f, const Vector3<>& x) { return friction(f, x); }, slip);
  }

  /// Moves to where the spring is inclined to the shaded normal as friction lets it: what it lags too far, seen from the shaded normal, it
  /// goes over the facets, until there is no more (after Ruspini, Kolarov & Khatib 1997, iterated). `shaded` is that normal, or zero if the
  /// facets decided.
  bool move_shaded(const Vector3<>& tip, SlidingState& slip, Vector3<>& shaded) noexcept {
    if (facet() == TriangleMesh::none && !move(tip, slip)) return false;
    for (int pass = 0; pass < most_passes && facet() != TriangleMesh::none; ++pass) {
      const Vector3<> from = position(), pull = tip - from;
      const Normals normal = radius_ > 0.0 ? normals_of_seat(tip) : normals_of_place(tip);
      const double depth = -normal.shaded.dot(pull);
      if (!(depth > 0.0)) break;
      shaded = normal.shaded;
      const Vector3<> lag = pull + depth * shaded;
      const double length = lag.norm(), small = 1e-7 * (depth + radius_);
      slip.least = small;
      const double left = friction(facet(), from).rest(length, depth, slip.slid, slip.sliding());
      if (!(length - left > small)) return true;
      // Hardly below the facets: deep down, the way to the next facet would not be as long as the tip's.
      const Vector3<> way = (1.0 - left / length) * turn(shaded, normal.flat, lag);
      const double below = std::fmin(depth, std::fmax(0.01 * depth, 0.5 * way.norm()));
      SlidingState free;
      const bool done = move(from + way - below * normal.flat, [](std::int32_t, const Vector3<>&) { return FrictionCone{}; }, free);
      const double slid = (position() - from).norm();
      slip.slid += slid;
      if (!done) return false;
      if (!(slid > 1e-3 * small)) return true;  // something is in the way
    }
    if (facet() != TriangleMesh::none && !shaded.isZero() && shaded.dot(tip - position()) < 0.0) return true;
    shaded.setZero();
    return move(tip, slip);
  }

  /// What turns `from` to `to` (unit), turns `x`.
  [[nodiscard]] static Vector3<> turn(const Vector3<>& from, const Vector3<>& to, const Vector3<>& x) noexcept {
    const Vector3<> axis = from.cross(to);
    return from.dot(to) * x + axis.cross(x) + axis.dot(x) / (1.0 + from.dot(to)) * axis;
  }

  /// Several supports count as they press; none if they make a crease.
  [[nodiscard]] Normals normals_of_seat(const Vector3<>& tip) const noexcept {
    Normals sum;
    for (int i = 0; i < seat_.count; ++i) {
      const SphereProxyState::ContactConstraint& s = seat_.support(i);
      const double press = s.normal.dot(seat_.centre - tip);
      if (press <= 0.0) continue;
      if (!field_->shading().smooth(*mesh_, s.facet, s.at.feature, s.at.point)) return {};
      const double side = s.normal.dot(mesh_->facet(s.facet).normal) >= 0.0 ? 1.0 : -1.0;
      const Vector3<> shaded = side * field_->shading().at(*mesh_, s.facet, s.at.point);
      if (!sum.flat.isZero() && !field_->shading().smooth(sum.shaded.normalized(), shaded)) return {};
      sum.shaded += press * shaded;
      sum.flat += press * s.normal;
    }
    if (sum.flat.isZero() || sum.shaded.isZero()) return {};
    return {sum.flat.normalized(), sum.shaded.normalized()};
  }

  /// On an edge or a corner that facet counts to which the shaded surface leads; none if it is a crease.
  [[nodiscard]] Normals normals_of_place(const Vector3<>& tip) noexcept {
    const Vector3<> x = place_.point, shaded = place_.side * field_->shading().at(*mesh_, place_.facet, x);
    if (place_.feature != Feature::inside) {
      if (!field_->shading().smooth(*mesh_, place_.facet, place_.feature, x)) return {};
      const Vector3<> pull = tip - x, lag = pull - shaded.dot(pull) * shaded;
      const auto look = [&](std::int32_t f, Feature feature) {
        const Face& facet = mesh_->facet(f);
        const auto k = static_cast<std::size_t>(index_of(feature));
        const Vector3<> e = facet.corner[(k + 1) % 3] - facet.corner[k], g = facet.corner[k] - facet.corner[(k + 2) % 3];
        if (facet.normal.cross(e).dot(lag) < 0.0 || (is_corner(feature) && facet.normal.cross(g).dot(lag) < 0.0)) return;
        place_.facet = f;
        place_.feature = feature;
      };
      const Face& here = mesh_->facet(place_.facet);
      const int i = index_of(place_.feature);
      if (is_edge(place_.feature)) {
        const std::int32_t h = here.neighbour[static_cast<std::size_t>(i)];
        look(h / 3, edge(h % 3));
      } else {
        mesh_->around(place_.facet, i, [&](std::int32_t f, int k) { look(f, corner(k)); });
      }
    }
    return {place_.side * mesh_->facet(place_.facet).normal, shaded};
  }

  [[nodiscard]] FrictionCone friction(std::int32_t f, const Vector3<>& x) const noexcept {
    const Surface& s = field_->surface();
    if (s.static_friction == 0.0 && s.viscous == 0.0) return {};
    if (s.tangential == 0.0) return {};  // nothing that could carry it
    const double normal = s.tangential < 0.0 ? 1.0 : field_->at(*mesh_, f, x).stiffness;
    const double tangential = s.tangential < 0.0 ? 1.0 : s.tangential;
    const double ratio = normal / tangential;
    FrictionCone cone{s.static_friction * ratio, s.dynamic_friction * ratio, 0.0};
    if (normal == 0.0) cone.hold = cone.slide = 0.0;  // infinite friction on a surface that does not push
    if (s.viscous > 0.0) {
      const double k = s.tangential < 0.0 ? field_->at(*mesh_, f, x).stiffness : s.tangential;
      cone.drag = k > 0.0 ? s.viscous / (s.period * k) : 0.0;
    }
    return cone;
  }

  /// The force at a proxy `at` with the tip `pressed` [m] under it along the normal.
  void answer(const Vector3<>& tip, std::int32_t facet, const Vector3<>& at, const Vector3<>& pressed, bool shaded) noexcept {
    contact_.position = at;
    contact_.triangle = facet;
    contact_.touching = facet != TriangleMesh::none;
    if (!contact_.touching) {
      contact_ = Contact{};
      contact_.position = at;
      approach_ = 0.0;
      return;
    }
    const Surface& s = field_->surface();
    const double depth = pressed.norm();
    const Vector3<> on = radius_ > 0.0 ? Vector3<>(at - radius_ * (depth > 0.0 ? pressed / depth : contact_.normal)) : at;
    const SurfaceField::Local local = field_->at(*mesh_, facet, on);
    if (depth > 0.0) {
      contact_.normal = pressed / depth;
    } else if (radius_ == 0.0) {
      contact_.normal = place_.normal;
    }
    double push = local.stiffness * depth;
    const double damping = field_->damping(*mesh_, facet, on);
    if (damping > 0.0) push = std::fmax(0.0, push + damping * (depth - approach_) / s.period);
    approach_ = depth;
    const double tangential = s.tangential < 0.0 ? local.stiffness : s.tangential;
    contact_.depth = depth;
    contact_.stiffness = local.stiffness;
    contact_.force = push * contact_.normal + tangential * (at - tip - pressed);
    if (s.field == FieldKind::continuous) {
      const Vector3<> slope =
          shaded && !local.slope.isZero() ? field_->shading().slope_below(*mesh_, facet, on, depth - radius_, local.slope) : local.slope;
      contact_.force -= 0.5 * depth * depth * slope;
    }
  }

  const TriangleMesh* mesh_;
  const SurfaceField* field_;
  PointProxy walk_;
  SphereProxy roll_;
  double radius_;  // m
  PointProxyState place_{};
  SphereProxyState seat_{};
  Contact contact_{};
  double approach_ = 0.0;  // depth in the last tick, m
  bool started_ = false;
  bool sliding_ = false;
  std::int64_t faults_ = 0;
  std::int64_t unfinished_ = 0;
};

}  // namespace palpate::mesh
