#pragma once

#include <memory>
#include <palpate/loop/servo.hpp>
#include <palpate/touch/proxy.hpp>
#include <utility>
#include <vector>

/// A mesh with its tree.
struct TouchMesh {
  palpate::Mesh mesh;
  palpate::Tree tree;

  TouchMesh(std::vector<palpate::Vector3<>> vertices, std::vector<palpate::Triangle> triangles, bool open)
      : mesh(std::move(vertices), std::move(triangles), open) {
    if (mesh.usable()) tree = palpate::Tree(mesh);
  }
};

/// A mesh with the surface laid out over it, and the radius of the tip that touches it.
struct TouchedSurface {
  std::shared_ptr<const TouchMesh> mesh;
  std::unique_ptr<const palpate::SurfaceField> field;
  double radius;  // m

  TouchedSurface(std::shared_ptr<const TouchMesh> m, const palpate::Surface& surface, double r)
      : mesh(std::move(m)), field(std::make_unique<const palpate::SurfaceField>(surface, mesh->mesh)), radius(r) {}

  [[nodiscard]] palpate::TouchedMesh touched() const noexcept { return {&mesh->mesh, &mesh->tree, field.get(), radius}; }
};
