#pragma once

#include <memory>
#include <utility>

#include "palpate/math/vector.hpp"
#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/proxy.hpp"
#include "palpate/mesh/surface_field.hpp"
#include "palpate/mesh/triangle_mesh.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// A triangle mesh with its tree and its surface, shared by every loop that touches it.
struct MeshModel {
  std::shared_ptr<const mesh::TriangleMesh> mesh;
  std::shared_ptr<const mesh::AabbTree> tree;
  std::shared_ptr<const mesh::SurfaceField> surface;

  /// Build tree and surface of a mesh. An unusable mesh or a surface that does not fit gives an empty model: see operator bool.
  [[nodiscard]] static MeshModel make(mesh::TriangleMesh triangles, const mesh::Surface& surface = {}) {
    if (!triangles.usable() || !mesh::SurfaceField::is_valid(surface, triangles)) return {};
    const auto shared = std::make_shared<const mesh::TriangleMesh>(std::move(triangles));
    return {shared, std::make_shared<const mesh::AabbTree>(*shared), std::make_shared<const mesh::SurfaceField>(surface, *shared)};
  }

  [[nodiscard]] explicit operator bool() const noexcept { return mesh && tree && surface; }
};

/// A mesh touched through a point or sphere proxy.
class MeshObject {
 public:
  using Scalar = double;
  static constexpr int columns = 9;  ///< proxy position (3), normal (3), depth, stiffness, triangle

  /// @param model   must not be empty
  /// @param radius  of the tip, m; 0 for a point
  explicit MeshObject(MeshModel model, double radius = 0.0)
      : model_(std::move(model)), proxy_(*model_.mesh, *model_.tree, *model_.surface, radius) {}

  const ContactResult& step(const TipState& tip) noexcept {
    const mesh::Contact& contact = proxy_.step(tip.position);
    result_.force = -contact.force;
    result_.touching = contact.touching;
    result_.normal = contact.normal;
    result_.depth = contact.depth;
    result_.stiffness = contact.stiffness;
    result_.deflection = contact.touching ? Vector3<>(tip.position - contact.position) : Vector3<>(Vector3<>::Zero());
    return result_;
  }

  [[nodiscard]] const ContactResult& result() const noexcept { return result_; }

  void reset() noexcept {
    proxy_.reset();
    result_ = {};
  }

  [[nodiscard]] int record_width() const noexcept { return columns; }
  void record(double* row) const noexcept {
    const mesh::Contact& contact = proxy_.contact();
    Eigen::Map<Vector3<>>{row} = contact.position;
    Eigen::Map<Vector3<>>{row + 3} = contact.normal;
    row[6] = contact.depth;
    row[7] = contact.stiffness;
    row[8] = contact.face;
  }

  /// The proxy, for sliding state and counters.
  [[nodiscard]] const mesh::Proxy& proxy() const noexcept { return proxy_; }
  [[nodiscard]] mesh::Proxy& proxy() noexcept { return proxy_; }

 private:
  MeshModel model_;
  mesh::Proxy proxy_;
  ContactResult result_;
};

}  // namespace palpate::object
