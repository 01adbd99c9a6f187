#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Tetrahedral mesh with Lame constants and Dirichlet conditions.
struct TetMesh {
  std::vector<Vector3<>> points;                        ///< rest positions, m
  std::vector<std::array<std::int32_t, 4>> tetrahedra;  ///< point indices; positive volume
  std::vector<double> shear, lame;                      ///< of each tetrahedron, Pa
  std::vector<bool> fixed;                              ///< by point: whether it does not move
};

}  // namespace palpate::deformable
