#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/hyperelastic/body_dynamics.hpp"
#include "palpate/deformable/hyperelastic/compliance_column_cache.hpp"
#include "palpate/deformable/hyperelastic/compliance_extrapolation.hpp"
#include "palpate/deformable/hyperelastic/contact_compliance.hpp"
#include "palpate/deformable/hyperelastic/hyperelastic_model.hpp"
#include "palpate/deformable/hyperelastic/solver_options.hpp"
#include "palpate/deformable/hyperelastic/surface_contact.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/deformable/multirate/local_model_contact.hpp"

namespace palpate::deformable {

/// Model update of a hyperelastic body under up to two tips, at a low rate. The displacements minimize the energy of the body and of the
/// elastic layer between its surface and the tips (SurfaceContact). Each step takes one Newton step towards that minimum, and linearizes
/// the body there to the next local model.
///
/// The Newton step takes the contact where the last local model moves to. If that does not reduce the energy, it takes it where it is.
///
/// The compliance of the local model is that of the tangent stiffness at the nodes near the tips. Under large indentation the equilibrium
/// may be stable under displacement control but unstable under force control; the tangent is then indefinite, and near that state its
/// compliance is unbounded. When the energy recoverable by the linear model exceeds twice the stored energy, which the energy tank could
/// not supply (PassiveModelSwitch), the tangent is made positive semidefinite until the stored energy falls below 0.7 of its value then.
/// Nodes farther out, which a fast tip may reach before the next model arrives, have no columns (see ComplianceExtrapolation).
///
/// With inertia (SolverOptions::inertia) each step advances the motion (BodyDynamics) to the time of its tips, which set_clock() tells. The
/// servo uses the next local model one to two update intervals later: the body is linearized about its state then, under the present tips,
/// with the compliance that inertia leaves it by then.
///
/// With relaxation (SolverOptions::relaxation) each step is an implicit step of the overstress to the time of its tips, by the same Newton
/// step; with inertia, by the stages of BodyDynamics. The local model has the compliance and the residual motion of a further step under
/// the present tips, to the time of its use.
///
/// A state with inverted tetrahedra has no meaning, and its tangent may have any compliance. The last local model stays until they have
/// turned back. The same holds for an overstress that compresses a tetrahedron more than the law resists: its potential has no minimum.
template <template <class> class Material, int lanes>
class QuasiStaticSolver {
 public:
  struct Report {
    double relative_residual = 0.0;  ///< force imbalance before the step, relative to the forces of the tips
    typename HyperelasticModel<Material, lanes>::Step newton;
    ComplianceColumnCache::Report compliance;
  };

  QuasiStaticSolver(const TetMesh& mesh, TetSurface surface, const SolverOptions& options)
      : model_(mesh, options.relaxation),
        surface_(std::move(surface)),
        layered_(mesh.points, surface_.triangles, surface_.point, surface_.modulus),
        options_(options),
        points_(mesh.points),
        tetrahedra_(mesh.tetrahedra),
        guess_(model_.unknowns()),
        residual_force_(model_.unknowns()),
        columns_(model_.unknowns(), at(std::min(TipPair::max_tips * options.nodes_per_tip, LocalModel::max_inner))) {
    node_of_.resize(mesh.points.size());
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(mesh.points.size()); ++i)
      node_of_[static_cast<std::size_t>(model_.point_of(i))] = i;
    index_of_.assign(mesh.points.size(), -1);
    tips_contact_ = SurfaceContact(points_, layered_, node_of_, model_.free_nodes());
    next_.compliance_matrix.assign(static_cast<std::size_t>(LocalModel::capacity) * LocalModel::capacity, 0.0);
    current_ = next_;
    if (options.contact_compliance) contact_compliance_ = ContactCompliance(model_.unknowns());
    if (options.inertia.density > 0.0) {
      std::vector<double> mass;
      for (std::size_t i = 0; i < at(model_.free_nodes()); ++i) mass.push_back(options.inertia.density * model_.volume_of_node(i));
      dynamics_ = BodyDynamics(options.inertia, std::move(mass), model_.nodes());
      dynamic_force_.resize(model_.unknowns());
      elastic_force_.resize(model_.unknowns());
    }
  }

