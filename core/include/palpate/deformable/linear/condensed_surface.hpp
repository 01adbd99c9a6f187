#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Contact nodes of a condensed body without the supports that change, its compliance and its vibration modes; shared by its phases.
struct CondensedSurface {
  std::vector<Vector3<>> points;    ///< at rest, m
  std::vector<Vector3<>> normals;   ///< outward, unit
  std::vector<double> areas;        ///< of the nodes' patches, m^2
  std::vector<float> compliance;    ///< 3n x 3n [m/N], symmetric positive definite; row 3 x node + axis
  std::vector<float> shapes;        ///< of the modes, 3n x m [1/sqrt(kg)], mass-normalized; none: without inertia
  std::vector<double> frequencies;  ///< m, rad/s

  [[nodiscard]] std::size_t size() const noexcept { return points.size(); }
  [[nodiscard]] std::size_t modes() const noexcept { return frequencies.size(); }
  /// Displacement by each mode (m numbers) of a row 3 x node + axis, 1/sqrt(kg).
  [[nodiscard]] const float* shape(std::size_t row) const noexcept { return shapes.data() + row * modes(); }
};

/// Nodes that are held in place, and those that a tip can touch, in ascending order. A held node is not touched.
struct SupportNodes {
  std::vector<std::int32_t> held, touched;
  friend bool operator==(const SupportNodes&, const SupportNodes&) = default;
};

/// Load on a node of a condensed body. Loads displace the body by its long-term compliance C under the sum of both parts.
struct NodeLoad {
  std::int32_t node = 0;
  Vector3<> force = Vector3<>::Zero();    ///< N; on a standard linear solid over the ratio r of its moduli
  Vector3<> delayed = Vector3<>::Zero();  ///< q, see DelayedForces, N; zero on an elastic body

  [[nodiscard]] Vector3<> total() const noexcept { return force + delayed; }
};

/// Loads that displace a condensed body as it is displaced now.
struct BodyLoads {
  std::vector<NodeLoad> nodes;
  std::vector<double> modes;  ///< inertial and damping forces on the modes, N/sqrt(kg); none: without inertia

  /// Whether no load displaces the body.
  [[nodiscard]] bool empty() const noexcept {
    for (const double force : modes)
      if (force != 0.0) return false;
    return nodes.empty();
  }
};

}  // namespace palpate::deformable
