#pragma once

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/spring_network.hpp"
#include "palpate/math/supernodal_cholesky.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Distribution of a surface node's force over network vertices. The node's position is the mean of theirs with the same weights.
struct PatchWeights {
  std::vector<std::int32_t> begin;     ///< of each node in the two lists, n + 1
  std::vector<std::int32_t> vertices;  ///< network vertices
  std::vector<double> weights;
};

/// Masses, springs and dampers on the vertices of a mesh. One period h moves the vertices by d,
///   (M / h^2 + a M / h + b L' / h + L / 2) d = M v / h + F(x) + f,   x + d -> x,   d / h -> v,
/// with the nonlinear network forces F, Rayleigh damping a (mass) and b (springs L'), and a constant upper bound L of the network's
/// stiffness. L is the same along each axis, so the matrix is factorized once.
///
/// From W(x + d) <= W(x) - F.d + d.L d / 2 follows for the total energy E, at any period and stiffness,
///   E(after) <= E(before) + f.d.
/// Volume terms under large strain may be stiffer than L. Each step is checked; a step that violates the inequality is shortened, or its
/// velocity reduced. The cost is numerical damping: L / 2 acts as a damper of L h / 2.
class MassSpringModel {
 public:
  static constexpr double max_step = 2e-3;  ///< longest period of a look-ahead at two rates, s (LinearBodySolver)

  MassSpringModel() = default;

