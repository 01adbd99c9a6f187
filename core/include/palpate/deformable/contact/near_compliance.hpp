#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Forces or displacements of up to `capacity` places: x of all places, then y, then z, single precision.
class PlaceForces {
 public:
  static constexpr int capacity = 256;  // a multiple of 16

  [[nodiscard]] const float* axis(int a) const noexcept { return value_.data() + a * capacity; }
  [[nodiscard]] float* axis(int a) noexcept { return value_.data() + a * capacity; }
  [[nodiscard]] Vector3<> get(int k) const noexcept { return {value_[at(k, 0)], value_[at(k, 1)], value_[at(k, 2)]}; }
  void set(int k, const Vector3<>& force) noexcept {
    for (int a = 0; a < 3; ++a) value_[at(k, a)] = static_cast<float>(force[a]);
  }

 private:
  [[nodiscard]] static std::size_t at(int k, int a) noexcept { return static_cast<std::size_t>(a * capacity + k); }
  alignas(64) std::array<float, static_cast<std::size_t>(3 * capacity)> value_{};
};

/// Copy of the compliance of the nodes near a tip, in the order of their places. The nine entries of the blocks of eight places lie
/// together, for products with PlaceForces and for the exchange of places.
class NearCompliance {
 public:
  static constexpr int capacity = PlaceForces::capacity;

  NearCompliance() : blocks_(static_cast<std::size_t>(capacity * row_length / 16)) {}

  /// Load what enter() will copy for `next` into the cache.
  void prefetch(const FullCompliance& compliance, std::int32_t next, const std::int32_t* node, int count) const noexcept {
    for (int j = 0; j < count; ++j) __builtin_prefetch(compliance.block(next, node[j]));
  }

  /// Copy the blocks of the place k = `count` - 1, whose node is node[k], with all places.
  void enter(const FullCompliance& compliance, const std::int32_t* node, int count) noexcept {
    const int k = count - 1;
    prefetch(compliance, node[k], node, count);
    for (int j = 0; j < count; ++j) {
      const float* block = compliance.block(node[k], node[j]);
      float *mine = entry(k, j), *other = entry(j, k);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) mine[(3 * a + b) * lanes] = other[(3 * b + a) * lanes] = block[3 * a + b];
    }
  }

  /// Exchange two of `count` places.
  void swap(int k, int l, int count) noexcept {
    std::swap_ranges(entry(k, 0), entry(k, 0) + 9 * lanes * detail::in_packs(count), entry(l, 0));
    for (int j = 0; j < count; ++j) {
      float *one = entry(j, k), *two = entry(j, l);
      for (int i = 0; i < 9; ++i) std::swap(one[i * lanes], two[i * lanes]);
    }
  }

  /// Displacement of place k under the forces of the first `count` places; further forces up to a multiple of 8 must be zero.
  [[nodiscard]] Vector3<> displacement(int k, const PlaceForces& forces, int count) const noexcept {
    detail::FloatPack x, y, z;
    const int n = detail::in_packs(count);
    const detail::FloatPack* c = detail::as_packs(entry(k, 0));
    const detail::FloatPack *fx = detail::as_packs(forces.axis(0)), *fy = detail::as_packs(forces.axis(1)),
                            *fz = detail::as_packs(forces.axis(2));
    for (int j = 0; j < n; ++j, c += 9) {
      x += c[0] * fx[j] + (c[1] * fy[j] + c[2] * fz[j]);
      y += c[3] * fx[j] + (c[4] * fy[j] + c[5] * fz[j]);
      z += c[6] * fx[j] + (c[7] * fy[j] + c[8] * fz[j]);
    }
    const auto sums = detail::sums_of(x, y, z, detail::FloatPack());
    return {sums[0], sums[1], sums[2]};
  }

  /// Compute d . C_kj s_j for the places `first` <= j < `count` into `out`: displacement of place k along `direction` by unit forces along
  /// s_j.
  void along(int k, const Vector3<>& direction, const PlaceForces& unit, int first, int count, float* out) const noexcept {
    const int n = detail::in_packs(count), from = first / lanes;
    const detail::FloatPack* c = detail::as_packs(entry(k, from * lanes));
    const detail::FloatPack d0 = direction[0], d1 = direction[1], d2 = direction[2];
    for (int j = from; j < n; ++j, c += 9) {
      detail::FloatPack sum;
      for (int b = 0; b < 3; ++b) sum += detail::as_packs(unit.axis(b))[j] * (d0 * c[b] + (d1 * c[3 + b] + d2 * c[6 + b]));
      detail::as_packs(out)[j] = sum;
    }
  }

  /// Add the displacements of the first `count` places by a force on place k to `sum`; the compliance is symmetric.
  void add_displacements(int k, const Vector3<>& force, int count, PlaceForces& sum) const noexcept {
    const int n = detail::in_packs(count);
    const detail::FloatPack* c = detail::as_packs(entry(k, 0));
    const detail::FloatPack f0 = force[0], f1 = force[1], f2 = force[2];
    for (int j = 0; j < n; ++j, c += 9)
      for (int a = 0; a < 3; ++a) detail::as_packs(sum.axis(a))[j] += f0 * c[a] + f1 * c[3 + a] + f2 * c[6 + a];
  }

  /// Block of places k and j, m/N.
  [[nodiscard]] Matrix3<> block(int k, int j) const noexcept {
    const float* at = entry(k, j);
    Matrix3<> m;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) m(a, b) = static_cast<double>(at[(3 * a + b) * lanes]);
    return m;
  }

 private:
  static constexpr int lanes = detail::float_lanes;
  static constexpr int row_length = 9 * capacity + 16;  // an odd number of cache lines: blocks of one column lie in different sets

  /// Entry (0, 0) of the block of places k and j; the other entries follow, row-major, `lanes` apart.
  [[nodiscard]] static std::ptrdiff_t offset(int k, int j) noexcept {
    return static_cast<std::ptrdiff_t>(k) * row_length + (j / lanes) * (9 * lanes) + j % lanes;
  }
  [[nodiscard]] float* entry(int k, int j) noexcept { return blocks_.data()->value.data() + offset(k, j); }
  [[nodiscard]] const float* entry(int k, int j) const noexcept { return blocks_.data()->value.data() + offset(k, j); }

  std::vector<detail::FloatLine> blocks_;  // m/N
};

