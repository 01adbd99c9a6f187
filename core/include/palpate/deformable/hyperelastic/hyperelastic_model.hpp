#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/conjugate_gradients.hpp"
#include "palpate/deformable/hyperelastic/two_level_preconditioner.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Tetrahedral mesh with Lame constants and Dirichlet conditions.
struct TetMesh {
  std::vector<Vector3<>> points;                        ///< rest positions, m
  std::vector<std::array<std::int32_t, 4>> tetrahedra;  ///< point indices; positive volume
  std::vector<double> shear, lame;                      ///< of each tetrahedron, Pa
  std::vector<bool> fixed;                              ///< by point: whether it does not move
};

/// Quasi-static hyperelastic body of linear tetrahedra under large deformation: energy, gradient, tangent, and Newton steps towards
/// equilibrium. `Material` is Corotational or NeoHookean; `lanes` tetrahedra are evaluated side by side.
///
/// Vectors have entry 3 x free node + axis; point_of() maps nodes to mesh points.
template <template <class> class Material, int lanes>
class HyperelasticModel {
 public:
  /// Report of a Newton step.
  struct Step {
    int solver_steps = 0;      ///< of conjugate gradients
    double step_length = 0.0;  ///< fraction of the Newton step taken, 0 to 1
    double residual = 0.0;     ///< load minus internal forces before the step, N
    bool indefinite = false;   ///< negative curvature was found in the tangent
  };

  explicit HyperelasticModel(const TetMesh& mesh) {
    const auto points = static_cast<std::int32_t>(mesh.points.size());
    std::vector<std::int32_t> number(mesh.points.size());
    for (const bool fixed : {false, true})
      for (std::int32_t p = 0; p < points; ++p)
        if (mesh.fixed[static_cast<std::size_t>(p)] == fixed) {
          number[static_cast<std::size_t>(p)] = static_cast<std::int32_t>(point_of_.size());
          point_of_.push_back(p);
          if (!fixed) ++free_count_;
        }
    std::vector<Vector3<>> positions;
    for (std::size_t i = 0; i < static_cast<std::size_t>(free_count_); ++i)
      positions.push_back(mesh.points[static_cast<std::size_t>(point_of_[i])]);
    std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
    pairs.reserve(static_cast<std::size_t>(free_count_) + 6 * mesh.tetrahedra.size());
    for (std::int32_t i = 0; i < free_count_; ++i) pairs.emplace_back(i, i);
    for (const auto& cell : mesh.tetrahedra)
      for (const std::int32_t p : cell)
        for (const std::int32_t q : cell) {
          const std::int32_t i = number[static_cast<std::size_t>(p)], j = number[static_cast<std::size_t>(q)];
          if (i < j && j < free_count_) pairs.emplace_back(i, j);
        }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    tangent_ = BlockMatrix(free_count_, pairs);
    preconditioner_ = TwoLevelPreconditioner(positions);
    const std::size_t cells = mesh.tetrahedra.size();
    groups_.resize((cells + lanes - 1) / lanes);
    for (std::size_t c = 0; c < groups_.size() * lanes; ++c) add_tetrahedron(mesh, number, std::min(c, cells - 1), c, c < cells);
    const std::size_t unknowns = 3 * static_cast<std::size_t>(free_count_), all = 3 * mesh.points.size();
    displacement_.assign(all, 0.0);
    trial_displacement_.assign(all, 0.0);
    gradient_.assign(unknowns, 0.0);
    trial_gradient_.assign(unknowns, 0.0);
    direction_.assign(unknowns, 0.0F);
    linear_residual_.assign(unknowns, 0.0F);
    direction_force_.assign(unknowns, 0.0F);
    solver_ = ConjugateGradients<float>(unknowns);
    reset();
  }

