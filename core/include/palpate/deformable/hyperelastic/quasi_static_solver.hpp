#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/hyperelastic/compliance_column_cache.hpp"
#include "palpate/deformable/hyperelastic/compliance_extrapolation.hpp"
#include "palpate/deformable/hyperelastic/hyperelastic_model.hpp"
#include "palpate/deformable/multirate/local_model.hpp"

namespace palpate::deformable {

/// Contact surface of a tetrahedral body: n nodes, the distribution of their forces over mesh points, and the surface triangles.
struct TetSurface {
  std::vector<std::int32_t> point;        ///< mesh point of each node, n
  std::vector<double> area;               ///< of the nodes' patches, n, m^2
  std::vector<std::int32_t> patch_begin;  ///< first entry of each node in patch_point and patch_weight, n + 1
  std::vector<std::int32_t> patch_point;  ///< mesh points
  std::vector<double> patch_weight;       ///< share of the node's force; also the weight of the point's displacement in the node's
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< mesh points, counterclockwise seen from outside
};

/// Effort of a step of QuasiStaticSolver.
struct SolverOptions {
  int nodes_per_tip = 32;         ///< nodes with compliance columns, nearest to each tip; at most LocalModel::max_inner in total
  float newton_tolerance = 0.1F;  ///< relative error of the Newton direction, in the energy norm
  int max_newton_steps = 60;      ///< of conjugate gradients per Newton step
  ComplianceColumnCache::RefineOptions compliance{};
};

/// Model update of a hyperelastic body under up to two tips, at a low rate. Each step solves the contact on the last local model, takes one
/// Newton step towards equilibrium under its forces, and linearizes there to the next local model.
///
/// The compliance of the local model is that of the tangent stiffness at the nodes near the tips. Under large indentation the equilibrium
/// may be stable under displacement control but unstable under force control; the tangent is then indefinite, and near that state its
/// compliance is unbounded. When the energy recoverable by the linear model exceeds twice the stored energy, which the energy tank could
/// not supply (PassiveModelSwitch), the tangent is made positive semidefinite until the stored energy falls below 0.7 of its value then.
/// Nodes farther out, which a fast tip may reach before the next model arrives, have no columns (see ComplianceExtrapolation).
template <template <class> class Material, int lanes>
class QuasiStaticSolver {
 public:
  struct Report {
    double relative_residual = 0.0;  ///< larger of force imbalance and force change since the last step, relative to the forces
    typename HyperelasticModel<Material, lanes>::Step newton;
    ComplianceColumnCache::Report compliance;
  };

  QuasiStaticSolver(const TetMesh& mesh, TetSurface surface, const SolverOptions& options)
      : model_(mesh),
        surface_(std::move(surface)),
        options_(options),
        points_(mesh.points),
        load_(model_.unknowns()),
        guess_(model_.unknowns()),
        residual_force_(model_.unknowns()),
        columns_(model_.unknowns(), static_cast<std::size_t>(std::min(TipPair::max_tips * options.nodes_per_tip, LocalModel::max_inner))) {
    node_of_.resize(mesh.points.size());
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(mesh.points.size()); ++i)
      node_of_[static_cast<std::size_t>(model_.point_of(i))] = i;
    triangles_of_point_.resize(mesh.points.size());
    for (std::size_t f = 0; f < surface_.triangles.size(); ++f)
      for (const std::int32_t p : surface_.triangles[f])
        triangles_of_point_[static_cast<std::size_t>(p)].push_back(static_cast<std::int32_t>(f));
    next_.compliance_matrix.assign(static_cast<std::size_t>(LocalModel::capacity) * LocalModel::capacity, 0.0);
    current_ = next_;
  }

  [[nodiscard]] const HyperelasticModel<Material, lanes>& model() const noexcept { return model_; }
  /// Displacement of all mesh points [m], 3 x point + axis.
  void displacement(double* to) const noexcept {
    for (std::size_t point = 0; point < node_of_.size(); ++point)
      std::copy_n(model_.displacement() + 3 * static_cast<std::size_t>(node_of_[point]), 3, to + 3 * point);
  }
  [[nodiscard]] const LocalModel& local_model() const noexcept { return current_; }
  [[nodiscard]] const LocalModelContact& contact() const noexcept { return contact_; }

