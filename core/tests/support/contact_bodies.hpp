#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <map>
#include <palpate/deformable/contact/patch_points.hpp>
#include <palpate/deformable/contact/surface_nodes.hpp>
#include <palpate/deformable/linear/full_compliance.hpp>
#include <utility>
#include <vector>

#include "support/mesh_shapes.hpp"

namespace contact_bodies {

using palpate::deformable::ContactSurface, palpate::deformable::SurfaceNodes, palpate::math::Vector3;

/// Body with a contact node at each vertex of a surface.
struct SurfaceBody {
  ContactSurface surface;
  SurfaceNodes nodes;
  palpate::deformable::FullCompliance compliance;
  palpate::deformable::ContactPatches patches;

  /// `block(i, j)` is the compliance of vertices i and j, m/N.
  template <class Block>
  SurfaceBody(const shapes::Shape& shape, double modulus, Block block) {
    surface.vertices = shape.vertices;
    for (const auto& t : shape.triangles) surface.triangles.push_back({t[0], t[1], t[2]});
    const std::size_t n = shape.vertices.size();
    std::vector<Vector3<>> normals(n, Vector3<>::Zero());
    std::vector<double> areas(n, 0.0);
    for (const auto& t : surface.triangles) {
      const Vector3<> area = 0.5 * (vertex(t[1]) - vertex(t[0])).cross(vertex(t[2]) - vertex(t[0]));
      for (const std::int32_t v : t) {
        normals[static_cast<std::size_t>(v)] += area;
        areas[static_cast<std::size_t>(v)] += area.norm() / 3.0;
      }
    }
    for (Vector3<>& normal : normals) normal.normalize();
    for (std::size_t i = 0; i < n; ++i) surface.node.push_back(static_cast<std::int32_t>(i));
    surface.modulus.assign(n, {modulus, modulus});
    std::vector<float> full(9 * n * n);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        const Eigen::Matrix3d c = block(i, j);
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            full[(3 * i + a) * 3 * n + 3 * j + b] = static_cast<float>(c(static_cast<int>(a), static_cast<int>(b)));
      }
    nodes = SurfaceNodes(surface.vertices, normals, areas);
    compliance = palpate::deformable::FullCompliance(nodes, full.data());
    patches = palpate::deformable::ContactPatches(surface);
  }

  [[nodiscard]] const Vector3<>& vertex(std::int32_t i) const { return surface.vertices[static_cast<std::size_t>(i)]; }
};

/// Mean of I / r + r r^T / r^3 over the bilinear hat functions of two nodes of a square grid of width 1, whose distance is d. The product
/// of the hats, averaged over all pairs of points at one distance, is a cubic B-spline in each direction.
inline Eigen::Matrix3d mean_over_hats(const Vector3<>& d) {
  const auto spline = [](double x) {
    const double t = std::abs(x);
    return t < 1.0 ? 2.0 / 3.0 - t * t + 0.5 * t * t * t : t < 2.0 ? std::pow(2.0 - t, 3) / 6.0 : 0.0;
  };
  constexpr int steps = 16;
  constexpr double width = 1.0 / steps;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int i = -2 * steps; i < 2 * steps; ++i)
    for (int j = -2 * steps; j < 2 * steps; ++j) {
      const double x = width * (i + 0.5), y = width * (j + 0.5), weight = width * width * spline(x) * spline(y);
      const Vector3<> r = d + Vector3<>(x, y, 0.0);
      if (r.norm() > width) {
        sum += weight * (Eigen::Matrix3d::Identity() / r.norm() + r * r.transpose() / std::pow(r.norm(), 3));
      } else {  // mean over the square at the singular corner: 2 ln(1 + sqrt 2) / width
        const double inverse = 2.0 * std::log(1.0 + std::sqrt(2.0)) / width;
        sum += weight * inverse * Eigen::Vector3d(1.5, 1.5, 1.0).asDiagonal().toDenseMatrix();
      }
    }
  return sum;
}

/// Incompressible half-space of plane-strain modulus `modulus` [Pa] under a flat sheet, by Boussinesq's and Cerruti's point forces: mean
/// displacement over the hat functions of nodes that are loaded by hat functions, as a condensed body gives it. Independent of finite
/// elements.
inline SurfaceBody half_space(int cells, double half_width, double modulus) {
  const shapes::Shape sheet = shapes::sheet(cells, half_width, [](double, double) { return 0.0; });
  const double width = 2.0 * half_width / cells;
  std::map<std::pair<long, long>, Eigen::Matrix3d> near;
  for (long i = -3; i <= 3; ++i)
    for (long j = -3; j <= 3; ++j) near[{i, j}] = mean_over_hats(Vector3<>(static_cast<double>(i), static_cast<double>(j), 0.0));
  return {sheet, modulus, [&](std::size_t i, std::size_t j) {
            const Vector3<> d = (sheet.vertices[i] - sheet.vertices[j]) / width;
            const auto found = near.find({std::lround(d[0]), std::lround(d[1])});
            const double r = d.norm(), scale = 1.0 / (M_PI * modulus * width);
            if (found != near.end()) return Eigen::Matrix3d(scale * found->second);
            return Eigen::Matrix3d(scale * (Eigen::Matrix3d::Identity() / r + d * d.transpose() / (r * r * r)));
          }};
}

/// Closed surface with a compliance that couples directions and falls off with distance; positive definite.
inline SurfaceBody soft(const shapes::Shape& shape, double modulus, double give, double range) {
  Eigen::Matrix3d coupling;
  coupling << 1.0, 0.2, -0.1, 0.2, 0.8, 0.15, -0.1, 0.15, 1.2;
  return {shape, modulus, [&shape, coupling, give, range](std::size_t i, std::size_t j) {
            return Eigen::Matrix3d(give * std::exp(-(shape.vertices[i] - shape.vertices[j]).norm() / range) * coupling);
          }};
}

/// The shape on a spring: `give` [m/N] in each direction for all nodes alike, beside a compliance of 6 mm/N that falls off with distance.
inline SurfaceBody sprung(const shapes::Shape& shape, double give) {
  return {shape, 1e4, [&shape, give](std::size_t i, std::size_t j) {
            const double own = 6e-3 * std::exp(-(shape.vertices[i] - shape.vertices[j]).norm() / 4e-3);
            return Eigen::Matrix3d(own * Eigen::Vector3d(1.0, 0.8, 1.2).asDiagonal().toDenseMatrix() + give * Eigen::Matrix3d::Identity());
          }};
}

}  // namespace contact_bodies
