#pragma once

#include <array>
#include <cstdint>

#include "palpate/math/vector.hpp"
#include "palpate/touch/mesh.hpp"
#include "palpate/touch/neighbourhood.hpp"
#include "palpate/touch/triangle.hpp"

namespace palpate {

/// A sphere's centre, free or held by facets.
struct Seat {
  static constexpr int most_supports = 12;

  /// A facet that touches the sphere. It is convex, so the plane through the centre across `normal` separates all places where the sphere
  /// would go deeper into it from those where it would not, to first order.
  struct Support {
    std::int32_t facet = Mesh::none;
    NearestPoint at{};                     // to the centre
    Vector3<> normal = Vector3<>::Zero();  // unit, from there to the centre
    double distance = 0.0;                 // from there to the centre, m
  };

  Vector3<> centre = Vector3<>::Zero();  ///< m
  Vector3<> rest = Vector3<>::Zero();    ///< where it would be without friction, as far as the supports' planes tell, m
  std::int32_t facet = Mesh::none;       ///< the one that pushes hardest; none: free
  int pressing = 0;                      ///< supports that push, 0 to 3
  std::array<Support, most_supports> supports{};
  int count = 0;
  Neighbourhood near{};

  [[nodiscard]] bool touching() const noexcept { return facet != Mesh::none; }
  [[nodiscard]] Support& support(int i) noexcept { return supports[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const Support& support(int i) const noexcept { return supports[static_cast<std::size_t>(i)]; }
};

}  // namespace palpate
