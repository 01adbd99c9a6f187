#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Triangles of a mesh file, or the reason why it could not be read.
struct MeshFile {
  std::vector<Vector3<>> vertices;  ///< m
  std::vector<Triangle> triangles;
  std::string error;  ///< empty on success; otherwise the problem, the place and the remedy

  [[nodiscard]] bool ok() const noexcept { return error.empty(); }
  [[nodiscard]] explicit operator bool() const noexcept { return ok(); }
};

/// Read an STL file, binary or ASCII, from memory.
///
/// Vertices with exactly equal coordinates are merged; normals and attributes are ignored. `unit` is
/// the length of a file unit [m]. Defects of the mesh are reported by TriangleMesh::diagnosis().
[[nodiscard]] MeshFile parse_stl(std::string_view bytes, double unit = 1.0);

/// Read a Wavefront OBJ file from memory.
///
/// Reads `v` and `f` and ignores all other statements. Polygons become triangle fans. Negative
/// indices count back from the last vertex. Vertices keep their order. `unit` is the length of a
/// file unit [m].
[[nodiscard]] MeshFile parse_obj(std::string_view text, double unit = 1.0);

/// Read a mesh file, STL (binary or ASCII) or OBJ, chosen by the extension of `path`.
///
/// `unit` is the length of a file unit [m], e.g. 1e-3 for millimeters. Neither throws on a bad file
/// nor repairs the mesh: see repair_mesh().
[[nodiscard]] MeshFile read_mesh_file(const std::string& path, double unit = 1.0);

}  // namespace palpate::mesh

#if !defined(PALPATE_COMPILED)
#include "palpate/mesh/impl/mesh_file.hpp"
#endif
