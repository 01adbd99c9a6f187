#pragma once

#include <cmath>
#include <cstdint>

#include "palpate/math/vector.hpp"
#include "palpate/touch/friction_cone.hpp"
#include "palpate/touch/mesh.hpp"
#include "palpate/touch/roll.hpp"
#include "palpate/touch/surface.hpp"
#include "palpate/touch/tree.hpp"
#include "palpate/touch/walk.hpp"

namespace palpate {

/// Where a tip touches a mesh and how hard.
struct Contact {
  bool touching = false;
  Vector3<> position = Vector3<>::Zero();  ///< of the proxy (a sphere's centre), m
  Vector3<> normal = Vector3<>::Zero();    ///< unit, out of the surface; zero if apart
  Vector3<> force = Vector3<>::Zero();     ///< of the surface on the tip, N
  std::int32_t triangle = Mesh::none;
  double depth = 0.0;      ///< of the tip under the proxy along the normal, m
  double stiffness = 0.0;  ///< there, along the normal, N/m
};

/// The god-object (Zilles & Salisbury 1995), a point or a sphere (Ruspini, Kolarov & Khatib 1997): it follows the tip as far as
/// the surface lets it, and the spring between them is the force. A step takes no memory, throws nothing and ends after a bounded number
/// of moves. Mesh, tree and surface field are the caller's, and outlive the proxy.
class Proxy {
 public:
  Proxy(const Mesh& mesh, const Tree& tree, const SurfaceField& field, double radius = 0.0) noexcept
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
    const auto cone = [this](std::int32_t f, const Vector3<>& x) { return friction(f, x); };
    if (radius_ > 0.0) {
      if (!roll_.follow(seat_, tip, cone, sliding_)) ++unfinished_;
      answer(tip, seat_.facet, seat_.centre, seat_.rest - tip);
    } else {
      if (!walk_.follow(place_, tip, cone, sliding_)) ++unfinished_;
      const Vector3<> away = place_.point - tip;
      answer(tip, place_.facet, place_.point, away.dot(place_.normal) * place_.normal);
    }
    return contact_;
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
  void answer(const Vector3<>& tip, std::int32_t facet, const Vector3<>& at, const Vector3<>& pressed) noexcept {
    contact_.position = at;
    contact_.triangle = facet;
    contact_.touching = facet != Mesh::none;
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
    if (s.field == Field::continuous) contact_.force -= 0.5 * depth * depth * local.slope;
  }

  const Mesh* mesh_;
  const SurfaceField* field_;
  Walk walk_;
  Roll roll_;
  double radius_;  // m
  Place place_{};
  Seat seat_{};
  Contact contact_{};
  double approach_ = 0.0;  // depth in the last tick, m
  bool started_ = false;
  bool sliding_ = false;
  std::int64_t faults_ = 0;
  std::int64_t unfinished_ = 0;
};

}  // namespace palpate
