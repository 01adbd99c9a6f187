#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Masses, springs and volumes on the vertices of a tetrahedral mesh.
struct SpringNetworkData {
  std::vector<Vector3<>> rest_positions;                ///< of the vertices, m
  std::vector<double> masses;                           ///< of the vertices, kg
  std::vector<std::uint8_t> fixed;                      ///< nonzero: the vertex does not move
  std::vector<std::array<std::int32_t, 2>> springs;     ///< end vertices
  std::vector<double> stiffness;                        ///< of each spring, N/m
  std::vector<std::array<std::int32_t, 4>> tetrahedra;  ///< of positive volume
  std::vector<double> pressure;                         ///< of each vertex per unit relative change of the volume around it, Pa
};

/// Elastic forces of a network of springs and volume terms. Springs alone give a solid of Poisson's ratio 1/4 (Cauchy); a pressure for the
/// volume around each vertex supplies the difference (Golec et al. 2020). The volume of a vertex is a quarter of each adjacent tetrahedron,
/// which avoids volumetric locking (Bonet & Burton 1998).
///   W = sum k (l - l0)^2 / 2 + sum p V0 (V / V0 - 1)^2 / 2
/// Lengths and volumes are exact, so rigid motion stores no energy.
class SpringNetwork {
 public:
  SpringNetwork() = default;

  explicit SpringNetwork(SpringNetworkData data)
      : data_(std::move(data)),
        rest_lengths_(data_.springs.size()),
        rest_volumes_(data_.rest_positions.size(), 0.0),
        volume_change_(data_.rest_positions.size(), 0.0) {
    const std::vector<Vector3<>>& x = data_.rest_positions;
    for (std::size_t s = 0; s < rest_lengths_.size(); ++s)
      rest_lengths_[s] = (at(x, data_.springs[s][1]) - at(x, data_.springs[s][0])).norm();
    for (const auto& t : data_.tetrahedra)
      for (const std::int32_t v : t) rest_volumes_[static_cast<std::size_t>(v)] += 0.25 * volume(x.data(), t);
  }

  [[nodiscard]] const SpringNetworkData& data() const noexcept { return data_; }

  /// Compute the forces [N] on the vertices at `x` [m]. Return the stored energy, J.
  double accumulate_forces(const Vector3<>* x, Vector3<>* force) noexcept {
    const std::size_t count = data_.rest_positions.size();
    double energy = 0.0;
    for (std::size_t v = 0; v < count; ++v) {
      force[v].setZero();
      volume_change_[v] = 0.0;
    }
    for (std::size_t s = 0; s < rest_lengths_.size(); ++s) {
      const auto a = static_cast<std::size_t>(data_.springs[s][0]), b = static_cast<std::size_t>(data_.springs[s][1]);
      const Vector3<> edge = x[b] - x[a];
      const double length = edge.norm(), elongation = length - rest_lengths_[s], k = data_.stiffness[s];
      // A spring of zero length has no direction and exerts no force.
      const Vector3<> f = (k * elongation / std::max(length, 1e-9 * rest_lengths_[s])) * edge;
      force[a] += f;
      force[b] -= f;
      energy += 0.5 * k * elongation * elongation;
    }
    for (const auto& t : data_.tetrahedra) {
      const double quarter = 0.25 * volume(x, t);
      for (const std::int32_t v : t) volume_change_[static_cast<std::size_t>(v)] += quarter;
    }
    for (std::size_t v = 0; v < count; ++v) {  // volume to pressure
      if (!(rest_volumes_[v] > 0.0)) continue;
      const double change = volume_change_[v] / rest_volumes_[v] - 1.0;
      volume_change_[v] = data_.pressure[v] * change;
      energy += 0.5 * volume_change_[v] * change * rest_volumes_[v];
    }
    for (const auto& t : data_.tetrahedra) {
      const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]), c = static_cast<std::size_t>(t[2]),
                 d = static_cast<std::size_t>(t[3]);
      const double p = (volume_change_[a] + volume_change_[b] + volume_change_[c] + volume_change_[d]) / 24.0;
      const Vector3<> u = x[b] - x[a], v = x[c] - x[a], w = x[d] - x[a];
      const Vector3<> fb = -p * v.cross(w), fc = -p * w.cross(u), fd = -p * u.cross(v);
      force[b] += fb;
      force[c] += fc;
      force[d] += fd;
      force[a] -= fb + fc + fd;
    }
    return energy;
  }

  /// Upper bound L of the stiffness along each axis [N/m], for any rotation. It holds for the springs at any deformation (their transverse
  /// stiffness never exceeds the axial one) and for the volume terms near rest.
  [[nodiscard]] Eigen::SparseMatrix<double> stiffness_bound() const {
    std::vector<Eigen::Triplet<double>> entries;
    const std::vector<Vector3<>>& x = data_.rest_positions;
    for (const auto& t : data_.tetrahedra) {
      double p = 0.0;
      for (const std::int32_t v : t) p += 0.25 * std::max(at(data_.pressure, v), 0.0);
      const Vector3<> u = at(x, t[1]) - at(x, t[0]), v = at(x, t[2]) - at(x, t[0]), w = at(x, t[3]) - at(x, t[0]);
      const Vector3<> vw = v.cross(w), wu = w.cross(u), uv = u.cross(v);
      const std::array<Vector3<>, 4> face{-vw - wu - uv, vw, wu, uv};
      const double factor = volume_factor * p / (6.0 * u.dot(vw));
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j) entries.emplace_back(t[i], t[j], factor * face[i].dot(face[j]));
    }
    return spring_bound() + matrix(entries);
  }

  /// Part of the bound due to the springs.
  [[nodiscard]] Eigen::SparseMatrix<double> spring_bound() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t s = 0; s < rest_lengths_.size(); ++s) {
      const std::int32_t a = data_.springs[s][0], b = data_.springs[s][1];
      const double k = data_.stiffness[s];
      entries.emplace_back(a, a, k);
      entries.emplace_back(b, b, k);
      entries.emplace_back(a, b, -k);
      entries.emplace_back(b, a, -k);
    }
    return matrix(entries);
  }

 private:
  // (div u)^2 <= 3 |grad u|^2 in each tetrahedron; the mean around a vertex is no larger.
  static constexpr double volume_factor = 3.0;

  template <class T>
  static const T& at(const std::vector<T>& values, std::int32_t i) noexcept {
    return values[static_cast<std::size_t>(i)];
  }

  static double volume(const Vector3<>* x, const std::array<std::int32_t, 4>& t) noexcept {
    const Vector3<>& a = x[t[0]];
    return (x[t[1]] - a).dot((x[t[2]] - a).cross(x[t[3]] - a)) / 6.0;
  }

  [[nodiscard]] Eigen::SparseMatrix<double> matrix(const std::vector<Eigen::Triplet<double>>& entries) const {
    const auto size = static_cast<Eigen::Index>(data_.rest_positions.size());
    Eigen::SparseMatrix<double> m(size, size);
    m.setFromTriplets(entries.begin(), entries.end());
    return m;
  }

  SpringNetworkData data_;
  std::vector<double> rest_lengths_;   // m
  std::vector<double> rest_volumes_;   // around each vertex, m^3
  std::vector<double> volume_change_;  // by vertex: volume [m^3], then pressure [Pa]
};

}  // namespace palpate::deformable
