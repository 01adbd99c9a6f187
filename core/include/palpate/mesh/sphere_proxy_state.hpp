#pragma once

#include <array>
#include <cstdint>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/broad_phase_cache.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// A sphere's centre, free or held by facets.
struct SphereProxyState {
  static constexpr int most_supports = 12;

  /// A facet that touches the sphere. It is convex, so the plane through the centre across `normal` separates all places where the sphere
  /// would go deeper into it from those where it would not, to first order.
  struct ContactConstraint {
    std::int32_t facet = TriangleMesh::none;
    NearestPoint at{};                     // to the centre
    Vector3<> normal = Vector3<>::Zero();  // unit, from there to the centre
    double distance = 0.0;                 // from there to the centre, m
  };

  Vector3<> centre = Vector3<>::Zero();     ///< m
  Vector3<> rest = Vector3<>::Zero();       ///< where it would be without friction, as far as the supports' planes tell, m
  std::int32_t facet = TriangleMesh::none;  ///< the one that pushes hardest; none: free
  int pressing = 0;                         ///< supports that push, 0 to 3
  std::array<ContactConstraint, most_supports> supports{};
  int count = 0;
  BroadPhaseCache near{};

  [[nodiscard]] bool touching() const noexcept { return facet != TriangleMesh::none; }
  [[nodiscard]] ContactConstraint& support(int i) noexcept { return supports[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const ContactConstraint& support(int i) const noexcept { return supports[static_cast<std::size_t>(i)]; }
};

}  // namespace palpate::mesh
