#pragma once

#include <cmath>
#include <cstdio>
#include <numbers>

#include "palpate/math/vector.hpp"
#include "palpate/mechanism/inverse_kinematics.hpp"

namespace palpate::mechanism {

/// Closed-form inverse kinematics of the PHANToM Premium (Hosseini-Zadeh 2004, 2.11-2.13).
struct PremiumInverse {
  double l1;  ///< upper arm, m
  double l2;  ///< forearm, m

  enum class Reach { reachable, too_far, too_close, on_yaw_axis, not_finite };

  struct Solution {
    Reach reach = Reach::reachable;
    Joints<3> q = Joints<3>::Zero();  ///< rad
  };

  /// Return a pose whose tip is at `p` [m], or the reason why there is none. There are up to four poses.
  /// @param behind      the base turns by half a turn and the mechanism reaches over it
  /// @param elbow_down  the elbow folds downward
  [[nodiscard]] Solution solve(const Vector3<>& p, bool behind, bool elbow_down) const {
    if (!p.allFinite()) return {Reach::not_finite, Joints<3>::Zero()};
    const double forward = p[2] + l1;
    double horizontal = std::hypot(p[0], forward);
    const double up = p[1] - l2;
    const double r2 = horizontal * horizontal + up * up;
    const double r = std::sqrt(r2);
    constexpr double tolerance = 1e-12;
    if (r > (l1 + l2) * (1.0 + tolerance)) return {Reach::too_far, Joints<3>::Zero()};
    if (r < std::abs(l1 - l2) * (1.0 - tolerance) || r <= tolerance * l1) return {Reach::too_close, Joints<3>::Zero()};
    if (horizontal <= tolerance * l1) return {Reach::on_yaw_axis, Joints<3>::Zero()};
    double yaw = std::atan2(p[0], forward);
    if (behind) {
      horizontal = -horizontal;
      yaw = std::atan2(-p[0], -forward);
    }
    const auto clamped_acos = [](double x) { return std::acos(std::fmin(1.0, std::fmax(-1.0, x))); };
    const double side = elbow_down ? -1.0 : 1.0;
    const double beta = std::atan2(up, horizontal);
    const double gamma = side * clamped_acos((l1 * l1 + r2 - l2 * l2) / (2.0 * l1 * r));
    const double alpha = side * clamped_acos((l1 * l1 + l2 * l2 - r2) / (2.0 * l1 * l2));
    const double theta2 = gamma + beta;
    return {Reach::reachable, Joints<3>(yaw, theta2, theta2 + alpha - 0.5 * std::numbers::pi)};
  }

  /// Return all poses whose tip is at `p` [m].
  [[nodiscard]] InverseKinematics<3> solve_all(const Vector3<>& p) const {
    InverseKinematics<3> out;
    for (const bool behind : {false, true}) {
      for (const bool elbow_down : {false, true}) {
        const Solution found = solve(p, behind, elbow_down);
        if (found.reach != Reach::reachable) return {{}, explain(p, found.reach)};
        out.poses.push_back(found.q);
      }
    }
    return out;
  }

  /// Return the reason why `p` [m] is unreachable as a sentence.
  [[nodiscard]] std::string explain(const Vector3<>& p, Reach reach) const {
    char text[96] = "";
    const double distance = 1e3 * (p - Vector3<>(0.0, l2, -l1)).norm();
    if (reach == Reach::too_far)
      std::snprintf(text, sizeof text, "%.1f mm from the shoulder, and the arm reaches %.1f mm", distance, 1e3 * (l1 + l2));
    else if (reach == Reach::too_close)
      std::snprintf(text, sizeof text, "%.1f mm from the shoulder, and the folded arm keeps %.1f mm away", distance,
                    1e3 * std::abs(l1 - l2));
    else if (reach == Reach::on_yaw_axis)
      return "it lies on the yaw axis, where the base angle is not determined";
    else if (reach == Reach::not_finite)
      return "it is not finite";
    return text;
  }
};

}  // namespace palpate::mechanism
