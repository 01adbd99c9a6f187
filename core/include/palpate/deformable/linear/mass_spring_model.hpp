#pragma once

#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/contact_lcp.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/spring_kernels.hpp"
#include "palpate/deformable/linear/spring_network.hpp"
#include "palpate/math/supernodal_cholesky.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Distribution of a surface node's force over network vertices. The node's position is the mean of theirs with the same weights.
struct PatchWeights {
  std::vector<std::int32_t> begin;     ///< of each node in the two lists, n + 1
  std::vector<std::int32_t> vertices;  ///< network vertices
  std::vector<double> weights;
  std::vector<Matrix3<>> compliance;  ///< static, of each node by itself, m/N; a partial coverage of its patch divides it
};

/// Masses, springs and dampers on vertices. One period h moves the vertices by d,
///   (M / h^2 + a M / h + D / h) d = M v / h + F(x) + f,   D = b L' + C + h L / 2,   x + d -> x,   d / h -> v,
/// with the nonlinear network forces F, Rayleigh damping a (mass) and b (springs L'), the springs' own dampers C, and a constant upper
/// bound L of the network's stiffness. D is the same along each axis, so the matrix is factorized once.
///
/// From W(x + d) <= W(x) - F.d + d.L d / 2 follows for the total energy E, at any period and stiffness,
///   E(after) <= E(before) + f.d.
/// Springs satisfy this at any deformation: the tangent stiffness of their law is limited. Volume terms under large strain may be stiffer
/// than L. Each step is checked; a step that violates the inequality is shortened, or its velocity reduced. The cost is numerical damping:
/// L / 2 acts as a damper of L h / 2.
///
/// The factor is applied in single precision, so the solution is the change of the step from that of the last period,
///   d = h v + (M / h^2 + a M / h + D / h)^-1 (F(x) + f' - a M v - D v) + R (f - f'),
/// with the forces f' of the last period and the response R to a change. The check of each step covers its rounding error too.
class MassSpringModel {  // NOLINT(clang-analyzer-optin.performance.Padding): one object per body
 public:
  static constexpr double max_step = 2e-3;  ///< longest period of a look-ahead at two rates, s (LinearBodySolver)

  MassSpringModel() = default;

