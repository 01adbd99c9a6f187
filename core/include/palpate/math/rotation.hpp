#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/math/vector.hpp"

namespace palpate::math {

/// Return the matrix of rotations by `angles` [rad] about x, then y, then z of a fixed frame.
[[nodiscard]] inline Eigen::Matrix3d rotation_xyz(const Vector3<>& angles) noexcept {
  const double cx = std::cos(angles[0]), sx = std::sin(angles[0]);
  const double cy = std::cos(angles[1]), sy = std::sin(angles[1]);
  const double cz = std::cos(angles[2]), sz = std::sin(angles[2]);
  Eigen::Matrix3d out;
  out << cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx,  //
      sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx,     //
      -sy, cy * sx, cy * cx;
  return out;
}

}  // namespace palpate::math
