#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/body/beyond.hpp"
#include "palpate/body/conjugate_gradients.hpp"
#include "palpate/body/snapshot.hpp"
#include "palpate/body/solid.hpp"

namespace palpate {

/// The part of a solid's surface that can be touched: n nodes, how a force on each is shared among the mesh's points, and its triangles.
struct SolidSurface {
  std::vector<std::int32_t> point;                     ///< of each node, n
  std::vector<double> area;                            ///< of the nodes' patches, n, m^2
  std::vector<std::int32_t> begin;                     ///< of each node's shares, n + 1
  std::vector<std::int32_t> shared;                    ///< points
  std::vector<double> weight;                          ///< of the force; and of the points' displacements in the node's
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< of points, anticlockwise seen from outside
};

/// How much work a step of a pressed solid is.
struct Effort {
  int near = 32;             ///< nodes near each tip whose compliance is solved for, at most Snapshot::most_inner in all
  float newton = 0.1F;       ///< to which share of its residual Newton's direction is solved
  int newton_steps = 30;     ///< of conjugate gradients, at most
  float compliance = 0.05F;  ///< to which share of the unit force each column of the compliance is solved
  int compliance_steps = 6;  ///< of conjugate gradients, at most: columns of new nodes take a few slow steps
};

/// A solid that tips press, at a low rate: each step takes the contact on the last snapshot, goes one Newton step towards rest under its
/// forces, and makes the next snapshot there.
///
/// The snapshot's compliance is that of the tangent: columns z_j = K^-1 b_j of the nodes near the tips are kept from step to step, and
/// bettered by conjugate gradients, sixteen side by side. What is left over in them, r_j = b_j - K z_j, is used once more: the compliance
/// b_i.z_j + z_i.r_j is symmetric and wrong by the square of the columns' errors only, and always too small. Nodes farther out, where a
/// quick tip may be before the next snapshot comes, have no columns: see Beyond.
template <template <class> class Material, int lanes>
class PressedSolid {
 public:
  struct Report {
    typename Solid<Material, lanes>::Step newton;
    int compliance_steps = 0;      ///< of conjugate gradients, over all groups of sixteen
    double compliance_left = 0.0;  ///< largest share of a unit force that its column leaves
  };

  PressedSolid(const SolidMesh& mesh, SolidSurface surface, const Effort& effort)
      : solid_(mesh),
        surface_(std::move(surface)),
        effort_(effort),
        points_(mesh.points),
        load_(solid_.unknowns()),
        guess_(solid_.unknowns()),
        left_(solid_.unknowns()),
        solver_(solid_.unknowns()) {
    node_of_.resize(mesh.points.size());
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(mesh.points.size()); ++i)
      node_of_[static_cast<std::size_t>(solid_.point_of(i))] = i;
    around_.resize(mesh.points.size());
    for (std::size_t f = 0; f < surface_.triangles.size(); ++f)
      for (const std::int32_t p : surface_.triangles[f]) around_[static_cast<std::size_t>(p)].push_back(static_cast<std::int32_t>(f));
    const std::size_t groups = (static_cast<std::size_t>(std::min(BodyTips::most * effort.near, Snapshot::most_inner)) + width - 1) / width;
    column_.assign(groups, std::vector<Columns>(solid_.unknowns(), Columns{}));
    rest_.assign(groups, std::vector<Columns>(solid_.unknowns(), Columns{}));
    slot_.fill(-1);
    next_.compliance.assign(static_cast<std::size_t>(Snapshot::capacity) * Snapshot::capacity, 0.0);
    state_ = next_;
  }

  [[nodiscard]] const Solid<Material, lanes>& solid() const noexcept { return solid_; }
  [[nodiscard]] const Snapshot& state() const noexcept { return state_; }
  [[nodiscard]] const SnapshotContact& contact() const noexcept { return contact_; }