  [[nodiscard]] const HyperelasticModel<Material, lanes>& model() const noexcept { return model_; }
  /// Displacement of all mesh points [m], 3 x point + axis.
  void displacement(double* to) const noexcept {
    for (std::size_t point = 0; point < node_of_.size(); ++point)
      std::copy_n((dynamics_.enabled() ? dynamics_.displacement().data() : model_.displacement()) + 3 * at(node_of_[point]), 3,
                  to + 3 * point);
  }
  [[nodiscard]] const LocalModel& local_model() const noexcept { return current_; }
  /// Outward normal of the surface at the contact node that is nearest to a place [m] in the present state.
  [[nodiscard]] Vector3<> normal_near(const Vector3<>& place) const {
    std::int32_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(surface_.point.size()); ++i) {
      const double square = (rest(i) + displacement_of(i) - place).squaredNorm();
      if (square >= least) continue;
      nearest = i;
      least = square;
    }
    return normal(nearest);
  }
  /// Energy of the body and its layer after the last step, kinetic energy included, J.
  [[nodiscard]] double energy() const noexcept {
    return dynamics_.enabled() ? state_energy_ : model_.energy() + tips_contact_.energy(model_.displacement());
  }

  /// Set the servo tick of the tips of the next step. Inertia and relaxation advance by the ticks since the last one.
  void set_clock(std::int64_t tick) noexcept { clock_ = tick; }
  /// Step towards equilibrium without inertia while `is_static`; the body is at rest and relaxed afterwards.
  void set_static(bool is_static) {
    is_static_ = is_static;
    if (dynamics_.enabled()) columns_.select({});  // with or without mass: a tenth of those of the other would remain
  }

  /// Take one step with the tips at their present positions. Write the next local model to `to`.
  Report step(const TipPair& tips, LocalModel& to) {
    Report report;
    tips_contact_.update_cones(tips, model_.displacement());
    tips_contact_.set_tips(tips);
    if (is_dynamic())
      advance(tips, report);
    else
      approach_equilibrium(tips, report);
    advanced_to_ = clock_;
    advanced_tips_ = tips;
    std::fill(tips_contact_.ahead().begin(), tips_contact_.ahead().end(), 0.0);
    tips_contact_.update_normals(model_.displacement());
    tips_contact_.linearize(model_.displacement());
    if (dynamics_.enabled() && is_static_) rest();
    if (options_.has_memory() && !is_dynamic()) state_energy_ = model_.energy() + tips_contact_.energy(model_.displacement());
    const bool is_balanced = relative_residual() < max_unbalanced;
    if (!is_dynamic()) model_.begin_step(horizon());
    next_.continued = tips_contact_.continued();
    next_.has_memory = options_.has_memory();
    next_.returnable = std::max(state_energy_, 0.0);  // not below by rounding
    if (has_inverted() || !model_.is_bounded()) {
      current_.inverted = true;
      current_.returnable = next_.returnable;
      ++current_.version;
      to = current_;
      return report;
    }
    select_column_nodes(tips);
    place_nodes(tips);
    if (!exact_tangent_ && model_.energy() < 0.7 * indefinite_energy_) set_exact_tangent(true);
    add_mass();
    report.compliance = columns_.refine(model_.tangent(), model_.preconditioner(), unit_forces_, column_index_, options_.compliance);
    linearize();
    const bool indefinite = report.newton.indefinite || report.compliance.indefinite;
    if (exact_tangent_ && (is_dynamic() ? indefinite : is_balanced && (indefinite || recoverable_energy() > 2.0 * model_.energy()))) {
      indefinite_energy_ = model_.energy();
      set_exact_tangent(false);
      add_mass();
      columns_.refine(model_.tangent(), model_.preconditioner(), unit_forces_, column_index_, options_.compliance);
      linearize();
    }
    find_contact_compliance();
    std::swap(current_, next_);
    to = current_;
    return report;
  }

  void reset() {
    model_.reset();
    exact_tangent_ = true;
    columns_.select({});
    contact_compliance_.reset();
    tips_contact_.reset();
    last_tips_ = TipPair{};
    const long version = current_.version;  // each model has its own
    current_ = LocalModel{};
    current_.version = version;
    current_.compliance_matrix.assign(next_.compliance_matrix.size(), 0.0);
    if (!options_.has_memory()) return;
    if (dynamics_.enabled()) rest();
    look_ahead_ = {};
    state_energy_ = 0.0;
    advanced_to_ = no_tick;
    clock_ = no_tick;
    is_static_ = false;
  }

 private:
  static constexpr double max_unbalanced = 0.05;        // relative residual above which a state does not show an indefinite tangent
  static constexpr double dynamic_tolerance = 1e-6;     // of a minimum of BodyDynamics: residual over the forces
  static constexpr double look_ahead_tolerance = 1e-3;  // same, of the look-ahead
  static constexpr int max_dynamic_steps = 8;           // Newton steps to such a minimum
  static constexpr std::int64_t no_tick = INT64_MIN;
  static constexpr double prediction_steps = 3.0;  // steps of tip motion ahead that the outer nodes cover

  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

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

  /// Time since the last step, s.
  [[nodiscard]] double elapsed() const noexcept {
    return advanced_to_ == no_tick || clock_ <= advanced_to_ ? 0.0 : static_cast<double>(clock_ - advanced_to_) * options_.tick_period;
  }
  /// Time to the tick at which the next local model is fully blended in, s.
  [[nodiscard]] double horizon() const noexcept { return (2.0 * options_.update_interval - 1.0) * options_.tick_period; }

  [[nodiscard]] bool is_dynamic() const noexcept { return dynamics_.enabled() && !is_static_; }

  /// Take a Newton step towards equilibrium.
  void approach_equilibrium(const TipPair& tips, Report& report) {
    model_.begin_step(is_static_ ? fully_relaxed : elapsed(), dynamics_.enabled() ? dynamics_.displacement().data() : nullptr);
    take_newton_step(tips, report);
    model_.end_step();
  }

  void take_newton_step(const TipPair& tips, Report& report) {
    tips_contact_.update_normals(model_.displacement());
    predict(tips);
    tips_contact_.linearize(model_.displacement());
    report.relative_residual = relative_residual();
    if (report.relative_residual <= 1e-6) return;
    report.newton = model_.step(tips_contact_, options_.newton_tolerance, options_.max_newton_steps, guess_.data(), 3);
    if (report.newton.step_length > 0.0) return;
    std::fill(tips_contact_.ahead().begin(), tips_contact_.ahead().end(), 0.0);
    tips_contact_.linearize(model_.displacement());
    report.newton = model_.step(tips_contact_, options_.newton_tolerance, options_.max_newton_steps);
  }

  /// Set the state of the motion: at rest at the present displacement.
  void rest() noexcept {
    model_.elastic_forces(elastic_force_);
    dynamics_.rest_at(model_.displacement(), elastic_force_.data());
  }

  /// Advance the motion to the clock, and look ahead.
  void advance(const TipPair& tips, Report& report) {
    const double h = elapsed();
    for (int stage = 0; stage < 2 && h > 0.0; ++stage) {
      tips_contact_.set_tips(stage == 0 ? between(advanced_tips_, tips, BodyDynamics::gamma) : tips);
      const BodyDynamics::Coefficients coefficients = dynamics_.begin_stage(stage, h, start_);
      model_.begin_stage(stage, BodyDynamics::gamma, h, stage == 0 ? start_.data() : nullptr, coefficients.weight);
      minimize(coefficients, dynamic_tolerance, report);
      model_.elastic_forces(elastic_force_);
      dynamics_.end_stage(stage, h, model_.displacement(), elastic_force_.data());
    }
    if (!(h > 0.0)) model_.begin_step(0.0, dynamics_.displacement().data());
    model_.end_step();
    tips_contact_.update_normals(model_.displacement());
    tips_contact_.linearize(model_.displacement());
    state_energy_ = model_.energy() + tips_contact_.energy(model_.displacement()) + dynamics_.kinetic_energy();
    const double damped = model_.weight() - 1.0;
    for (std::size_t k = 0; k < elastic_force_.size(); ++k) elastic_force_[k] = model_.gradient()[k] - damped * elastic_force_[k];
    look_ahead_ = dynamics_.begin_look_ahead(horizon(), tips_contact_.force(), elastic_force_.data());
    model_.begin_step(horizon(), nullptr, look_ahead_.weight);
    Report ahead;
    minimize(look_ahead_, look_ahead_tolerance, ahead);
    report.newton.indefinite = report.newton.indefinite || ahead.newton.indefinite;
  }

  /// Find the minimum of the dynamics from the present displacement.
  void minimize(BodyDynamics::Coefficients coefficients, double tolerance, Report& report) {
    DynamicForces forces(tips_contact_, dynamics_, coefficients, dynamic_force_);
    tips_contact_.update_normals(model_.displacement());
    for (int k = 0;; ++k) {
      forces.linearize(model_.displacement());
      double residual = 0.0, internal = 0.0;
      for (std::size_t i = 0; i < dynamic_force_.size(); ++i) {
        const double r = dynamic_force_[i] - model_.gradient()[i];
        residual += r * r;
        internal += model_.gradient()[i] * model_.gradient()[i];
      }
      const double scale = forces.norm() + std::sqrt(internal);
      report.relative_residual = std::sqrt(residual) > model_.force_round_off() ? std::sqrt(residual) / scale : 0.0;
      if (report.relative_residual <= tolerance || k == max_dynamic_steps) return;
      const auto step = model_.step(forces, 1e-3F, options_.max_newton_steps);
      report.newton.solver_steps += step.solver_steps;
      report.newton.indefinite = report.newton.indefinite || step.indefinite;
      if (k == 0) report.newton.residual = step.residual;
      if (step.step_length == 0.0) return;
    }
  }

  /// Add the mass of the look-ahead to the tangent.
  void add_mass() {
    if (is_dynamic()) model_.add_mass(DynamicForces(tips_contact_, dynamics_, look_ahead_, dynamic_force_));
  }

  /// Tips between two positions of theirs.
  [[nodiscard]] static TipPair between(const TipPair& from, const TipPair& to, double part) noexcept {
    TipPair out = to;
    for (std::size_t t = 0; t < at(std::min(from.count, to.count)); ++t) {
      const Vector3<> move = to.tip[t].center - from.tip[t].center;
      if (move.allFinite()) out.tip[t].center = from.tip[t].center + part * move;
    }
    return out;
  }

  /// Predict the motion of the contact nodes by the last local model, and the body's by its columns.
  void predict(const TipPair& tips) {
    std::vector<double>& ahead = tips_contact_.ahead();
    std::fill(ahead.begin(), ahead.end(), 0.0);
    std::fill(guess_.begin(), guess_.end(), 0.0F);
    if (current_.nodes.size() == 0 || current_.inverted) return;
    contact_.solve(current_, tips, 1.0);
    if (!contact_.last().solved) return;
    for (std::int32_t i = 0; i < current_.nodes.size(); ++i) {
      const std::int32_t id = current_.node_ids[at(i)], node = node_of_[at(surface_.point[at(id)])];
      Eigen::Map<Vector3<>>(ahead.data() + 3 * at(node)) = -contact_.displacement(at(i)) * current_.nodes.normal(i);
      const double change = contact_.force(at(i)) - current_.force[at(i)];
      if (change != 0.0 && columns_.has(id)) columns_.add(id, static_cast<float>(change), guess_.data());
    }
  }

  /// Norm of the forces of the tips minus the internal forces, relative to the former; infinite without contact.
  [[nodiscard]] double relative_residual() const {
    double residual = 0.0;
    for (std::size_t k = 0; k < model_.unknowns(); ++k) {
      const double r = tips_contact_.force()[k] - model_.gradient()[k];
      residual += r * r;
    }
    const double size = std::sqrt(residual);
    return size <= model_.force_round_off() ? 0.0 : size / tips_contact_.force_norm();
  }

  [[nodiscard]] const Vector3<>& rest(std::int32_t id) const { return points_[at(surface_.point[at(id)])]; }
  [[nodiscard]] Vector3<> displacement_of(std::int32_t id) const {
    return Eigen::Map<const Vector3<>>(model_.displacement() + 3 * at(node_of_[at(surface_.point[at(id)])]));
  }

  [[nodiscard]] Vector3<> position(std::int32_t point) const {
    return points_[static_cast<std::size_t>(point)] +
           Eigen::Map<const Vector3<>>(model_.displacement() + 3 * static_cast<std::size_t>(node_of_[static_cast<std::size_t>(point)]));
  }

  [[nodiscard]] bool has_inverted() const {
    return std::any_of(tetrahedra_.begin(), tetrahedra_.end(), [this](const std::array<std::int32_t, 4>& t) {
      const Vector3<> a = position(t[0]);
      return !((position(t[1]) - a).cross(position(t[2]) - a).dot(position(t[3]) - a) > 0.0);
    });
  }

  /// Outward normal of the deformed surface, area-weighted over the adjacent triangles.
  [[nodiscard]] Vector3<> normal(std::int32_t id) const {
    Vector3<> sum = Vector3<>::Zero();
    for (const std::size_t f : tips_contact_.triangles_around(node_of_[at(surface_.point[at(id)])])) {
      const auto& t = surface_.triangles[f];
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
        const Vector3<> place = rest(i) + displacement_of(i);
        double distance = std::min((place - now).squaredNorm(), (place - then).squaredNorm());
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
      const Vector3<> place = rest(i) + displacement_of(i);
      double distance = 1e300;
      for (int t = 0; t < tips.count; ++t) {
        const Vector3<>& now = tips.tip[static_cast<std::size_t>(t)].center;
        const Vector3<> motion = t < last_tips_.count
                                     ? Vector3<>(prediction_steps * (now - last_tips_.tip[static_cast<std::size_t>(t)].center))
                                     : Vector3<>::Zero();
        const double square = motion.squaredNorm(), part = square > 0.0 ? std::clamp((place - now).dot(motion) / square, 0.0, 1.0) : 0.0;
        distance = std::min(distance, (place - now - part * motion).squaredNorm());
      }
      by_distance_.emplace_back(distance, i);
    }
    const auto room = std::min(at(LocalModel::capacity) - column_nodes_.size(), by_distance_.size());
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

  /// Place the nodes and triangles of the next model. A node in contact moves along the force on it, others along the surface normal.
  void place_nodes(const TipPair& tips) {
    std::vector<Vector3<>> positions, normals;
    std::vector<double> areas;
    next_.node_ids.fill(0);
    next_.force.fill(0.0);
    unit_forces_.clear();
    for (std::size_t i = 0; i < model_nodes_.size(); ++i) {
      const std::int32_t id = model_nodes_[i], node = node_of_[at(surface_.point[at(id)])];
      next_.node_ids[i] = id;
      next_.displacement[i] = displacement_of(id);
      positions.push_back(rest(id) + next_.displacement[i]);
      normals.push_back(normal(id));
      areas.push_back(layered_.area(id));
      const Eigen::Map<const Vector3<>> force(tips_contact_.force() + 3 * at(node));
      next_.force[i] = force.norm();
      if (next_.force[i] > 0.0) normals.back() = -force / next_.force[i];
      for (std::size_t a = 0; a < 3; ++a)
        unit_forces_.entries.push_back({3 * at(node) + a, static_cast<float>(-normals.back()[static_cast<int>(a)])});
      unit_forces_.begin.push_back(unit_forces_.entries.size());
    }
    next_.nodes = SurfaceNodes(std::move(positions), std::move(normals), areas);
    place_triangles(tips);
  }

  /// Place the triangles around the nodes of the next model, by their distance from the tips.
  void place_triangles(const TipPair& tips) {
    for (std::size_t i = 0; i < model_nodes_.size(); ++i) index_of_[at(surface_.point[at(model_nodes_[i])])] = static_cast<std::int16_t>(i);
    by_distance_.clear();
    for (std::size_t f = 0; f < surface_.triangles.size(); ++f) {
      const auto& t = surface_.triangles[f];
      if (std::none_of(t.begin(), t.end(), [this](std::int32_t v) { return index_of_[at(v)] >= 0; })) continue;
      const Vector3<> center = (position(t[0]) + position(t[1]) + position(t[2])) / 3.0;
      double distance = 1e300;
      for (std::size_t k = 0; k < at(tips.count); ++k) distance = std::min(distance, (center - tips.tip[k].center).squaredNorm());
      by_distance_.emplace_back(distance, static_cast<std::int32_t>(f));
    }
    std::sort(by_distance_.begin(), by_distance_.end());
    triangles_.resize(std::min(by_distance_.size(), LocalTriangles::max_triangles));
    beyond_.assign(surface_.triangles.size(), true);
    for (std::size_t k = 0; k < triangles_.size(); ++k) {
      const std::int32_t f = by_distance_[k].second;
      triangles_[k] = {};
      triangles_[k].normal = tips_contact_.normal(f);
      triangles_[k].cones = tips_contact_.cones(f);
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int32_t v = surface_.triangles[at(f)][c];
        LocalTriangles::Corner& corner = triangles_[k].corner[c];
        corner.node = index_of_[at(v)];
        corner.position = position(v);
        corner.displacement = corner.position - points_[at(v)];
        const LayerCorner& layer = layered_.triangles()[at(f)].corner[c];
        if (corner.node < 0) {
          if (layer.exists()) triangles_[k].complete = false;
          continue;
        }
        corner.direction = -next_.nodes.normal(corner.node);
        corner.layer = layer;
      }
      beyond_[at(f)] = !triangles_[k].complete;
    }
    next_.truncated = tips_contact_.part_on(beyond_) > LocalModel::max_beyond;
    next_.triangles.assign(tips.count > 0 ? tips.tip[0].center : Vector3<>(Vector3<>::Zero()), triangles_);
    for (const std::int32_t id : model_nodes_) index_of_[at(surface_.point[at(id)])] = -1;
  }

  /// Compute compliance and residual displacement of the next local model.
  void linearize() {
    const std::size_t count = model_nodes_.size();
    const double* force = tips_contact_.force();
    if (is_dynamic()) {
      DynamicForces(tips_contact_, dynamics_, look_ahead_, dynamic_force_).linearize(model_.displacement());
      force = dynamic_force_.data();
    }
    for (std::size_t k = 0; k < model_.unknowns(); ++k) residual_force_[k] = static_cast<float>(force[k] - model_.gradient()[k]);
    columns_.project(unit_forces_, column_index_, residual_force_, next_.compliance_matrix.data(), LocalModel::capacity,
                     next_.residual_displacement.data());
    extrapolation_.complete(next_);
    for (std::size_t i = 0; i < count; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < count; ++j) sum += next_.compliance_matrix[i * LocalModel::capacity + j] * next_.force[j];
      next_.elastic_displacement[i] = sum;
    }
    next_.round();
    next_.inverted = false;
    next_.version = current_.version + 1;
  }

  /// Find the compliance of the contact as a whole in the long term, of the body without mass. The tangent is that of the long term then.
  void find_contact_compliance() {
    next_.contact_compliance.setZero();
    if (!options_.contact_compliance) return;
    loads_.clear();
    for (std::size_t i = 0; i < model_nodes_.size(); ++i)
      if (next_.force[i] > 0.0) loads_.emplace_back(at(node_of_[at(surface_.point[at(model_nodes_[i])])]), next_.force[i]);
    if (loads_.empty()) return;
    contact_compliance_.set_loads(loads_);
    if (options_.has_memory()) model_.begin_equilibrium();
    if (!contact_compliance_.refine(model_.tangent(), model_.preconditioner(), options_.compliance)) return;
    next_.contact_compliance = contact_compliance_.matrix();
  }

  HyperelasticModel<Material, lanes> model_;
  BodyDynamics dynamics_;
  BodyDynamics::Coefficients look_ahead_;                 // of the local model
  double state_energy_ = 0.0;                             // of the body with inertia or relaxation, J
  std::int64_t clock_ = no_tick, advanced_to_ = no_tick;  // ticks: of the next step, and of the last one
  TipPair advanced_tips_;                                 // of the last step
  bool is_static_ = false;
  std::vector<double> start_, dynamic_force_;  // workspaces, m and N
  std::vector<double> elastic_force_;          // workspace: forces of the body, N
  bool exact_tangent_ = true;                  // false: positive semidefinite tangent in use
  double indefinite_energy_ = 0.0;             // stored energy when the exact tangent was abandoned, J
  TetSurface surface_;
  LayeredSurface layered_;
  SurfaceContact tips_contact_;
  SolverOptions options_;
  std::vector<Vector3<>> points_;                        // rest positions, m
  std::vector<std::array<std::int32_t, 4>> tetrahedra_;  // mesh points
  std::vector<std::int32_t> node_of_;                    // node of each mesh point
  std::vector<std::int16_t> index_of_;                   // workspace: index in the local model by mesh point; -1: absent
  LocalModelContact contact_;
  std::vector<LocalTriangles::Triangle> triangles_;  // workspace
  std::vector<bool> beyond_;                         // workspace: triangles with contact nodes outside of the next model
  LocalModel current_, next_;
  std::vector<float> guess_, residual_force_;  // m, N
  std::vector<std::pair<double, std::int32_t>> by_distance_;
  std::vector<std::int32_t> column_nodes_, model_nodes_;  // ascending ids: nodes with columns, and all nodes of the next model
  std::vector<std::size_t> column_index_;                 // load vector of each column: indices of column_nodes_ in model_nodes_
  TipPair last_tips_;                                     // of the last step
  UnitForces unit_forces_;                                // along the inward normals of model_nodes_
  ComplianceColumnCache columns_;
  ContactCompliance contact_compliance_;
  std::vector<std::pair<std::size_t, double>> loads_;  // workspace of it
  ComplianceExtrapolation extrapolation_;
};

}  // namespace palpate::deformable
