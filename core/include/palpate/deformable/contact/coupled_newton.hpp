#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Newton's method of SignedDistanceContact for the displacements u of all places: u = free + C g(u), with the force g of the law of
/// contact and friction at a place. A step solves (1 - C J) du = free + C g(u) - u with J = dg/du.
///
/// It counts what ContactNewton and the sweeps of LayerFriction neglect: the turn of the normal forces, and the coupling of normal force
/// and friction by the body. On a body that yields much more than the layer of the contact, such as a cantilever, these decide. The factors
/// of the matrix serve until the steps shrink slowly. A step is halved until the next one with the same factors is smaller (natural
/// monotonicity test, Deuflhard 2004, section 3.3). Where no such step leads to a solution, the body can be followed as if it were damped.
class CoupledNewton {
 public:
  static constexpr int capacity = 64;  ///< places in contact

  /// Force of the law at a place, N, stiffness of its points, N/m, those that carry friction, and their energy, J.
  struct Force {
    Vector3<> normal = Vector3<>::Zero(), traction = Vector3<>::Zero();
    double stiffness = 0.0, energy = 0.0;
    Grip grip{};
  };

  CoupledNewton() : compliance_(square(capacity)), matrix_(square(3 * capacity)) {}

  /// Find the displacements of the engaged places, at most `capacity`, from their present ones on, and set their forces. `law(k, u)` is the
  /// force at place k. With `damped`, the body is followed as if it were damped. Return false if they are not found; the forces are then
  /// unchanged.
  template <class Law>
  bool solve(NearNodes& near, bool damped, const Law& law) noexcept {
    if (gather(near)) factored_ = false;
    iterations_ = 0;
    for (int k = 0; k < count_; ++k) {
      const NearNodes::Place& p = near.place(k);
      begin_[at(k)] = p.displacement;
      internal_[at(k)] = p.force + p.traction;
    }
    if (!(damped ? find_damped(near, law) : find(near, law, 0.0))) return false;
    for (int k = 0; k < count_; ++k) {
      NearNodes::Place& p = near.place(k);
      const Force f = law(k, p.displacement);
      p.force = f.normal;
      p.traction = f.traction;
      p.target = f.normal;
      p.stiffness = f.stiffness;
      p.grip = f.grip;
      p.layer_energy = f.energy;
      const double length = f.normal.norm();
      if (length > 0.0) p.direction = f.normal / length;
      near.set_force(k);
    }
    return true;
  }

  /// Begin a tick: its solutions share one bound on their work.
  void begin_tick() noexcept { work_ = 0.0; }
  /// Number of iterations of the last solve().
  [[nodiscard]] int iterations() const noexcept { return iterations_; }
  void reset() noexcept { count_ = 0; }

 private:
  static constexpr double tolerance = 3e-5;  // of the forces, relative to their sum; the last step is taken beyond it
  static constexpr double rounding = 1e-8;   // of displacements, relative to the radius
  static constexpr double slow = 0.3;        // ratio of two steps with which the factors are not kept
  static constexpr int max_iterations = 12;  // of one solution
  static constexpr int max_damped = 200;     // solutions of the damped body
  static constexpr double max_work = 1e8;    // of one tick, three multiplications and more each: 20 to 60 ms

  template <class T>
  using Rows = std::array<T, static_cast<std::size_t>(capacity)>;
  using Column = std::array<double, static_cast<std::size_t>(3 * capacity)>;

