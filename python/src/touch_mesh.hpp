#pragma once

#include <cstdint>
#include <memory>
#include <palpate/mesh/mesh_updater.hpp>
#include <palpate/mesh/proxy.hpp>
#include <palpate/object/mesh_object.hpp>
#include <utility>
#include <vector>

/// A mesh with its AABB tree and, after the first move, its updater.
struct TouchMesh {
  palpate::mesh::TriangleMesh mesh;
  palpate::mesh::AabbTree tree;
  palpate::mesh::MeshUpdater deformation;
  std::int64_t moves = 0;

  TouchMesh(std::vector<palpate::math::Vector3<>> vertices, std::vector<palpate::mesh::Triangle> triangles, bool open)
      : mesh(std::move(vertices), std::move(triangles), open) {
    if (mesh.usable()) tree = palpate::mesh::AabbTree(mesh);
  }

  /// See MeshUpdater::move.
  std::int32_t move(const std::vector<std::int32_t>& vertices, const std::vector<palpate::math::Vector3<>>& to) {
    if (moves == 0) deformation = palpate::mesh::MeshUpdater(mesh);
    const std::int32_t flat = deformation.move(mesh, tree, vertices.data(), to.data(), vertices.size());
    if (flat == palpate::mesh::TriangleMesh::none) ++moves;
    return flat;
  }
};

/// A mesh, its surface field, and the radius of the tip that touches it.
struct TouchedSurface {
  std::shared_ptr<const TouchMesh> mesh;
  std::shared_ptr<palpate::mesh::SurfaceField> field;
  double radius;  // m

  TouchedSurface(std::shared_ptr<const TouchMesh> m, const palpate::mesh::Surface& surface, double r)
      : mesh(std::move(m)), field(std::make_shared<palpate::mesh::SurfaceField>(surface, mesh->mesh)), radius(r) {}

  /// Update the field after the mesh has moved since its move number `seen`.
  void refit(std::int64_t seen) noexcept {
    const palpate::mesh::MeshUpdater& d = mesh->deformation;
    if (mesh->moves == seen + 1) {
      field->refit(mesh->mesh, d.affected_faces().begin(), d.affected_faces().end());
    } else {
      field->refit(mesh->mesh);
    }
  }

  [[nodiscard]] palpate::object::MeshModel model() const noexcept { return {{mesh, &mesh->mesh}, {mesh, &mesh->tree}, field}; }
};