  /// One step with the tips where they are; the snapshot that comes of it into `to`.
  Report step(const BodyTips& tips, Snapshot& to) {
    Report report;
    contact_.solve(state_, tips, 1.0, pressed_.data(), before_);
    before_ = contact_.last().nodes;
    std::copy(contact_.pressed(), contact_.pressed() + before_, pressed_.begin());
    push();
    if (!at_rest()) report.newton = solid_.step(load_.data(), effort_.newton, effort_.newton_steps, guess_.data());
    choose_near(tips);
    place_nodes(tips);
    better_columns(report);
    linearise();
    std::swap(state_, next_);
    to = state_;
    return report;
  }

  void reset() {
    solid_.reset();
    slot_.fill(-1);
    for (auto& group : column_) std::fill(group.begin(), group.end(), Columns{});
    before_ = 0;
    seen_ = BodyTips{};
    state_ = Snapshot{};
    state_.compliance.assign(next_.compliance.size(), 0.0);
  }

 private:
  static constexpr std::size_t width = sizeof(Columns) / sizeof(float);
  static constexpr double ahead_steps = 3.0;  // that a quick tip may go before it feels the snapshot

  /// The load of the contact's forces along the last snapshot's ways, and what the columns say that it changes.
  void push() {
    std::fill(load_.begin(), load_.end(), 0.0);
    std::fill(guess_.begin(), guess_.end(), 0.0F);
    std::array<double, Snapshot::capacity> force{};
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
      if (change == 0.0) continue;
      const auto slot = static_cast<std::size_t>(std::find(slot_.begin(), slot_.end(), state_.name[n]) - slot_.begin());
      if (slot == slot_.size()) continue;  // it had no column
      const std::vector<Columns>& group = column_[slot / width];
      for (std::size_t k = 0; k < guess_.size(); ++k) guess_[k] += static_cast<float>(change) * group[k][slot % width];
    }
    force_ = force;
  }

  /// Whether what is left of the load is too little to be felt.
  [[nodiscard]] bool at_rest() const {
    double left = 0.0, whole = 0.0;
    for (std::size_t k = 0; k < load_.size(); ++k) {
      left += (load_[k] - solid_.gradient()[k]) * (load_[k] - solid_.gradient()[k]);
      whole += load_[k] * load_[k];
    }
    return left <= 1e-10 * whole;
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

  /// The nodes nearest to the tips get slots; those that have one keep it as long as they are near enough.
  void choose_near(const BodyTips& tips) {
    const auto n = static_cast<std::int32_t>(surface_.point.size());
    wanted_.clear();
    const int each = std::min(effort_.near, Snapshot::most_inner / std::max(tips.count, 1));
    for (int t = 0; t < tips.count; ++t) {
      // Where the tip is, and where it will be when the snapshot comes, if it goes on as it went.
      const Vector3<>&now = tips.tip[static_cast<std::size_t>(t)].centre, &before = seen_.tip[static_cast<std::size_t>(t)].centre;
      const Vector3<> then = t < seen_.count ? Vector3<>(2.0 * now - before) : now;
      near_.clear();
      for (std::int32_t i = 0; i < n; ++i) {
        const Vector3<> at = points_[static_cast<std::size_t>(surface_.point[static_cast<std::size_t>(i)])] + moved(i);
        double far = std::min((at - now).squaredNorm(), (at - then).squaredNorm());
        if (std::find(slot_.begin(), slot_.end(), i) != slot_.end()) far *= 0.8;
        near_.emplace_back(far, i);
      }
      const auto take = std::min(static_cast<std::ptrdiff_t>(each), static_cast<std::ptrdiff_t>(n));
      std::partial_sort(near_.begin(), near_.begin() + take, near_.end());
      for (std::ptrdiff_t k = 0; k < take; ++k) wanted_.push_back(near_[static_cast<std::size_t>(k)].second);
    }
    std::sort(wanted_.begin(), wanted_.end());
    wanted_.erase(std::unique(wanted_.begin(), wanted_.end()), wanted_.end());
    for (std::int32_t& s : slot_)
      if (s >= 0 && !std::binary_search(wanted_.begin(), wanted_.end(), s)) s = -1;
    for (const std::int32_t name : wanted_) {
      if (std::find(slot_.begin(), slot_.end(), name) != slot_.end()) continue;
      const auto slot = static_cast<std::size_t>(std::find(slot_.begin(), slot_.end(), -1) - slot_.begin());
      slot_[slot] = name;
      for (Columns& c : column_[slot / width]) c[slot % width] = 0.0F;
    }
    choose_beyond(tips);
    seen_ = tips;
    groups_ = 0;
    for (std::size_t s = 0; s < slot_.size(); ++s)
      if (slot_[s] >= 0) groups_ = s / width + 1;
  }

  /// Those of the others that lie nearest to where the tips go if they go on for a few steps more: as many as a snapshot has room for.
  void choose_beyond(const BodyTips& tips) {
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
    const auto room = std::min(static_cast<std::size_t>(Snapshot::capacity) - wanted_.size(), near_.size());
    std::partial_sort(near_.begin(), near_.begin() + static_cast<std::ptrdiff_t>(room), near_.end());
    covered_ = wanted_;
    for (std::size_t k = 0; k < room; ++k) covered_.push_back(near_[k].second);
    std::sort(covered_.begin(), covered_.end());
    for (std::size_t i = 0; i < covered_.size(); ++i) {
      slot_at_[i] = static_cast<std::size_t>(std::find(slot_.begin(), slot_.end(), covered_[i]) - slot_.begin());
      next_.inner[i] = slot_at_[i] < slot_.size();
    }
  }

  /// Nodes that are pressed give way as the tip pushes, without friction: along its radius, or the rod's axis. The others along the
  /// surface's normals.
  void place_nodes(const BodyTips& tips) {
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
      const BodyTip& tip = tips.tip[static_cast<std::size_t>(by_[before])];
      const Vector3<> way = tip.kind == BodyTip::Kind::sphere ? Vector3<>(tip.centre - places.back()) : tip.outward;
      if (way.norm() > 0.1 * tip.radius) ways.back() = way.normalized();
    }
    next_.nodes = BodyNodes(std::move(places), std::move(ways), areas);
  }

  /// Calls take(k, value) for each entry of the unit force along the inward normal of the node in place i.
  template <class Take>
  void each_entry(std::size_t i, Take take) const {
    const Vector3<>& outward = next_.nodes.normal(static_cast<std::int32_t>(i));
    each_share(next_.name[i], [&](std::size_t k, double weight) {
      for (std::size_t a = 0; a < 3; ++a) take(k + a, -weight * outward[static_cast<int>(a)]);
    });
  }

  void better_columns(Report& report) {
    for (std::size_t g = 0; g < groups_; ++g) {
      std::vector<Columns>&z = column_[g], &r = rest_[g];
      Columns square{};
      for (std::size_t l = 0; l < width; ++l)
        if (slot_[g * width + l] < 0)
          for (Columns& c : z) c[l] = 0.0F;
      solid_.tangent().multiply(z.data(), r.data());
      for (Columns& c : r) c = -c;
      bool used = false;
      for (std::size_t i = 0; i < covered_.size(); ++i) {
        if (!next_.inner[i] || slot_at_[i] / width != g) continue;
        used = true;
        each_entry(i, [&](std::size_t k, double value) {
          r[k][slot_at_[i] % width] += static_cast<float>(value);
          square[slot_at_[i] % width] += static_cast<float>(value * value);
        });
      }
      if (!used) continue;  // none of the sixteen is near
      const auto solved =
          solver_.solve(solid_.tangent(), solid_.precondition(), z.data(), r.data(), square, effort_.compliance, effort_.compliance_steps);
      report.compliance_steps += solved.steps;
      Columns left;
      solver_.dot(r.data(), r.data(), left);
      for (std::size_t l = 0; l < width; ++l)
        if (square[l] > 0.0F)
          report.compliance_left = std::max(report.compliance_left, std::sqrt(static_cast<double>(left[l] / square[l])));
    }
  }

  /// Compliance, and what the body is still to move.
  void linearise() {
    const std::size_t count = covered_.size();
    // What is left of the load with the forces along the new ways.
    std::fill(load_.begin(), load_.end(), 0.0);
    for (std::size_t i = 0; i < count; ++i) load(next_.name[i], -next_.force[i] * next_.nodes.normal(static_cast<std::int32_t>(i)));
    for (std::size_t k = 0; k < load_.size(); ++k) left_[k] = static_cast<float>(load_[k] - solid_.gradient()[k]);
    // z_i . r_j of all slots, and z_i . left.
    for (std::size_t g = 0; g < groups_; ++g) {
      Columns ahead{};
      for (std::size_t k = 0; k < left_.size(); ++k) ahead += left_[k] * column_[g][k];
      for (std::size_t l = 0; l < width; ++l) ahead_[g * width + l] = ahead[l];
      for (std::size_t h = 0; h < groups_; ++h) {
        std::array<Columns, width> sum{};
        for (std::size_t k = 0; k < left_.size(); ++k)
          for (std::size_t l = 0; l < width; ++l) sum[l] += rest_[h][k][l] * column_[g][k];
        for (std::size_t l = 0; l < width; ++l)
          for (std::size_t m = 0; m < width; ++m)
            product_[(g * width + m) * Snapshot::most_inner + h * width + l] = static_cast<double>(sum[l][m]);
      }
    }
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j) {
        if (!next_.inner[j]) continue;
        double sum = next_.inner[i] ? product_[slot_at_[i] * Snapshot::most_inner + slot_at_[j]] : 0.0;
        each_entry(i, [&](std::size_t k, double value) {
          sum += value * static_cast<double>(column_[slot_at_[j] / width][k][slot_at_[j] % width]);
        });
        next_.compliance[i * Snapshot::capacity + j] = sum;
        if (!next_.inner[i]) next_.compliance[j * Snapshot::capacity + i] = sum;
      }
    for (std::size_t i = 0; i < count; ++i) {
      if (!next_.inner[i]) continue;
      for (std::size_t j = 0; j < i; ++j) {
        if (!next_.inner[j]) continue;
        double &one = next_.compliance[i * Snapshot::capacity + j], &two = next_.compliance[j * Snapshot::capacity + i];
        one = two = 0.5 * (one + two);
      }
      next_.ahead[i] = static_cast<double>(ahead_[slot_at_[i]]);
    }
    beyond_.complete(next_);
    for (std::size_t i = 0; i < count; ++i) {
      double sum = 0.0;
      for (std::size_t j = 0; j < count; ++j) sum += next_.compliance[i * Snapshot::capacity + j] * next_.force[j];
      next_.given[i] = sum;
    }
    next_.number = state_.number + 1;
  }

  Solid<Material, lanes> solid_;
  SolidSurface surface_;
  Effort effort_;
  std::vector<Vector3<>> points_;                  // at rest, m
  std::vector<std::int32_t> node_of_;              // the solid's, of each point
  std::vector<std::vector<std::int32_t>> around_;  // triangles at each point
  SnapshotContact contact_;
  Snapshot state_, next_;
  int before_ = 0;  // pressed
  std::array<std::int32_t, Snapshot::capacity> pressed_{};
  std::array<double, Snapshot::capacity> force_{};  // by place of the state, N
  std::array<int, Snapshot::capacity> by_{};        // tip that presses it, by place of the state
  std::vector<double> load_;                        // N
  std::vector<float> guess_, left_;                 // m, N
  std::vector<std::pair<double, std::int32_t>> near_;
  std::vector<std::int32_t> wanted_, covered_;  // names, rising: of nodes with columns, and all of the next state
  Beyond beyond_;
  std::array<std::int32_t, Snapshot::most_inner> slot_{};  // name that each column belongs to; -1: none
  BodyTips seen_;                                          // of the last step
  std::size_t groups_ = 0;                                 // of sixteen columns in use
  std::array<std::size_t, Snapshot::capacity> slot_at_{};  // column of each place of the next state
  std::vector<std::vector<Columns>> column_, rest_;        // by sixteen, m and N
  std::array<float, Snapshot::most_inner> ahead_{};        // by column, m
  std::vector<double> product_ = std::vector<double>(static_cast<std::size_t>(Snapshot::most_inner) * Snapshot::most_inner);
  ConjugateGradients<Columns> solver_;
};

}  // namespace palpate
