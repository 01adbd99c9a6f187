#pragma once

#include <array>
#include <cstdint>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/broad_phase_cache.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Spherical proxy, free or in contact.
struct SphereProxyState {
  static constexpr int max_constraints = 12;

  /// Face in contact with the sphere. The face is convex, so the plane through the center
  /// perpendicular to `normal` bounds the admissible positions to first order.
  struct ContactConstraint {
    std::int32_t face = TriangleMesh::none;
    NearestPoint at{};                     // to the center
    Vector3<> normal = Vector3<>::Zero();  // unit, from there to the center
    double distance = 0.0;                 // from there to the center, m
  };

  Vector3<> center = Vector3<>::Zero();    ///< m
  Vector3<> goal = Vector3<>::Zero();      ///< position without friction, admitted by the planes of the constraints, m
  std::int32_t face = TriangleMesh::none;  ///< face with the largest penetration; none: free
  int active_count = 0;                    ///< active constraints, 0 to 3
  std::array<ContactConstraint, max_constraints> constraints{};
  int count = 0;
  BroadPhaseCache broad_phase{};

  [[nodiscard]] bool touching() const noexcept { return face != TriangleMesh::none; }
  [[nodiscard]] ContactConstraint& constraint(int i) noexcept { return constraints[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const ContactConstraint& constraint(int i) const noexcept { return constraints[static_cast<std::size_t>(i)]; }
};

}  // namespace palpate::mesh