  /// `period` [s]; mass damping `alpha` [1/s] and stiffness damping `beta` [s] (of shear). `kernels` of this program by default.
  MassSpringModel(const SurfaceNodes& nodes, SpringNetworkData data, PatchWeights patches, double period, double alpha, double beta,
                  const SpringKernels& kernels = spring_kernels())
      : kernels_(&kernels), network_(std::move(data)), patches_(std::move(patches)), period_(period), alpha_(alpha) {
    const SpringNetworkData& p = network_.data();
    const std::size_t count = p.rest_positions.size();
    free_index_.assign(count, -1);
    for (std::size_t v = 0; v < count; ++v)
      if (!p.fixed[v]) {
        free_index_[v] = static_cast<std::int32_t>(free_vertices_.size());
        free_vertices_.push_back(static_cast<std::int32_t>(v));
      }
    position_.assign(count, PaddedVector(0.0));
    force_ = velocity_ = position_;
    step_.assign(free_vertices_.size(), PaddedVector(0.0));
    free_step_ = step_;
    // In an isotropic solid the springs hold a vertex five times as stiffly as its shear does.
    network_.set_damping(period_, 0.2 * beta);
    rounding_ = rounding_energy();
    const Eigen::SparseMatrix<double> system = system_matrix();
    factor_ = SupernodalCholesky(system);
    if (!factor_.positive_definite()) return;
    compute_response(nodes, system);
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      const Vector3<>& normal = inward_normals_.emplace_back(-nodes.normal(i));
      const auto& basis = tangent_bases_.emplace_back(nodes.tangent_basis(i));
      layer_.push_back(normal.dot(patches_.compliance[index(i)] * normal));
      tangential_layer_.emplace_back(basis.transpose() * patches_.compliance[index(i)] * basis);
    }
    force_change_.assign(inward_normals_.size(), Vector3<>::Zero());
    reset();
  }

  /// Whether the springs have a linear law; large displacements are nonlinear even so.
  [[nodiscard]] bool linear() const noexcept { return network_.data().law.kind == SpringLaw::Kind::linear; }
  /// False if a mass or volume is not positive.
  [[nodiscard]] bool definite() const noexcept { return factor_.positive_definite(); }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[index(i) * inward_normals_.size() + index(j)]) *
           inward_normals_[index(i)].dot(inward_normals_[index(j)]);
  }

  [[nodiscard]] double layer_compliance(std::int32_t i) const noexcept { return layer_[index(i)]; }
  [[nodiscard]] Eigen::Matrix2d tangential_layer(std::int32_t i) const noexcept { return tangential_layer_[index(i)]; }

  [[nodiscard]] double free_displacement(std::int32_t i) const noexcept { return inward_normals_[index(i)].dot(patch_displacement(i)); }

  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[index(i) * inward_normals_.size() + index(j)]) * tangent_bases_[index(i)].transpose() *
           tangent_bases_[index(j)];
  }

  [[nodiscard]] Eigen::Vector2d free_tangential_displacement(std::int32_t i) const noexcept {
    return tangent_bases_[index(i)].transpose() * patch_displacement(i);
  }

  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  /// `tangential` are forces in the nodes' tangent planes, or null. At most ContactLcp::capacity nodes.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* tangential, int count) noexcept {
    for (std::size_t c = 0; c < loads_; ++c) force_change_[index(load_[c].node)] = -load_[c].force;
    std::array<NodeLoad, max_loads> old = load_;
    const std::size_t old_count = loads_;
    loads_ = 0;
    for (int c = 0; c < count; ++c) {
      const Vector3<> force = node_force(nodes[c], forces[c], tangential == nullptr ? nullptr : tangential + c);
      force_change_[index(nodes[c])] += force;
      load_[loads_++] = {nodes[c], force};
    }
    columns_ = 0;
    for (std::size_t c = 0; c < loads_; ++c) take_change(load_[c].node);
    for (std::size_t c = 0; c < old_count; ++c) take_change(old[c].node);
    std::copy(free_step_.begin(), free_step_.end(), step_.begin());
    kernels_->add_columns(column_.data(), columns_, step_.data(), step_.size());
    double work = 0.0;
    for (std::size_t c = 0; c < loads_; ++c) {
      Vector3<> patch_step = Vector3<>::Zero();
      for_each_free_in_patch(load_[c].node, [&](std::size_t k, double weight) { patch_step += weight * vector(step_[k]); });
      work += load_[c].force.dot(patch_step);
    }
    apply_step(work);
    predict();
  }

  /// Adopt the state of the same body with another period.
  void take_state(const MassSpringModel& other) noexcept {
    position_ = other.position_;
    velocity_ = other.velocity_;
    restart();  // the dampers depend on the period
  }

  void reset() noexcept {
    for (std::size_t v = 0; v < position_.size(); ++v) position_[v] = padded(network_.data().rest_positions[v]);
    for (PaddedVector& v : velocity_) v = PaddedVector(0.0);
    limited_steps_ = 0;
    restart();
  }

  /// Set vertex `positions` [m] and `velocities` [m/s], one per vertex. Fixed vertices stay at the given position.
  void set_state(const Vector3<>* positions, const Vector3<>* velocities) noexcept {
    for (std::size_t v = 0; v < position_.size(); ++v) position_[v] = padded(positions[v]);
    for (const std::int32_t v : free_vertices_) velocity_[index(v)] = padded(velocities[v]);
    restart();
  }

  /// Kinetic and potential energy, J.
  [[nodiscard]] double energy() const noexcept { return kinetic_ + potential_; }
  /// Number of periods that were shortened or slowed to satisfy the energy inequality.
  [[nodiscard]] long limited_steps() const noexcept { return limited_steps_; }
  /// Whether tetrahedra are inverted: the forces then have no meaning (SpringNetwork::inverted).
  [[nodiscard]] bool inverted() const noexcept { return network_.inverted(); }
  [[nodiscard]] std::size_t vertices() const noexcept { return position_.size(); }
  /// Position of a vertex, m.
  [[nodiscard]] Vector3<> position(std::size_t vertex) const noexcept { return vector(position_[vertex]); }
  [[nodiscard]] std::size_t factor_entries() const noexcept { return factor_.nonzeros(); }

  /// Mean displacement of a node's patch, m.
  [[nodiscard]] Vector3<> displacement(std::int32_t i) const noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (std::int32_t e = patches_.begin[index(i)]; e < patches_.begin[index(i) + 1]; ++e) {
      const std::size_t v = index(patches_.vertices[index(e)]);
      sum += patches_.weights[index(e)] * (vector(position_[v]) - network_.data().rest_positions[v]);
    }
    return sum;
  }

 private:
  static constexpr std::size_t max_loads = static_cast<std::size_t>(ContactLcp::capacity);

  struct NodeLoad {
    std::int32_t node = 0;
    Vector3<> force = Vector3<>::Zero();  // N
  };

  static std::size_t index(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  /// Total force on a node, N.
  [[nodiscard]] Vector3<> node_force(std::int32_t node, double inward, const Eigen::Vector2d* tangential) const noexcept {
    Vector3<> force = inward * inward_normals_[index(node)];
    if (tangential != nullptr) force += tangent_bases_[index(node)] * *tangential;
    return force;
  }

  /// Call `visit(k, weight)` for the free vertices of a node's patch.
  template <class Visit>
  void for_each_free_in_patch(std::int32_t node, Visit visit) const {
    for (std::int32_t e = patches_.begin[index(node)]; e < patches_.begin[index(node) + 1]; ++e) {
      const std::int32_t k = free_index_[index(patches_.vertices[index(e)])];
      if (k >= 0) visit(index(k), patches_.weights[index(e)]);
    }
  }

  [[nodiscard]] double rounding_energy() const {
    double extent = 0.0;
    for (const Vector3<>& x : network_.data().rest_positions) extent = std::max(extent, x.cwiseAbs().maxCoeff());
    const double rounding = 4.0 * std::numeric_limits<double>::epsilon() * extent;
    return 0.5 * network_.stiffness_bound().diagonal().sum() * rounding * rounding;
  }

  [[nodiscard]] Eigen::SparseMatrix<double> system_matrix() const {
    std::vector<Eigen::Triplet<double>> entries;
    const Eigen::SparseMatrix<double> dampers = network_.damping_matrix();
    for (Eigen::Index c = 0; c < dampers.outerSize(); ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator e(dampers, c); e; ++e) {
        const std::int32_t i = free_index_[static_cast<std::size_t>(e.row())], j = free_index_[static_cast<std::size_t>(e.col())];
        if (i >= 0 && j >= 0) entries.emplace_back(i, j, e.value() / period_);
      }
    for (std::size_t k = 0; k < free_vertices_.size(); ++k) {
      const double inertia = network_.data().masses[index(free_vertices_[k])] * (1.0 / period_ + alpha_) / period_;
      entries.emplace_back(static_cast<int>(k), static_cast<int>(k), inertia);
    }
    const auto size = static_cast<Eigen::Index>(free_vertices_.size());
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
  }

  /// Solve for `x` with `right`, and once more for its residual: to double precision, nearly.
  void solve_twice(const Eigen::SparseMatrix<double>& system, const Eigen::MatrixX3d& right, Eigen::MatrixX3d& x) {
    x.setZero(right.rows(), 3);
    for (int pass = 0; pass < 2; ++pass) {
      const Eigen::MatrixX3d residual = right - system * x;
      for (Eigen::Index k = 0; k < right.rows(); ++k) step_[static_cast<std::size_t>(k)] = padded(residual.row(k));
      kernels_->solve(factor_, step_.data());
      for (Eigen::Index k = 0; k < right.rows(); ++k) x.row(k) += vector(step_[static_cast<std::size_t>(k)]).transpose();
    }
  }

  /// Compute the displacement of all vertices and nodes in a period per unit force on each node; the same along each axis.
  void compute_response(const SurfaceNodes& nodes, const Eigen::SparseMatrix<double>& system) {
    const auto n = static_cast<std::size_t>(nodes.size()), size = free_vertices_.size();
    response_.resize(n * size);
    compliance_.resize(n * n);
    Eigen::MatrixX3d right(static_cast<Eigen::Index>(size), 3), x;
    for (std::size_t first = 0; first < n; first += 3) {  // solve for three nodes at a time, one per axis
      right.setZero();
      const std::size_t axes = std::min<std::size_t>(3, n - first);
      for (std::size_t a = 0; a < axes; ++a)
        for_each_free_in_patch(static_cast<std::int32_t>(first + a), [&](std::size_t k, double weight) {
          right(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(a)) += weight;
        });
      solve_twice(system, right, x);
      for (std::size_t a = 0; a < axes; ++a) {
        const auto column = x.col(static_cast<Eigen::Index>(a));
        for (std::size_t k = 0; k < size; ++k) response_[(first + a) * size + k] = static_cast<float>(column[static_cast<Eigen::Index>(k)]);
        for (std::size_t i = 0; i < n; ++i) {
          double sum = 0.0;
          for_each_free_in_patch(static_cast<std::int32_t>(i),
                                 [&](std::size_t k, double weight) { sum += weight * column[static_cast<Eigen::Index>(k)]; });
          compliance_[i * n + first + a] = static_cast<float>(sum);
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i)  // exactly symmetric
      for (std::size_t j = 0; j < i; ++j) compliance_[j * n + i] = compliance_[i * n + j];
  }

  /// Displacement from rest of node i's patch at the end of the period without forces, m. The free step is that under the forces of the
  /// last period; the response to them is subtracted.
  [[nodiscard]] Vector3<> patch_displacement(std::int32_t i) const noexcept {
    Vector3<> sum = displacement(i);
    for_each_free_in_patch(i, [&](std::size_t k, double weight) { sum += weight * vector(free_step_[k]); });
    const float* row = compliance_.data() + index(i) * inward_normals_.size();
    for (std::size_t c = 0; c < loads_; ++c) sum -= static_cast<double>(row[index(load_[c].node)]) * load_[c].force;
    return sum;
  }

  /// Append the column of a node whose force changes, once.
  void take_change(std::int32_t node) noexcept {
    Vector3<>& change = force_change_[index(node)];
    if (change.isZero(0.0)) return;
    column_[columns_++] = {response_.data() + index(node) * free_vertices_.size(), padded(change)};
    change.setZero();
  }

  /// Apply `step_`, in which the external forces do `work` [J]. Shorten the step or reduce the velocity if energy would be gained.
  void apply_step(double work) noexcept {
    const double initial = energy(), rounding = 1e-13 * initial + rounding_;
    double fraction = 1.0, applied = 0.0;  // of the step: target and already applied
    for (int halving = 0; halving <= 4; ++halving) {
      const double move = fraction - applied, speed = fraction / period_;
      kinetic_ = 0.0;
      for (std::size_t k = 0; k < free_vertices_.size(); ++k) {
        const std::size_t v = index(free_vertices_[k]);
        position_[v] += move * step_[k];
        velocity_[v] = speed * step_[k];
        kinetic_ += kinetic(v);
      }
      potential_ = kernels_->accumulate_forces(network_, position_.data(), velocity_.data(), force_.data());
      const double allowed = initial + fraction * work;
      if (potential_ <= allowed + rounding || fraction == 0.0) {
        bool limited = fraction < 1.0;
        if (energy() > allowed + rounding && kinetic_ > 0.0) {
          limited = true;
          slow_down(std::max(allowed - potential_, 0.0) / kinetic_);
        }
        limited_steps_ += limited ? 1 : 0;
        return;
      }
      applied = fraction;
      fraction = halving < 3 ? 0.5 * fraction : 0.0;
    }
  }

  /// Reduce the velocities to a fraction of the kinetic energy.
  void slow_down(double kinetic_fraction) noexcept {
    for (const std::int32_t v : free_vertices_) velocity_[index(v)] *= std::sqrt(kinetic_fraction);
    kinetic_ *= kinetic_fraction;
    potential_ = kernels_->accumulate_forces(network_, position_.data(), velocity_.data(), force_.data());
  }

  /// Predict the next step of the vertices under the forces of the last period.
  void predict() noexcept {
    for (std::size_t c = 0; c < loads_; ++c)
      for_each_free_in_patch(load_[c].node,
                             [&](std::size_t k, double weight) { force_[index(free_vertices_[k])] += padded(weight * load_[c].force); });
    for (std::size_t k = 0; k < free_vertices_.size(); ++k) {
      const std::size_t v = index(free_vertices_[k]);
      free_step_[k] = force_[v] - (alpha_ * network_.data().masses[v]) * velocity_[v];
    }
    kernels_->solve(factor_, free_step_.data());
    for (std::size_t k = 0; k < free_vertices_.size(); ++k) free_step_[k] += period_ * velocity_[index(free_vertices_[k])];
  }

  /// Begin at the present positions and velocities, without external forces.
  void restart() noexcept {
    loads_ = 0;
    potential_ = kernels_->accumulate_forces(network_, position_.data(), velocity_.data(), force_.data());
    kinetic_ = 0.0;
    for (const std::int32_t v : free_vertices_) kinetic_ += kinetic(index(v));
    predict();
  }

  /// Kinetic energy of a vertex, J.
  [[nodiscard]] double kinetic(std::size_t vertex) const noexcept {
    const PaddedVector squared = velocity_[vertex] * velocity_[vertex];
    return 0.5 * network_.data().masses[vertex] * (squared[0] + squared[1] + squared[2]);
  }

  const SpringKernels* kernels_ = &spring_kernels();
  SpringNetwork network_;
  PatchWeights patches_;
  double period_ = 1e-3, alpha_ = 0.0;       // s, 1/s
  std::vector<std::int32_t> free_vertices_;  // vertices that are not fixed
  std::vector<std::int32_t> free_index_;     // by vertex: its index in free_vertices_, or -1
  SupernodalCholesky factor_;
  std::vector<Vector3<>> inward_normals_;                   // by node
  std::vector<Eigen::Matrix<double, 3, 2>> tangent_bases_;  // by node
  std::vector<double> layer_;                               // by node: static compliance along the normal, m/N
  std::vector<Eigen::Matrix2d> tangential_layer_;           // same in the tangent plane
  std::vector<float> response_;                             // nodes x free vertices: displacement in a period per unit force, m/N
  std::vector<float> compliance_;                           // nodes x nodes, m/N
  std::vector<PaddedVector> position_;                      // of all vertices, m
  std::vector<PaddedVector> force_;                         // of the network and its dampers on all vertices, N
  std::vector<PaddedVector> velocity_;                      // of all vertices, m/s
  std::vector<PaddedVector> free_step_;                     // of the free vertices: next step under the last forces, m
  std::vector<PaddedVector> step_;                          // of the free vertices: this step, m
  std::array<NodeLoad, max_loads> load_{};                  // of the last period
  std::size_t loads_ = 0;
  std::vector<Vector3<>> force_change_;                 // by node; zero between two periods
  std::array<ResponseColumn, 2 * max_loads> column_{};  // of the nodes whose force changes
  std::size_t columns_ = 0;
  double potential_ = 0.0, kinetic_ = 0.0;
  double rounding_ = 0.0;  // energy of the network by the rounding of its vertices' positions, J
  long limited_steps_ = 0;
};

}  // namespace palpate::deformable
