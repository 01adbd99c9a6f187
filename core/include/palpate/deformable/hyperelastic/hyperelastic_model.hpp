#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/conjugate_gradients.hpp"
#include "palpate/deformable/hyperelastic/overstress.hpp"
#include "palpate/deformable/hyperelastic/smoothing_domains.hpp"
#include "palpate/deformable/hyperelastic/solver_options.hpp"
#include "palpate/deformable/hyperelastic/tet_mesh.hpp"
#include "palpate/deformable/hyperelastic/two_level_preconditioner.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// External forces that do not depend on the displacement, for HyperelasticModel::step().
struct DeadLoad {
  const double* load;  ///< N
  std::size_t unknowns;

  [[nodiscard]] const double* right_side() const noexcept { return load; }
  [[nodiscard]] const double* force() const noexcept { return load; }
  [[nodiscard]] const double* reference() const noexcept { return nullptr; }
  void add_stiffness(BlockMatrix& /*tangent*/) const noexcept {}
  [[nodiscard]] double energy(const double* displacement) const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < unknowns; ++k) sum -= load[k] * displacement[k];
    return sum;
  }
};

/// Quasi-static hyperelastic body of linear tetrahedra under large deformation: energy, gradient, tangent, and Newton steps towards
/// equilibrium. `Material` is Corotational or NeoHookean; `lanes` edges are evaluated side by side.
///
/// Selective edge- and node-based smoothing (Nguyen-Thoi, Liu, Vu-Do & Nguyen-Xuan 2009) avoids volumetric locking and reduces shear
/// locking. With the law psi(F; mu, lambda) = psi(F; mu, 0) + lambda/2 theta(F)^2, the energy is
///   sum_e V_e psi(F_e; mu_e, 0) + sum_i V_i lambda_i/2 theta_i^2,
/// where F_e is the mean deformation gradient around edge e, and theta_i the mean of theta(F_e) over the edges of node i, each of
/// similar moduli (SmoothingDomains). A negative lambda stays in the first sum, so the second one is convex in theta.
///
/// With relaxation the body is a standard linear solid (Overstress) in each edge domain, whose stress includes the pressure of its nodes.
/// Between begin_step() and end_step(), energies, forces and tangent are those of the potential of the step,
///   (weight + gain) W + sum_e V_e H_e : (F_e^T F_e - I) / 2,
/// with the energy W above. So an implicit step is a minimum, as an equilibrium is. The weight is 1 but for damping by the stiffness.
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

  explicit HyperelasticModel(const TetMesh& mesh, const Relaxation& relaxation = {}) : relaxation_(relaxation) {
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
    SmoothingDomains domains(mesh, number);
    energy_round_off_ = domains.energy_round_off;
    double volume = 0.0;
    for (const double v : domains.volume_of_node) volume += v;
    length_ = std::cbrt(volume);
    tangent_ = make_tangent(domains);
    preconditioner_ = TwoLevelPreconditioner(positions);
    add_groups(domains);
    volume_of_node_ = std::move(domains.volume_of_node);
    nodal_volume_ = std::move(domains.nodal_volume);
    nodal_lame_ = std::move(domains.nodal_lame);
    nodal_strain_.resize(nodal_volume_.size());
    if (relaxation_.enabled()) nodal_memory_.resize(nodal_volume_.size(), PressureMemory(0.0));
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
  /// Energy stored in the body, J: W, and with relaxation the energy of the overstress after the last step, as at small strains.
  [[nodiscard]] double energy() const noexcept { return elastic_energy_ + overstress_energy_; }
  [[nodiscard]] const BlockMatrix& tangent() const noexcept { return tangent_; }  ///< derivative of the internal forces, N/m
  [[nodiscard]] TwoLevelPreconditioner& preconditioner() noexcept { return preconditioner_; }
  [[nodiscard]] double volume_of_node(std::size_t node) const noexcept { return volume_of_node_[node]; }  ///< m^3

  /// Add a mass to the tangent, until the next evaluation.
  template <class External>
  void add_mass(const External& external) {
    external.add_mass(tangent_);
    preconditioner_.update(tangent_);
    if (is_coarse_old_) preconditioner_.update_coarse(tangent_);
    is_coarse_old_ = false;
  }

  [[nodiscard]] const Relaxation& relaxation() const noexcept { return relaxation_; }
  [[nodiscard]] double weight() const noexcept { return weight_; }  ///< of the elastic energy in the potential

  /// Begin a step of a duration [s] of a body with relaxation. With `fully_relaxed` the forces are those of the long term. `displacement`
  /// [m], of all nodes, is set first if given. `weight` of the elastic energy in the potential.
  void begin_step(double duration, const double* displacement = nullptr, double weight = 1.0) {
    if (relaxation_.enabled()) {
      relaxation_step_ = RelaxationStep(relaxation_, duration);
      for (Overstress<Scalar>& o : overstress_) o.begin_step(relaxation_step_);
      for (PressureMemory& m : nodal_memory_) m.begin_step(relaxation_step_);
    }
    begin(displacement, weight);
  }

  /// Take the forces and the tangent of equilibria, i.e. of the long term and without mass, at the present displacement.
  void begin_equilibrium() {
    if (relaxation_.enabled()) return begin_step(fully_relaxed);
    weight_ = 1.0;
    evaluate_state();
  }

  /// Begin stage 0 or 1 of a step of length h [s] of the Runge-Kutta method with `gamma` (BodyDynamics); the second one at the end of the
  /// first one. `displacement` and `weight` as in begin_step().
  void begin_stage(int stage, double gamma, double h, const double* displacement, double weight) {
    if (relaxation_.enabled()) {
      relaxation_step_ = RelaxationStep::stage(relaxation_, stage, gamma, h);
      for (std::size_t g = 0; g < groups_.size(); ++g)
        if (stage == 0)
          overstress_[g].begin_step(relaxation_step_);
        else
          overstress_[g].begin_second_stage(relaxation_step_, deformations_[g], materials_[g].stress());
      for (std::size_t i = 0; i < nodal_memory_.size(); ++i)
        if (stage == 0)
          nodal_memory_[i].begin_step(relaxation_step_);
        else
          nodal_memory_[i].begin_second_stage(relaxation_step_, nodal_pressure(i));
    }
    begin(displacement, weight);
  }

  /// Whether the potential of the step has a lower bound in each edge: its constant stress compresses less than the law resists a stretch.
  [[nodiscard]] bool is_bounded() const noexcept {
    for (std::size_t g = 0; g < overstress_.size(); ++g)
      if (any(overstress_[g].compression() >= Scalar(stiffness()) * Material<Scalar>::stretch_modulus(groups_[g].shear))) return false;
    return true;
  }

  /// Write the derivative of W, i.e. the internal forces of the long term, to the free nodes of `forces`, N.
  void elastic_forces(std::vector<double>& forces) noexcept {
    std::fill(forces.begin(), forces.end(), 0.0);
    for (std::size_t g = 0; g < groups_.size(); ++g) add_gradient(groups_[g], materials_[g].stress() * groups_[g].volume, forces.data());
  }

  /// Complete the step at the present displacement.
  void end_step() noexcept {
    if (!relaxation_.enabled()) return;
    overstress_energy_ = 0.0;
    const double ratio = relaxation_.instantaneous_ratio - 1.0;
    for (std::size_t i = 0; i < nodal_memory_.size(); ++i) {
      nodal_memory_[i].end_step(relaxation_step_, nodal_pressure(i));
      const double q = nodal_memory_[i].overstress;
      if (nodal_lame_[i] > 0.0) overstress_energy_ += 0.5 * nodal_volume_[i] * q * q / (ratio * nodal_lame_[i]);
    }
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Group& group = groups_[g];
      overstress_[g].end_step(relaxation_step_, deformations_[g], materials_[g].stress());
      const Scalar pressure = mean_of_ends(group, [this](std::size_t i) { return nodal_memory_[i].overstress; });
      const Scalar stored = group.volume * overstress_[g].stored(pressure, Scalar(ratio), group.shear, group.lame);
      for (int l = 0; l < lanes; ++l) overstress_energy_ += stored[l];
    }
  }

  /// Select the exact tangent, or one whose geometric stiffness is reduced per tetrahedron until it is positive semidefinite. Equilibria
  /// are not affected.
  void set_exact_tangent(bool exact) {
    exact_tangent_ = exact;
    evaluate_state();
  }

  /// Return to rest, with the exact tangent.
  void reset() {
    exact_tangent_ = true;
    for (Overstress<Scalar>& o : overstress_) o = {};
    for (PressureMemory& m : nodal_memory_) m = PressureMemory(0.0);
    overstress_energy_ = 0.0;
    relaxation_step_ = {};
    weight_ = 1.0;
    set_displacement(std::vector<double>(displacement_.size(), 0.0).data());
    preconditioner_.update_coarse(tangent_);
    baseline_steps_ = 0;
    is_coarse_old_ = true;
  }

  /// Norm of the internal forces below which they are rounding errors of the displacements, N.
  [[nodiscard]] double force_round_off() const noexcept { return stiffness() * energy_round_off_ / length_; }

  /// Set the displacement [m] of all nodes, including fixed ones, and evaluate energy, gradient and tangent.
  void set_displacement(const double* displacement) {
    std::copy(displacement, displacement + displacement_.size(), displacement_.begin());
    std::copy(displacement_.begin(), displacement_.end(), trial_displacement_.begin());
    evaluate_state();
  }

  /// Take one Newton step towards equilibrium with external forces. Solves to the relative `tolerance` (energy norm) or `max_steps` steps
  /// of conjugate gradients; the line search halves the step, up to `max_halvings` times, until the total potential decreases sufficiently.
  /// On negative curvature the tangent is made positive semidefinite per edge and the system solved again. `guess` [m] optionally starts
  /// the solver. The step length is zero if no step was found.
  ///
  /// `External` provides, for the present displacement (see DeadLoad, SurfaceContact),
  ///   const double* force()                          forces on the free nodes, N
  ///   const double* right_side()                     same, of the linear system
  ///   const double* reference()                      forces that `tolerance` refers to; null: the right side minus the internal forces
  ///   void add_stiffness(BlockMatrix&)               positive semidefinite stiffness of the linear system
  ///   double energy(const double* displacement)      potential, J
  ///   void add_mass(BlockMatrix&)                    optional: mass of the linear system
  template <class External>
  Step step(const External& external, float tolerance, int max_steps, const float* guess = nullptr, int max_halvings = 12) {
    Step result;
    double square = 0.0;
    for (std::size_t k = 0; k < unknowns(); ++k) {
      const double r = external.force()[k] - gradient_[k];
      square += r * r;
    }
    result.residual = std::sqrt(square);
    if (!(square > 0.0)) return result;
    constexpr bool has_mass = requires(BlockMatrix& matrix) { external.add_mass(matrix); };
    if constexpr (has_mass) {
      external.add_mass(tangent_);
      preconditioner_.update(tangent_);
    }
    if (baseline_steps_ > 0 && last_steps_ > 10 + baseline_steps_ + baseline_steps_ / 2) {
      if constexpr (has_mass)
        is_coarse_old_ = true;
      else
        preconditioner_.update_coarse(tangent_);
      baseline_steps_ = 0;
    }
    external.add_stiffness(tangent_);
    if (!compute_direction(external.right_side(), external.reference(), tolerance, max_steps, guess, result)) {
      result.indefinite = true;
      evaluate(displacement_.data(), gradient_.data(), false);
      external.add_stiffness(tangent_);
      if constexpr (has_mass) external.add_mass(tangent_);
      preconditioner_.update(tangent_);
      compute_direction(external.right_side(), external.reference(), tolerance, max_steps, nullptr, result);
    } else {
      last_steps_ = result.solver_steps;
      if (baseline_steps_ == 0) baseline_steps_ = last_steps_;
    }
    double slope = 0.0;
    for (std::size_t k = 0; k < unknowns(); ++k) slope += (gradient_[k] - external.force()[k]) * static_cast<double>(direction_[k]);
    const double before = potential_ + external.energy(displacement_.data());
    double length = 1.0;
    for (int halvings = 0; halvings < max_halvings; ++halvings, length *= 0.5) {
      for (std::size_t k = 0; k < unknowns(); ++k) trial_displacement_[k] = displacement_[k] + length * static_cast<double>(direction_[k]);
      const double potential = evaluate(trial_displacement_.data(), trial_gradient_.data(), exact_tangent_);
      if (potential + external.energy(trial_displacement_.data()) <=
          before + 1e-4 * length * std::min(slope, 0.0) + stiffness() * energy_round_off_) {
        potential_ = potential;
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

  using PressureMemory = StressMemory<double, double>;
  using Indices = std::array<std::int32_t, static_cast<std::size_t>(lanes)>;

  /// `lanes` edges side by side, with the same number of weights; the last edge is repeated without volume.
  struct Group {
    std::size_t weights = 0;        // number of nodes of each edge
    std::size_t first_weight = 0;   // in weights_
    std::size_t first_pair = 0;     // in pair_block_: pairs a <= b, by a
    std::array<Indices, 2> ends{};  // nodal volumes of the edges' ends
    Scalar volume, shear, lame;     // m^3, Pa, Pa
  };
  struct Weight {
    Indices node{};
    Vector3<Scalar> gradient;         // 1/m
    std::array<Indices, 2> factor{};  // index of the node in the tangent's factor rows of the two ends; -1: it is fixed
  };

  [[nodiscard]] BlockMatrix make_tangent(const SmoothingDomains& domains) const {
    std::vector<BlockMatrix::Pair> pairs, factors;
    std::vector<std::vector<std::int32_t>> above(static_cast<std::size_t>(free_count_)), around(domains.nodal_volume.size());
    for (const EdgeDomain& edge : domains.edges)
      for (const auto& a : edge.weights) {
        if (a.node >= free_count_) continue;
        for (const std::int32_t end : {edge.ends.first, edge.ends.second}) around[static_cast<std::size_t>(end)].push_back(a.node);
        for (const auto& b : edge.weights)
          if (a.node <= b.node && b.node < free_count_) above[static_cast<std::size_t>(a.node)].push_back(b.node);
      }
    for (std::int32_t i = 0; i < free_count_; ++i) above[static_cast<std::size_t>(i)].push_back(i);
    append_rows(above, pairs);
    append_rows(around, factors);
    return {free_count_, pairs, factors};
  }

  static void append_rows(std::vector<std::vector<std::int32_t>>& rows, std::vector<BlockMatrix::Pair>& to) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      std::sort(rows[i].begin(), rows[i].end());
      rows[i].erase(std::unique(rows[i].begin(), rows[i].end()), rows[i].end());
      for (const std::int32_t j : rows[i]) to.emplace_back(static_cast<std::int32_t>(i), j);
    }
  }

  void add_groups(const SmoothingDomains& domains) {
    for (std::size_t from = 0, to = 0; from < domains.edges.size(); from = to) {
      const std::size_t size = domains.edges[from].weights.size();
      while (to < domains.edges.size() && to < from + lanes && domains.edges[to].weights.size() == size) ++to;
      Group& group = groups_.emplace_back();
      group.weights = size;
      group.first_weight = weights_.size();
      group.first_pair = pair_block_.size();
      weights_.resize(weights_.size() + size);
      pair_block_.resize(pair_block_.size() + size * (size + 1) / 2);
      for (int lane = 0; lane < lanes; ++lane)
        add_edge(domains.edges[std::min(from + static_cast<std::size_t>(lane), to - 1)], group, lane,
                 from + static_cast<std::size_t>(lane) < to);
    }
    materials_.resize(groups_.size());
    if (relaxation_.enabled()) {
      deformations_.resize(groups_.size());
      overstress_.resize(groups_.size());
    }
    tangent_factors_.resize(groups_.empty() ? 0 : groups_.back().weights);
    images_.resize(tangent_factors_.size());
  }

  void add_edge(const EdgeDomain& edge, Group& group, int lane, bool is_used) {
    const auto l = static_cast<std::size_t>(lane);
    const std::array<std::int32_t, 2> ends{edge.ends.first, edge.ends.second};
    for (std::size_t e = 0; e < 2; ++e) group.ends[e][l] = ends[e];
    group.volume.set(lane, is_used ? edge.volume : 0.0);
    group.shear.set(lane, edge.shear);
    group.lame.set(lane, edge.lame);
    for (std::size_t a = 0, pair = group.first_pair; a < group.weights; ++a) {
      Weight& weight = weights_[group.first_weight + a];
      const std::int32_t i = weight.node[l] = edge.weights[a].node;
      for (int axis = 0; axis < 3; ++axis) weight.gradient[axis].set(lane, edge.weights[a].gradient[axis]);
      for (std::size_t e = 0; e < 2; ++e)
        weight.factor[e][l] = i < free_count_ ? static_cast<std::int32_t>(tangent_.factor_index(ends[e], i)) : -1;
      for (std::size_t b = a; b < group.weights; ++b) {
        const std::int32_t j = edge.weights[b].node;
        pair_block_[pair++][l] = j < free_count_ ? static_cast<std::int32_t>(tangent_.block_index(i, j)) : -1;
      }
    }
  }

  [[nodiscard]] double nodal_pressure(std::size_t i) const noexcept { return nodal_lame_[i] * nodal_strain_[i]; }  ///< Pa
  /// Mean of a value of nodes over the two ends of each edge.
  template <class Value>
  [[nodiscard]] static Scalar mean_of_ends(const Group& group, Value value) noexcept {
    Scalar mean;
    for (int l = 0; l < lanes; ++l) {
      const auto at = static_cast<std::size_t>(l);
      mean.set(l, 0.5 * (value(static_cast<std::size_t>(group.ends[0][at])) + value(static_cast<std::size_t>(group.ends[1][at]))));
    }
    return mean;
  }

  void begin(const double* displacement, double weight) {
    const bool is_old = relaxation_.enabled() || weight != weight_;
    weight_ = weight;
    if (displacement != nullptr)
      set_displacement(displacement);
    else if (is_old)
      evaluate_state();
  }

  /// Factor of the elastic energy in the potential.
  [[nodiscard]] double stiffness() const noexcept { return weight_ + relaxation_step_.gain; }

  void evaluate_state() {
    potential_ = evaluate(displacement_.data(), gradient_.data(), exact_tangent_);
    preconditioner_.update(tangent_);
  }

  /// Compute the Newton direction. Return false if negative curvature was found.
  bool compute_direction(const double* load, const double* reference, float tolerance, int max_steps, const float* guess, Step& result) {
    float limit = 0.0F, unused = 0.0F;
    for (std::size_t k = 0; k < unknowns(); ++k) linear_residual_[k] = static_cast<float>(load[k] - gradient_[k]);
    preconditioner_.compute_norm(linear_residual_.data(), limit);
    if (reference != nullptr) {
      float least = 0.0F;
      for (std::size_t k = 0; k < unknowns(); ++k) linear_residual_[k] = static_cast<float>(reference[k]);
      preconditioner_.compute_norm(linear_residual_.data(), least);
      limit = std::min(limit, least);
      for (std::size_t k = 0; k < unknowns(); ++k) linear_residual_[k] = static_cast<float>(load[k] - gradient_[k]);
    }
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

  /// Evaluate potential [J], gradient and tangent at `displacement`; the tangent exact or positive semidefinite.
  double evaluate(const double* displacement, double* gradient, bool exact) noexcept {
    double energy = evaluate_strains(displacement), constant = 0.0;
    for (std::size_t i = 0; i < nodal_strain_.size(); ++i)
      energy += 0.5 * nodal_volume_[i] * nodal_lame_[i] * nodal_strain_[i] * nodal_strain_[i];
    elastic_energy_ = energy;
    std::fill(gradient, gradient + unknowns(), 0.0);
    tangent_.set_zero();
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Group& group = groups_[g];
      Material<Scalar>& material = materials_[g];
      material.add_pressure(mean_of_ends(group, [this](std::size_t i) { return nodal_pressure(i); }));
      Matrix3<Scalar> stress = material.stress() * (group.volume * Scalar(stiffness()));
      if (relaxation_.enabled()) {
        stress += overstress_[g].stress(deformations_[g]) * group.volume;
        const Scalar potential = group.volume * overstress_[g].potential(deformations_[g]);
        for (int l = 0; l < lanes; ++l) constant += potential[l];
        for (std::size_t a = 0; a < group.weights; ++a)
          images_[a] = overstress_[g].image(weights_[group.first_weight + a].gradient, exact) * group.volume;
      }
      add_gradient(group, stress, gradient);
      add_tangent(group, material, exact ? Scalar(1.0) : material.psd_geometric_fraction());
      add_factors(group, material);
    }
    return stiffness() * energy + constant;
  }

  /// Evaluate the materials and the mean volume strain of each node. Return the energy of the edges, J.
  double evaluate_strains(const double* displacement) noexcept {
    std::fill(nodal_strain_.begin(), nodal_strain_.end(), 0.0);
    double energy = 0.0;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Group& group = groups_[g];
      Matrix3<Scalar> deformation = Matrix3<Scalar>::Identity();
      for (std::size_t a = 0; a < group.weights; ++a) {
        const Weight& weight = weights_[group.first_weight + a];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          Scalar u;
          for (int l = 0; l < lanes; ++l)
            u.set(l, displacement[3 * static_cast<std::size_t>(weight.node[static_cast<std::size_t>(l)]) + axis]);
          for (int b = 0; b < 3; ++b) deformation(static_cast<int>(axis), b) += u * weight.gradient[b];
        }
      }
      materials_[g] = Material<Scalar>(deformation, group.shear, group.lame);
      if (relaxation_.enabled()) deformations_[g] = deformation;
      const Scalar stored = group.volume * materials_[g].energy(), change = (Scalar(0.5) * group.volume) * materials_[g].volume_strain();
      for (int l = 0; l < lanes; ++l) {
        energy += stored[l];
        for (const Indices& end : group.ends) nodal_strain_[static_cast<std::size_t>(end[static_cast<std::size_t>(l)])] += change[l];
      }
    }
    for (std::size_t i = 0; i < nodal_strain_.size(); ++i)
      if (nodal_volume_[i] > 0.0) nodal_strain_[i] /= nodal_volume_[i];
    return energy;
  }

  /// `stress` is that of the group times its volume.
  void add_gradient(const Group& group, const Matrix3<Scalar>& stress, double* gradient) noexcept {
    for (std::size_t a = 0; a < group.weights; ++a) {
      const Weight& weight = weights_[group.first_weight + a];
      const Vector3<Scalar> force = stress * weight.gradient;
      for (int l = 0; l < lanes; ++l) {
        const std::int32_t node = weight.node[static_cast<std::size_t>(l)];
        if (node >= free_count_) continue;
        for (int axis = 0; axis < 3; ++axis)
          gradient[3 * static_cast<std::size_t>(node) + static_cast<std::size_t>(axis)] += force[axis][l];
      }
    }
  }

  /// Add the tangent at constant nodal pressures.
  void add_tangent(const Group& group, const Material<Scalar>& material, Scalar geometric_fraction) noexcept {
    for (std::size_t a = 0; a < group.weights; ++a)
      tangent_factors_[a] = material.tangent_factor(weights_[group.first_weight + a].gradient);
    const Scalar volume = group.volume * Scalar(stiffness());
    for (std::size_t a = 0, pair = group.first_pair; a < group.weights; ++a) {
      for (std::size_t b = a; b < group.weights; ++b, ++pair) {
        Matrix3<Scalar> block = material.tangent(tangent_factors_[a], tangent_factors_[b], geometric_fraction) * volume;
        if (relaxation_.enabled()) {
          const Scalar diagonal = images_[a].dot(weights_[group.first_weight + b].gradient);
          for (int i = 0; i < 3; ++i) block(i, i) += diagonal;
        }
        std::array<float, static_cast<std::size_t>(lanes)> number;
        std::array<std::array<float, 9>, static_cast<std::size_t>(lanes)> by_lane;
        for (std::size_t k = 0; k < 9; ++k) {
          store_float(block(static_cast<int>(k / 3), static_cast<int>(k % 3)), number.data());
          for (std::size_t l = 0; l < lanes; ++l) by_lane[l][k] = number[l];
        }
        for (std::size_t l = 0; l < lanes; ++l) {
          if (pair_block_[pair][l] < 0) continue;
          float* to = tangent_.block(static_cast<std::size_t>(pair_block_[pair][l]));
          for (std::size_t k = 0; k < 9; ++k) to[k] += by_lane[l][k];
        }
      }
    }
  }

  /// Add the change of the nodal pressures to the tangent, in factor form: row i is sqrt(lambda_i V_i) times the derivative of theta_i.
  void add_factors(const Group& group, const Material<Scalar>& material) noexcept {
    std::array<Scalar, 2> scale;
    for (std::size_t e = 0; e < 2; ++e)
      for (int l = 0; l < lanes; ++l) {
        const auto i = static_cast<std::size_t>(group.ends[e][static_cast<std::size_t>(l)]);
        scale[e].set(l, std::sqrt(stiffness() * nodal_lame_[i] / nodal_volume_[i]));
      }
    const Matrix3<Scalar> change = material.volume_strain_gradient() * (Scalar(0.5) * group.volume);
    for (std::size_t a = 0; a < group.weights; ++a) {
      const Weight& weight = weights_[group.first_weight + a];
      const Vector3<Scalar> values = change * weight.gradient;
      for (std::size_t e = 0; e < 2; ++e)
        for (int l = 0; l < lanes; ++l) {
          const std::int32_t at = weight.factor[e][static_cast<std::size_t>(l)];
          if (at < 0) continue;
          float* to = tangent_.factor(static_cast<std::size_t>(at));
          for (int axis = 0; axis < 3; ++axis) to[axis] += static_cast<float>(scale[e][l] * values[axis][l]);
        }
    }
  }

  bool exact_tangent_ = true;   // false: made positive semidefinite
  bool is_coarse_old_ = false;  // whether add_mass() updates the coarse matrix of the preconditioner
  std::int32_t free_count_ = 0;
  std::vector<std::int32_t> point_of_;  // mesh point of each node, free nodes first
  std::vector<Group> groups_;
  std::vector<Weight> weights_;
  std::vector<Indices> pair_block_;                                        // index in the tangent; -1: a node is fixed
  std::vector<Material<Scalar>> materials_;                                // by group, at the last evaluated displacement
  std::vector<typename Material<Scalar>::TangentFactor> tangent_factors_;  // workspace, by weight of a group
  std::vector<double> volume_of_node_;                                     // m^3
  std::vector<double> nodal_volume_, nodal_lame_, nodal_strain_;           // by nodal volume: m^3, Pa, and mean volume strain
  BlockMatrix tangent_;
  TwoLevelPreconditioner preconditioner_;
  ConjugateGradients<float> solver_;
  Relaxation relaxation_;
  RelaxationStep relaxation_step_;              // of the potential
  double weight_ = 1.0;                         // same, of the elastic energy
  std::vector<Matrix3<Scalar>> deformations_;   // by group, with relaxation: F at the last evaluated displacement
  std::vector<Overstress<Scalar>> overstress_;  // same
  std::vector<PressureMemory> nodal_memory_;    // by nodal volume, with relaxation: for the energy of the overstress
  std::vector<Vector3<Scalar>> images_;         // workspace, by weight of a group: constant stress times gradient and volume
  double potential_ = 0.0;                      // of the step at the displacement, J
  double elastic_energy_ = 0.0;                 // W at the last evaluated displacement, J
  double overstress_energy_ = 0.0;              // after the last step, J
  double energy_round_off_ = 0.0;               // J
  double length_ = 1.0;                         // of a cube of the body's volume, m
  int last_steps_ = 0, baseline_steps_ = 0;     // solver steps: of the last solve, and of the first after the coarse matrix was updated
  std::vector<double> displacement_, trial_displacement_;             // of all nodes, m
  std::vector<double> gradient_, trial_gradient_;                     // N
  std::vector<float> direction_, linear_residual_, direction_force_;  // Newton direction, m; its linear residual and internal force, N
};

}  // namespace palpate::deformable
