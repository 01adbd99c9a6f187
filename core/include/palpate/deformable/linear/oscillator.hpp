#pragma once

#include <Eigen/Core>
#include <cmath>

namespace palpate::deformable {

/// One damped oscillator of unit mass, exact over a period with a held force: place, speed, and the place of the dashpot in its spring.
///   q'' + (alpha + beta w^2) q' + w^2 (q + (instant - 1) (q - z)) = f,   (creep / instant) z' = q - z
/// The spring is a standard linear solid, `instant` times as stiff at once as at last; at 1 it is elastic and z does nothing.
struct Oscillator {
  Eigen::Matrix3d by_state = Eigen::Matrix3d::Identity();
  Eigen::Vector3d by_force = Eigen::Vector3d::Zero();

  Oscillator() = default;

  /// `frequency` w [rad/s] at last, `period` [s], Rayleigh damping `alpha` [1/s] and `beta` [s], `creep` [s].
  Oscillator(double frequency, double period, double alpha, double beta, double instant, double creep) {
    if (instant > 1.0)
      relax(frequency, period, alpha + beta * frequency * frequency, instant, creep);
    else
      ring(frequency * frequency, period, 0.5 * (alpha + beta * frequency * frequency));
  }

 private:
  /// Elastic, in closed form; `c` is the decay, 1/s.
  void ring(double square, double period, double c) {
    const double d = square - c * c;
    const double decay = std::exp(-c * period);
    double even, test_bit;  // e^-ct cos(nt), e^-ct sin(nt)/n, or their hyperbolic kin
    if (d > 1e-12 * square) {
      const double n = std::sqrt(d);
      even = decay * std::cos(n * period);
      test_bit = decay * std::sin(n * period) / n;
    } else if (d < -1e-12 * square) {
      const double n = std::sqrt(-d);  // the exponents -c + n and -c - n are negative: no overflow for stiff, damped modes
      const double slow = std::exp((n - c) * period), fast = std::exp(-(n + c) * period);
      even = 0.5 * (slow + fast);
      test_bit = 0.5 * (slow - fast) / n;
    } else {
      even = decay;
      test_bit = decay * period;
    }
    by_state.topLeftCorner<2, 2>() << even + c * test_bit, test_bit, -square * test_bit, even - c * test_bit;
    by_force << (1.0 - by_state(0, 0)) / square, test_bit, 0.0;
  }

  /// By the exponential of the system with its force (Van Loan 1978), places times w: Taylor's series of a part of the period, squared.
  void relax(double w, double period, double damping, double instant, double creep) {
    Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
    a.row(0) << 0.0, w, 0.0, 0.0;
    a.row(1) << -w * instant, -damping, w * (instant - 1.0), 1.0;
    a.row(2) << instant / creep, 0.0, -instant / creep, 0.0;
    a *= period;
    const double size = a.cwiseAbs().rowwise().sum().maxCoeff();
    const int halvings = size > 0.25 ? static_cast<int>(std::ceil(std::log2(size / 0.25))) : 0;
    a *= std::ldexp(1.0, -halvings);
    Eigen::Matrix4d term = Eigen::Matrix4d::Identity(), sum = term;
    for (int k = 1; k <= 14; ++k) {
      term = (term * a / k).eval();
      sum += term;
    }
    for (int k = 0; k < halvings; ++k) sum = (sum * sum).eval();
    const Eigen::Vector3d scale(1.0 / w, 1.0, 1.0 / w);
    by_state = scale.asDiagonal() * sum.topLeftCorner<3, 3>() * scale.cwiseInverse().asDiagonal();
    by_force = scale.asDiagonal() * sum.topRightCorner<3, 1>();
  }
};

}  // namespace palpate::deformable
