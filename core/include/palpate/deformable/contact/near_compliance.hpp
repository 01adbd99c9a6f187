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

/// Copy of the compliance of the nodes near a tip, in the order of their places. The nine entries of the blocks of as many places as a
/// register has lanes lie together, for products with PlaceForces and for the exchange of places.
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
    std::swap_ranges(entry(k, 0), entry(k, 0) + 9 * lanes * detail::in_registers(count), entry(l, 0));
    for (int j = 0; j < count; ++j) {
      float *one = entry(j, k), *two = entry(j, l);
      for (int i = 0; i < 9; ++i) std::swap(one[i * lanes], two[i * lanes]);
    }
  }

  /// Displacement of place k under the forces of the first `count` places; further forces up to a multiple of 8 must be zero.
  [[nodiscard]] Vector3<> displacement(int k, const PlaceForces& forces, int count) const noexcept {
    detail::Floats x{}, y{}, z{};
    const int n = detail::in_registers(count);
    const detail::Floats* c = detail::as_floats(entry(k, 0));
    const detail::Floats *fx = detail::as_floats(forces.axis(0)), *fy = detail::as_floats(forces.axis(1)),
                         *fz = detail::as_floats(forces.axis(2));
    for (int j = 0; j < n; ++j, c += 9) {
      x += (c[0] * fx[j] + c[1] * fy[j]) + c[2] * fz[j];
      y += (c[3] * fx[j] + c[4] * fy[j]) + c[5] * fz[j];
      z += (c[6] * fx[j] + c[7] * fy[j]) + c[8] * fz[j];
    }
    return {detail::sum_of(x), detail::sum_of(y), detail::sum_of(z)};
  }

  /// Compute d . C_kj s_j for the places `first` <= j < `count` into `out`: displacement of place k along `direction` by unit forces along
  /// s_j.
  void along(int k, const Vector3<>& direction, const PlaceForces& unit, int first, int count, float* out) const noexcept {
    const int n = detail::in_registers(count), from = first / lanes;
    const detail::Floats* c = detail::as_floats(entry(k, from * lanes));
    const auto d0 = static_cast<float>(direction[0]), d1 = static_cast<float>(direction[1]), d2 = static_cast<float>(direction[2]);
    for (int j = from; j < n; ++j, c += 9) {
      detail::Floats sum{};
      for (int b = 0; b < 3; ++b) sum += detail::as_floats(unit.axis(b))[j] * (d0 * c[b] + d1 * c[3 + b] + d2 * c[6 + b]);
      detail::as_floats(out)[j] = sum;
    }
  }

  /// Add the displacements of the first `count` places by a force on place k to `sum`; the compliance is symmetric.
  void add_displacements(int k, const Vector3<>& force, int count, PlaceForces& sum) const noexcept {
    const int n = detail::in_registers(count);
    const detail::Floats* c = detail::as_floats(entry(k, 0));
    const auto f0 = static_cast<float>(force[0]), f1 = static_cast<float>(force[1]), f2 = static_cast<float>(force[2]);
    for (int j = 0; j < n; ++j, c += 9)
      for (int a = 0; a < 3; ++a) detail::as_floats(sum.axis(a))[j] += f0 * c[a] + f1 * c[3 + a] + f2 * c[6 + a];
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
    const int n = detail::in_registers(size_);
    for (int c = 0; c < size_; ++c) {
      const int from = c / detail::float_lanes;  // the entries above the diagonal in its register are never read
      float* v = factor_column(c);
      for (int i = from; i < n; ++i) detail::as_floats(v)[i] = detail::as_floats(column(c))[i];
      v[c] += static_cast<float>(diagonal[c]);
      int j = 0;
      for (; j + 3 < c; j += 4) {
        const float *p = factor_column(j), *q = factor_column(j + 1), *r = factor_column(j + 2), *s = factor_column(j + 3);
        const float a = p[c], b = q[c], d = r[c], e = s[c];
        for (int i = from; i < n; ++i)
          detail::as_floats(v)[i] -=
              (a * detail::as_floats(p)[i] + b * detail::as_floats(q)[i]) + (d * detail::as_floats(r)[i] + e * detail::as_floats(s)[i]);
      }
      for (; j < c; ++j) {
        const float* p = factor_column(j);
        const float a = p[c];
        for (int i = from; i < n; ++i) detail::as_floats(v)[i] -= a * detail::as_floats(p)[i];
      }
      if (!(v[c] > 0.0F)) return false;
      const float scale = 1.0F / std::sqrt(v[c]);
      inverse_[static_cast<std::size_t>(c)] = scale;
      for (int i = from; i < n; ++i) detail::as_floats(v)[i] *= scale;
    }
    return true;
  }

  /// Replace the right-hand side `x` by the solution.
  void solve(double* x) noexcept {
    const int n = detail::in_registers(size_);
    float* y = work_.data();
    for (int i = 0; i < n * detail::float_lanes; ++i) y[i] = i < size_ ? static_cast<float>(x[i]) : 0.0F;
    for (int c = 0; c < size_; ++c) {
      const float *p = factor_column(c), scaled = y[c] * inverse_[static_cast<std::size_t>(c)];
      for (int i = c / detail::float_lanes; i < n; ++i) detail::as_floats(y)[i] -= scaled * detail::as_floats(p)[i];
      y[c] = scaled;
      done_[static_cast<std::size_t>(c)] = scaled;
    }
    for (int i = 0; i < n * detail::float_lanes; ++i) y[i] = 0.0F;
    for (int c = size_ - 1; c >= 0; --c) {
      const float* p = factor_column(c);
      detail::Floats sum{};
      for (int i = c / detail::float_lanes; i < n; ++i) sum += detail::as_floats(p)[i] * detail::as_floats(y)[i];
      y[c] = (done_[static_cast<std::size_t>(c)] - detail::sum_of(sum)) * inverse_[static_cast<std::size_t>(c)];
      x[c] = static_cast<double>(y[c]);
    }
  }

 private:
  static constexpr int stride = capacity + 16;  // of the columns: an odd number of cache lines

  [[nodiscard]] float* factor_column(int c) noexcept { return factor_.data()->value.data() + c * stride; }

  int size_ = 0;
  std::vector<detail::FloatLine> matrix_, factor_;
  std::array<float, static_cast<std::size_t>(capacity)> inverse_{}, done_{};  // 1 / diagonal of the factor; forward solution
  alignas(64) std::array<float, static_cast<std::size_t>(capacity)> work_{};
};

}  // namespace palpate::deformable