  /// `period` [s]; mass damping `alpha` [1/s] and stiffness damping `beta` [s] (of shear).
  MassSpringModel(const SurfaceNodes& nodes, SpringNetworkData data, PatchWeights patches, double period, double alpha, double beta)
      : network_(std::move(data)), patches_(std::move(patches)), period_(period) {
    const SpringNetworkData& p = network_.data();
    const std::size_t count = p.rest_positions.size();
    free_index_.assign(count, -1);
    for (std::size_t v = 0; v < count; ++v)
      if (!p.fixed[v]) {
        free_index_[v] = static_cast<std::int32_t>(free_vertices_.size());
        free_vertices_.push_back(static_cast<std::int32_t>(v));
      }
    position_ = p.rest_positions;
    force_.assign(count, Vector3<>::Zero());
    step_.assign(free_vertices_.size(), Vector3<>::Zero());
    free_step_ = velocity_ = step_;
    factorize(alpha, beta);
    if (!factor_.positive_definite()) return;
    compute_response(nodes);
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      inward_normals_.push_back(-nodes.normal(i));
      tangent_bases_.push_back(nodes.tangent_basis(i));
    }
    reset();
  }

  /// False if a mass or volume is not positive.
  [[nodiscard]] bool definite() const noexcept { return factor_.positive_definite(); }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[index(i) * inward_normals_.size() + index(j)]) *
           inward_normals_[index(i)].dot(inward_normals_[index(j)]);
  }

  [[nodiscard]] double free_displacement(std::int32_t i) const noexcept {
    return inward_normals_[index(i)].dot(patch_displacement(i, free_step_));
  }

  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[index(i) * inward_normals_.size() + index(j)]) * tangent_bases_[index(i)].transpose() *
           tangent_bases_[index(j)];
  }

  [[nodiscard]] Eigen::Vector2d free_tangential_displacement(std::int32_t i) const noexcept {
    return tangent_bases_[index(i)].transpose() * patch_displacement(i, free_step_);
  }

  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  /// `tangential` are forces in the nodes' tangent planes, or null.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* tangential, int count) noexcept {
    step_ = free_step_;
    for (int c = 0; c < count; ++c) {
      const Vector3<> force = node_force(nodes[c], forces[c], tangential == nullptr ? nullptr : tangential + c);
      const float* column = response_.data() + index(nodes[c]) * free_vertices_.size();
      for (std::size_t k = 0; k < free_vertices_.size(); ++k) step_[k] += static_cast<double>(column[k]) * force;
    }
    double work = 0.0;
    for (int c = 0; c < count; ++c) {
      const std::int32_t node = nodes[c];
      Vector3<> patch_step = Vector3<>::Zero();
      for (std::int32_t e = patches_.begin[index(node)]; e < patches_.begin[index(node) + 1]; ++e) {
        const std::int32_t k = free_index_[index(patches_.vertices[index(e)])];
        if (k >= 0) patch_step += patches_.weights[index(e)] * step_[index(k)];
      }
      work += node_force(node, forces[c], tangential == nullptr ? nullptr : tangential + c).dot(patch_step);
    }
    apply_step(work);
    predict();
  }

  /// Adopt the state of the same body with another period.
  void take_state(const MassSpringModel& other) noexcept {
    position_ = other.position_;
    velocity_ = other.velocity_;
    force_ = other.force_;
    potential_ = other.potential_;
    kinetic_ = other.kinetic_;
    predict();
  }

  void reset() noexcept {
    position_ = network_.data().rest_positions;
    for (Vector3<>& v : velocity_) v.setZero();
    potential_ = network_.accumulate_forces(position_.data(), force_.data());
    kinetic_ = 0.0;
    limited_steps_ = 0;
    predict();
  }

  /// Set vertex `positions` [m] and `velocities` [m/s], one per vertex. Fixed vertices stay at the given position.
  void set_state(const Vector3<>* positions, const Vector3<>* velocities) noexcept {
    for (std::size_t v = 0; v < position_.size(); ++v) position_[v] = positions[v];
    for (std::size_t k = 0; k < free_vertices_.size(); ++k) velocity_[k] = velocities[free_vertices_[k]];
    potential_ = network_.accumulate_forces(position_.data(), force_.data());
    kinetic_ = kinetic();
    predict();
  }

  /// Kinetic and potential energy, J.
  [[nodiscard]] double energy() const noexcept { return kinetic_ + potential_; }
  /// Number of periods that were shortened or slowed to satisfy the energy inequality.
  [[nodiscard]] long limited_steps() const noexcept { return limited_steps_; }
  [[nodiscard]] const std::vector<Vector3<>>& positions() const noexcept { return position_; }
  [[nodiscard]] std::size_t factor_entries() const noexcept { return factor_.nonzeros(); }

  /// Mean displacement of a node's patch, m.
  [[nodiscard]] Vector3<> displacement(std::int32_t i) const noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (std::int32_t e = patches_.begin[index(i)]; e < patches_.begin[index(i) + 1]; ++e) {
      const std::size_t v = index(patches_.vertices[index(e)]);
      sum += patches_.weights[index(e)] * (position_[v] - network_.data().rest_positions[v]);
    }
    return sum;
  }

 private:
  static std::size_t index(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  /// Total force on a node, N.
  [[nodiscard]] Vector3<> node_force(std::int32_t node, double inward, const Eigen::Vector2d* tangential) const noexcept {
    Vector3<> force = inward * inward_normals_[index(node)];
    if (tangential != nullptr) force += tangent_bases_[index(node)] * *tangential;
    return force;
  }

  void factorize(double alpha, double beta) {
    const SpringNetworkData& p = network_.data();
    // In an isotropic solid the springs hold a vertex five times as stiffly as its shear does.
    const Eigen::SparseMatrix<double> whole = 0.5 * network_.stiffness_bound() + (0.2 * beta / period_) * network_.spring_bound();
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index c = 0; c < whole.outerSize(); ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator e(whole, c); e; ++e) {
        const std::int32_t i = free_index_[static_cast<std::size_t>(e.row())], j = free_index_[static_cast<std::size_t>(e.col())];
        if (i >= 0 && j >= 0) entries.emplace_back(i, j, e.value());
      }
    for (std::size_t k = 0; k < free_vertices_.size(); ++k) {
      const double inertia = p.masses[index(free_vertices_[k])] * (1.0 / period_ + alpha) / period_;
      entries.emplace_back(static_cast<int>(k), static_cast<int>(k), inertia);
    }
    const auto size = static_cast<Eigen::Index>(free_vertices_.size());
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_ = SupernodalCholesky(matrix);
  }

  /// Compute the displacement of all vertices and nodes in a period per unit force on each node; the same along each axis.
  void compute_response(const SurfaceNodes& nodes) {
    const auto n = static_cast<std::size_t>(nodes.size());
    response_.resize(n * free_vertices_.size());
    compliance_.resize(n * n);
    for (std::size_t first = 0; first < n; first += 3) {  // solve for three nodes at a time, one per axis
      for (Vector3<>& m : step_) m.setZero();
      for (std::size_t a = 0; a < 3 && first + a < n; ++a)
        for (std::int32_t e = patches_.begin[first + a]; e < patches_.begin[first + a + 1]; ++e) {
          const std::int32_t k = free_index_[index(patches_.vertices[index(e)])];
          if (k >= 0) step_[index(k)][static_cast<int>(a)] += patches_.weights[index(e)];
        }
      factor_.solve(step_.data());
      for (std::size_t a = 0; a < 3 && first + a < n; ++a) {
        for (std::size_t k = 0; k < free_vertices_.size(); ++k)
          response_[(first + a) * free_vertices_.size() + k] = static_cast<float>(step_[k][static_cast<int>(a)]);
        for (std::size_t i = 0; i < n; ++i) {
          double sum = 0.0;
          for (std::int32_t e = patches_.begin[i]; e < patches_.begin[i + 1]; ++e) {
            const std::int32_t k = free_index_[index(patches_.vertices[index(e)])];
            if (k >= 0) sum += patches_.weights[index(e)] * step_[index(k)][static_cast<int>(a)];
          }
          compliance_[i * n + first + a] = static_cast<float>(sum);
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i)  // exactly symmetric
      for (std::size_t j = 0; j < i; ++j) compliance_[j * n + i] = compliance_[i * n + j];
  }

  /// Displacement from rest of node i's patch after its vertices moved by `step`, m.
  [[nodiscard]] Vector3<> patch_displacement(std::int32_t i, const std::vector<Vector3<>>& step) const noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (std::int32_t e = patches_.begin[index(i)]; e < patches_.begin[index(i) + 1]; ++e) {
      const std::size_t v = index(patches_.vertices[index(e)]);
      const std::int32_t k = free_index_[v];
      sum += patches_.weights[index(e)] * (position_[v] - network_.data().rest_positions[v]);
      if (k >= 0) sum += patches_.weights[index(e)] * step[index(k)];
    }
    return sum;
  }

  /// Apply `step_`, in which the external forces do `work` [J]. Shorten the step or reduce the velocity if energy would be gained.
  void apply_step(double work) noexcept {
    const double initial = energy(), rounding = 1e-13 * initial;
    double fraction = 1.0, applied = 0.0;  // of the step: target and already applied
    for (int halving = 0; halving <= 4; ++halving) {
      for (std::size_t k = 0; k < free_vertices_.size(); ++k) position_[index(free_vertices_[k])] += (fraction - applied) * step_[k];
      potential_ = network_.accumulate_forces(position_.data(), force_.data());
      const double allowed = initial + fraction * work;
      if (potential_ <= allowed + rounding || fraction == 0.0) {
        for (std::size_t k = 0; k < free_vertices_.size(); ++k) velocity_[k] = (fraction / period_) * step_[k];
        kinetic_ = kinetic();
        bool limited = fraction < 1.0;
        if (energy() > allowed + rounding && kinetic_ > 0.0) {
          limited = true;
          const double kinetic_fraction = std::max(allowed - potential_, 0.0) / kinetic_;
          for (Vector3<>& v : velocity_) v *= std::sqrt(kinetic_fraction);
          kinetic_ *= kinetic_fraction;
        }
        limited_steps_ += limited ? 1 : 0;
        return;
      }
      applied = fraction;
      fraction = halving < 3 ? 0.5 * fraction : 0.0;
    }
  }

  /// Predict the next step of the vertices without external forces.
  void predict() noexcept {
    for (std::size_t k = 0; k < free_vertices_.size(); ++k)
      free_step_[k] = (network_.data().masses[index(free_vertices_[k])] / period_) * velocity_[k] + force_[index(free_vertices_[k])];
    factor_.solve(free_step_.data());
  }

  [[nodiscard]] double kinetic() const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < free_vertices_.size(); ++k)
      sum += 0.5 * network_.data().masses[index(free_vertices_[k])] * velocity_[k].squaredNorm();
    return sum;
  }

  SpringNetwork network_;
  PatchWeights patches_;
  double period_ = 1e-3;                     // s
  std::vector<std::int32_t> free_vertices_;  // vertices that are not fixed
  std::vector<std::int32_t> free_index_;     // by vertex: its index in free_vertices_, or -1
  SupernodalCholesky factor_;
  std::vector<Vector3<>> inward_normals_;                   // by node
  std::vector<Eigen::Matrix<double, 3, 2>> tangent_bases_;  // by node
  std::vector<float> response_;                             // nodes x free vertices: displacement in a period per unit force, m/N
  std::vector<float> compliance_;                           // nodes x nodes, m/N
  std::vector<Vector3<>> position_;                         // of all vertices, m
  std::vector<Vector3<>> force_;                            // network forces on all vertices, N
  std::vector<Vector3<>> velocity_;                         // of the free vertices, m/s
  std::vector<Vector3<>> free_step_;                        // next step without external forces, m
  std::vector<Vector3<>> step_;                             // this step, m
  double potential_ = 0.0, kinetic_ = 0.0;
  long limited_steps_ = 0;
};

}  // namespace palpate::deformable
