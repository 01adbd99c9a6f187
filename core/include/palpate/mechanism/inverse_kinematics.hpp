#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::mechanism {

/// Poses whose tip is at a given position. It may allocate: inverse kinematics is no part of a servo tick.
template <int dof>
struct InverseKinematics {
  std::vector<Joints<dof>> poses;  ///< rad, or m for prismatic joints; empty if the position is unreachable
  std::string error;               ///< why the position is unreachable, e.g. "412.0 mm from the shoulder, ..."
};

/// Return the pose whose tip is at `p` [m] by damped Newton iteration (Levenberg-Marquardt) from `start`.
template <class Mechanism>
[[nodiscard]] InverseKinematics<Mechanism::dof> newton_inverse(const Mechanism& mechanism, const Vector3<>& p,
                                                               const Joints<Mechanism::dof>& start) {
  constexpr int dof = Mechanism::dof;
  constexpr int max_iterations = 200;
  constexpr double tolerance = 1e-9;  // m
  using Square = Eigen::Matrix<double, dof, dof>;
  Joints<dof> q = start;
  Vector3<> error = p - Vector3<>(mechanism.forward(q));
  double damping = 1e-6;
  for (int i = 0; i < max_iterations && error.norm() > 0.0; ++i) {
    const TipJacobian<dof> j = mechanism.jacobian(q);
    const Square normal = j.transpose() * j;
    const double scale = normal.trace();
    const Joints<dof> step = (normal + damping * scale * Square::Identity()).ldlt().solve(Joints<dof>(j.transpose() * error));
    const Joints<dof> next = q + step;
    const Vector3<> next_error = p - Vector3<>(mechanism.forward(next));
    if (next_error.norm() < error.norm()) {
      const bool converged = error.norm() < tolerance && next_error.norm() > 0.5 * error.norm();  // at rounding
      q = next;
      error = next_error;
      damping = std::fmax(0.1 * damping, 1e-15);
      if (converged) break;
    } else {
      if (damping > 1e8 || !q.allFinite()) break;
      damping *= 10.0;
    }
  }
  if (error.norm() < tolerance) return {{q}, {}};
  if (!std::isfinite(error.norm())) return {{}, "the search began at a pose that the mechanism cannot take; give a pose near the position"};
  char text[96];
  std::snprintf(text, sizeof text, "the nearest position found from the starting pose is %.1f mm away", 1e3 * error.norm());
  return {{}, text};
}

}  // namespace palpate::mechanism
