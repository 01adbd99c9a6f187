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

/// Smoothing domain of a mesh edge: a sixth of each tetrahedron around it. Its deformation gradient is the volume average of theirs,
///   F = I + sum_a u_a gradient_a^T.
struct EdgeDomain {
  struct Weight {
    std::int32_t node = 0;
    Vector3<> gradient = Vector3<>::Zero();  ///< of the shape function, averaged over the domain, 1/m
  };
  std::pair<std::int32_t, std::int32_t> ends{};  ///< nodes of the edge
  double volume = 0.0;                           ///< m^3
  double shear = 0.0;                            ///< volume average, Pa
  double lame = 0.0;                             ///< volume average of min(Lame's lambda, 0), Pa
  std::vector<Weight> weights;                   ///< nodes of the tetrahedra around the edge, ascending
};

/// Domains of the edge-based smoothed finite element method (ES-FEM: Nguyen-Thoi, Liu, Vu-Do & Nguyen-Xuan 2009) and the nodal volumes
/// over which the volume change is averaged (Bonet & Burton 1998; Puso & Solberg 2006). The domain of a node has half of the domain of
/// each of its edges.
struct SmoothingDomains {
  std::vector<EdgeDomain> edges;     ///< in groups of equal numbers of weights, which increase
  std::vector<double> nodal_volume;  ///< by node, m^3
  std::vector<double> nodal_lame;    ///< by node: volume average of max(Lame's lambda, 0), Pa
  double energy_round_off = 0.0;     ///< J

  /// `number` maps mesh points to nodes.
  SmoothingDomains(const TetMesh& mesh, const std::vector<std::int32_t>& number)
      : nodal_volume(mesh.points.size()), nodal_lame(mesh.points.size()) {
    struct Use {
      std::pair<std::int32_t, std::int32_t> ends{};
      std::size_t cell = 0;
    };
    std::vector<Use> uses;
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
        const auto i = static_cast<std::size_t>(node(corner[a]));
        nodal_volume[i] += 0.25 * volume[c];
        nodal_lame[i] += 0.25 * volume[c] * std::max(mesh.lame[c], 0.0);
        for (std::size_t b = 0; b < a; ++b) uses.push_back({std::minmax({node(corner[a]), node(corner[b])}), c});
      }
    }
    for (std::size_t i = 0; i < nodal_lame.size(); ++i)
      if (nodal_volume[i] > 0.0) nodal_lame[i] /= nodal_volume[i];
    std::sort(uses.begin(), uses.end(), [](const Use& x, const Use& y) { return std::tie(x.ends, x.cell) < std::tie(y.ends, y.cell); });
    for (std::size_t from = 0, to = 0; from < uses.size(); from = to) {
      EdgeDomain edge;
      edge.ends = uses[from].ends;
      for (; to < uses.size() && uses[to].ends == edge.ends; ++to) {
        const std::size_t c = uses[to].cell;
        const double part = volume[c] / 6.0;
        edge.volume += part;
        edge.shear += part * mesh.shear[c];
        edge.lame += part * std::min(mesh.lame[c], 0.0);
        for (std::size_t a = 0; a < 4; ++a) {
          const std::int32_t i = node(mesh.tetrahedra[c][a]);
          const auto same = std::find_if(edge.weights.begin(), edge.weights.end(), [&](const auto& w) { return w.node == i; });
          if (same == edge.weights.end())
            edge.weights.push_back({i, part * gradient[c][a]});
          else
            same->gradient += part * gradient[c][a];
        }
      }
      edge.shear /= edge.volume;
      edge.lame /= edge.volume;
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