  [[nodiscard]] static std::size_t square(int n) noexcept { return static_cast<std::size_t>(n) * static_cast<std::size_t>(n); }
  [[nodiscard]] static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] static Vector3<> part(const Column& column, int k) noexcept {
    return {column[at(3 * k)], column[at(3 * k + 1)], column[at(3 * k + 2)]};
  }
  [[nodiscard]] double norm(const Column& column) const noexcept {
    double sum = 0.0;
    for (int i = 0; i < 3 * count_; ++i) sum += column[at(i)] * column[at(i)];
    return std::sqrt(sum);
  }
  [[nodiscard]] double& entry(int r, int c) noexcept { return matrix_[at(c * 3 * capacity + r)]; }
  [[nodiscard]] Matrix3<>& block(int k, int j) noexcept { return compliance_[at(j * capacity + k)]; }

  /// Copy the compliance of the engaged places. Return whether they have changed.
  bool gather(const NearNodes& near) noexcept {
    const int count = near.engaged();
    bool same = count == count_;
    for (int k = 0; k < count; ++k) {
      const NearNodes::Place& p = near.place(k);
      same = same && node_[at(k)] == p.node && tip_[at(k)] == p.tip;
      node_[at(k)] = p.node;
      tip_[at(k)] = p.tip;
    }
    count_ = count;
    if (same) return false;
    for (int j = 0; j < count; ++j)
      for (int k = 0; k < count; ++k) block(k, j) = near.compliance(k, j);
    return true;
  }

  /// Follow the body to its next equilibrium as if it were damped in proportion to its stiffness: where the contact snaps to another
  /// equilibrium, the damped body goes there on its way down in energy. With the damping over the pseudo time step d and the internal
  /// forces f, which begin as the forces of the last equilibrium, a step solves (1 + d) (u - free) = C (g(u) + d f).
  template <class Law>
  bool find_damped(NearNodes& near, const Law& law) noexcept {
    double damping = 1.0;
    restore(near);
    for (int step = 0; step < max_damped && damping < 1e4; ++step) {
      if (!find(near, law, damping)) {
        damping = 8.0 * std::max(damping, 0.05);
        restore(near);
        continue;
      }
      if (damping == 0.0) return true;
      for (int k = 0; k < count_; ++k) {
        begin_[at(k)] = near.place(k).displacement;
        internal_[at(k)] = (damping * internal_[at(k)] + force_[at(k)]) / (1.0 + damping);
      }
      damping = damping > 0.05 ? 0.25 * damping : 0.0;
    }
    return false;
  }

  /// Return to the displacements at the begin of the step.
  void restore(NearNodes& near) const noexcept {
    for (int k = 0; k < count_; ++k) near.place(k).displacement = begin_[at(k)];
  }

  /// Find the displacements of one step. Return whether they are found.
  template <class Law>
  bool find(NearNodes& near, const Law& law, double damping) noexcept {
    const double law_share = 1.0 / (1.0 + damping);
    if (law_share != law_share_) factored_ = false;
    law_share_ = law_share;
    find_residual(near, law);
    for (int iteration = 0; iteration < max_iterations && work_ < max_work; ++iteration) {
      ++iterations_;
      if (!factored_ && !factor(near, law)) return false;
      substitute(step_);
      const double before = norm(step_);
      double share = 1.0, after = 0.0;
      if (!is_small(step_, near, 0.1)) {
        for (int k = 0; k < count_; ++k) start_[at(k)] = near.place(k).displacement;
        for (;; share *= 0.5) {
          for (int k = 0; k < count_; ++k) near.place(k).displacement = start_[at(k)] + share * part(step_, k);
          find_residual(near, law);
          substitute(rest_);
          after = norm(rest_);
          if (after <= (1.0 - 0.25 * share) * before || share < 0.01) break;
        }
        if (share < 1.0 || after > slow * before) factored_ = false;
        if (!factored_ || !is_small(rest_, near, 1.0)) continue;
      } else {
        rest_ = step_;
      }
      for (int k = 0; k < count_; ++k) near.place(k).displacement += part(rest_, k);
      return true;
    }
    return false;
  }

  template <class Law>
  void find_residual(const NearNodes& near, const Law& law) noexcept {
    total_ = 0.0;
    work_ += 100.0 * count_ * count_;
    for (int k = 0; k < count_; ++k) {
      const Force f = law(k, near.place(k).displacement);
      force_[at(k)] = f.normal + f.traction;
      driving_[at(k)] = law_share_ * force_[at(k)] + (1.0 - law_share_) * internal_[at(k)];
      total_ += f.normal.norm();
    }
    for (int k = 0; k < count_; ++k) {
      Vector3<> missing = near.place(k).free - near.place(k).displacement;
      for (int j = 0; j < count_; ++j) missing += block(k, j) * driving_[at(j)];
      for (int a = 0; a < 3; ++a) residual_[at(3 * k + a)] = missing[a];
    }
  }

  /// Whether a change of the displacements changes the forces by at most `share` of the tolerance, with all points in contact.
  [[nodiscard]] bool is_small(const Column& change, const NearNodes& near, double share) const noexcept {
    double sum = 0.0, allowed = 0.0;
    for (int k = 0; k < count_; ++k) {
      const NearNodes::Place& p = near.place(k);
      const NearNodes::Tip& tip = near.tip_of(p);
      const double stiffness = tip.points->stiffness(p.node);
      sum += stiffness * stiffness * part(change, k).squaredNorm();
      allowed = std::max(allowed, rounding * tip.shape.radius * stiffness);
    }
    return std::sqrt(sum) <= share * tolerance * total_ + allowed;
  }

  /// Factor 1 - C J by Gaussian elimination with row exchanges. Return false if it is singular.
  template <class Law>
  bool factor(const NearNodes& near, const Law& law) noexcept {
    const int n = 3 * count_;
    work_ += std::pow(n, 3);
    for (int j = 0; j < count_; ++j) {
      const NearNodes::Place& p = near.place(j);
      const double by = 1e-7 * near.tip_of(p).shape.radius;
      for (int b = 0; b < 3; ++b) {
        Vector3<> u = p.displacement;
        u[b] += by;
        const Force f = law(j, u);
        const Vector3<> slope = law_share_ / by * (f.normal + f.traction - force_[at(j)]);
        for (int k = 0; k < count_; ++k) {
          const Vector3<> moved = block(k, j) * slope;
          for (int a = 0; a < 3; ++a) entry(3 * k + a, 3 * j + b) = (k == j && a == b ? 1.0 : 0.0) - moved[a];
        }
      }
    }
    for (int c = 0; c < n; ++c) {
      double* column = &entry(0, c);
      int p = c;
      for (int r = c + 1; r < n; ++r)
        if (std::abs(column[r]) > std::abs(column[p])) p = r;
      if (!(std::abs(column[p]) > 1e-12)) return false;
      exchange_[at(c)] = p;
      if (p != c)
        for (int j = 0; j < n; ++j) std::swap(entry(p, j), entry(c, j));
      const double inverse = 1.0 / column[c];
      for (int r = c + 1; r < n; ++r) column[r] *= inverse;
      for (int j = c + 1; j < n; ++j) {
        double* other = &entry(0, j);
        const double factor = other[c];
        for (int r = c + 1; r < n; ++r) other[r] -= factor * column[r];
      }
    }
    factored_ = true;
    return true;
  }

  /// Solve for the residual.
  void substitute(Column& x) noexcept {
    const int n = 3 * count_;
    for (int i = 0; i < n; ++i) x[at(i)] = residual_[at(i)];
    for (int c = 0; c < n; ++c) std::swap(x[at(c)], x[at(exchange_[at(c)])]);
    for (int c = 0; c < n; ++c) {
      const double* column = &entry(0, c);
      for (int r = c + 1; r < n; ++r) x[at(r)] -= x[at(c)] * column[r];
    }
    for (int c = n - 1; c >= 0; --c) {
      const double* column = &entry(0, c);
      x[at(c)] /= column[c];
      for (int r = 0; r < c; ++r) x[at(r)] -= x[at(c)] * column[r];
    }
  }

  int count_ = 0, iterations_ = 0;
  bool factored_ = false;
  double law_share_ = 1.0;             // of the law in driving_; internal_ has the rest
  double work_ = 0.0;                  // of this tick
  double total_ = 0.0;                 // of the sizes of the normal forces, N
  std::vector<Matrix3<>> compliance_;  // m/N
  std::vector<double> matrix_;         // its factors, by columns
  std::array<int, static_cast<std::size_t>(3 * capacity)> exchange_{};
  Column residual_{}, step_{}, rest_{};
  Rows<Vector3<>> force_{}, driving_{}, internal_{}, start_{}, begin_{};
  Rows<std::int32_t> node_{};
  Rows<int> tip_{};
};

}  // namespace palpate::deformable
