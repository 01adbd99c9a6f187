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
    detail::FloatPack sum[3];
    const detail::FloatPack *q = detail::as_packs(next_free_.data()->value.data()), *x = detail::as_packs(row(node, 0)),
                            *y = detail::as_packs(row(node, 1)), *z = detail::as_packs(row(node, 2));
    const int n = detail::in_packs(static_cast<int>(stride_));
    for (int k = 0; k < n; ++k) {
      sum[0] += x[k] * q[k];
      sum[1] += y[k] * q[k];
      sum[2] += z[k] * q[k];
    }
    const auto sums = detail::sums_of(sum[0], sum[1], sum[2], detail::FloatPack());
    return {sums[0], sums[1], sums[2]};
  }

  [[nodiscard]] Vector3<> next_free(std::int32_t node, const Vector3<>& /*free*/, const Vector3<>& /*by_forces*/) const noexcept override {
    return free_displacement(node);
  }

  [[nodiscard]] bool costly() const noexcept override { return true; }

  double advance(const Period& period) noexcept override {
    float* const push = modal_force_.data()->value.data();
    const int n = detail::in_packs(static_cast<int>(stride_));
    for (int k = 0; k < n; k += unrolled) {
      detail::FloatPack sum[unrolled];
      for (int c = 0; c < period.count; ++c)
        for (int a = 0; a < 3; ++a) {
          const detail::FloatPack* shape = detail::as_packs(row(period.nodes[c], a)) + k;
          const detail::FloatPack force = period.forces[c][a];
          for (int i = 0; i < unrolled; ++i) sum[i] += force * shape[i];
        }
      for (int i = 0; i < unrolled; ++i) detail::as_packs(push)[k + i] = sum[i];
    }
    const double modal_work = (transition_[3] * Eigen::Map<const Eigen::ArrayXf>(push, omega2_.size()).cast<double>().square()).sum();
    step_modes(push);
    double twice = (state_[1].square() + omega2_ * state_[0].square()).sum();
    if (ratio_ > 1.0) twice += (ratio_ - 1.0) * (omega2_ * (state_[0] - state_[2]).square()).sum();
    return 0.5 * (twice + period.compliance_work - modal_work);
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
    return omega2_[i] * state_[0][i] - static_cast<double>(modal_force_.data()->value[k]);
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
  static constexpr int unrolled = static_cast<int>(lanes) / detail::float_lanes;

  [[nodiscard]] static Vector3<> counted(const Vector3<>& normal, const Vector3<>& v, double sideways) {
    return sideways * v + (1.0 - sideways) * normal.dot(v) * normal;
  }
  [[nodiscard]] float* row(std::int32_t i, int a) noexcept {
    return shapes_.data()->value.data() + (3 * static_cast<std::size_t>(i) + static_cast<std::size_t>(a)) * stride_;
  }
  [[nodiscard]] const float* row(std::int32_t i, int a) const noexcept {
    return shapes_.data()->value.data() + (3 * static_cast<std::size_t>(i) + static_cast<std::size_t>(a)) * stride_;
  }

  /// Advance the modes under the modal forces `push`.
  void step_modes(const float* push) noexcept {
    const bool creeps = ratio_ > 1.0;
    float* const free = next_free_.data()->value.data();
    for (Eigen::Index k = 0; k < omega2_.size(); ++k) {
      const double f = static_cast<double>(push[k]), q = state_[0][k], v = state_[1][k], z = creeps ? state_[2][k] : 0.0;
      state_[0][k] = flush_denormal(transition_[0][k] * q + transition_[1][k] * v + transition_[2][k] * z + transition_[3][k] * f);
      state_[1][k] = flush_denormal(transition_[4][k] * q + transition_[5][k] * v + transition_[6][k] * z + transition_[7][k] * f);
      if (creeps)
        state_[2][k] = flush_denormal(transition_[8][k] * q + transition_[9][k] * v + transition_[10][k] * z + transition_[11][k] * f);
      free[k] = static_cast<float>(transition_[0][k] * state_[0][k] + transition_[1][k] * state_[1][k] +
                                   (creeps ? transition_[2][k] * state_[2][k] : 0.0));
    }
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
