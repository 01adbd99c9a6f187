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

/// Smoothing domain of a mesh edge: a sixth of each tetrahedron around it, of similar shear moduli. Its deformation gradient is the volume
/// average of theirs,
///   F = I + sum_a u_a gradient_a^T.
struct EdgeDomain {
  struct Weight {
    std::int32_t node = 0;
    Vector3<> gradient = Vector3<>::Zero();  ///< of the shape function, averaged over the domain, 1/m
  };
  std::pair<std::int32_t, std::int32_t> ends{};  ///< nodal volumes of the edge's ends
  double volume = 0.0;                           ///< m^3
  double shear = 0.0;                            ///< volume average, Pa
  double lame = 0.0;                             ///< volume average of min(Lame's lambda, 0), Pa
  std::vector<Weight> weights;                   ///< nodes of the tetrahedra in the domain, ascending
};

/// Domains of the edge-based smoothed finite element method (ES-FEM: Nguyen-Thoi, Liu, Vu-Do & Nguyen-Xuan 2009) and the nodal volumes
/// over which the volume change is averaged (Bonet & Burton 1998; Puso & Solberg 2006). The domain of a node has half of the domain of
/// each of its edges.
///
/// The tetrahedra around an edge or a node form one domain as long as their shear moduli, in ascending order, increase by `contrast` or
/// less from one to the next. A mean deformation over soft and stiff tetrahedra, with their mean modulus, would make the soft ones stiff: a
/// column of which one half is ten times as stiff, on cells of a quarter of its height, would be 16 % too stiff. In separate domains for
/// similar moduli, as of a graded material, the tetrahedra would lock.
struct SmoothingDomains {
  static constexpr double contrast = 2.0;
  std::vector<EdgeDomain> edges;       ///< in groups of equal numbers of weights, which increase
  std::vector<double> volume_of_node;  ///< by node, m^3
  std::vector<double> nodal_volume;    ///< by node and similar moduli, m^3
  std::vector<double> nodal_lame;      ///< same: volume average of max(Lame's lambda, 0), Pa
  double energy_round_off = 0.0;       ///< J

  /// `number` maps mesh points to nodes.
  SmoothingDomains(const TetMesh& mesh, const std::vector<std::int32_t>& number) : volume_of_node(mesh.points.size()) {
    struct Use {
      std::pair<std::int32_t, std::int32_t> ends{};  // nodes
      double shear = 0.0;
      std::size_t cell = 0;
    };
    std::vector<Use> uses;
    std::vector<std::pair<std::int32_t, double>> moduli;  // node and shear modulus
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
        moduli.emplace_back(node(corner[a]), mesh.shear[c]);
        volume_of_node[static_cast<std::size_t>(node(corner[a]))] += 0.25 * volume[c];
        for (std::size_t b = 0; b < a; ++b) uses.push_back({std::minmax({node(corner[a]), node(corner[b])}), mesh.shear[c], c});
      }
    }
    std::sort(moduli.begin(), moduli.end());
    moduli.erase(std::unique(moduli.begin(), moduli.end()), moduli.end());
    std::vector<std::int32_t> domain_of;  // nodal volume of each
    for (std::size_t k = 0; k < moduli.size(); ++k) {
      const bool same = k > 0 && moduli[k].first == moduli[k - 1].first && are_similar(moduli[k - 1].second, moduli[k].second);
      domain_of.push_back(k == 0 ? 0 : domain_of.back() + (same ? 0 : 1));
    }
    nodal_volume.assign(domain_of.empty() ? 0 : static_cast<std::size_t>(domain_of.back()) + 1, 0.0);
    nodal_lame = nodal_volume;
    const auto nodal = [&](std::int32_t of, double shear) {
      return domain_of[static_cast<std::size_t>(std::lower_bound(moduli.begin(), moduli.end(), std::pair(of, shear)) - moduli.begin())];
    };
    std::sort(uses.begin(), uses.end(),
              [](const Use& x, const Use& y) { return std::tie(x.ends, x.shear, x.cell) < std::tie(y.ends, y.shear, y.cell); });
    for (std::size_t from = 0, to = 0; from < uses.size(); from = to) {
      const auto ends = uses[from].ends;
      EdgeDomain edge;
      edge.ends = {nodal(ends.first, uses[from].shear), nodal(ends.second, uses[from].shear)};
      double positive = 0.0;
      for (; to < uses.size() && uses[to].ends == ends && (to == from || are_similar(uses[to - 1].shear, uses[to].shear)); ++to) {
        const std::size_t c = uses[to].cell;
        const double part = volume[c] / 6.0;
        edge.volume += part;
        edge.shear += part * mesh.shear[c];
        edge.lame += part * std::min(mesh.lame[c], 0.0);
        positive += part * std::max(mesh.lame[c], 0.0);
        for (std::size_t a = 0; a < 4; ++a) {
          const std::int32_t i = node(mesh.tetrahedra[c][a]);
          const auto same = std::find_if(edge.weights.begin(), edge.weights.end(), [&](const auto& w) { return w.node == i; });
          if (same == edge.weights.end())
            edge.weights.push_back({i, part * gradient[c][a]});
          else
            same->gradient += part * gradient[c][a];
        }
      }
      for (const std::int32_t end : {edge.ends.first, edge.ends.second}) {
        nodal_volume[static_cast<std::size_t>(end)] += 0.5 * edge.volume;
        nodal_lame[static_cast<std::size_t>(end)] += 0.5 * positive;
      }
      edge.shear /= edge.volume;
      edge.lame /= edge.volume;
      for (EdgeDomain::Weight& w : edge.weights) w.gradient /= edge.volume;
      std::sort(edge.weights.begin(), edge.weights.end(), [](const auto& x, const auto& y) { return x.node < y.node; });
      edges.push_back(std::move(edge));
    }
    for (std::size_t i = 0; i < nodal_lame.size(); ++i) nodal_lame[i] /= nodal_volume[i];
    std::sort(edges.begin(), edges.end(), [](const EdgeDomain& x, const EdgeDomain& y) {
      return std::tuple(x.weights.size(), x.ends, x.shear) < std::tuple(y.weights.size(), y.ends, y.shear);
    });
  }

 private:
  /// Whether two shear moduli in ascending order are similar.
  [[nodiscard]] static bool are_similar(double low, double high) noexcept { return high <= contrast * low; }
};

}  // namespace palpate::deformable
