#pragma once

#include <cstdint>
#include <memory>
#include <palpate/loop/servo.hpp>
#include <palpate/touch/deformation.hpp>
#include <palpate/touch/proxy.hpp>
#include <utility>
#include <vector>

/// A mesh with its tree, and what moves it once it has moved.
struct TouchMesh {
  palpate::Mesh mesh;
  palpate::Tree tree;
  palpate::Deformation deformation;
  std::int64_t moves = 0;

  TouchMesh(std::vector<palpate::Vector3<>> vertices, std::vector<palpate::Triangle> triangles, bool open)
      : mesh(std::move(vertices), std::move(triangles), open) {
    if (mesh.usable()) tree = palpate::Tree(mesh);
  }

  /// See Deformation::move.
  std::int32_t move(const std::vector<std::int32_t>& vertices, const std::vector<palpate::Vector3<>>& to) {
    if (moves == 0) deformation = palpate::Deformation(mesh);
    const std::int32_t flat = deformation.move(mesh, tree, vertices.data(), to.data(), vertices.size());
    if (flat == palpate::Mesh::none) ++moves;
    return flat;
  }
};

/// A mesh with the surface laid out over it, and the radius of the tip that touches it.
struct TouchedSurface {
  std::shared_ptr<const TouchMesh> mesh;
  std::unique_ptr<palpate::SurfaceField> field;
  double radius;  // m

  TouchedSurface(std::shared_ptr<const TouchMesh> m, const palpate::Surface& surface, double r)
      : mesh(std::move(m)), field(std::make_unique<palpate::SurfaceField>(surface, mesh->mesh)), radius(r) {}

  /// After the mesh has moved from its state `seen` moves ago.
  void refit(std::int64_t seen) noexcept {
    const palpate::Deformation& d = mesh->deformation;
    if (mesh->moves == seen + 1) {
      field->refit(mesh->mesh, d.around().begin(), d.around().end());
    } else {
      field->refit(mesh->mesh);
    }
  }

  [[nodiscard]] palpate::TouchedMesh touched() const noexcept { return {&mesh->mesh, &mesh->tree, field.get(), radius}; }
};
