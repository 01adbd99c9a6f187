#pragma once

#include <cstdint>
#include <vector>

#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Changes made by repair_mesh().
struct RepairReport {
  std::int64_t dropped_degenerate = 0;
  std::int64_t dropped_duplicate = 0;
  std::int64_t flipped = 0;  ///< triangles with reversed orientation
};

/// Remove degenerate and duplicate triangles, orient neighbors consistently and closed components
/// outwards.
///
/// Only unambiguous repairs are made. Indices must be in range and vertices finite.
RepairReport repair_mesh(const std::vector<Vector3<>>& vertices, std::vector<Triangle>& triangles);

/// Count vertices at which parts of the surface meet in a single point. A proxy on one part does
/// not see the other part there.
MeshDiagnosis::Count pinched_vertices(const TriangleMesh& mesh);

/// Count edges that pierce a triangle with which they share no vertex.
MeshDiagnosis::Count self_intersections(const TriangleMesh& mesh, const AabbTree& tree);

}  // namespace palpate::mesh

#if !defined(PALPATE_COMPILED)
#include "palpate/mesh/impl/mesh_repair.hpp"
#endif
