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

/// The part of a solid's surface that can be touched: n nodes, how a force on each is shared among the mesh's points, and its triangles.
struct TetSurface {
  std::vector<std::int32_t> point;                     ///< of each node, n
  std::vector<double> area;                            ///< of the nodes' patches, n, m^2
  std::vector<std::int32_t> begin;                     ///< of each node's shares, n + 1
  std::vector<std::int32_t> shared;                    ///< points
  std::vector<double> weight;                          ///< of the force; and of the points' displacements in the node's
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< of points, anticlockwise seen from outside
};

/// How much work a step of a pressed solid is.
struct SolverOptions {
  int near = 32;          ///< nodes near each tip whose compliance is solved for, at most Snapshot::most_inner in all
  float newton = 0.1F;    ///< how far from Newton's direction it may stay, in the energy's norm
  int newton_steps = 30;  ///< of conjugate gradients, at most
  ComplianceColumnCache::SolverOptions compliance{};
};

/// A solid that tips press, at a low rate: each step takes the contact on the last snapshot, goes one Newton step towards rest under its
/// forces, and makes the next snapshot there.
///
/// The snapshot's compliance is that of the tangent, of nodes near the tips. A body that is pressed far may be stable under the tip only,
/// not under its forces alone: then the exact tangent is not positive, and near there the compliance grows beyond all bounds. So once it
/// would give back more than twice what the solid holds, which no account pays for (BlendedContact), the tangent is taken without so much
/// of its geometric part that it stays positive, until the solid holds clearly less than that again. Nodes farther out, where a quick tip
/// may be before the next snapshot comes, have no columns: see Beyond.
template <template <class> class Material, int lanes>
class QuasiStaticSolver {
 public:
  struct Report {
    double unrest = 0.0;  ///< what the contact's forces differ by from the inner ones, or from those of the step before, over them
    typename HyperelasticModel<Material, lanes>::Step newton;
    ComplianceColumnCache::Report compliance;
  };