  /// Take one step with the tips at their present positions. Write the next local model to `to`.
  Report step(const TipPair& tips, LocalModel& to) {
    Report report;
    contact_.solve(current_, tips, 1.0, contact_nodes_.data(), contact_count_);
    contact_count_ = contact_.last().nodes;
    std::copy(contact_.contact_nodes(), contact_.contact_nodes() + contact_count_, contact_nodes_.begin());
    collect_forces();
    const double change = force_change();
    const bool stalled = is_stalled(tips, change);
    assemble_load();
    const double residual = load_residual();
    report.relative_residual = std::max(residual, change);
    if (residual > 1e-5) report.newton = model_.step(load_.data(), options_.newton_tolerance, options_.max_newton_steps, guess_.data());
    select_column_nodes(tips);
    place_nodes(tips);
    if (!exact_tangent_ && model_.energy() < 0.7 * indefinite_energy_) set_exact_tangent(true);
    report.compliance = columns_.refine(model_.tangent(), model_.preconditioner(), unit_forces_, column_index_, options_.compliance);
    linearize();
    if (exact_tangent_ && (stalled || report.newton.indefinite || recoverable_energy() > 2.0 * model_.energy())) {
      indefinite_energy_ = model_.energy();
      set_exact_tangent(false);
      columns_.refine(model_.tangent(), model_.preconditioner(), unit_forces_, column_index_, options_.compliance);
      linearize();
    }
    std::swap(current_, next_);
    to = current_;
    return report;
  }

  void reset() {
    model_.reset();
    exact_tangent_ = true;
    columns_.select({});
    contact_count_ = 0;
    last_tips_ = TipPair{};
    current_ = LocalModel{};
    current_.compliance_matrix.assign(next_.compliance_matrix.size(), 0.0);
  }

 private:
  static constexpr int max_stalls = 6;
  static constexpr double prediction_steps = 3.0;  // steps of tip motion ahead that the outer nodes cover

  void set_exact_tangent(bool exact) {
    exact_tangent_ = exact;
    model_.set_exact_tangent(exact);
  }

