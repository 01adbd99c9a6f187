#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <utility>
#include <vector>

/// Cube of `side` cells of six tetrahedra, fixed at the bottom; springs along all edges.
struct Cube {
  palpate::deformable::SpringNetworkData data;
  palpate::deformable::PatchWeights patches{{0}, {}, {}, {}};
  palpate::deformable::SurfaceNodes nodes;

  explicit Cube(std::int32_t side, bool fix_bottom = true, double width = 5e-3, double stiffness = 20.0) {
    const std::int32_t line = side + 1;
    const auto number = [line](std::int32_t x, std::int32_t y, std::int32_t z) { return (x * line + y) * line + z; };
    std::vector<palpate::math::Vector3<>> at, normals;
    std::vector<double> areas;
    for (std::int32_t x = 0; x < line; ++x)
      for (std::int32_t y = 0; y < line; ++y)
        for (std::int32_t z = 0; z < line; ++z) {
          data.rest_positions.emplace_back(width * x, width * y, width * z);
          data.masses.push_back(1000.0 * std::pow(width, 3));
          data.fixed.push_back(fix_bottom && z == 0 ? 1 : 0);
          data.pressure.push_back(2e4);
          if (z < side) continue;
          at.push_back(data.rest_positions.back());
          normals.emplace_back(0, 0, 1);
          areas.push_back(width * width);
          patches.vertices.push_back(number(x, y, z));
          patches.weights.push_back(1.0);
          patches.compliance.emplace_back(Eigen::Matrix3d::Identity() / stiffness);
          patches.begin.push_back(static_cast<std::int32_t>(patches.weights.size()));
        }
    for (std::int32_t x = 0; x < side; ++x)
      for (std::int32_t y = 0; y < side; ++y)
        for (std::int32_t z = 0; z < side; ++z) {
          const int ways[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}};
          for (int w = 0; w < 6; ++w) {
            std::int32_t c[3] = {x, y, z};
            std::array<std::int32_t, 4> t{number(x, y, z), 0, 0, 0};
            for (std::size_t i = 0; i < 3; ++i) {
              ++c[ways[w][i]];
              t[i + 1] = number(c[0], c[1], c[2]);
            }
            if (w >= 3) std::swap(t[1], t[2]);
            data.tetrahedra.push_back(t);
            for (std::size_t i = 0; i < 4; ++i)
              for (std::size_t j = 0; j < i; ++j) {
                data.springs.push_back({t[i], t[j]});
                data.stiffness.push_back(stiffness / 6.0);
              }
          }
        }
    nodes = palpate::deformable::SurfaceNodes(at, normals, areas);
  }

  [[nodiscard]] palpate::deformable::MassSpringModel model(double period, double alpha = 0.0, double beta = 0.0) const {
    return {nodes, data, patches, period, alpha, beta};
  }
};
