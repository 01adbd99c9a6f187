#pragma once

#include <Eigen/Core>

#include "palpate/math/vector.hpp"

namespace palpate::plant {

/// A sampled linear device, torques to angles, about a working point:
///   q = pose + C x,   x_{k+1} = A x_k + B (torque - working_torque)
/// It stands in for the nonlinear arm where the thesis uses the linearised or the identified model.
template <int dof>
class LinearPlant {
 public:
  LinearPlant() = default;
  /// A n x n, B n x dof, C dof x n, sampled at the servo's period; pose [rad], working torque [N*m].
  LinearPlant(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const Eigen::MatrixXd& c, const Joints<dof>& pose,
              const Joints<dof>& working_torque)
      : a_(a), b_(b), c_(c), x_(Eigen::VectorXd::Zero(a.rows())), next_(x_), pose_(pose), working_torque_(working_torque) {}

  [[nodiscard]] Joints<dof> angles() const noexcept {
    Joints<dof> q = pose_;
    q.noalias() += c_ * x_;
    return q;
  }

  void advance(const Joints<dof>& torque) noexcept {
    next_.noalias() = a_ * x_;
    next_.noalias() += b_ * (torque - working_torque_);
    x_.swap(next_);
  }

 private:
  Eigen::MatrixXd a_, b_, c_;
  Eigen::VectorXd x_, next_;
  Joints<dof> pose_ = Joints<dof>::Zero();
  Joints<dof> working_torque_ = Joints<dof>::Zero();
};

}  // namespace palpate::plant
