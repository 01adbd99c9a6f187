#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "palpate/deformable/hyperelastic/conjugate_gradients.hpp"

namespace palpate::deformable {

/// Unit forces B, each on some of the unknowns.
struct UnitForces {
  struct Entry {
    std::size_t unknown = 0;
    float share = 0.0F;
  };
  std::vector<std::size_t> begin{0};  ///< of each in entries, and the end
  std::vector<Entry> entries;

  [[nodiscard]] std::size_t size() const noexcept { return begin.size() - 1; }
  void clear() {
    begin.assign(1, 0);
    entries.clear();
  }
  /// Calls take(unknown, share) for the entries of force i.
  template <class Take>
  void each(std::size_t i, Take take) const {
    for (std::size_t e = begin[i]; e < begin[i + 1]; ++e) take(entries[e].unknown, entries[e].share);
  }
};

/// Columns Z near K^-1 B of a stiffness K that changes little by little: kept from step to step, and those that are worst bettered by
/// conjugate gradients, sixteen side by side.
///
/// The compliance is that of a body which can only move as the columns do together (Ritz), B'Z (Z'K Z)^-1 Z'B: symmetric, wrong by the
/// square of what the columns lack only, and never too soft.
class ComplianceColumnCache {
 public:
  /// How much work a step is. Distances are in the energy's norm, about.
  struct SolverOptions {
    float enough = 0.05F;  ///< how far from itself a column may stay
    float rough = 0.3F;    ///< the same, of those that are not among the sixteen that are worst
    int steps = 6;         ///< of conjugate gradients, at most: new columns take a few times
  };
  struct Report {
    int steps = 0;      ///< of conjugate gradients, over all sixteens
    double left = 0.0;  ///< how far the worst column was from itself, about; 1 if it was new
  };

  ComplianceColumnCache() = default;
  /// For up to `most` columns at a time.
  ComplianceColumnCache(std::size_t unknowns, std::size_t most)
      : name_((most + width - 1) / width * width, -1),
        own_(name_.size()),
        ahead_(name_.size()),
        product_(name_.size() * name_.size()),
        column_(name_.size() / width, std::vector<Columns>(unknowns)),
        rest_(column_),
        more_(unknowns),
        less_(unknowns),
        solver_(unknowns) {}

  [[nodiscard]] bool has(std::int32_t name) const noexcept { return std::find(name_.begin(), name_.end(), name) != name_.end(); }

  /// to += times * the column of that name, which is there.
  void add(std::int32_t name, float times, float* to) const noexcept {
    const std::size_t slot = slot_of(name);
    const std::vector<Columns>& column = column_[slot / width];
    for (std::size_t k = 0; k < column.size(); ++k) to[k] += times * column[k][slot % width];
  }

  /// From now on the columns of these names, rising: new ones begin at zero.
  void keep(const std::vector<std::int32_t>& names) {
    for (std::int32_t& name : name_)
      if (!std::binary_search(names.begin(), names.end(), name)) name = -1;
    slot_.clear();
    groups_ = 0;
    for (const std::int32_t name : names) {
      if (!has(name)) {
        const std::size_t slot = slot_of(-1);
        name_[slot] = name;
        own_[slot] = 0.0F;
        for (Columns& c : column_[slot / width]) c[slot % width] = 0.0F;
      }
      slot_.push_back(slot_of(name));
      groups_ = std::max(groups_, slot_.back() / width + 1);
    }
  }

