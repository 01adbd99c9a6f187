#pragma once

#include <Eigen/Core>

#include "palpate/math/vector.hpp"

namespace palpate {

/// A sampled controller from reference and object force to tip force:
///   u_k = C x_k + D [reference; object],   x_{k+1} = A x_k + B [reference; object] + L (applied - u)
/// where `applied` is what the drive really gave. L = 0 is a plain state space; an observer that must know the true input, or
/// an integrator that must not wind up, puts its gain there.
class StateSpace {
 public:
  StateSpace()
      : StateSpace(Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 6), Eigen::MatrixXd(3, 0), Eigen::MatrixXd::Zero(3, 6),
                   Eigen::MatrixXd(0, 3)) {}

  /// A n x n, B n x 6, C 3 x n, D 3 x 6, L n x 3. All memory is taken here; the tick takes none.
  StateSpace(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const Eigen::MatrixXd& c, const Eigen::MatrixXd& d,
             const Eigen::MatrixXd& antiwindup)
      : order_(static_cast<int>(a.rows())), ab_(a.rows(), a.cols() + 9), cd_(3, a.cols() + 6), xv_(a.cols() + 9), next_(a.rows()) {
    ab_ << a, b, antiwindup;
    cd_ << c, d;
    xv_.setZero();
    next_.setZero();
  }

  /// u = reference - object: no states. An impedance display with zero reference renders the object as it is.
  static StateSpace negative_feedback() {
    Eigen::MatrixXd d(3, 6);
    d << Eigen::Matrix3d::Identity(), -Eigen::Matrix3d::Identity();
    return {Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 6), Eigen::MatrixXd(3, 0), d, Eigen::MatrixXd(0, 3)};
  }

  [[nodiscard]] int order() const { return order_; }

  /// Output for this sample: tip force [N] from reference force and object force [N].
  Vector3<> output(const Vector3<>& reference, const Vector3<>& object) noexcept {
    xv_.segment<3>(order_) = reference;
    xv_.segment<3>(order_ + 3) = object;
    // Column by column in registers: a general matrix product costs more to call than to do at this size.
    Vector3<> u = Vector3<>::Zero();
    for (int j = 0; j < order_ + 6; ++j) u += xv_[j] * cd_.col(j);
    output_ = u;
    return output_;
  }

  /// Moves the state on, once the force that was really applied [N] is known.
  void advance(const Vector3<>& applied) noexcept {
    if (order_ == 0) return;
    xv_.tail<3>() = applied - output_;
    next_.noalias() = ab_ * xv_;
    xv_.head(order_) = next_;
  }

  void reset() noexcept { xv_.setZero(); }

  [[nodiscard]] auto state() const { return xv_.head(order_); }

 private:
  int order_ = 0;
  Eigen::MatrixXd ab_;                           // [A B L], n x (n + 9)
  Eigen::Matrix<double, 3, Eigen::Dynamic> cd_;  // [C D], 3 x (n + 6)
  Eigen::VectorXd xv_;                           // state, reference, object, applied - output
  Eigen::VectorXd next_;                         // state
  Vector3<> output_ = Vector3<>::Zero();
};

}  // namespace palpate
