#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "palpate/deformable/linear/spring_law.hpp"
#include "palpate/math/quad.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Three components in a vector register; the last lane is zero.
using PaddedVector = math::Quad;

[[nodiscard, gnu::always_inline]] inline PaddedVector padded(const Vector3<>& x) noexcept {
  return {x[0], x[1], x[2], 0.0};
}
[[nodiscard, gnu::always_inline]] inline Vector3<> vector(const PaddedVector& x) noexcept {
  return {x[0], x[1], x[2]};
}

/// Masses, springs and volumes on vertices.
struct SpringNetworkData {
  std::vector<Vector3<>> rest_positions;                ///< of the vertices, m
  std::vector<double> masses;                           ///< of the vertices, kg
  std::vector<std::uint8_t> fixed;                      ///< nonzero: the vertex does not move
  std::vector<std::array<std::int32_t, 2>> springs;     ///< end vertices
  std::vector<double> stiffness;                        ///< of each spring at rest, N/m
  std::vector<std::array<std::int32_t, 4>> tetrahedra;  ///< of positive volume; may be empty
  std::vector<double> pressure;                         ///< of each vertex per unit relative change of the volume around it, Pa
  std::vector<double> rest_lengths;                     ///< of each spring, m; empty: the distance of its vertices
  std::vector<double> damping;                          ///< of each spring, N s/m; empty: none
  SpringLaw law;                                        ///< of all springs
};

/// Elastic forces of a network of springs and volume terms. Springs alone give a solid of Poisson's ratio 1/4 (Cauchy); a pressure for the
/// volume around each vertex supplies the difference (Golec et al. 2020). The volume of a vertex is a quarter of each adjacent tetrahedron,
/// which avoids volumetric locking (Bonet & Burton 1998).
///   W = sum k l0^2 P((l - l0) / l0) + sum p V0 c^2 / 2,   c = V / V0 - 1,   P the integral of the law of the springs, e^2 / 2 if linear
/// A negative pressure, of a Poisson's ratio below 1/4, has c^2 / (1 + c^2) in place of c^2: W would have no lower bound, and a body whose
/// tetrahedra are inverted no bound of its forces.
/// Lengths and volumes are exact, so rigid motion stores no energy.
///
/// Four springs, or the edges of one tetrahedron, are evaluated side by side. The sums have one order, whatever the width of the registers.
class SpringNetwork {
 public:
  SpringNetwork() = default;

  explicit SpringNetwork(SpringNetworkData data)
      : data_(std::move(data)), rest_volumes_(data_.rest_positions.size(), 0.0), volume_change_(data_.rest_positions.size(), 0.0) {
    const std::vector<Vector3<>>& x = data_.rest_positions;
    if (data_.rest_lengths.empty())
      for (const auto& s : data_.springs) data_.rest_lengths.push_back((at(x, s[1]) - at(x, s[0])).norm());
    if (data_.damping.empty()) data_.damping.assign(data_.springs.size(), 0.0);
    for (const auto& t : data_.tetrahedra)
      for (const std::int32_t v : t) rest_volumes_[static_cast<std::size_t>(v)] += 0.25 * volume(x, t);
    volume_force_.assign(data_.tetrahedra.empty() ? 0 : x.size(), PaddedVector(0.0));
    turned_.assign(2 * volume_force_.size(), PaddedVector(0.0));
    for (const auto& t : data_.tetrahedra) tetrahedra_.push_back({offset_of(t[0]), offset_of(t[1]), offset_of(t[2]), offset_of(t[3])});
    set_damping(1.0, 0.0);
  }

  [[nodiscard]] const SpringNetworkData& data() const noexcept { return data_; }

