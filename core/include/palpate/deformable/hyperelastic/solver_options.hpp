#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::deformable {

/// Effort of a step of ComplianceColumnCache. Errors are relative, in the energy norm (approximate).
struct ColumnRefinement {
  float tolerance = 0.05F;       ///< columns below this error are not refined
  float batch_tolerance = 0.3F;  ///< columns above this error are refined even beyond the sixteen worst
  int max_steps = 6;             ///< of conjugate gradients per refinement; a new column takes several
};

/// Contact surface of a tetrahedral body: n nodes and the surface triangles.
struct TetSurface {
  std::vector<std::int32_t> point;                     ///< mesh point of each node, n
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< mesh points, counterclockwise seen from outside
};

/// Effort of a step of QuasiStaticSolver.
struct SolverOptions {
  int nodes_per_tip = 32;         ///< nodes with compliance columns, nearest to each tip; at most LocalModel::max_inner in total
  float newton_tolerance = 0.1F;  ///< relative error of the Newton direction, in the energy norm
  int max_newton_steps = 60;      ///< of conjugate gradients per Newton step
  ColumnRefinement compliance{};
};

}  // namespace palpate::deformable
