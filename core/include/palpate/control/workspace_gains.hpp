#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

#include "palpate/math/vector.hpp"

namespace palpate::control {

/// Rates and ratios from which the gains of a WorkspaceController follow. Plain data.
struct WorkspaceParameters {
  double bandwidth = 200.0;            ///< of the feedback, rad/s
  double damping = 0.9;                ///< ratio of the feedback, at most 1
  double observer = 6.0;               ///< rate of the observer of position and velocity over the bandwidth
  double disturbance = 0.05;           ///< rate of the observer of the disturbance over the bandwidth
  double reference = 250.0;            ///< bandwidth of the reference model, rad/s
  double reference_damping = 1.0;      ///< ratio of the reference model, at most 1
  double share = 0.85;                 ///< of the drive's limit that the reference model uses, above 0 and at most 1
  Vector3<> stiffness{1e3, 1e3, 1e3};  ///< by which forces without a known stiffness are divided, per axis, N/m
  bool normal_only = false;            ///< track an object with a normal along it alone; display its force along the surface
  double operator_mass = 0.0;          ///< that the operator adds to the tip, kg; rather too large than too small

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    const auto positive = [](double x) { return x > 0.0 && std::isfinite(x); };
    if (!positive(bandwidth) || !positive(reference)) return "bandwidth and reference must be positive and finite [rad/s]";
    if (!positive(observer) || !positive(disturbance)) return "observer and disturbance must be positive and finite";
    if (!positive(damping) || !positive(reference_damping) || damping > 1.0 || reference_damping > 1.0)
      return "damping and reference_damping must be above 0 and at most 1";
    if (!positive(share) || share > 1.0) return "share must be above 0 and at most 1";
    if (!stiffness.allFinite() || !(stiffness.minCoeff() > 0.0)) return "stiffness must be positive and finite [N/m]";
    if (!(operator_mass >= 0.0) || !std::isfinite(operator_mass)) return "operator_mass must be finite and not negative [kg]";
    return nullptr;
  }
};

/// Gains of a WorkspaceController for one axis: a double integrator, sampled with a zero-order hold.
struct WorkspaceGains {
  double position = 0.0, velocity = 0.0;   ///< k_p, 1/s^2, and k_d, 1/s
  Vector3<> observer = Vector3<>::Zero();  ///< corrections of deflection, 1, velocity, 1/s, and disturbance, 1/s^2
  double reference_position = 0.0, reference_velocity = 0.0;

  WorkspaceGains() = default;
  /// @param period  servo period T, s
  WorkspaceGains(const WorkspaceParameters& p, double period) {
    place(p.bandwidth, p.damping, period, position, velocity);
    place(p.reference, p.reference_damping, period, reference_position, reference_velocity);
    const double fast = std::exp(-p.observer * p.bandwidth * period), slow = std::exp(-p.disturbance * p.bandwidth * period);
    // Ackermann's formula for the pair (A, C A): the estimate corrected by the measurement of the same tick has the poles.
    Eigen::Matrix3d a;
    a << 1.0, period, 0.5 * period * period, 0.0, 1.0, period, 0.0, 0.0, 1.0;
    Eigen::Matrix3d observability;
    observability.row(0) = a.row(0);
    observability.row(1) = observability.row(0) * a;
    observability.row(2) = observability.row(1) * a;
    const Eigen::Matrix3d eye = Eigen::Matrix3d::Identity();
    observer = (a - fast * eye) * (a - fast * eye) * (a - slow * eye) * observability.inverse().col(2);
  }

 private:
  /// State feedback that places the poles exp((-damping +- j sqrt(1 - damping^2)) rate T).
  static void place(double rate, double damping, double period, double& position, double& velocity) noexcept {
    const double radius = std::exp(-damping * rate * period);
    const double a1 = 2.0 * radius * std::cos(std::sqrt(1.0 - damping * damping) * rate * period), a0 = radius * radius;
    position = (1.0 - a1 + a0) / (period * period);
    velocity = (3.0 - a1 - a0) / (2.0 * period);
  }
};

}  // namespace palpate::control
