#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/float_pack.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/body_motion.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/deformable/linear/oscillator.hpp"
#include "palpate/math/shared_buffer.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Vibration modes of a body at its nodes.
struct ModalData {
  const float* shapes = nullptr;    ///< 3n x m [1/sqrt(kg)], row 3 x node + axis, mass-normalized
  std::vector<double> frequencies;  ///< m, rad/s
  double rayleigh_alpha = 0.0;      ///< damping by mass, 1/s
  double rayleigh_beta = 0.0;       ///< damping by stiffness, s
};

/// Memory of a body with inertia, by its modes in all directions. Each mode is integrated exactly over a period with constant force:
///   q'' + (alpha + beta w^2) q' + w^2 q = phi . f
/// The compliance that the modes leave out has no inertia. With an `instantaneous_ratio` above 1 the modes are a standard linear
/// solid; the compliance left out stays at its long-term value.
class ModalMotion final : public BodyMotion {
 public:
  /// `sideways` as for FullCompliance.
  ModalMotion(const SurfaceNodes& nodes, const ModalData& modes, double period, double instantaneous_ratio, double retardation_time,
              double sideways)
      : stride_((modes.frequencies.size() + lanes - 1) / lanes * lanes),
        ratio_(instantaneous_ratio),
        shapes_(3 * static_cast<std::size_t>(nodes.size()) * stride_ / 16),
        omega2_(Values::Ones(static_cast<Eigen::Index>(stride_))),
        next_free_(stride_ / 16),
        modal_force_(stride_ / 16) {
    const std::size_t count = modes.frequencies.size();
    for (std::int32_t i = 0; i < nodes.size(); ++i)
      for (std::size_t k = 0; k < count; ++k) {
        const float* at = modes.shapes + 3 * static_cast<std::size_t>(i) * count + k;
        const Vector3<> moved = counted(nodes.normal(i), Vector3<float>(at[0], at[count], at[2 * count]).cast<double>(), sideways);
        for (int a = 0; a < 3; ++a) row(i, a)[k] = static_cast<float>(moved[a]);
      }
    for (Values& v : transition_) v = Values::Zero(omega2_.size());
    for (Values& v : state_) v = Values::Zero(omega2_.size());
    for (std::size_t k = 0; k < count; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      const Oscillator o(modes.frequencies[k], period, modes.rayleigh_alpha, modes.rayleigh_beta, instantaneous_ratio, retardation_time);
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) transition_[static_cast<std::size_t>(4 * r + c)][at] = o.transition(r, c);
        transition_[static_cast<std::size_t>(4 * r + 3)][at] = o.input[r];
      }
      omega2_[at] = modes.frequencies[k] * modes.frequencies[k];
    }
  }
  ModalMotion(const ModalMotion&) = default;

  /// Compliance of a period [m/N], 3n x 3n: `full` with the modes' response within a period in place of their static response.
  [[nodiscard]] static std::vector<float> period_compliance(const float* full, std::int32_t nodes, const ModalData& modes, double period,
                                                            double instantaneous_ratio, double retardation_time) {
    using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto size = static_cast<Eigen::Index>(3 * nodes), count = static_cast<Eigen::Index>(modes.frequencies.size());
    Eigen::VectorXf change(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const double w = modes.frequencies[static_cast<std::size_t>(k)];
      const Oscillator o(w, period, modes.rayleigh_alpha, modes.rayleigh_beta, instantaneous_ratio, retardation_time);
      change[k] = static_cast<float>(o.input[0] - 1.0 / (w * w));
    }
    std::vector<float> result(full, full + size * size);
    const Eigen::Map<const Rows> shapes(modes.shapes, size, count);
    Eigen::Map<Rows>(result.data(), size, size).noalias() += shapes * change.asDiagonal() * shapes.transpose();
    return result;
  }

  [[nodiscard]] Vector3<> free_displacement(std::int32_t node) const noexcept override {
    detail::FloatPack sum[3][unrolled];  // the processor adds to several at once
    const detail::FloatPack *q = detail::as_packs(next_free_.data()->value.data()), *x = detail::as_packs(row(node, 0)),
                            *y = detail::as_packs(row(node, 1)), *z = detail::as_packs(row(node, 2));
    const std::size_t n = stride_ / detail::float_lanes;
    for (std::size_t k = 0; k < n; k += unrolled)
      for (std::size_t i = 0; i < unrolled; ++i) {
        sum[0][i] += x[k + i] * q[k + i];
        sum[1][i] += y[k + i] * q[k + i];
        sum[2][i] += z[k + i] * q[k + i];
      }
    for (auto& parts : sum)
      for (std::size_t i = 1; i < unrolled; ++i) parts[0] += parts[i];
    const auto sums = detail::sums_of(sum[0][0], sum[1][0], sum[2][0], detail::FloatPack());
    return {sums[0], sums[1], sums[2]};
  }

  [[nodiscard]] Vector3<> next_free(std::int32_t node, const Vector3<>& /*free*/, const Vector3<>& /*by_forces*/) const noexcept override {
    return free_displacement(node);
  }

  [[nodiscard]] bool costly() const noexcept override { return true; }

  double advance(const Period& period) noexcept override {
    gather(period);
    const double twice = ratio_ > 1.0 ? step_modes<true>() : step_modes<false>();
    return 0.5 * (twice + period.compliance_work);
  }

  void reset() noexcept override {
    for (Values& v : state_) v.setZero();
    std::fill(next_free_.begin(), next_free_.end(), detail::FloatLine());
    std::fill(modal_force_.begin(), modal_force_.end(), detail::FloatLine());
  }

  /// Values [sqrt(kg) m] and velocities [sqrt(kg) m/s] of the modes.
  [[nodiscard]] const double* values() const noexcept { return state_[0].data(); }
  [[nodiscard]] const double* velocities() const noexcept { return state_[1].data(); }

  /// Force on mode k that inertia and damping exert at the end of the last period, as if the mode were in equilibrium, N/sqrt(kg).
  [[nodiscard]] double inertial_force(std::size_t k) const noexcept {
    const auto i = static_cast<Eigen::Index>(k);
    return omega2_[i] * state_[0][i] - static_cast<double>(modal_force_[k / 16].value[k % 16]);
  }

  /// Continue with the first `count` values and velocities, of an elastic body.
  void set_state(const double* values, const double* velocities, std::size_t count) noexcept {
    float* const free = next_free_.data()->value.data();
    for (std::size_t k = 0; k < count; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      state_[0][i] = values[k];
      state_[1][i] = velocities[k];
      free[k] = static_cast<float>(transition_[0][i] * values[k] + transition_[1][i] * velocities[k]);
    }
  }

  [[nodiscard]] std::unique_ptr<BodyMotion> clone_at_rest() const override {
    auto copy = std::make_unique<ModalMotion>(*this);
    copy->reset();
    return copy;
  }

 private:
  using Values = Eigen::ArrayXd;
  static constexpr std::size_t lanes = 16;  // modes are padded to a multiple of it
  static constexpr std::size_t unrolled = lanes / detail::float_lanes;

  [[nodiscard]] static Vector3<> counted(const Vector3<>& normal, const Vector3<>& v, double sideways) {
    return sideways * v + (1.0 - sideways) * normal.dot(v) * normal;
  }
  [[nodiscard]] float* row(std::int32_t i, int a) noexcept {
    return shapes_.data()->value.data() + (3 * static_cast<std::size_t>(i) + static_cast<std::size_t>(a)) * stride_;
  }
  [[nodiscard]] const float* row(std::int32_t i, int a) const noexcept {
    return shapes_.data()->value.data() + (3 * static_cast<std::size_t>(i) + static_cast<std::size_t>(a)) * stride_;
  }

  /// Set the modal forces to those of a period.
  void gather(const Period& period) noexcept {
    const std::size_t n = stride_ / detail::float_lanes;
    std::size_t k = 0;
    for (; k + 4 * unrolled <= n; k += 4 * unrolled) gather<4 * unrolled>(period, k);
    for (; k < n; k += unrolled) gather<unrolled>(period, k);
  }
  /// The same in the registers `first` to first + count - 1.
  template <std::size_t count>
  void gather(const Period& period, std::size_t first) noexcept {
    detail::FloatPack sum[count];
    for (int c = 0; c < period.count; ++c)
      for (int a = 0; a < 3; ++a) {
        const detail::FloatPack* shape = detail::as_packs(row(period.nodes[c], a)) + first;
        const detail::FloatPack force = period.forces[c][a];
        for (std::size_t i = 0; i < count; ++i) sum[i] += force * shape[i];
      }
    for (std::size_t i = 0; i < count; ++i) detail::as_packs(modal_force_.data()->value.data())[first + i] = sum[i];
  }

  /// Advance the modes under the modal forces. Return twice their energy at the end, less the forces' work in their response within the
  /// period, J.
  template <bool creeps>
  double step_modes() noexcept {
    const double ratio = ratio_;
    std::array<double, lanes> sum{};
    for (std::size_t first = 0; first < stride_; first += lanes) {
      const float* const push = modal_force_.data()->value.data() + first;
      float* const free = next_free_.data()->value.data() + first;
      const auto at = [first](Values& values) { return values.data() + first; };
      std::array<const double*, 12> by{};
      for (std::size_t i = 0; i < by.size(); ++i) by[i] = at(transition_[i]);
      const double* const omega2 = at(omega2_);
      double *const value = at(state_[0]), *const velocity = at(state_[1]), *const dashpot = at(state_[2]);
      // Into arrays of their own: the compiler knows that no other array overlaps them, and vectorizes.
      std::array<double, lanes> next_q, next_v, next_z, rest;
      for (std::size_t l = 0; l < lanes; ++l) {
        const double f = static_cast<double>(push[l]), q = value[l], v = velocity[l], z = creeps ? dashpot[l] : 0.0;
        const auto next = [&](std::size_t i) {
          const double elastic = by[i][l] * q + by[i + 1][l] * v;
          return flush_denormal((creeps ? elastic + by[i + 2][l] * z : elastic) + by[i + 3][l] * f);
        };
        next_q[l] = next(0);
        next_v[l] = next(4);
        next_z[l] = creeps ? next(8) : 0.0;
        rest[l] = by[0][l] * next_q[l] + by[1][l] * next_v[l];
        if (creeps) rest[l] += by[2][l] * next_z[l];
        const double bent = next_q[l] * next_q[l] + (creeps ? (ratio - 1.0) * ((next_q[l] - next_z[l]) * (next_q[l] - next_z[l])) : 0.0);
        sum[l] += next_v[l] * next_v[l] + omega2[l] * bent - by[3][l] * (f * f);
      }
      for (std::size_t l = 0; l < lanes; ++l) {
        value[l] = next_q[l];
        velocity[l] = next_v[l];
        if (creeps) dashpot[l] = next_z[l];
        free[l] = static_cast<float>(rest[l]);
      }
    }
    double total = 0.0;
    for (const double part : sum) total += part;
    return total;
  }

  /// Flush values below 1e-34 to zero: denormal numbers of decayed modes would slow the tick down.
  [[nodiscard]] static double flush_denormal(double x) noexcept { return (x + 1e-18) - 1e-18; }

  std::size_t stride_;  // modes, padded with zeros
  double ratio_;
  SharedBuffer<detail::FloatLine> shapes_;  // 3n x stride, 1/sqrt(kg)
  Values omega2_;                           // squared frequencies, 1/s^2
  std::array<Values, 12> transition_;       // by mode: next value, velocity and dashpot by value, velocity, dashpot and force
  std::array<Values, 3> state_;             // value, velocity, dashpot
  std::vector<detail::FloatLine> next_free_, modal_force_;  // value after the next period without force; N/sqrt(kg)
};

}  // namespace palpate::deformable
