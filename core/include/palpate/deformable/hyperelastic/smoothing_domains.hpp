#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "palpate/deformable/hyperelastic/tet_mesh.hpp"

namespace palpate::deformable {

/// Smoothing domain of a mesh edge: a sixth of each tetrahedron of one material around it. Its deformation gradient is the volume average
/// of theirs,
///   F = I + sum_a u_a gradient_a^T.
struct EdgeDomain {
  struct Weight {
    std::int32_t node = 0;
    Vector3<> gradient = Vector3<>::Zero();  ///< of the shape function, averaged over the domain, 1/m
  };
  std::pair<std::int32_t, std::int32_t> ends{};  ///< nodal volumes of the edge's ends and the material
  double volume = 0.0;                           ///< m^3
  double shear = 0.0;                            ///< Pa
  double lame = 0.0;                             ///< min(Lame's lambda, 0), Pa
  std::vector<Weight> weights;                   ///< nodes of the tetrahedra in the domain, ascending
};

/// Domains of the edge-based smoothed finite element method (ES-FEM: Nguyen-Thoi, Liu, Vu-Do & Nguyen-Xuan 2009) and the nodal volumes
/// over which the volume change is averaged (Bonet & Burton 1998; Puso & Solberg 2006). The domain of a node has half of the domain of
/// each of its edges.
///
/// Domains end where the material changes. A mean deformation over soft and stiff tetrahedra, with their mean modulus, would make the soft
/// ones stiff: a column of which one half is ten times as stiff, on cells of a quarter of its height, would be 16 % too stiff.
struct SmoothingDomains {
  std::vector<EdgeDomain> edges;       ///< in groups of equal numbers of weights, which increase
  std::vector<double> volume_of_node;  ///< by node, m^3
  std::vector<double> nodal_volume;    ///< by node and material, m^3
  std::vector<double> nodal_lame;      ///< same: max(Lame's lambda, 0), Pa
  double energy_round_off = 0.0;       ///< J

  /// `number` maps mesh points to nodes.
  SmoothingDomains(const TetMesh& mesh, const std::vector<std::int32_t>& number) : volume_of_node(mesh.points.size()) {
    struct Use {
      std::pair<std::int32_t, std::int32_t> ends{};  // nodes
      std::pair<double, double> material;
      std::size_t cell = 0;
    };
    std::vector<Use> uses;
    using NodeOf = std::tuple<std::int32_t, double, double>;  // node and material
    std::vector<NodeOf> parts;
    std::vector<std::array<Vector3<>, 4>> gradient(mesh.tetrahedra.size());
    std::vector<double> volume(mesh.tetrahedra.size());
    uses.reserve(6 * mesh.tetrahedra.size());
    const auto node = [&](std::int32_t point) { return number[static_cast<std::size_t>(point)]; };
    for (std::size_t c = 0; c < mesh.tetrahedra.size(); ++c) {
      const auto& corner = mesh.tetrahedra[c];
      Eigen::Matrix3d sides;
      for (std::size_t a = 1; a < 4; ++a)
        sides.col(static_cast<int>(a) - 1) =
            mesh.points[static_cast<std::size_t>(corner[a])] - mesh.points[static_cast<std::size_t>(corner[0])];
      const Eigen::Matrix3d inverse = sides.inverse();
      for (std::size_t a = 1; a < 4; ++a) gradient[c][a] = inverse.row(static_cast<int>(a) - 1).transpose();
      gradient[c][0] = -((gradient[c][1] + gradient[c][2]) + gradient[c][3]);
      volume[c] = std::abs(sides.determinant()) / 6.0;
      energy_round_off += 1e-14 * volume[c] * (2.0 * mesh.shear[c] + std::abs(mesh.lame[c]));
      for (std::size_t a = 0; a < 4; ++a) {
        parts.emplace_back(node(corner[a]), mesh.shear[c], mesh.lame[c]);
        volume_of_node[static_cast<std::size_t>(node(corner[a]))] += 0.25 * volume[c];
        for (std::size_t b = 0; b < a; ++b)
          uses.push_back({std::minmax({node(corner[a]), node(corner[b])}), {mesh.shear[c], mesh.lame[c]}, c});
      }
    }
    std::sort(parts.begin(), parts.end());
    parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
    nodal_volume.assign(parts.size(), 0.0);
    for (const NodeOf& part : parts) nodal_lame.push_back(std::max(std::get<2>(part), 0.0));
    const auto part_of = [&](std::int32_t of, const std::pair<double, double>& material) {
      const auto found = std::lower_bound(parts.begin(), parts.end(), NodeOf{of, material.first, material.second});
      return static_cast<std::int32_t>(found - parts.begin());
    };
    std::sort(uses.begin(), uses.end(),
              [](const Use& x, const Use& y) { return std::tie(x.ends, x.material, x.cell) < std::tie(y.ends, y.material, y.cell); });
    for (std::size_t from = 0, to = 0; from < uses.size(); from = to) {
      const auto [ends, material, first] = uses[from];
      EdgeDomain edge;
      edge.ends = {part_of(ends.first, material), part_of(ends.second, material)};
      edge.shear = material.first;
      edge.lame = std::min(material.second, 0.0);
      for (; to < uses.size() && uses[to].ends == ends && uses[to].material == material; ++to) {
        const std::size_t c = uses[to].cell;
        const double part = volume[c] / 6.0;
        edge.volume += part;
        for (std::size_t a = 0; a < 4; ++a) {
          const std::int32_t i = node(mesh.tetrahedra[c][a]);
          const auto same = std::find_if(edge.weights.begin(), edge.weights.end(), [&](const auto& w) { return w.node == i; });
          if (same == edge.weights.end())
            edge.weights.push_back({i, part * gradient[c][a]});
          else
            same->gradient += part * gradient[c][a];
        }
      }
      for (const std::int32_t end : {edge.ends.first, edge.ends.second}) nodal_volume[static_cast<std::size_t>(end)] += 0.5 * edge.volume;
      for (EdgeDomain::Weight& w : edge.weights) w.gradient /= edge.volume;
      std::sort(edge.weights.begin(), edge.weights.end(), [](const auto& x, const auto& y) { return x.node < y.node; });
      edges.push_back(std::move(edge));
    }
    std::sort(edges.begin(), edges.end(), [](const EdgeDomain& x, const EdgeDomain& y) {
      return std::pair(x.weights.size(), x.ends) < std::pair(y.weights.size(), y.ends);
    });
  }
};

}  // namespace palpate::deformable
