#pragma once

#include <cstdint>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Result of one contact step of a tip on a body.
struct ContactResult {
  bool touching = false;
  Vector3<> force = Vector3<>::Zero();       ///< of the body on the tip, N
  Vector3<> deflection = Vector3<>::Zero();  ///< mean displacement of the contact nodes, weighted by their normal forces, m
  Vector3<> friction = Vector3<>::Zero();    ///< tangential part of `force`, N
  Vector3<> moment = Vector3<>::Zero();      ///< of `force` about the tip's center, N*m; of contact by signed distance only
  double energy = 0.0;                       ///< of the body at the end of the tick, kinetic and elastic, J
  double tank_energy = 0.0;                  ///< level of the energy tank (PassiveModelSwitch), J
  int nodes = 0;                             ///< number of contact nodes
  bool sliding = false;                      ///< full sliding: dynamic friction
  bool lost = false;                         ///< tip inside the body without contact: it began there or was pushed through
  bool opposed = false;                      ///< tips of a tool press against each other: no common normal or depth
  bool solved = true;  ///< false: LCP iteration limit reached, inverted tetrahedra, or more nodes under the tip than its capacity
};

/// Estimate the outward unit normal of a contact from the forces `node_force(k)` of `count` nodes, given in outward direction. Without
/// force, return the normal of the nearest node within two tip radii, or else `tip.outward`.
template <class NodeForce>
[[nodiscard]] Vector3<> estimate_outward(const SurfaceNodes& nodes, const Tip& tip, int count, NodeForce node_force) noexcept {
  Vector3<> outward = Vector3<>::Zero();
  for (int k = 0; k < count; ++k) outward += node_force(k);
  const double length = outward.norm();
  if (length > 0.0) return outward / length;
  const std::int32_t node = nodes.nearest(tip.center, 2.0 * tip.radius);
  return node >= 0 ? nodes.normal(node) : tip.outward;
}

}  // namespace palpate::deformable