  /// Energy that the next local model returns when its forces are removed, J.
  [[nodiscard]] double recoverable_energy() const noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < model_nodes_.size(); ++i) sum += 0.5 * next_.force[i] * next_.elastic_displacement[i];
    return sum;
  }

  /// Collect the contact forces by node of the current model.
  void collect_forces() {
    contact_force_.fill(0.0);
    for (int k = 0; k < contact_count_; ++k) {
      const auto end = current_.node_ids.begin() + current_.nodes.size();
      const auto at = std::lower_bound(current_.node_ids.begin(), end, contact_nodes_[static_cast<std::size_t>(k)]);
      contact_force_[static_cast<std::size_t>(at - current_.node_ids.begin())] = contact_.forces()[k];
      contact_tip_[static_cast<std::size_t>(at - current_.node_ids.begin())] = contact_.contact_tips()[k];
    }
  }

  /// Count the steps with tips at rest that hardly reduce the change of the forces. Return whether they are too many.
  bool is_stalled(const TipPair& tips, double change) {
    bool is_held = tips.count == last_tips_.count;
    for (std::size_t t = 0; is_held && t < static_cast<std::size_t>(tips.count); ++t)
      is_held = tips.tip[t].center == last_tips_.tip[t].center;
    stalls_ = !is_held ? 0 : stalls_ + (change > 1e-4 && change > 0.7 * last_change_ ? 1 : 0);
    last_change_ = change;
    return stalls_ > max_stalls;
  }

  /// Assemble the load of the contact forces along the last normals, and the initial guess: the column combination of the force change.
  void assemble_load() {
    std::fill(load_.begin(), load_.end(), 0.0);
    std::fill(guess_.begin(), guess_.end(), 0.0F);
    for (std::int32_t i = 0; i < current_.nodes.size(); ++i) {
      const auto n = static_cast<std::size_t>(i);
      add_load(current_.node_ids[n], -contact_force_[n] * current_.nodes.normal(i));
      const double change = contact_force_[n] - current_.force[n];
      if (change != 0.0 && columns_.has(current_.node_ids[n]))
        columns_.add(current_.node_ids[n], static_cast<float>(change), guess_.data());
    }
  }

  /// Norm of load minus internal forces, relative to the load; infinite without load.
  [[nodiscard]] double load_residual() const {
    double residual = 0.0, total = 0.0;
    for (std::size_t k = 0; k < load_.size(); ++k) {
      residual += (load_[k] - model_.gradient()[k]) * (load_[k] - model_.gradient()[k]);
      total += load_[k] * load_[k];
    }
    return residual == 0.0 ? 0.0 : std::sqrt(residual / total);  // NaN counts as not at equilibrium
  }

  /// Norm of the change of the contact forces against those of the current model, relative to the forces.
  [[nodiscard]] double force_change() const {
    double change = 0.0, total = 0.0;
    for (std::int32_t i = 0; i < current_.nodes.size(); ++i) {
      const auto n = static_cast<std::size_t>(i);
      change += (contact_force_[n] - current_.force[n]) * (contact_force_[n] - current_.force[n]);
      total += contact_force_[n] * contact_force_[n];
    }
    return change == 0.0 ? 0.0 : std::sqrt(change / total);
  }

  void add_load(std::int32_t id, const Vector3<>& force) {
    for_each_patch_point(id, [&](std::size_t k, double weight) {
      for (std::size_t a = 0; a < 3; ++a) load_[k + a] += weight * force[static_cast<int>(a)];
    });
  }

  /// Call visit(3 x free node, weight) for each free mesh point of the node's patch.
  template <class Visit>
  void for_each_patch_point(std::int32_t id, Visit visit) const {
    const auto n = static_cast<std::size_t>(id);
    for (std::int32_t s = surface_.patch_begin[n]; s < surface_.patch_begin[n + 1]; ++s) {
      const std::int32_t node = node_of_[static_cast<std::size_t>(surface_.patch_point[static_cast<std::size_t>(s)])];
      if (node < model_.free_nodes()) visit(3 * static_cast<std::size_t>(node), surface_.patch_weight[static_cast<std::size_t>(s)]);
    }
  }

  [[nodiscard]] Vector3<> patch_displacement(std::int32_t id) const {
    Vector3<> sum = Vector3<>::Zero();
    for_each_patch_point(id, [&](std::size_t k, double weight) { sum += weight * Eigen::Map<const Vector3<>>(model_.displacement() + k); });
    return sum;
  }

  [[nodiscard]] Vector3<> position(std::int32_t point) const {
    return points_[static_cast<std::size_t>(point)] +
           Eigen::Map<const Vector3<>>(model_.displacement() + 3 * static_cast<std::size_t>(node_of_[static_cast<std::size_t>(point)]));
  }

  /// Outward normal of the deformed surface, area-weighted over the adjacent triangles.
  [[nodiscard]] Vector3<> normal(std::int32_t id) const {
    Vector3<> sum = Vector3<>::Zero();
    for (const std::int32_t f : triangles_of_point_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(id)])]) {
      const auto& t = surface_.triangles[static_cast<std::size_t>(f)];
      const Vector3<> a = position(t[0]);
      sum += (position(t[1]) - a).cross(position(t[2]) - a);
    }
    const double length = sum.norm();
    return length > 0.0 ? Vector3<>(sum / length) : Vector3<>(Vector3<>::UnitZ());
  }

  /// Select the nodes nearest to the tips for compliance columns. Nodes that have one are preferred (hysteresis factor 0.8).
  void select_column_nodes(const TipPair& tips) {
    const auto n = static_cast<std::int32_t>(surface_.point.size());
    column_nodes_.clear();
    const int per_tip = std::min(options_.nodes_per_tip, LocalModel::max_inner / std::max(tips.count, 1));
    for (int t = 0; t < tips.count; ++t) {
      // Distance to the tip and to its linear extrapolation by one step.
      const Vector3<>&now = tips.tip[static_cast<std::size_t>(t)].center, &before = last_tips_.tip[static_cast<std::size_t>(t)].center;
      const Vector3<> then = t < last_tips_.count ? Vector3<>(2.0 * now - before) : now;
      by_distance_.clear();
      for (std::int32_t i = 0; i < n; ++i) {
        const Vector3<> at = points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(i)])] + patch_displacement(i);
        double distance = std::min((at - now).squaredNorm(), (at - then).squaredNorm());
        if (columns_.has(i)) distance *= 0.8;
        by_distance_.emplace_back(distance, i);
      }
      const auto chosen = std::min(static_cast<std::ptrdiff_t>(per_tip), static_cast<std::ptrdiff_t>(n));
      std::partial_sort(by_distance_.begin(), by_distance_.begin() + chosen, by_distance_.end());
      for (std::ptrdiff_t k = 0; k < chosen; ++k) column_nodes_.push_back(by_distance_[static_cast<std::size_t>(k)].second);
    }
    std::sort(column_nodes_.begin(), column_nodes_.end());
    column_nodes_.erase(std::unique(column_nodes_.begin(), column_nodes_.end()), column_nodes_.end());
    columns_.select(column_nodes_);
    select_outer_nodes(tips);
    last_tips_ = tips;
  }

  /// Fill the local model with the nodes nearest to the tips' extrapolated paths of a few steps.
  void select_outer_nodes(const TipPair& tips) {
    by_distance_.clear();
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(surface_.point.size()); ++i) {
      if (std::binary_search(column_nodes_.begin(), column_nodes_.end(), i)) continue;
      const Vector3<> at = points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(i)])] + patch_displacement(i);
      double distance = 1e300;
      for (int t = 0; t < tips.count; ++t) {
        const Vector3<>& now = tips.tip[static_cast<std::size_t>(t)].center;
        const Vector3<> motion = t < last_tips_.count
                                     ? Vector3<>(prediction_steps * (now - last_tips_.tip[static_cast<std::size_t>(t)].center))
                                     : Vector3<>::Zero();
        const double square = motion.squaredNorm(), part = square > 0.0 ? std::clamp((at - now).dot(motion) / square, 0.0, 1.0) : 0.0;
        distance = std::min(distance, (at - now - part * motion).squaredNorm());
      }
      by_distance_.emplace_back(distance, i);
    }
    const auto room = std::min(static_cast<std::size_t>(LocalModel::capacity) - column_nodes_.size(), by_distance_.size());
    std::partial_sort(by_distance_.begin(), by_distance_.begin() + static_cast<std::ptrdiff_t>(room), by_distance_.end());
    model_nodes_ = column_nodes_;
    for (std::size_t k = 0; k < room; ++k) model_nodes_.push_back(by_distance_[k].second);
    std::sort(model_nodes_.begin(), model_nodes_.end());
    column_index_.clear();
    for (std::size_t i = 0; i < model_nodes_.size(); ++i) {
      next_.inner[i] = std::binary_search(column_nodes_.begin(), column_nodes_.end(), model_nodes_[i]);
      if (next_.inner[i]) column_index_.push_back(i);
    }
  }

  /// Place the nodes of the next model. The direction of a contact node is that of the frictionless force: radial from a sphere's center,
  /// or along the rod's axis. Other nodes take the surface normal.
  void place_nodes(const TipPair& tips) {
    std::vector<Vector3<>> positions, normals;
    std::vector<double> areas;
    next_.node_ids.fill(0);
    next_.force.fill(0.0);
    for (std::size_t i = 0; i < model_nodes_.size(); ++i) {
      const std::int32_t id = model_nodes_[i];
      next_.node_ids[i] = id;
      next_.displacement[i] = patch_displacement(id);
      positions.push_back(points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(id)])] + next_.displacement[i]);
      normals.push_back(normal(id));
      areas.push_back(surface_.area[static_cast<std::size_t>(id)]);
      const auto end = current_.node_ids.begin() + current_.nodes.size();
      const auto at = std::lower_bound(current_.node_ids.begin(), end, id);
      if (at == end || *at != id) continue;
      const auto before = static_cast<std::size_t>(at - current_.node_ids.begin());
      next_.force[i] = contact_force_[before];
      if (!(contact_force_[before] > 0.0) || contact_tip_[before] >= tips.count) continue;
      const Tip& tip = tips.tip[static_cast<std::size_t>(contact_tip_[before])];
      const Vector3<> direction = tip.kind == Tip::Kind::sphere ? Vector3<>(tip.center - positions.back()) : tip.outward;
      if (direction.norm() > 0.1 * tip.radius) normals.back() = direction.normalized();
    }
    next_.nodes = SurfaceNodes(std::move(positions), std::move(normals), areas);
    unit_forces_.clear();
    for (std::size_t i = 0; i < model_nodes_.size(); ++i) {
      const Vector3<>& outward = next_.nodes.normal(static_cast<std::int32_t>(i));
      for_each_patch_point(next_.node_ids[i], [&](std::size_t k, double weight) {
        for (std::size_t a = 0; a < 3; ++a)
          unit_forces_.entries.push_back({k + a, static_cast<float>(-weight * outward[static_cast<int>(a)])});
      });
      unit_forces_.begin.push_back(unit_forces_.entries.size());
    }
  }

  /// Compute compliance and residual displacement of the next local model.
  void linearize() {
    const std::size_t count = model_nodes_.size();
    // Residual load with the forces along the new directions.
    std::fill(load_.begin(), load_.end(), 0.0);
    for (std::size_t i = 0; i < count; ++i) add_load(next_.node_ids[i], -next_.force[i] * next_.nodes.normal(static_cast<std::int32_t>(i)));
    for (std::size_t k = 0; k < load_.size(); ++k) residual_force_[k] = static_cast<float>(load_[k] - model_.gradient()[k]);
    columns_.project(unit_forces_, column_index_, residual_force_, next_.compliance_matrix.data(), LocalModel::capacity,
                     next_.residual_displacement.data());
    extrapolation_.complete(next_);
    for (std::size_t i = 0; i < count; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < count; ++j) sum += next_.compliance_matrix[i * LocalModel::capacity + j] * next_.force[j];
      next_.elastic_displacement[i] = sum;
    }
    next_.version = current_.version + 1;
  }

  HyperelasticModel<Material, lanes> model_;
  bool exact_tangent_ = true;       // false: positive semidefinite tangent in use
  double indefinite_energy_ = 0.0;  // stored energy when the exact tangent was abandoned, J
  int stalls_ = 0;                  // steps with tips at rest that hardly reduced the change of the forces
  double last_change_ = 0.0;        // of the contact forces in the last step, relative
  TetSurface surface_;
  SolverOptions options_;
  std::vector<Vector3<>> points_;                              // rest positions, m
  std::vector<std::int32_t> node_of_;                          // node of each mesh point
  std::vector<std::vector<std::int32_t>> triangles_of_point_;  // by mesh point
  LocalModelContact contact_;
  LocalModel current_, next_;
  int contact_count_ = 0;  // contact nodes
  std::array<std::int32_t, LocalModel::capacity> contact_nodes_{};
  std::array<double, LocalModel::capacity> contact_force_{};  // by node of the current model, N
  std::array<int, LocalModel::capacity> contact_tip_{};       // by node of the current model: tip in contact
  std::vector<double> load_;                                  // N
  std::vector<float> guess_, residual_force_;                 // m, N
  std::vector<std::pair<double, std::int32_t>> by_distance_;
  std::vector<std::int32_t> column_nodes_, model_nodes_;  // ascending ids: nodes with columns, and all nodes of the next model
  std::vector<std::size_t> column_index_;                 // indices of column_nodes_ in model_nodes_
  TipPair last_tips_;                                     // of the last step
  UnitForces unit_forces_;                                // along the inward normals of model_nodes_
  ComplianceColumnCache columns_;
  ComplianceExtrapolation extrapolation_;
};

}  // namespace palpate::deformable
