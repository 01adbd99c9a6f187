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

/// Masses, springs and volumes between the vertices of a tetrahedral mesh.
struct SpringNetworkData {
  std::vector<Vector3<>> places;                        ///< of the vertices at rest, m
  std::vector<double> inertia_parameters;               ///< kg
  std::vector<std::uint8_t> held;                       ///< vertices that do not move
  std::vector<std::array<std::int32_t, 2>> springs;     ///< their ends
  std::vector<double> stiffness;                        ///< of each spring, N/m
  std::vector<std::array<std::int32_t, 4>> tetrahedra;  ///< of positive volume
  std::vector<double> pressure;                         ///< at each vertex by a unit change of the volume around it, Pa
};

/// What holds a network together: springs along the lines between vertices, which alone make a solid of Poisson's ratio 1/4 (Cauchy), and a
/// pressure for the volume around each vertex that makes up the rest (Golec et al. 2020). The volume is a quarter of each tetrahedron
/// there, so that an incompressible solid does not lock (Bonet & Burton 1998).
///   W = sum k (l - l0)^2 / 2 + sum p V0 (V / V0 - 1)^2 / 2
/// with the true lengths and volumes: turning or shifting it as a whole stores nothing.
class SpringNetwork {
 public:
  SpringNetwork() = default;

  explicit SpringNetwork(SpringNetworkData parts)
      : parts_(std::move(parts)), lengths_(parts_.springs.size()), volumes_(parts_.places.size(), 0.0), swell_(parts_.places.size(), 0.0) {
    const std::vector<Vector3<>>& x = parts_.places;
    for (std::size_t s = 0; s < lengths_.size(); ++s) lengths_[s] = (at(x, parts_.springs[s][1]) - at(x, parts_.springs[s][0])).norm();
    for (const auto& t : parts_.tetrahedra)
      for (const std::int32_t v : t) volumes_[static_cast<std::size_t>(v)] += 0.25 * volume(x.data(), t);
  }

  [[nodiscard]] const SpringNetworkData& parts() const noexcept { return parts_; }

  /// The forces on the vertices at `x`, N, are put into `force`; returns the energy stored, J.
  double pull(const Vector3<>* x, Vector3<>* force) noexcept {
    const std::size_t count = parts_.places.size();
    double energy = 0.0;
    for (std::size_t v = 0; v < count; ++v) {
      force[v].setZero();
      swell_[v] = 0.0;
    }
    for (std::size_t s = 0; s < lengths_.size(); ++s) {
      const auto a = static_cast<std::size_t>(parts_.springs[s][0]), b = static_cast<std::size_t>(parts_.springs[s][1]);
      const Vector3<> way = x[b] - x[a];
      const double length = way.norm(), longer = length - lengths_[s], k = parts_.stiffness[s];
      // A spring of no length has no direction, and pulls nowhere.
      const Vector3<> f = (k * longer / std::max(length, 1e-9 * lengths_[s])) * way;
      force[a] += f;
      force[b] -= f;
      energy += 0.5 * k * longer * longer;
    }
    for (const auto& t : parts_.tetrahedra) {
      const double quarter = 0.25 * volume(x, t);
      for (const std::int32_t v : t) swell_[static_cast<std::size_t>(v)] += quarter;
    }
    for (std::size_t v = 0; v < count; ++v) {  // from a volume to a pressure
      if (!(volumes_[v] > 0.0)) continue;
      const double change = swell_[v] / volumes_[v] - 1.0;
      swell_[v] = parts_.pressure[v] * change;
      energy += 0.5 * swell_[v] * change * volumes_[v];
    }
    for (const auto& t : parts_.tetrahedra) {
      const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]), c = static_cast<std::size_t>(t[2]),
                 d = static_cast<std::size_t>(t[3]);
      const double p = (swell_[a] + swell_[b] + swell_[c] + swell_[d]) / 24.0;
      const Vector3<> u = x[b] - x[a], v = x[c] - x[a], w = x[d] - x[a];
      const Vector3<> fb = -p * v.cross(w), fc = -p * w.cross(u), fd = -p * u.cross(v);
      force[b] += fb;
      force[c] += fc;
      force[d] += fd;
      force[a] -= fb + fc + fd;
    }
    return energy;
  }

  /// A matrix L by vertex, N/m, such that the network, however it is turned and deformed, is nowhere stiffer than L along each axis. Of the
  /// springs that is so at any deformation (a spring is no stiffer sideways than along it); of the volumes near rest.
  [[nodiscard]] Eigen::SparseMatrix<double> bound() const {
    std::vector<Eigen::Triplet<double>> entries;
    const std::vector<Vector3<>>& x = parts_.places;
    for (const auto& t : parts_.tetrahedra) {
      double p = 0.0;
      for (const std::int32_t v : t) p += 0.25 * std::max(at(parts_.pressure, v), 0.0);
      const Vector3<> u = at(x, t[1]) - at(x, t[0]), v = at(x, t[2]) - at(x, t[0]), w = at(x, t[3]) - at(x, t[0]);
      const Vector3<> vw = v.cross(w), wu = w.cross(u), uv = u.cross(v);
      const std::array<Vector3<>, 4> face{-vw - wu - uv, vw, wu, uv};
      const double share = volume_share * p / (6.0 * u.dot(vw));
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j) entries.emplace_back(t[i], t[j], share * face[i].dot(face[j]));
    }
    return links() + matrix(entries);
  }

  /// The springs' part of the bound.
  [[nodiscard]] Eigen::SparseMatrix<double> links() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t s = 0; s < lengths_.size(); ++s) {
      const std::int32_t a = parts_.springs[s][0], b = parts_.springs[s][1];
      const double k = parts_.stiffness[s];
      entries.emplace_back(a, a, k);
      entries.emplace_back(b, b, k);
      entries.emplace_back(a, b, -k);
      entries.emplace_back(b, a, -k);
    }
    return matrix(entries);
  }

 private:
  // (div u)^2 <= 3 |grad u|^2 in each tetrahedron, and the mean around a vertex is no more.
  static constexpr double volume_share = 3.0;

  template <class T>
  static const T& at(const std::vector<T>& list, std::int32_t i) noexcept {
    return list[static_cast<std::size_t>(i)];
  }

  static double volume(const Vector3<>* x, const std::array<std::int32_t, 4>& t) noexcept {
    const Vector3<>& a = x[t[0]];
    return (x[t[1]] - a).dot((x[t[2]] - a).cross(x[t[3]] - a)) / 6.0;
  }

  [[nodiscard]] Eigen::SparseMatrix<double> matrix(const std::vector<Eigen::Triplet<double>>& entries) const {
    const auto size = static_cast<Eigen::Index>(parts_.places.size());
    Eigen::SparseMatrix<double> m(size, size);
    m.setFromTriplets(entries.begin(), entries.end());
    return m;
  }

  SpringNetworkData parts_;
  std::vector<double> lengths_;  // at rest, m
  std::vector<double> volumes_;  // around each vertex at rest, m^3
  std::vector<double> swell_;    // volumes, then pressures
};

}  // namespace palpate::deformable
