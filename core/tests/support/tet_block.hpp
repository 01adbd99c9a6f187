#pragma once

#include <Eigen/LU>
#include <palpate/deformable/hyperelastic/quasi_static_solver.hpp>
#include <utility>

/// Block of cubes of six tetrahedra each; bottom fixed, top is the contact surface.
struct TetBlock {
  int nx, ny, nz;
  double side = 5e-3;  // of a cube, m
  palpate::deformable::TetMesh mesh;

  TetBlock(int x, int y, int z, double young, double poisson) : nx(x), ny(y), nz(z) {
    for (int i = 0; i <= nx; ++i)
      for (int j = 0; j <= ny; ++j)
        for (int k = 0; k <= nz; ++k) {
          mesh.points.emplace_back(i * side, j * side, k * side);
          mesh.fixed.push_back(k == 0);
        }
    const int ways[6][2] = {{4, 6}, {4, 5}, {2, 6}, {2, 3}, {1, 5}, {1, 3}};
    for (int i = 0; i < nx; ++i)
      for (int j = 0; j < ny; ++j)
        for (int k = 0; k < nz; ++k)
          for (const auto& way : ways) {
            std::array<std::int32_t, 4> cell{corner(i, j, k, 0), corner(i, j, k, way[0]), corner(i, j, k, way[1]), corner(i, j, k, 7)};
            Eigen::Matrix3d edges;
            for (std::size_t c = 1; c < 4; ++c) edges.col(static_cast<int>(c) - 1) = at(cell[c]) - at(cell[0]);
            if (edges.determinant() < 0.0) std::swap(cell[1], cell[2]);
            mesh.tetrahedra.push_back(cell);
            mesh.shear.push_back(young / (2.0 * (1.0 + poisson)));
            mesh.lame.push_back(young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)));
          }
  }

  [[nodiscard]] std::int32_t number(int i, int j, int k) const { return (i * (ny + 1) + j) * (nz + 1) + k; }
  [[nodiscard]] std::int32_t corner(int i, int j, int k, int c) const { return number(i + (c >> 2), j + ((c >> 1) & 1), k + (c & 1)); }
  [[nodiscard]] const palpate::math::Vector3<>& at(std::int32_t p) const { return mesh.points[static_cast<std::size_t>(p)]; }

  [[nodiscard]] palpate::deformable::TetSurface top() const {
    palpate::deformable::TetSurface surface;
    for (int i = 0; i <= nx; ++i)
      for (int j = 0; j <= ny; ++j) surface.point.push_back(number(i, j, nz));
    const double shear = mesh.shear.front(), lame = mesh.lame.front(), modulus = 4.0 * shear * (lame + shear) / (lame + 2.0 * shear);
    surface.modulus.assign(surface.point.size(), {modulus, modulus});
    for (int i = 0; i < nx; ++i)
      for (int j = 0; j < ny; ++j) {
        surface.triangles.push_back({number(i, j, nz), number(i + 1, j, nz), number(i + 1, j + 1, nz)});
        surface.triangles.push_back({number(i, j, nz), number(i + 1, j + 1, nz), number(i, j + 1, nz)});
      }
    return surface;
  }
};
