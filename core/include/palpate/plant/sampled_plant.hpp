#pragma once

#include <Eigen/Core>

#include "palpate/math/vector.hpp"

namespace palpate::plant {

/// A sampled linear model of the device from torques to angles, about an operating point:
///   q = pose + C x,   x_{k+1} = A x_k + B (torque - operating_torque)
/// It replaces the nonlinear mechanism by its linearization or by an identified model.
template <int dof>
class SampledPlant {
 public:
  SampledPlant() = default;
  /// @param a  n x n
  /// @param b  n x dof
  /// @param c  dof x n; all sampled at the servo period
  /// @param pose              rad
  /// @param operating_torque  N*m
  SampledPlant(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const Eigen::MatrixXd& c, const Joints<dof>& pose,
               const Joints<dof>& operating_torque)
      : a_(a), b_(b), c_(c), x_(Eigen::VectorXd::Zero(a.rows())), next_(x_), pose_(pose), operating_torque_(operating_torque) {}

  /// Joint angles [rad].
  [[nodiscard]] Joints<dof> angles() const noexcept {
    Joints<dof> q = pose_;
    q.noalias() += c_ * x_;
    return q;
  }

  /// Advance by one period under a constant torque [N*m].
  void advance(const Joints<dof>& torque) noexcept {
    next_.noalias() = a_ * x_;
    next_.noalias() += b_ * (torque - operating_torque_);
    x_.swap(next_);
  }

 private:
  Eigen::MatrixXd a_, b_, c_;
  Eigen::VectorXd x_, next_;
  Joints<dof> pose_ = Joints<dof>::Zero();
  Joints<dof> operating_torque_ = Joints<dof>::Zero();
};

}  // namespace palpate::plant
