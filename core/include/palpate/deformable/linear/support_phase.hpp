#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Contact nodes of a condensed body without the supports that change, and their compliance; shared by its phases.
struct CondensedSurface {
  std::vector<Vector3<>> points;   ///< at rest, m
  std::vector<Vector3<>> normals;  ///< outward, unit
  std::vector<double> areas;       ///< of the nodes' patches, m^2
  std::vector<float> compliance;   ///< 3n x 3n [m/N], symmetric positive definite; row 3 x node + axis

  [[nodiscard]] std::size_t size() const noexcept { return points.size(); }
};

/// Nodes that are held in place, and those that a tip can touch, in ascending order. A held node is not touched.
struct SupportNodes {
  std::vector<std::int32_t> held, touched;
  friend bool operator==(const SupportNodes&, const SupportNodes&) = default;
};

/// A condensed body between two changes of its supports. The forces r on the k held nodes s that keep their displacements zero reduce the
/// compliance of the m touched nodes to
///   C' = C - C_s^T C_ss^-1 C_s,
/// with the capacitance matrix C_ss (James & Pai, ArtDefo, 1999). Computed when the body is loaded or in a thread besides the servo; sums
/// are in a fixed order, so the bits do not depend on the registers.
class SupportPhase {
 public:
  SupportPhase(std::shared_ptr<const CondensedSurface> surface, SupportNodes nodes)
      : surface_(std::move(surface)), nodes_(std::move(nodes)), local_(surface_->size(), -1), held_(surface_->size(), -1) {
    for (std::size_t k = 0; k < nodes_.touched.size(); ++k) local_[at(nodes_.touched[k])] = static_cast<std::int32_t>(k);
    for (std::size_t k = 0; k < nodes_.held.size(); ++k) held_[at(nodes_.held[k])] = static_cast<std::int32_t>(k);
    std::vector<double> factor;
    definite_ = factorize(factor);
    if (definite_) update(factor);
  }

  /// Whether the compliance of the held nodes is positive definite to rounding; otherwise the phase cannot be used.
  [[nodiscard]] bool definite() const noexcept { return definite_; }
  [[nodiscard]] const std::shared_ptr<const CondensedSurface>& surface() const noexcept { return surface_; }
  [[nodiscard]] const std::vector<std::int32_t>& held() const noexcept { return nodes_.held; }
  [[nodiscard]] const std::vector<std::int32_t>& touched() const noexcept { return nodes_.touched; }
  /// Index of a node of the body among the touched or the held nodes, or -1.
  [[nodiscard]] std::int32_t local(std::int32_t node) const noexcept { return local_[at(node)]; }
  [[nodiscard]] std::int32_t held_index(std::int32_t node) const noexcept { return held_[at(node)]; }

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

  /// Compute Cholesky's factor L of C_ss; row c of `columns` is column c of L. Return false if C_ss is not definite to rounding.
  bool factorize(std::vector<double>& columns) const {
    const std::size_t n = 3 * nodes_.held.size();
    columns.assign(n * n, 0.0);
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t r = c; r < n; ++r) columns[c * n + r] = entry(row_of(nodes_.held, c), row_of(nodes_.held, r));
    for (std::size_t c = 0; c < n; ++c) {
      double* const column = columns.data() + c * n;
      const double pivot = column[c], diagonal = entry(row_of(nodes_.held, c), row_of(nodes_.held, c));
      if (!(pivot > min_pivot * diagonal)) return false;
      const double scale = 1.0 / std::sqrt(pivot);
      for (std::size_t r = c; r < n; ++r) column[r] *= scale;
      for (std::size_t next = c + 1; next < n; ++next) subtract(column[next], column + next, columns.data() + next * n + next, n - next);
    }
    return true;
  }

  /// Compute C' = C - U^T U with U = L^-1 C_s, and the shares L^-T U.
  void update(const std::vector<double>& columns) {
    std::vector<std::int32_t> others = nodes_.touched;  // then those that only deform
    for (std::int32_t node = 0; node < static_cast<std::int32_t>(surface_->size()); ++node)
      if (local_[at(node)] < 0 && held_[at(node)] < 0) others.push_back(node);
    const std::size_t n = 3 * nodes_.held.size(), m = 3 * others.size();
    std::vector<double> u(n * m);
    for (std::size_t r = 0; r < n; ++r)
      for (std::size_t c = 0; c < m; ++c) u[r * m + c] = entry(row_of(nodes_.held, r), row_of(others, c));
    for (std::size_t r = 0; r < n; ++r) {
      scale(1.0 / columns[r * n + r], u.data() + r * m, m);
      for (std::size_t next = r + 1; next < n; ++next) subtract(columns[r * n + next], u.data() + r * m, u.data() + next * m, m);
    }
    reduce(u, m);
    for (std::size_t r = n; r-- > 0;) {
      for (std::size_t k = r + 1; k < n; ++k) subtract(columns[r * n + k], u.data() + k * m, u.data() + r * m, m);
      scale(1.0 / columns[r * n + r], u.data() + r * m, m);
    }
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
            subtract(u[k * width + top + r], u.data() + k * width + left, tile.data() + r * wide, count);
        for (std::size_t r = 0; r < rows; ++r)
          for (std::size_t c = 0; c < count && left + c <= top + r; ++c)
            compliance_[(top + r) * m + left + c] = compliance_[(left + c) * m + top + r] = static_cast<float>(tile[r * wide + c]);
      }
  }

  static void subtract(double times, const double* row, double* from, std::size_t count) noexcept {
    for (std::size_t c = 0; c < count; ++c) from[c] -= times * row[c];
  }
  static void scale(double times, double* row, std::size_t count) noexcept {
    for (std::size_t c = 0; c < count; ++c) row[c] *= times;
  }

  static constexpr double min_pivot = 1e-6;  // of the diagonal: the rounding of a compliance in single precision

  std::shared_ptr<const CondensedSurface> surface_;
  SupportNodes nodes_;
  std::vector<std::int32_t> local_, held_;  // by node of the body
  bool definite_ = false;
  std::vector<float> compliance_, shares_;
};

}  // namespace palpate::deformable