  [[nodiscard]] std::int32_t free_nodes() const noexcept { return free_count_; }
  [[nodiscard]] std::size_t unknowns() const noexcept { return gradient_.size(); }
  /// Mesh point of a node. Free nodes come first, then the fixed ones.
  [[nodiscard]] std::int32_t point_of(std::int32_t node) const noexcept { return point_of_[static_cast<std::size_t>(node)]; }
  [[nodiscard]] std::size_t nodes() const noexcept { return point_of_.size(); }
  [[nodiscard]] const double* displacement() const noexcept { return displacement_.data(); }  ///< of all nodes, m
  [[nodiscard]] const double* gradient() const noexcept { return gradient_.data(); }  ///< of the energy, i.e. the internal forces, N
  [[nodiscard]] double energy() const noexcept { return energy_; }                    ///< J
  [[nodiscard]] const BlockMatrix& tangent() const noexcept { return tangent_; }      ///< derivative of the internal forces, N/m
  [[nodiscard]] TwoLevelPreconditioner& preconditioner() noexcept { return preconditioner_; }

  /// Select the exact tangent, or one whose geometric stiffness is reduced per tetrahedron until it is positive semidefinite. Equilibria
  /// are not affected.
  void set_exact_tangent(bool exact) {
    exact_tangent_ = exact;
    evaluate_state();
  }

  /// Return to rest, with the exact tangent.
  void reset() {
    exact_tangent_ = true;
    set_displacement(std::vector<double>(displacement_.size(), 0.0).data());
    preconditioner_.update_coarse(tangent_);
    baseline_steps_ = 0;
  }

  /// Set the displacement [m] of all nodes, including fixed ones, and evaluate energy, gradient and tangent.
  void set_displacement(const double* displacement) {
    std::copy(displacement, displacement + displacement_.size(), displacement_.begin());
    std::copy(displacement_.begin(), displacement_.end(), trial_displacement_.begin());
    evaluate_state();
  }

  /// Take one Newton step towards equilibrium under `load` [N]. Solves to the relative `tolerance` (energy norm) or `max_steps` steps of
  /// conjugate gradients; the line search halves the step until the total potential decreases sufficiently. On negative curvature the
  /// tangent is made positive semidefinite per tetrahedron and the system solved again. `guess` [m] optionally starts the solver.
  Step step(const double* load, float tolerance, int max_steps, const float* guess = nullptr) {
    Step result;
    double square = 0.0;
    for (std::size_t k = 0; k < unknowns(); ++k) {
      const double r = load[k] - gradient_[k];
      square += r * r;
    }
    result.residual = std::sqrt(square);
    if (!(square > 0.0)) return result;
    if (baseline_steps_ > 0 && last_steps_ > 10 + baseline_steps_ + baseline_steps_ / 2) {
      preconditioner_.update_coarse(tangent_);
      baseline_steps_ = 0;
    }
    if (!compute_direction(load, tolerance, max_steps, guess, result)) {
      result.indefinite = true;
      evaluate(displacement_.data(), gradient_.data(), false);
      preconditioner_.update(tangent_);
      compute_direction(load, tolerance, max_steps, nullptr, result);
    } else {
      last_steps_ = result.solver_steps;
      if (baseline_steps_ == 0) baseline_steps_ = last_steps_;
    }
    double slope = 0.0, before = energy_;
    for (std::size_t k = 0; k < unknowns(); ++k) {
      slope += (gradient_[k] - load[k]) * static_cast<double>(direction_[k]);
      before -= load[k] * displacement_[k];
    }
    double length = 1.0;
    for (int halvings = 0; halvings < 12; ++halvings, length *= 0.5) {
      for (std::size_t k = 0; k < unknowns(); ++k) trial_displacement_[k] = displacement_[k] + length * static_cast<double>(direction_[k]);
      const double energy = evaluate(trial_displacement_.data(), trial_gradient_.data(), exact_tangent_);
      double after = energy;
      for (std::size_t k = 0; k < unknowns(); ++k) after -= load[k] * trial_displacement_[k];
      if (after <= before + 1e-4 * length * slope + energy_round_off_) {
        energy_ = energy;
        displacement_.swap(trial_displacement_);
        gradient_.swap(trial_gradient_);
        preconditioner_.update(tangent_);
        result.step_length = length;
        return result;
      }
    }
    evaluate_state();
    return result;
  }

 private:
  using Scalar = Pack<lanes>;