  /// Conjugate gradients on the columns that are worst: sixteen, or all that are rough. `own` tells
  /// which of the forces is that of each name, in turn.
  Report better(const BlockMatrix& stiffness, TwoLevelPreconditioner& precondition, const UnitForces& forces,
                const std::vector<std::size_t>& own, const SolverOptions& effort) {
    Columns unused;
    for (std::size_t g = 0; g < groups_; ++g) stiffness.multiply(column_[g].data(), rest_[g].data(), unused);
    for (std::size_t j = 0; j < slot_.size(); ++j)
      forces.each(own[j], [&](std::size_t k, float share) { rest_[slot_[j] / width][k][slot_[j] % width] -= share; });
    const float enough = effort.enough * effort.enough, rough = effort.rough * effort.rough;
    worst_.clear();
    for (std::size_t g = 0; g < groups_; ++g) {
      Columns left;
      Columns* rest = rest_[g].data();
      precondition.measure(rest, left, [rest](std::size_t k) { rest[k] = -rest[k]; });
      for (std::size_t slot = g * width; slot < (g + 1) * width; ++slot) {
        if (name_[slot] < 0) continue;
        const float far = own_[slot] > 0.0F ? std::min(left[slot % width] / own_[slot], 1.0F) : 2.0F;
        if (far > enough) worst_.emplace_back(far, slot);
      }
    }
    std::sort(worst_.begin(), worst_.end(), std::greater<>());
    Report report;
    report.left = worst_.empty() ? 0.0 : std::min(std::sqrt(static_cast<double>(worst_[0].first)), 1.0);
    for (std::size_t from = 0; from < worst_.size() && (from == 0 || worst_[from].first > rough); from += width)
      report.steps += better(stiffness, precondition, from, enough, effort.steps);
    return report;
  }

