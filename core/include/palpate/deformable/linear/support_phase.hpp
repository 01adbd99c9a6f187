#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/cholesky_factor.hpp"
#include "palpate/deformable/linear/condensed_surface.hpp"
#include "palpate/deformable/linear/supported_modes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// A condensed body between two changes of its supports. The forces r on the k held nodes s that keep their displacements zero reduce the
/// compliance of the m touched nodes to
///   C' = C - C_s^T C_ss^-1 C_s,
/// with the capacitance matrix C_ss (James & Pai, ArtDefo, 1999). Computed when the body is loaded or in a thread besides the servo; sums
/// are in a fixed order, so the bits do not depend on the registers.
class SupportPhase {
 public:
  /// `yielding` is the least compliance of the supports of a body with inertia, see yielding().
  SupportPhase(std::shared_ptr<const CondensedSurface> surface, SupportNodes nodes, double yielding = 0.0)
      : surface_(std::move(surface)), nodes_(std::move(nodes)), local_(surface_->size(), -1), held_(surface_->size(), -1) {
    for (std::size_t k = 0; k < nodes_.touched.size(); ++k) local_[at(nodes_.touched[k])] = static_cast<std::int32_t>(k);
    for (std::size_t k = 0; k < nodes_.held.size(); ++k) held_[at(nodes_.held[k])] = static_cast<std::int32_t>(k);
    CholeskyFactor remainder;
    if (surface_->modes() > 0 && !nodes_.held.empty()) remainder = yield(yielding);
    if (!remainder.definite()) return;
    const CholeskyFactor capacitance(
        3 * nodes_.held.size(),
        [&](std::size_t r, std::size_t c) { return entry(row_of(nodes_.held, r), row_of(nodes_.held, c)) + (r == c ? yielding_ : 0.0); },
        [&](std::size_t r) { return min_pivot * entry(row_of(nodes_.held, r), row_of(nodes_.held, r)); });
    definite_ = capacitance.definite();
    if (!definite_) return;
    modes_ = SupportedModes(*surface_, nodes_, capacitance, remainder);
    update(capacitance);
  }

  /// Whether the compliance of the held nodes is positive definite to rounding; otherwise the phase cannot be used.
  [[nodiscard]] bool definite() const noexcept { return definite_; }
  [[nodiscard]] const std::shared_ptr<const CondensedSurface>& surface() const noexcept { return surface_; }
  [[nodiscard]] const std::vector<std::int32_t>& held() const noexcept { return nodes_.held; }
  [[nodiscard]] const std::vector<std::int32_t>& touched() const noexcept { return nodes_.touched; }
  /// Index of a node of the body among the touched or the held nodes, or -1.
  [[nodiscard]] std::int32_t local(std::int32_t node) const noexcept { return local_[at(node)]; }
  [[nodiscard]] std::int32_t held_index(std::int32_t node) const noexcept { return held_[at(node)]; }

  /// Of a body with inertia; size 0: none.
  [[nodiscard]] const SupportedModes& modes() const noexcept { return modes_; }

  /// Compliance of the support of a held node, m/N: of a body with inertia as little as the rounding of its compliance permits, otherwise
  /// none. Mass at a node that does not yield would stop in no time. If it differed between phases, a change could supply energy.
  [[nodiscard]] double yielding() const noexcept { return yielding_; }

  /// C' (3m)^2, m/N.
  [[nodiscard]] const std::vector<float>& compliance() const noexcept { return compliance_; }
  /// Column of C_ss^-1 C_s (3k entries) of a node that is not held: the forces that free the held nodes of the displacement by a unit force
  /// on it along `axis`.
  [[nodiscard]] const float* share(std::int32_t node, int axis) const noexcept {
    return shares_.data() + (3 * at(node) + static_cast<std::size_t>(axis)) * 3 * nodes_.held.size();
  }

  /// The touched nodes, for a contact.
  [[nodiscard]] SurfaceNodes contact_nodes() const {
    std::vector<Vector3<>> points, normals;
    std::vector<double> areas;
    for (const std::int32_t node : nodes_.touched) {
      points.push_back(surface_->points[at(node)]);
      normals.push_back(surface_->normals[at(node)]);
      areas.push_back(surface_->areas[at(node)]);
    }
    return {std::move(points), std::move(normals), areas};
  }