  /// `lanes` tetrahedra side by side.
  struct Group {
    std::array<std::array<std::int32_t, static_cast<std::size_t>(lanes)>, 4> node{};  // of each corner, ascending
    std::array<std::array<std::int32_t, static_cast<std::size_t>(lanes)>, 10>
        block{};                                    // index in the tangent of each pair of corners; -1: one is fixed
    std::array<Vector3<Scalar>, 3> shape_gradient;  // of the shape functions of corners 1 to 3, 1/m
    Scalar volume, shear, lame;                     // m^3, Pa, Pa
  };

  /// Index of the corners a <= b among the ten pairs.
  static constexpr std::size_t pair(std::size_t a, std::size_t b) noexcept { return a * (7 - a) / 2 + b; }

  void add_tetrahedron(const TetMesh& mesh, const std::vector<std::int32_t>& number, std::size_t cell, std::size_t at, bool is_used) {
    Group& group = groups_[at / lanes];
    const auto lane = static_cast<int>(at % lanes);
    const auto l = static_cast<std::size_t>(lane);
    auto corners = mesh.tetrahedra[cell];
    const auto of = [&](std::int32_t point) { return number[static_cast<std::size_t>(point)]; };
    std::sort(corners.begin(), corners.end(), [&](std::int32_t p, std::int32_t q) { return of(p) < of(q); });
    Eigen::Matrix3d edges;
    for (std::size_t c = 0; c < 4; ++c) {
      group.node[c][l] = of(corners[c]);
      if (c > 0)
        edges.col(static_cast<int>(c) - 1) =
            mesh.points[static_cast<std::size_t>(corners[c])] - mesh.points[static_cast<std::size_t>(corners[0])];
    }
    const Eigen::Matrix3d gradients = edges.inverse();  // one per row
    for (int c = 0; c < 3; ++c)
      for (int a = 0; a < 3; ++a) group.shape_gradient[static_cast<std::size_t>(c)][a].set(lane, gradients(c, a));
    const double volume = std::abs(edges.determinant()) / 6.0;
    group.volume.set(lane, is_used ? volume : 0.0);
    energy_round_off_ += 1e-14 * volume * (2.0 * mesh.shear[cell] + mesh.lame[cell]);
    group.shear.set(lane, mesh.shear[cell]);
    group.lame.set(lane, mesh.lame[cell]);
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = a; b < 4; ++b) {
        const std::int32_t i = group.node[a][l], j = group.node[b][l];
        group.block[pair(a, b)][l] = j < free_count_ ? static_cast<std::int32_t>(tangent_.block_index(i, j)) : -1;
      }
  }

  void evaluate_state() {
    energy_ = evaluate(displacement_.data(), gradient_.data(), exact_tangent_);
    preconditioner_.update(tangent_);
  }

  /// Compute the Newton direction. Return false if negative curvature was found.
  bool compute_direction(const double* load, float tolerance, int max_steps, const float* guess, Step& result) {
    for (std::size_t k = 0; k < unknowns(); ++k) linear_residual_[k] = static_cast<float>(load[k] - gradient_[k]);
    float limit = 0.0F, unused = 0.0F;
    preconditioner_.compute_norm(linear_residual_.data(), limit);
    if (guess != nullptr) {
      std::copy(guess, guess + unknowns(), direction_.begin());
      tangent_.multiply(direction_.data(), direction_force_.data(), unused);
      for (std::size_t k = 0; k < unknowns(); ++k) linear_residual_[k] -= direction_force_[k];
    } else {
      std::fill(direction_.begin(), direction_.end(), 0.0F);
    }
    const auto solved =
        solver_.solve(tangent_, preconditioner_, direction_.data(), linear_residual_.data(), tolerance * tolerance * limit, max_steps);
    result.solver_steps += solved.steps;
    return !solved.indefinite;
  }

  /// Evaluate energy [J], gradient and tangent at `displacement`; the tangent exact or positive semidefinite.
  double evaluate(const double* displacement, double* gradient, bool exact) noexcept {
    std::fill(gradient, gradient + unknowns(), 0.0);
    tangent_.set_zero();
    double energy = 0.0;
    for (const Group& group : groups_) {
      std::array<Vector3<Scalar>, 4> corner;
      for (std::size_t c = 0; c < 4; ++c)
        for (std::size_t a = 0; a < 3; ++a) {
          Scalar x;
          for (int l = 0; l < lanes; ++l)
            x.set(l, displacement[3 * static_cast<std::size_t>(group.node[c][static_cast<std::size_t>(l)]) + a]);
          corner[c][static_cast<int>(a)] = x;
        }
      Matrix3<Scalar> deformation;  // F = I + displacement gradient
      for (int a = 0; a < 3; ++a) {
        const Scalar x = corner[1][a] - corner[0][a], y = corner[2][a] - corner[0][a], z = corner[3][a] - corner[0][a];
        for (int b = 0; b < 3; ++b)
          deformation(a, b) = (x * group.shape_gradient[0][b] + y * group.shape_gradient[1][b]) + z * group.shape_gradient[2][b] +
                              Scalar(a == b ? 1.0 : 0.0);
      }
      const Material<Scalar> material(deformation, group.shear, group.lame);
      const Scalar geometric_fraction = exact ? Scalar(1.0) : material.psd_geometric_fraction();
      const Scalar stored = group.volume * material.energy();
      for (int l = 0; l < lanes; ++l) energy += stored[l];
      const Matrix3<Scalar> stress = material.stress() * group.volume;
      std::array<Vector3<Scalar>, 4> force;
      for (std::size_t c = 1; c < 4; ++c) force[c] = stress * group.shape_gradient[c - 1];
      force[0] = -((force[1] + force[2]) + force[3]);
      for (std::size_t c = 0; c < 4; ++c)
        for (int l = 0; l < lanes; ++l) {
          const std::int32_t node = group.node[c][static_cast<std::size_t>(l)];
          if (node >= free_count_) continue;
          for (int a = 0; a < 3; ++a) gradient[3 * static_cast<std::size_t>(node) + static_cast<std::size_t>(a)] += force[c][a][l];
        }
      // Blocks of corners 1 to 3; the blocks of corner 0 make the row sums zero.
      std::array<Matrix3<Scalar>, 10> block;
      for (std::size_t a = 1; a < 4; ++a)
        for (std::size_t b = a; b < 4; ++b)
          block[pair(a, b)] = material.tangent(group.shape_gradient[a - 1], group.shape_gradient[b - 1], geometric_fraction) * group.volume;
      const Matrix3<Scalar>&xy = block[pair(1, 2)], &xz = block[pair(1, 3)], &yz = block[pair(2, 3)];
      block[pair(0, 1)] = -((block[pair(1, 1)] + xy.transpose()) + xz.transpose());
      block[pair(0, 2)] = -((xy + block[pair(2, 2)]) + yz.transpose());
      block[pair(0, 3)] = -((xz + yz) + block[pair(3, 3)]);
      block[pair(0, 0)] = -((block[pair(0, 1)] + block[pair(0, 2)]) + block[pair(0, 3)]);
      for (std::size_t p = 0; p < block.size(); ++p) {
        std::array<float, 9 * static_cast<std::size_t>(lanes)> number;
        for (std::size_t k = 0; k < 9; ++k)
          store_float(block[p](static_cast<int>(k / 3), static_cast<int>(k % 3)), number.data() + k * lanes);
        for (std::size_t l = 0; l < lanes; ++l) {
          if (group.block[p][l] < 0) continue;
          float* to = tangent_.block(static_cast<std::size_t>(group.block[p][l]));
          for (std::size_t k = 0; k < 9; ++k) to[k] += number[k * lanes + l];
        }
      }
    }
    return energy;
  }

  bool exact_tangent_ = true;  // false: made positive semidefinite
  std::int32_t free_count_ = 0;
  std::vector<std::int32_t> point_of_;  // mesh point of each node, free nodes first
  std::vector<Group> groups_;
  BlockMatrix tangent_;
  TwoLevelPreconditioner preconditioner_;
  ConjugateGradients<float> solver_;
  double energy_ = 0.0;
  double energy_round_off_ = 0.0;            // J
  int last_steps_ = 0, baseline_steps_ = 0;  // solver steps: of the last solve, and of the first after the coarse matrix was updated
  std::vector<double> displacement_, trial_displacement_;             // of all nodes, m
  std::vector<double> gradient_, trial_gradient_;                     // N
  std::vector<float> direction_, linear_residual_, direction_force_;  // Newton direction, m; its linear residual and internal force, N
};

}  // namespace palpate::deformable
