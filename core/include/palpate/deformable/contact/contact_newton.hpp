#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/deformable/contact/near_compliance.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Newton's method of SignedDistanceContact for one number per place, the change of its force along the direction d of its points'
/// resultant: (d_i.C_ij d_j + 1/h_i) delta = right-hand side. The matrix is kept while the places and directions stay.
class ContactNewton {
 public:
  static constexpr double tolerance = 1e-3;  ///< of the last change of the force; the error is about a tenth of it

  /// Update the directions and, if needed, the matrix. Return whether it is new.
  bool assemble(NearNodes& near) noexcept {
    int size = 0;
    bool stale = false;
    const double mean = force_.squaredNorm() / (std::max(size_, 1) * std::max(size_, 1));
    for (int k = 0; k < near.engaged(); ++k) {
      NearNodes::Place& p = near.place(k);
      if (p.stiffness == 0.0) continue;
      const double length = p.target.norm();
      if (length > 0.0) p.direction = p.target / length;
      const auto a = static_cast<std::size_t>(size++);
      stale = stale || row_node_[a] != p.node || row_tip_[a] != p.tip || row_place_[a] != k ||
              (p.direction - row_direction_[a]).squaredNorm() * std::min(p.target.squaredNorm(), mean) > max_turn * mean;
      row_place_[a] = k;
    }
    if (!stale && size == size_) return false;
    size_ = size;
    system_.resize(size);
    for (int k = 0; k < near.engaged(); ++k) near.set_scratch(k, near.place(k).direction);
    near.finish_scratch();
    for (int a = 0; a < size; ++a) {
      const auto r = static_cast<std::size_t>(a);
      const int k = row_place_[r];
      row_node_[r] = near.place(k).node;
      row_tip_[r] = near.place(k).tip;
      row_direction_[r] = near.place(k).direction;
      near.along(k, row_direction_[r], k, line_.data());
      float* column = system_.column(a);
      for (int b = a; b < size; ++b) column[b] = line_[static_cast<std::size_t>(row_place_[static_cast<std::size_t>(b)])];
    }
    return true;
  }

  /// Factor the matrix with the stiffness of the points. Return false if it is not positive definite.
  bool factor(const NearNodes& near) noexcept {
    for (int a = 0; a < size_; ++a) {
      const auto r = static_cast<std::size_t>(a);
      row_value_[r] = 1.0 / std::max(near.place(row_place_[r]).stiffness, 1e-9);
    }
    return system_.factor(row_value_.data());
  }

  /// Change the forces once. Return the size of the change relative to the tolerance.
  double step(NearNodes& near) noexcept {
    double aside = 0.0;
    for (int k = 0; k < near.engaged(); ++k) {
      NearNodes::Place& p = near.place(k);
      const Vector3<> missing = p.target - p.force;
      p.change = p.stiffness > 0.0 ? Vector3<>(missing - missing.dot(p.direction) * p.direction) : Vector3<>(-p.force);
      near.set_scratch(k, p.change);
      aside = std::max(aside, p.change.squaredNorm());
    }
    near.finish_scratch();
    const bool turned = aside > 1e-10 * force_.squaredNorm();
    for (int a = 0; a < size_; ++a) {
      const auto r = static_cast<std::size_t>(a);
      const NearNodes::Place& p = near.place(row_place_[r]);
      row_value_[r] = p.direction.dot(p.target - p.force) / std::max(p.stiffness, 1e-9);
      if (turned) row_value_[r] -= p.direction.dot(near.scratch_displacement(row_place_[r]));
    }
    system_.solve(row_value_.data());
    for (int a = 0; a < size_; ++a) {
      const auto r = static_cast<std::size_t>(a);
      NearNodes::Place& p = near.place(row_place_[r]);
      p.change += row_value_[r] * p.direction;
    }
    Vector3<> total = Vector3<>::Zero(), change = Vector3<>::Zero();
    double largest = 0.0, allowed = 0.0;
    for (int k = 0; k < near.engaged(); ++k) {
      NearNodes::Place& p = near.place(k);
      p.force += p.change;
      near.set_force(k);
      total += p.force;
      change += p.change;
      largest = std::max(largest, p.change.squaredNorm());
      allowed = std::max(allowed, rounding * near.tip_of(p).shape.radius * p.stiffness);
    }
    force_ = total;
    return std::max(change.norm(), 0.3 * std::sqrt(largest)) / (tolerance * total.norm() + allowed + 1e-30);
  }

  /// Sum of the forces of the points on the nodes after the last step, N.
  [[nodiscard]] const Vector3<>& force() const noexcept { return force_; }

  void reset() noexcept {
    size_ = -1;
    force_.setZero();
  }

 private:
  static constexpr double rounding = 1e-7;  // of positions, relative to the radius
  static constexpr double max_turn = 4e-4;  // square of the change of a mean force's direction that renews the matrix

  template <class T>
  using Rows = std::array<T, static_cast<std::size_t>(NearNodes::capacity)>;

  alignas(64) Rows<float> line_{};
  LayeredSystem system_;
  Vector3<> force_ = Vector3<>::Zero();
  int size_ = -1;
  Rows<double> row_value_{};
  Rows<Vector3<>> row_direction_{};
  Rows<int> row_place_{}, row_tip_{};
  Rows<std::int32_t> row_node_{};
};

}  // namespace palpate::deformable