 private:
  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }
  /// Row of the body's compliance of row `r` of a list of nodes.
  [[nodiscard]] static std::size_t row_of(const std::vector<std::int32_t>& list, std::size_t r) noexcept {
    return 3 * at(list[r / 3]) + r % 3;
  }
  [[nodiscard]] double entry(std::size_t row, std::size_t column) const noexcept {
    return static_cast<double>(surface_->compliance[row * 3 * surface_->size() + column]);
  }

  /// Find the least compliance of the supports with which what the modes leave of the held nodes' compliance is definite. Return its
  /// factor.
  [[nodiscard]] CholeskyFactor yield(double least) {
    double largest = 0.0;
    for (std::size_t r = 0; r < 3 * nodes_.held.size(); ++r)
      largest = std::max(largest, entry(row_of(nodes_.held, r), row_of(nodes_.held, r)));
    yielding_ = std::max(least, least_yield * largest);
    CholeskyFactor factor = SupportedModes::remainder(*surface_, nodes_.held, yielding_);
    while (!factor.definite() && yielding_ < most_yield * largest) {
      yielding_ *= 4.0;
      factor = SupportedModes::remainder(*surface_, nodes_.held, yielding_);
    }
    return factor;
  }

  /// Compute C' = C - U^T U with U = L^-1 C_s, and the shares L^-T U.
  void update(const CholeskyFactor& capacitance) {
    std::vector<std::int32_t> others = nodes_.touched;  // then those that only deform
    for (std::int32_t node = 0; node < static_cast<std::int32_t>(surface_->size()); ++node)
      if (local_[at(node)] < 0 && held_[at(node)] < 0) others.push_back(node);
    const std::size_t n = 3 * nodes_.held.size(), m = 3 * others.size();
    std::vector<double> u(n * m);
    for (std::size_t r = 0; r < n; ++r)
      for (std::size_t c = 0; c < m; ++c) u[r * m + c] = entry(row_of(nodes_.held, r), row_of(others, c));
    capacitance.solve_lower(u.data(), m);
    reduce(u, m);
    capacitance.solve_upper(u.data(), m);
    shares_.assign(3 * surface_->size() * n, 0.0F);
    for (std::size_t c = 0; c < m; ++c)
      for (std::size_t r = 0; r < n; ++r) shares_[row_of(others, c) * n + r] = static_cast<float>(u[r * m + c]);
  }

  /// Compute C' from U (3k x `width`), whose first columns are those of the touched nodes, in tiles.
  void reduce(const std::vector<double>& u, std::size_t width) {
    const std::size_t n = 3 * nodes_.held.size(), m = 3 * nodes_.touched.size();
    compliance_.resize(m * m);
    constexpr std::size_t tall = 8, wide = 256;
    std::vector<double> tile(tall * wide);
    for (std::size_t top = 0; top < m; top += tall)
      for (std::size_t left = 0; left <= top; left += wide) {
        const std::size_t rows = std::min(tall, m - top), count = std::min(wide, m - left);
        for (std::size_t r = 0; r < rows; ++r)
          for (std::size_t c = 0; c < count; ++c)
            tile[r * wide + c] = entry(row_of(nodes_.touched, top + r), row_of(nodes_.touched, left + c));
        for (std::size_t k = 0; k < n; ++k)
          for (std::size_t r = 0; r < rows; ++r)
            CholeskyFactor::subtract(u[k * width + top + r], u.data() + k * width + left, tile.data() + r * wide, count);
        for (std::size_t r = 0; r < rows; ++r)
          for (std::size_t c = 0; c < count && left + c <= top + r; ++c)
            compliance_[(top + r) * m + left + c] = compliance_[(left + c) * m + top + r] = static_cast<float>(tile[r * wide + c]);
      }
  }

  static constexpr double least_yield = 1e-6, most_yield = 1e-3;  // of the largest compliance of a held node
  static constexpr double min_pivot = 1e-6;                       // of the diagonal: the rounding of a compliance in single precision

  std::shared_ptr<const CondensedSurface> surface_;
  SupportNodes nodes_;
  std::vector<std::int32_t> local_, held_;  // by node of the body
  bool definite_ = false;
  SupportedModes modes_;
  double yielding_ = 0.0;  // m/N
  std::vector<float> compliance_, shares_;
};

}  // namespace palpate::deformable
