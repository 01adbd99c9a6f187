#pragma once

#include <Eigen/Core>
#include <cmath>

namespace palpate::deformable {

/// Damped oscillator of unit mass, exact over a period with constant force. State: displacement q, velocity q', dashpot displacement z.
///   q'' + (alpha + beta omega^2) q' + omega^2 (q + (r - 1) (q - z)) = f,   (retardation_time / r) z' = q - z
/// The spring is a standard linear solid with the ratio r of instantaneous to long-term modulus; r = 1 is elastic and z has no effect.
struct Oscillator {
  Eigen::Matrix3d transition = Eigen::Matrix3d::Identity();
  Eigen::Vector3d input = Eigen::Vector3d::Zero();

  Oscillator() = default;

  /// Long-term frequency `omega` [rad/s], `period` [s], Rayleigh damping `alpha` [1/s] and `beta` [s], `retardation_time` [s].
  Oscillator(double omega, double period, double alpha, double beta, double instantaneous_ratio, double retardation_time) {
    if (instantaneous_ratio > 1.0)
      discretize_viscoelastic(omega, period, alpha + beta * omega * omega, instantaneous_ratio, retardation_time);
    else
      discretize_elastic(omega * omega, period, 0.5 * (alpha + beta * omega * omega));
  }

 private:
  /// Closed form for the elastic oscillator; `c` is the decay rate, 1/s.
  void discretize_elastic(double omega2, double period, double c) {
    const double d = omega2 - c * c;
    const double decay = std::exp(-c * period);
    double cos_term, sin_term;  // e^-ct cos(nt) and e^-ct sin(nt)/n, or their hyperbolic counterparts
    if (d > 1e-12 * omega2) {
      const double n = std::sqrt(d);
      cos_term = decay * std::cos(n * period);
      sin_term = decay * std::sin(n * period) / n;
    } else if (d < -1e-12 * omega2) {
      const double n = std::sqrt(-d);  // both exponents -c +- n are negative: no overflow for stiff, damped modes
      const double slow = std::exp((n - c) * period), fast = std::exp(-(n + c) * period);
      cos_term = 0.5 * (slow + fast);
      sin_term = 0.5 * (slow - fast) / n;
    } else {
      cos_term = decay;
      sin_term = decay * period;
    }
    transition.topLeftCorner<2, 2>() << cos_term + c * sin_term, sin_term, -omega2 * sin_term, cos_term - c * sin_term;
    input << (1.0 - transition(0, 0)) / omega2, sin_term, 0.0;
  }

  /// Matrix exponential of the system augmented by its force (Van Loan 1978), displacements times omega: scaling and squaring of a Taylor
  /// series.
  void discretize_viscoelastic(double omega, double period, double damping, double instantaneous_ratio, double retardation_time) {
    Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
    a.row(0) << 0.0, omega, 0.0, 0.0;
    a.row(1) << -omega * instantaneous_ratio, -damping, omega * (instantaneous_ratio - 1.0), 1.0;
    a.row(2) << instantaneous_ratio / retardation_time, 0.0, -instantaneous_ratio / retardation_time, 0.0;
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
    const Eigen::Vector3d scale(1.0 / omega, 1.0, 1.0 / omega);
    transition = scale.asDiagonal() * sum.topLeftCorner<3, 3>() * scale.cwiseInverse().asDiagonal();
    input = scale.asDiagonal() * sum.topRightCorner<3, 1>();
  }
};

}  // namespace palpate::deformable