  QuasiStaticSolver(const TetMesh& mesh, TetSurface surface, const SolverOptions& effort)
      : solid_(mesh),
        surface_(std::move(surface)),
        effort_(effort),
        points_(mesh.points),
        load_(solid_.unknowns()),
        guess_(solid_.unknowns()),
        left_(solid_.unknowns()),
        columns_(solid_.unknowns(), static_cast<std::size_t>(std::min(TipPair::most * effort.near, LocalModel::most_inner))) {
    node_of_.resize(mesh.points.size());
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(mesh.points.size()); ++i)
      node_of_[static_cast<std::size_t>(solid_.point_of(i))] = i;
    around_.resize(mesh.points.size());
    for (std::size_t f = 0; f < surface_.triangles.size(); ++f)
      for (const std::int32_t p : surface_.triangles[f]) around_[static_cast<std::size_t>(p)].push_back(static_cast<std::int32_t>(f));
    next_.compliance.assign(static_cast<std::size_t>(LocalModel::capacity) * LocalModel::capacity, 0.0);
    state_ = next_;
  }

  [[nodiscard]] const HyperelasticModel<Material, lanes>& solid() const noexcept { return solid_; }
  /// Displacement of all points, 3 x point + axis, m.
  void displacement(double* to) const noexcept {
    for (std::size_t point = 0; point < node_of_.size(); ++point)
      std::copy_n(solid_.displacement() + 3 * static_cast<std::size_t>(node_of_[point]), 3, to + 3 * point);
  }
  [[nodiscard]] const LocalModel& state() const noexcept { return state_; }
  [[nodiscard]] const LocalModelContact& contact() const noexcept { return contact_; }

  /// One step with the tips where they are; the snapshot that comes of it into `to`.
  Report step(const TipPair& tips, LocalModel& to) {
    Report report;
    contact_.solve(state_, tips, 1.0, pressed_.data(), before_);
    before_ = contact_.last().nodes;
    std::copy(contact_.pressed(), contact_.pressed() + before_, pressed_.begin());
    push();
    const double left = unbalanced();
    report.unrest = std::max(left, changed());
    if (left > 1e-5) report.newton = solid_.step(load_.data(), effort_.newton, effort_.newton_steps, guess_.data());
    choose_near(tips);
    place_nodes(tips);
    if (!exact_ && solid_.energy() < 0.7 * most_exact_) take_tangent(true);
    report.compliance = columns_.better(solid_.tangent(), solid_.precondition(), unit_, solved_, effort_.compliance);
    linearise();
    if (exact_ && (report.newton.negative || given_back() > 2.0 * solid_.energy())) {
      most_exact_ = solid_.energy();
      take_tangent(false);
      columns_.better(solid_.tangent(), solid_.precondition(), unit_, solved_, effort_.compliance);
      linearise();
    }
    std::swap(state_, next_);
    to = state_;
    return report;
  }

  void reset() {
    solid_.reset();
    exact_ = true;
    columns_.keep({});
    before_ = 0;
    seen_ = TipPair{};
    state_ = LocalModel{};
    state_.compliance.assign(next_.compliance.size(), 0.0);
  }

 private:
  static constexpr double ahead_steps = 3.0;  // that a quick tip may go before it feels the snapshot

  void take_tangent(bool exact) {
    exact_ = exact;
    solid_.take_tangent(exact);
  }

  /// What the next snapshot gives back under its forces, J.
  [[nodiscard]] double given_back() const noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < covered_.size(); ++i) sum += 0.5 * next_.force[i] * next_.given[i];
    return sum;
  }

  /// The load of the contact's forces along the last snapshot's ways, and what the columns say that it changes.
  void push() {
    std::fill(load_.begin(), load_.end(), 0.0);
    std::fill(guess_.begin(), guess_.end(), 0.0F);
    std::array<double, LocalModel::capacity> force{};
    for (int k = 0; k < before_; ++k) {
      const auto end = state_.name.begin() + state_.nodes.size();
      const auto at = std::lower_bound(state_.name.begin(), end, pressed_[static_cast<std::size_t>(k)]);
      force[static_cast<std::size_t>(at - state_.name.begin())] = contact_.forces()[k];
      by_[static_cast<std::size_t>(at - state_.name.begin())] = contact_.tips()[k];
    }
    for (std::int32_t i = 0; i < state_.nodes.size(); ++i) {
      const auto n = static_cast<std::size_t>(i);
      load(state_.name[n], -force[n] * state_.nodes.normal(i));
      const double change = force[n] - state_.force[n];
      if (change != 0.0 && columns_.has(state_.name[n])) columns_.add(state_.name[n], static_cast<float>(change), guess_.data());
    }
    force_ = force;
  }

  /// What is left of the load, over it; infinite under no load, while inner forces are left.
  [[nodiscard]] double unbalanced() const {
    double left = 0.0, whole = 0.0;
    for (std::size_t k = 0; k < load_.size(); ++k) {
      left += (load_[k] - solid_.gradient()[k]) * (load_[k] - solid_.gradient()[k]);
      whole += load_[k] * load_[k];
    }
    return left == 0.0 ? 0.0 : std::sqrt(left / whole);  // not a number: no rest
  }

  /// By how much the contact's forces are others than those of the state, over them: it answers otherwise as its compliance gets better.
  [[nodiscard]] double changed() const {
    double change = 0.0, whole = 0.0;
    for (std::int32_t i = 0; i < state_.nodes.size(); ++i) {
      const auto n = static_cast<std::size_t>(i);
      change += (force_[n] - state_.force[n]) * (force_[n] - state_.force[n]);
      whole += force_[n] * force_[n];
    }
    return change == 0.0 ? 0.0 : std::sqrt(change / whole);
  }

  void load(std::int32_t name, const Vector3<>& force) {
    each_share(name, [&](std::size_t k, double weight) {
      for (std::size_t a = 0; a < 3; ++a) load_[k + a] += weight * force[static_cast<int>(a)];
    });
  }

  /// Calls take(3 x free node, weight) for each point that a force on the node is shared with and that is free.
  template <class Take>
  void each_share(std::int32_t name, Take take) const {
    const auto n = static_cast<std::size_t>(name);
    for (std::int32_t s = surface_.begin[n]; s < surface_.begin[n + 1]; ++s) {
      const std::int32_t node = node_of_[static_cast<std::size_t>(surface_.shared[static_cast<std::size_t>(s)])];
      if (node < solid_.free_nodes()) take(3 * static_cast<std::size_t>(node), surface_.weight[static_cast<std::size_t>(s)]);
    }
  }

  [[nodiscard]] Vector3<> moved(std::int32_t name) const {
    Vector3<> sum = Vector3<>::Zero();
    each_share(name, [&](std::size_t k, double weight) { sum += weight * Eigen::Map<const Vector3<>>(solid_.displacement() + k); });
    return sum;
  }

  [[nodiscard]] Vector3<> place(std::int32_t point) const {
    return points_[static_cast<std::size_t>(point)] +
           Eigen::Map<const Vector3<>>(solid_.displacement() + 3 * static_cast<std::size_t>(node_of_[static_cast<std::size_t>(point)]));
  }

  /// Of the deformed surface, mean of the triangles' weighted by area; outward.
  [[nodiscard]] Vector3<> normal(std::int32_t name) const {
    Vector3<> sum = Vector3<>::Zero();
    for (const std::int32_t f : around_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(name)])]) {
      const auto& t = surface_.triangles[static_cast<std::size_t>(f)];
      const Vector3<> a = place(t[0]);
      sum += (place(t[1]) - a).cross(place(t[2]) - a);
    }
    const double length = sum.norm();
    return length > 0.0 ? Vector3<>(sum / length) : Vector3<>(Vector3<>::UnitZ());
  }

  /// The nodes nearest to the tips get columns; those that have one keep it as long as they are near enough.
  void choose_near(const TipPair& tips) {
    const auto n = static_cast<std::int32_t>(surface_.point.size());
    wanted_.clear();
    const int each = std::min(effort_.near, LocalModel::most_inner / std::max(tips.count, 1));
    for (int t = 0; t < tips.count; ++t) {
      // Where the tip is, and where it will be when the snapshot comes, if it goes on as it went.
      const Vector3<>&now = tips.tip[static_cast<std::size_t>(t)].centre, &before = seen_.tip[static_cast<std::size_t>(t)].centre;
      const Vector3<> then = t < seen_.count ? Vector3<>(2.0 * now - before) : now;
      near_.clear();
      for (std::int32_t i = 0; i < n; ++i) {
        const Vector3<> at = points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(i)])] + moved(i);
        double far = std::min((at - now).squaredNorm(), (at - then).squaredNorm());
        if (columns_.has(i)) far *= 0.8;
        near_.emplace_back(far, i);
      }
      const auto take = std::min(static_cast<std::ptrdiff_t>(each), static_cast<std::ptrdiff_t>(n));
      std::partial_sort(near_.begin(), near_.begin() + take, near_.end());
      for (std::ptrdiff_t k = 0; k < take; ++k) wanted_.push_back(near_[static_cast<std::size_t>(k)].second);
    }
    std::sort(wanted_.begin(), wanted_.end());
    wanted_.erase(std::unique(wanted_.begin(), wanted_.end()), wanted_.end());
    columns_.keep(wanted_);
    choose_beyond(tips);
    seen_ = tips;
  }

  /// Those of the others that lie nearest to where the tips go if they go on for a few steps more: as many as a snapshot has room for.
  void choose_beyond(const TipPair& tips) {
    near_.clear();
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(surface_.point.size()); ++i) {
      if (std::binary_search(wanted_.begin(), wanted_.end(), i)) continue;
      const Vector3<> at = points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(i)])] + moved(i);
      double far = 1e300;
      for (int t = 0; t < tips.count; ++t) {
        const Vector3<>& now = tips.tip[static_cast<std::size_t>(t)].centre;
        const Vector3<> way =
            t < seen_.count ? Vector3<>(ahead_steps * (now - seen_.tip[static_cast<std::size_t>(t)].centre)) : Vector3<>::Zero();
        const double square = way.squaredNorm(), part = square > 0.0 ? std::clamp((at - now).dot(way) / square, 0.0, 1.0) : 0.0;
        far = std::min(far, (at - now - part * way).squaredNorm());
      }
      near_.emplace_back(far, i);
    }
    const auto room = std::min(static_cast<std::size_t>(LocalModel::capacity) - wanted_.size(), near_.size());
    std::partial_sort(near_.begin(), near_.begin() + static_cast<std::ptrdiff_t>(room), near_.end());
    covered_ = wanted_;
    for (std::size_t k = 0; k < room; ++k) covered_.push_back(near_[k].second);
    std::sort(covered_.begin(), covered_.end());
    solved_.clear();
    for (std::size_t i = 0; i < covered_.size(); ++i) {
      next_.inner[i] = std::binary_search(wanted_.begin(), wanted_.end(), covered_[i]);
      if (next_.inner[i]) solved_.push_back(i);
    }
  }

  /// Nodes that are pressed give way as the tip pushes, without friction: along its radius, or the rod's axis. The others along the
  /// surface's normals.
  void place_nodes(const TipPair& tips) {
    std::vector<Vector3<>> places, ways;
    std::vector<double> areas;
    next_.name.fill(0);
    next_.force.fill(0.0);
    for (std::size_t i = 0; i < covered_.size(); ++i) {
      const std::int32_t name = covered_[i];
      next_.name[i] = name;
      next_.displacement[i] = moved(name);
      places.push_back(points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(name)])] + next_.displacement[i]);
      ways.push_back(normal(name));
      areas.push_back(surface_.area[static_cast<std::size_t>(name)]);
      const auto end = state_.name.begin() + state_.nodes.size();
      const auto at = std::lower_bound(state_.name.begin(), end, name);
      if (at == end || *at != name) continue;
      const auto before = static_cast<std::size_t>(at - state_.name.begin());
      next_.force[i] = force_[before];
      if (!(force_[before] > 0.0) || by_[before] >= tips.count) continue;
      const Tip& tip = tips.tip[static_cast<std::size_t>(by_[before])];
      const Vector3<> way = tip.kind == Tip::Kind::sphere ? Vector3<>(tip.centre - places.back()) : tip.outward;
      if (way.norm() > 0.1 * tip.radius) ways.back() = way.normalized();
    }
    next_.nodes = SurfaceNodes(std::move(places), std::move(ways), areas);
    unit_.clear();
    for (std::size_t i = 0; i < covered_.size(); ++i) {
      const Vector3<>& outward = next_.nodes.normal(static_cast<std::int32_t>(i));
      each_share(next_.name[i], [&](std::size_t k, double weight) {
        for (std::size_t a = 0; a < 3; ++a) unit_.entries.push_back({k + a, static_cast<float>(-weight * outward[static_cast<int>(a)])});
      });
      unit_.begin.push_back(unit_.entries.size());
    }
  }

  /// Compliance, and what the body is still to move.
  void linearise() {
    const std::size_t count = covered_.size();
    // What is left of the load with the forces along the new ways.
    std::fill(load_.begin(), load_.end(), 0.0);
    for (std::size_t i = 0; i < count; ++i) load(next_.name[i], -next_.force[i] * next_.nodes.normal(static_cast<std::int32_t>(i)));
    for (std::size_t k = 0; k < load_.size(); ++k) left_[k] = static_cast<float>(load_[k] - solid_.gradient()[k]);
    columns_.project(unit_, solved_, left_, next_.compliance.data(), LocalModel::capacity, next_.ahead.data());
    beyond_.complete(next_);
    for (std::size_t i = 0; i < count; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < count; ++j) sum += next_.compliance[i * LocalModel::capacity + j] * next_.force[j];
      next_.given[i] = sum;
    }
    next_.number = state_.number + 1;
  }

  HyperelasticModel<Material, lanes> solid_;
  bool exact_ = true;        // its tangent
  double most_exact_ = 0.0;  // what it held when it was no longer, J
  TetSurface surface_;
  SolverOptions effort_;
  std::vector<Vector3<>> points_;                  // at rest, m
  std::vector<std::int32_t> node_of_;              // the solid's, of each point
  std::vector<std::vector<std::int32_t>> around_;  // triangles at each point
  LocalModelContact contact_;
  LocalModel state_, next_;
  int before_ = 0;  // pressed
  std::array<std::int32_t, LocalModel::capacity> pressed_{};
  std::array<double, LocalModel::capacity> force_{};  // by place of the state, N
  std::array<int, LocalModel::capacity> by_{};        // tip that presses it, by place of the state
  std::vector<double> load_;                          // N
  std::vector<float> guess_, left_;                   // m, N
  std::vector<std::pair<double, std::int32_t>> near_;
  std::vector<std::int32_t> wanted_, covered_;  // names, rising: of nodes with columns, and all of the next state
  std::vector<std::size_t> solved_;             // places of the former among the latter
  TipPair seen_;                                // of the last step
  UnitForces unit_;                             // along the inward normals of the nodes that are covered
  ComplianceColumnCache columns_;
  ComplianceExtrapolation beyond_;
};

}  // namespace palpate::deformable