  /// The compliance of all forces, those without a column too, into `compliance` [m/N], rows of `stride`; how far each goes ahead under
  /// `left` [N] into `ahead` [m].
  void project(const UnitForces& forces, const std::vector<std::size_t>& own, const std::vector<float>& left, double* compliance,
               std::size_t stride, double* ahead) {
    products(left);
    const std::size_t count = forces.size(), row = count + 1;
    // b_i . z_j, and z_j . left at the end of its row.
    reach_.resize(slot_.size() * row);
    for (std::size_t g = 0; g < groups_; ++g)
      for (std::size_t i = 0; i < count; ++i) {
        Columns sum{};
        forces.each(i, [&](std::size_t k, float share) { sum += share * column_[g][k]; });
        for (std::size_t j = 0; j < slot_.size(); ++j)
          if (slot_[j] / width == g) reach_[j * row + i] = static_cast<double>(sum[slot_[j] % width]);
      }
    for (std::size_t j = 0; j < slot_.size(); ++j) reach_[j * row + count] = static_cast<double>(ahead_[slot_[j]]);
    orthonormalise(own, row);
    const auto product = [&](std::size_t i, std::size_t j) {
      double sum = 0.0;
      for (std::size_t k = 0; k < slot_.size(); ++k) sum += reach_[k * row + i] * reach_[k * row + j];
      return sum;
    };
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j <= i; ++j) compliance[i * stride + j] = compliance[j * stride + i] = product(i, j);
      ahead[i] = product(i, count);
    }
    for (std::size_t j = 0; j < slot_.size(); ++j) own_[slot_[j]] = static_cast<float>(compliance[own[j] * stride + own[j]]);
  }

 private:
  static constexpr std::size_t width = sizeof(Columns) / sizeof(float);

  [[nodiscard]] std::size_t slot_of(std::int32_t name) const noexcept {
    return static_cast<std::size_t>(std::find(name_.begin(), name_.end(), name) - name_.begin());
  }

  /// On up to sixteen of the worst columns, side by side.
  int better(const BlockMatrix& stiffness, TwoLevelPreconditioner& precondition, std::size_t from, float enough, int most) {
    const std::size_t count = std::min(worst_.size() - from, width);
    std::array<Columns*, width> column{}, rest{};
    std::array<std::size_t, width> lane{};
    Columns limit{};
    for (std::size_t l = 0; l < count; ++l) {
      const std::size_t slot = worst_[from + l].second;
      column[l] = column_[slot / width].data();
      rest[l] = rest_[slot / width].data();
      lane[l] = slot % width;
      limit[l] = enough * own_[slot];
    }
    for (std::size_t k = 0; k < less_.size(); ++k) {
      more_[k] = less_[k] = Columns{};
      for (std::size_t l = 0; l < count; ++l) less_[k][l] = rest[l][k][lane[l]];
    }
    const auto solved = solver_.solve(stiffness, precondition, more_.data(), less_.data(), limit, most);
    for (std::size_t k = 0; k < less_.size(); ++k)
      for (std::size_t l = 0; l < count; ++l) {
        column[l][k][lane[l]] += more_[k][l];
        rest[l][k][lane[l]] = less_[k][l];
      }
    return solved.steps;
  }

  /// z_i . left of all columns, and z_i . r_j of those whose i is in no later sixteen than j.
  void products(const std::vector<float>& left) {
    for (std::size_t g = 0; g < groups_; ++g) {
      Columns ahead{};
      for (std::size_t k = 0; k < left.size(); ++k) ahead += left[k] * column_[g][k];
      for (std::size_t l = 0; l < width; ++l) ahead_[g * width + l] = ahead[l];
      for (std::size_t h = g; h < groups_; ++h) {
        std::array<Columns, width> sum{};
        for (std::size_t k = 0; k < left.size(); ++k)
          for (std::size_t l = 0; l < width; ++l) sum[l] += rest_[h][k][l] * column_[g][k];
        for (std::size_t l = 0; l < width; ++l)
          for (std::size_t m = 0; m < width; ++m) product_[(g * width + m) * name_.size() + h * width + l] = static_cast<double>(sum[l][m]);
      }
    }
  }

  /// Turns the rows of reach_, one for each column, into those of columns that are orthonormal in the energy, by Cholesky's factor of
  /// Z'K Z; a column that says nothing new gets zeros.
  void orthonormalise(const std::vector<std::size_t>& own, std::size_t row) {
    const std::size_t count = slot_.size();
    lower_.resize(count * count);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j <= i; ++j) {  // z_i . K z_j = z_i . b_j - z_i . r_j
        const std::size_t one = slot_[i], two = slot_[j];
        lower_[i * count + j] = one / width <= two / width ? reach_[i * row + own[j]] - product_[one * name_.size() + two]
                                                           : reach_[j * row + own[i]] - product_[two * name_.size() + one];
      }
    for (std::size_t j = 0; j < count; ++j) {
      const double* const line = &lower_[j * count];
      double pivot = line[j];
      for (std::size_t k = 0; k < j; ++k) pivot -= line[k] * line[k];
      const double inverse = pivot > 1e-5 * line[j] ? 1.0 / std::sqrt(pivot) : 0.0;
      for (std::size_t i = j + 1; i < count; ++i) {
        double sum = lower_[i * count + j];
        for (std::size_t k = 0; k < j; ++k) sum -= lower_[i * count + k] * line[k];
        lower_[i * count + j] = inverse * sum;
      }
      for (std::size_t i = 0; i < row; ++i) {
        double sum = reach_[j * row + i];
        for (std::size_t k = 0; k < j; ++k) sum -= line[k] * reach_[k * row + i];
        reach_[j * row + i] = inverse * sum;
      }
    }
  }

  std::vector<std::int32_t> name_;                    // that each column belongs to; -1: none
  std::vector<std::size_t> slot_;                     // of each name that is kept, in turn
  std::size_t groups_ = 0;                            // of sixteen columns in use
  std::vector<float> own_;                            // compliance of each by itself, m/N; 0: not known
  std::vector<float> ahead_;                          // of each, m
  std::vector<double> product_;                       // z_i . r_j, J
  std::vector<std::vector<Columns>> column_, rest_;   // Z and R = B - K Z, by sixteen, m and N
  std::vector<Columns> more_, less_;                  // sixteen at work, and what is left of them, m and N
  std::vector<std::pair<float, std::size_t>> worst_;  // how far each is from itself, a square; slot
  std::vector<double> reach_, lower_;
  ConjugateGradients<Columns> solver_;
};

}  // namespace palpate::deformable