  /// Set the dampers of the edges for a period [s]: each spring's own one, stiffness damping `beta` [s] of the springs at rest, and
  /// period / 2 times the stiffness bound.
  void set_damping(double period, double beta) {
    std::map<std::array<std::int32_t, 2>, double> edges;  // off-diagonal entries of the volumes' bound, N/m
    for_each_volume_bound([&edges](std::int32_t i, std::int32_t j, double value) {
      if (i < j) edges[{i, j}] -= value;
    });
    edges_.clear();
    for (std::size_t s = 0; s < data_.springs.size(); ++s) {
      std::array<std::int32_t, 2> ends = data_.springs[s];
      const double k = data_.stiffness[s];
      double damper = data_.damping[s] + (beta + 0.5 * period * data_.law.stiffness_bound()) * k;
      if (ends[0] > ends[1]) std::swap(ends[0], ends[1]);
      if (const auto found = edges.find(ends); found != edges.end()) {
        damper += 0.5 * period * found->second;
        edges.erase(found);
      }
      edges_.push_back({ends, data_.rest_lengths[s], k, damper});
    }
    for (const auto& [ends, value] : edges) edges_.push_back({ends, 1.0, 0.0, 0.5 * period * value});
    arrange_springs();
  }

  /// Matrix of the dampers of the edges, the same along each axis, N s/m.
  [[nodiscard]] Eigen::SparseMatrix<double> damping_matrix() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (const Edge& e : edges_) add_edge(entries, e.ends, e.damper);
    return matrix(entries);
  }

  /// Compute the forces [N] on the vertices at `x` [m]: those of the network, and of the dampers at the velocities `v` [m/s]. Return the
  /// stored energy, J.
  double accumulate_forces(const PaddedVector* x, const PaddedVector* v, PaddedVector* force) noexcept {
    const std::size_t count = data_.rest_positions.size();
    for (std::size_t i = 0; i < count; ++i) force[i] = PaddedVector(0.0);
    double energy = 0.0;
    switch (data_.law.kind) {
      case SpringLaw::Kind::linear:
        energy = add_springs<SpringLaw::Kind::linear>(x, v, force);
        break;
      case SpringLaw::Kind::cubic:
        energy = add_springs<SpringLaw::Kind::cubic>(x, v, force);
        break;
      case SpringLaw::Kind::exponential:
        energy = add_springs<SpringLaw::Kind::exponential>(x, v, force);
        break;
    }
    return tetrahedra_.empty() ? energy : energy + add_volumes(x, force);
  }

  /// Whether a tetrahedron had no positive volume at the positions of the last forces. Nothing resists that but the springs, which then
  /// hold the body in a shape without meaning, and a negative pressure drives it on.
  [[nodiscard]] bool inverted() const noexcept { return inverted_; }

  /// Upper bound L of the stiffness along each axis [N/m], for any rotation. It holds for the springs at any deformation (their transverse
  /// stiffness never exceeds the bound of the axial one) and for the volume terms near rest.
  [[nodiscard]] Eigen::SparseMatrix<double> stiffness_bound() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t s = 0; s < data_.springs.size(); ++s)
      add_edge(entries, data_.springs[s], data_.law.stiffness_bound() * data_.stiffness[s]);
    for_each_volume_bound([&entries](std::int32_t i, std::int32_t j, double value) { entries.emplace_back(i, j, value); });
    return matrix(entries);
  }

 private:
  static constexpr std::size_t lanes = 4;
  static constexpr std::size_t chunk = 128;  // springs, a multiple of eight
  // (div u)^2 <= 3 |grad u|^2 in each tetrahedron; the mean around a vertex is no larger.
  static constexpr double volume_factor = 3.0;

  /// Springs of one vertex: its offset, and the end of the range.
  struct Run {
    std::uint32_t start, end;
  };

  struct Edge {
    std::array<std::int32_t, 2> ends;
    double rest_length, stiffness, damper;  // m, N/m, N s/m
  };

  template <class T>
  static const T& at(const std::vector<T>& values, std::int32_t i) noexcept {
    return values[static_cast<std::size_t>(i)];
  }

  static double volume(const std::vector<Vector3<>>& x, const std::array<std::int32_t, 4>& t) noexcept {
    const Vector3<>& a = at(x, t[0]);
    return (at(x, t[1]) - a).dot((at(x, t[2]) - a).cross(at(x, t[3]) - a)) / 6.0;
  }

  /// Call `add(i, j, entry)` for the entries of the volume terms' bound.
  template <class Add>
  void for_each_volume_bound(Add add) const {
    const std::vector<Vector3<>>& x = data_.rest_positions;
    for (const auto& t : data_.tetrahedra) {
      double p = 0.0;
      for (const std::int32_t v : t) p += 0.25 * std::max(at(data_.pressure, v), 0.0);
      const Vector3<> u = at(x, t[1]) - at(x, t[0]), v = at(x, t[2]) - at(x, t[0]), w = at(x, t[3]) - at(x, t[0]);
      const Vector3<> vw = v.cross(w), wu = w.cross(u), uv = u.cross(v);
      const std::array<Vector3<>, 4> face{-vw - wu - uv, vw, wu, uv};
      const double factor = volume_factor * p / (6.0 * u.dot(vw));
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j) add(t[i], t[j], factor * face[i].dot(face[j]));
    }
  }

  static void add_edge(std::vector<Eigen::Triplet<double>>& entries, const std::array<std::int32_t, 2>& ends, double k) {
    entries.emplace_back(ends[0], ends[0], k);
    entries.emplace_back(ends[1], ends[1], k);
    entries.emplace_back(ends[0], ends[1], -k);
    entries.emplace_back(ends[1], ends[0], -k);
  }

  [[nodiscard]] Eigen::SparseMatrix<double> matrix(const std::vector<Eigen::Triplet<double>>& entries) const {
    const auto size = static_cast<Eigen::Index>(data_.rest_positions.size());
    Eigen::SparseMatrix<double> m(size, size);
    m.setFromTriplets(entries.begin(), entries.end());
    return m;
  }

  /// Sort the edges by their first vertex, and divide them in runs of one vertex.
  void arrange_springs() {
    std::vector<Edge> sorted = edges_;
    std::sort(sorted.begin(), sorted.end(), [](const Edge& a, const Edge& b) {
      return std::tie(a.ends, a.rest_length, a.stiffness, a.damper) < std::tie(b.ends, b.rest_length, b.stiffness, b.damper);
    });
    while (sorted.size() % (2 * lanes) != 0) sorted.push_back({sorted.back().ends, 1.0, 0.0, 0.0});
    ends_.clear();
    runs_.clear();
    dampers_.clear();
    rest_lengths_.assign(sorted.size() / lanes, PaddedVector(0.0));
    stiffness_ = rest_lengths_;
    for (std::size_t s = 0; s < sorted.size(); ++s) {
      const Edge& e = sorted[s];
      if (s % chunk == 0 || runs_.back().start != offset_of(e.ends[0])) runs_.push_back({offset_of(e.ends[0]), 0});
      runs_.back().end = static_cast<std::uint32_t>(s + 1);
      ends_.push_back(offset_of(e.ends[1]));
      dampers_.push_back(e.damper);
      rest_lengths_[s / lanes].set(s % lanes, e.rest_length);
      stiffness_[s / lanes].set(s % lanes, e.stiffness);
    }
  }

  /// Vector at an offset: a quarter of its distance in bytes, so that it is a distance in a list of numbers too.
  [[gnu::always_inline]] static const PaddedVector& at(const PaddedVector* values, std::uint32_t offset) noexcept {
    return *reinterpret_cast<const PaddedVector*>(reinterpret_cast<const char*>(values) + std::size_t{4} * offset);
  }
  [[gnu::always_inline]] static PaddedVector& at(PaddedVector* values, std::uint32_t offset) noexcept {
    return *reinterpret_cast<PaddedVector*>(reinterpret_cast<char*>(values) + std::size_t{4} * offset);
  }
  static std::uint32_t offset_of(std::int32_t vertex) noexcept { return static_cast<std::uint32_t>(vertex) * sizeof(double); }

  /// Return the squared lengths of four vectors.
  [[gnu::always_inline]] static PaddedVector squares_of(const PaddedVector* x) noexcept {
    return PaddedVector::sums_of(x[0] * x[0], x[1] * x[1], x[2] * x[2], x[3] * x[3]);
  }

  /// Compute 1 / sqrt(x) of eight numbers to rounding, from those of single precision and one step of third order.
  [[gnu::always_inline]] static void invert_roots(const PaddedVector* x, PaddedVector* roots) noexcept {
    PaddedVector::single_inverse_roots(x, roots);
    for (int i = 0; i < 2; ++i) {
      const PaddedVector error = 1.0 - x[i] * roots[i] * roots[i];
      roots[i] += roots[i] * error * (0.5 + 0.375 * error);
    }
  }

  template <SpringLaw::Kind kind>
  double add_springs(const PaddedVector* x, const PaddedVector* v, PaddedVector* force) noexcept {
    const detail::SpringLawKernel<kind> law(data_.law);
    PaddedVector energy(0.0);
    PaddedVector edge[chunk], over_length[chunk / lanes];  // m; force over length, N/m
    const Run* run = runs_.data();
    for (std::size_t begin = 0; begin < ends_.size(); begin += chunk) {
      const std::size_t end = std::min(begin + chunk, ends_.size());
      const Run* const first = run;
      for (std::size_t s = begin; s < end; ++run) {
        const PaddedVector from = at(x, run->start);
        for (; s < run->end; ++s) edge[s - begin] = at(x, ends_[s]) - from;
      }
      for (std::size_t s = begin; s < end; s += 2 * lanes)
        add_eight(law, edge + (s - begin), rest_lengths_.data() + s / lanes, stiffness_.data() + s / lanes,
                  over_length + (s - begin) / lanes, energy);
      const double* const scale = reinterpret_cast<const double*>(over_length);
      run = first;
      for (std::size_t s = begin; s < end; ++run) {
        const PaddedVector from = at(v, run->start);
        PaddedVector sum = at(force, run->start);
        for (; s < run->end; ++s) {
          const PaddedVector f = scale[s - begin] * edge[s - begin] + dampers_[s] * (at(v, ends_[s]) - from);
          sum += f;
          at(force, ends_[s]) -= f;
        }
        at(force, run->start) = sum;
      }
    }
    return (energy[0] + energy[1]) + (energy[2] + energy[3]);
  }

  /// Compute the forces of eight springs over their lengths, N/m, and add their energy.
  template <SpringLaw::Kind kind>
  [[gnu::always_inline]] static void add_eight(const detail::SpringLawKernel<kind>& law, const PaddedVector* edge, const PaddedVector* rest,
                                               const PaddedVector* stiffness, PaddedVector* over_length, PaddedVector& energy) noexcept {
    PaddedVector squared[2], inverse[2];
    for (int i = 0; i < 2; ++i) {  // a spring of zero length has no direction and exerts no force
      const PaddedVector least = 1e-18 * (rest[i] * rest[i]), length2 = squares_of(edge + 4 * i);
      squared[i] = select(length2 < least, least, length2);
    }
    invert_roots(squared, inverse);
    for (int i = 0; i < 2; ++i) {
      const PaddedVector elongation = squared[i] * inverse[i] - rest[i];
      if constexpr (kind == SpringLaw::Kind::linear) {
        const PaddedVector along = stiffness[i] * elongation;
        energy += 0.5 * (along * elongation);
        over_length[i] = along * inverse[i];
      } else {
        PaddedVector p, stored;
        law.evaluate(elongation / rest[i], p, stored);
        const PaddedVector scale = stiffness[i] * rest[i];
        energy += scale * (rest[i] * stored);
        over_length[i] = scale * p * inverse[i];
      }
    }
  }

  /// Volume or pressure of the vertex at an offset of its vector.
  [[gnu::always_inline]] double& value_at(std::uint32_t offset) noexcept {
    return *reinterpret_cast<double*>(reinterpret_cast<char*>(volume_change_.data()) + offset);
  }

  double add_volumes(const PaddedVector* x, PaddedVector* force) noexcept {
    const std::size_t count = data_.rest_positions.size();
    PaddedVector *const yzx = turned_.data(), *const zxy = turned_.data() + count;  // positions with their components rotated
    for (std::size_t i = 0; i < count; ++i) {
      volume_change_[i] = 0.0;
      volume_force_[i] = PaddedVector(0.0);
      yzx[i] = x[i].rotated();
      zxy[i] = yzx[i].rotated();
    }
    double least = 1.0;  // m^3, more than any
    for (const auto& t : tetrahedra_) {
      const PaddedVector a = at(x, t[0]), ra = at(yzx, t[0]), v = at(x, t[2]) - a, w = at(x, t[3]) - a;
      const PaddedVector rv = at(yzx, t[2]) - ra, rw = at(yzx, t[3]) - ra, u = at(zxy, t[1]) - at(zxy, t[0]);
      const PaddedVector triple = u * (v * rw - rv * w);  // components z, x, y
      const double quarter = (triple[0] + triple[1] + triple[2]) * (1.0 / 24.0);
      for (const std::uint32_t i : t) value_at(i) += quarter;
      least = std::min(least, quarter);
    }
    inverted_ = !(least > 0.0);
    double energy = 0.0;
    for (std::size_t i = 0; i < count; ++i) {  // volume to pressure
      if (!(rest_volumes_[i] > 0.0)) continue;
      const double change = volume_change_[i] / rest_volumes_[i] - 1.0;
      const double bound = data_.pressure[i] < 0.0 ? 1.0 / (1.0 + change * change) : 1.0;
      volume_change_[i] = data_.pressure[i] * change * bound;
      energy += 0.5 * volume_change_[i] * change * rest_volumes_[i];
      volume_change_[i] *= bound;
    }
    PaddedVector* const rotated_force = volume_force_.data();
    for (const auto& t : tetrahedra_) {
      const double p = ((value_at(t[0]) + value_at(t[1])) + (value_at(t[2]) + value_at(t[3]))) * (-1.0 / 24.0);
      const PaddedVector a = at(x, t[0]), u = at(x, t[1]) - a, v = at(x, t[2]) - a, w = at(x, t[3]) - a;
      const PaddedVector ra = at(yzx, t[0]), ru = at(yzx, t[1]) - ra, rv = at(yzx, t[2]) - ra, rw = at(yzx, t[3]) - ra;
      const PaddedVector fb = p * (v * rw - rv * w), fc = p * (w * ru - rw * u), fd = p * (u * rv - ru * v);  // components z, x, y
      at(rotated_force, t[1]) += fb;
      at(rotated_force, t[2]) += fc;
      at(rotated_force, t[3]) += fd;
      at(rotated_force, t[0]) -= fb + fc + fd;
    }
    for (std::size_t i = 0; i < count; ++i) force[i] += volume_force_[i].rotated();
    return energy;
  }

  SpringNetworkData data_;
  bool inverted_ = false;    // see inverted()
  std::vector<Edge> edges_;  // springs, and edges of tetrahedra without a spring
  // The same edges, sorted by their first vertex.
  std::vector<Run> runs_;
  std::vector<std::uint32_t> ends_;                       // offsets of the second vertices
  std::vector<PaddedVector> rest_lengths_;                // of four springs, m
  std::vector<PaddedVector> stiffness_;                   // N/m
  std::vector<double> dampers_;                           // N s/m
  std::vector<std::array<std::uint32_t, 4>> tetrahedra_;  // offsets of the vertices
  std::vector<double> rest_volumes_;                      // around each vertex, m^3
  std::vector<double> volume_change_;                     // by vertex: volume [m^3], then pressure [Pa]
  std::vector<PaddedVector> turned_;                      // workspace of positions
  std::vector<PaddedVector> volume_force_;                // by vertex, components rotated: z, x, y; N
};

}  // namespace palpate::deformable