/// Dense symmetric positive definite system A + diag(D), single precision, factored by columns.
class LayeredSystem {
 public:
  static constexpr int capacity = PlaceForces::capacity;

  LayeredSystem() : matrix_(static_cast<std::size_t>(capacity * stride / 16)), factor_(matrix_.size()) {}

  [[nodiscard]] int size() const noexcept { return size_; }
  void resize(int size) noexcept { size_ = size; }
  /// Row and column `c` of A; entries from c on, up to a multiple of 8, are read.
  [[nodiscard]] float* column(int c) noexcept { return matrix_.data()->value.data() + c * stride; }

  /// Factor A + diag(`diagonal`). Return false if it is not positive definite to round-off.
  bool factor(const double* diagonal) noexcept {
    const int n = detail::in_packs(size_);
    for (int c = 0; c < size_; ++c) {
      const int from = c / lanes;  // the entries above the diagonal in its register are never read
      float* v = factor_column(c);
      int i = from;
      for (; i + 2 < n; i += 3) eliminate<3>(c, i);
      if (i + 2 == n) eliminate<2>(c, i);
      if (i + 1 == n) eliminate<1>(c, i);
      v[c] += static_cast<float>(diagonal[c]);
      if (!(v[c] > 0.0F)) return false;
      const float scale = 1.0F / std::sqrt(v[c]);
      inverse_[static_cast<std::size_t>(c)] = scale;
      for (i = from; i < n; ++i) detail::as_packs(v)[i] *= scale;
    }
    return true;
  }

  /// Replace the right-hand side `x` by the solution.
  void solve(double* x) noexcept {
    const int n = detail::in_packs(size_);
    float* y = work_.data();
    for (int i = 0; i < n * lanes; ++i) y[i] = i < size_ ? static_cast<float>(x[i]) : 0.0F;
    for (int r = 0; r < n; ++r) {  // forward, one register after the other
      const int first = r * lanes, end = std::min(first + lanes, size_);
      for (int c = first; c < end; ++c) {
        const float* p = factor_column(c);
        y[c] *= inverse_[static_cast<std::size_t>(c)];
        for (int i = c + 1; i < end; ++i) y[i] -= y[c] * p[i];
      }
      for (int i = r + 1; i < n; ++i) {
        detail::FloatPack sum = detail::as_packs(y)[i];
        for (int c = first; c < end; ++c) sum -= y[c] * detail::as_packs(factor_column(c))[i];
        detail::as_packs(y)[i] = sum;
      }
    }
    for (int r = n - 1; r >= 0; --r) {  // backward
      const int first = r * lanes, end = std::min(first + lanes, size_);
      for (int c = first; c < end; c += 4) {
        detail::FloatPack sum[4];
        for (int i = r + 1; i < n; ++i)
          for (int l = 0; l < 4; ++l) sum[l] += detail::as_packs(factor_column(c + l))[i] * detail::as_packs(y)[i];
        const auto sums = detail::sums_of(sum[0], sum[1], sum[2], sum[3]);
        for (int l = 0; l < 4; ++l) y[c + l] -= sums[static_cast<std::size_t>(l)];
      }
      for (int i = end - 1; i >= first; --i) {
        y[i] *= inverse_[static_cast<std::size_t>(i)];
        for (int c = first; c < i; ++c) y[c] -= factor_column(c)[i] * y[i];
      }
      for (int i = end; i < first + lanes; ++i) y[i] = 0.0F;
    }
    for (int i = 0; i < size_; ++i) x[i] = static_cast<double>(y[i]);
  }

 private:
  static constexpr int lanes = detail::float_lanes;
  static constexpr int stride = capacity + 16;  // of the columns: an odd number of cache lines

  /// Compute the registers `from` to from + count - 1 of column c of A less the columns before it of the factor.
  template <int count>
  void eliminate(int c, int from) noexcept {
    detail::FloatPack even[count], odd[count];
    for (int i = 0; i < count; ++i) even[i] = detail::as_packs(column(c))[from + i];
    const auto take = [this, c, from](int j, detail::FloatPack* left) {
      const detail::FloatPack factor = factor_column(j)[c];
      for (int i = 0; i < count; ++i) left[i] -= factor * detail::as_packs(factor_column(j))[from + i];
    };
    int j = 0;
    for (; j + 1 < c; j += 2) {
      take(j, even);
      take(j + 1, odd);
    }
    if (j < c) take(j, even);
    for (int i = 0; i < count; ++i) detail::as_packs(factor_column(c))[from + i] = even[i] + odd[i];
  }

  [[nodiscard]] float* factor_column(int c) noexcept { return factor_.data()->value.data() + c * stride; }

  int size_ = 0;
  std::vector<detail::FloatLine> matrix_, factor_;
  std::array<float, static_cast<std::size_t>(capacity)> inverse_{};  // 1 / diagonal of the factor
  alignas(64) std::array<float, static_cast<std::size_t>(capacity)> work_{};
};

}  // namespace palpate::deformable
