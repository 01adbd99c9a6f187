#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/body/nodes.hpp"
#include "palpate/math/vector.hpp"

namespace palpate {

/// A body with inertia: m vibration modes, each exact over one servo period with the forces held, and all that they leave out as if it had
/// none (static correction): held for long, forces give the deflection of the full compliance.
///   q'' + (alpha + beta w^2) q' + w^2 q = phi . f
class Modal {
 public:
  Modal() = default;

  /// `full` (3n)^2 [m/N] and `shapes` 3n x m [1/sqrt(kg)], row 3 x node + axis; `frequencies` m [rad/s]; `period` [s]; Rayleigh damping by
  /// mass `alpha` [1/s] and stiffness `beta` [s].
  Modal(const BodyNodes& nodes, const float* full, const float* shapes, const std::vector<double>& frequencies, double period, double alpha,
        double beta)
      : count_(static_cast<std::size_t>(nodes.size())),
        modes_(frequencies.size()),
        stride_((frequencies.size() + lanes - 1) / lanes * lanes),
        shape_(count_ * stride_, 0.0F),
        compliance_(count_ * count_),
        free_(stride_, 0.0F),
        push_(stride_, 0.0F),
        mode_(frequencies.size()) {
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t k = 0; k < modes_; ++k) {
        double sum = 0.0;
        for (std::size_t a = 0; a < 3; ++a)
          sum -= nodes.normal(static_cast<std::int32_t>(i))[static_cast<int>(a)] * static_cast<double>(shapes[(3 * i + a) * modes_ + k]);
        shape_[i * stride_ + k] = static_cast<float>(sum);
      }
    std::vector<double> change(modes_);  // of the compliance: what a mode gives within one period, less what it gives at last
    for (std::size_t k = 0; k < modes_; ++k) {
      mode_[k] = Mode(frequencies[k], period, alpha, beta);
      change[k] = mode_[k].place_by_force - 1.0 / (frequencies[k] * frequencies[k]);
    }
    const std::size_t row = 3 * count_;
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        const Vector3<>&ni = nodes.normal(static_cast<std::int32_t>(i)), &nj = nodes.normal(static_cast<std::int32_t>(j));
        double sum = 0.0;
        for (std::size_t a = 0; a < 3; ++a)
          for (std::size_t b = 0; b < 3; ++b)
            sum += ni[static_cast<int>(a)] * nj[static_cast<int>(b)] * static_cast<double>(full[(3 * i + a) * row + 3 * j + b]);
        for (std::size_t k = 0; k < modes_; ++k)
          sum += static_cast<double>(shape_[i * stride_ + k]) * static_cast<double>(shape_[j * stride_ + k]) * change[k];
        compliance_[i * count_ + j] = compliance_[j * count_ + i] = static_cast<float>(sum);
      }
  }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j)]);
  }

  [[nodiscard]] double at_rest(std::int32_t i) const noexcept {
    const float* shape = shape_.data() + static_cast<std::size_t>(i) * stride_;
    float part[lanes] = {};  // sums side by side, for vector registers
    for (std::size_t k = 0; k < stride_; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) part[l] += shape[k + l] * free_[k + l];
    double sum = 0.0;
    for (const float p : part) sum += static_cast<double>(p);
    return sum;
  }

  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept {
    for (float& p : push_) p = 0.0F;
    for (int c = 0; c < count; ++c) {
      const float* shape = shape_.data() + static_cast<std::size_t>(nodes[c]) * stride_;
      const auto force = static_cast<float>(forces[c]);
      for (std::size_t k = 0; k < stride_; ++k) push_[k] += force * shape[k];
    }
    for (std::size_t k = 0; k < modes_; ++k) free_[k] = static_cast<float>(mode_[k].advance(static_cast<double>(push_[k])));
  }

  void reset() noexcept {
    for (Mode& m : mode_) m.place = m.speed = 0.0;
    for (float& f : free_) f = 0.0F;
  }

  /// Kinetic and elastic energy of the modes, J.
  [[nodiscard]] double energy() const noexcept {
    double sum = 0.0;
    for (const Mode& m : mode_) sum += 0.5 * (m.speed * m.speed + m.square * m.place * m.place);
    return sum;
  }

 private:
  static constexpr std::size_t lanes = 16;

  /// One damped oscillator of unit mass, exact over a period with a held force.
  struct Mode {
    Mode() = default;
    Mode(double frequency, double period, double alpha, double beta) : square(frequency * frequency) {
      const double c = 0.5 * (alpha + beta * square);  // decay, 1/s
      const double d = square - c * c;
      const double decay = std::exp(-c * period);
      double even, odd;  // e^-ct cos(nt), e^-ct sin(nt)/n, or their hyperbolic kin
      if (d > 1e-12 * square) {
        const double n = std::sqrt(d);
        even = decay * std::cos(n * period);
        odd = decay * std::sin(n * period) / n;
      } else if (d < -1e-12 * square) {
        const double n = std::sqrt(-d);  // the exponents -c + n and -c - n are negative: no overflow for stiff, damped modes
        const double slow = std::exp((n - c) * period), fast = std::exp(-(n + c) * period);
        even = 0.5 * (slow + fast);
        odd = 0.5 * (slow - fast) / n;
      } else {
        even = decay;
        odd = decay * period;
      }
      place_by_place = even + c * odd;
      place_by_speed = odd;
      speed_by_place = -square * odd;
      speed_by_speed = even - c * odd;
      place_by_force = (1.0 - place_by_place) / square;
      speed_by_force = odd;
    }

    /// One period under `force`; returns where it will be after the next one without any.
    double advance(double force) noexcept {
      const double q = place_by_place * place + place_by_speed * speed + place_by_force * force;
      speed = speed_by_place * place + speed_by_speed * speed + speed_by_force * force;
      place = q;
      return place_by_place * place + place_by_speed * speed;
    }

    double square = 1.0;  // of the frequency, 1/s^2
    double place_by_place = 1.0, place_by_speed = 0.0, place_by_force = 0.0;
    double speed_by_place = 0.0, speed_by_speed = 1.0, speed_by_force = 0.0;
    double place = 0.0, speed = 0.0;
  };

  std::size_t count_ = 0;  // nodes
  std::size_t modes_ = 0;
  std::size_t stride_ = 0;         // modes, filled up with zeros
  std::vector<float> shape_;       // n x stride: displacement along the inward normal, 1/sqrt(kg)
  std::vector<float> compliance_;  // n x n, m/N: at the end of a period, by a force held over it
  std::vector<float> free_;        // where each mode will be after the next period without forces, sqrt(kg) m
  std::vector<float> push_;        // on each mode, N/sqrt(kg)
  std::vector<Mode> mode_;
};

}  // namespace palpate
