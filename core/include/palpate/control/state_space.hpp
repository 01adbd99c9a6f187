#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "palpate/control/controller.hpp"
#include "palpate/control/stiffness_normalization.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

/// Sampled linear controller from reference and object force to tip force:
///   u_k = C x_k + D [reference; object],   x_{k+1} = A x_k + B [reference; object] + L (applied - u)
/// `applied` is the force that the drive gave. L = 0 is a plain state space. L is nonzero for an observer of the true input and for
/// anti-windup of an integrator. With normalize(), reference and object force are those that an object of the design stiffness would have.
template <class Number>
class BasicStateSpace {
 public:
  using Scalar = Number;

  /// u = reference - object, without states. With zero reference this is the plain impedance display.
  BasicStateSpace() : cd_(18, 0.0), xv_(9, Scalar(0.0)) {
    for (std::size_t i = 0; i < 3; ++i) {
      cd_[4 * i] = 1.0;
      cd_[9 + 4 * i] = -1.0;
    }
  }

  /// A n x n, B n x 6, C 3 x n, D 3 x 6, L n x 3. Allocates; the tick does not.
  BasicStateSpace(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const Eigen::MatrixXd& c, const Eigen::MatrixXd& d,
                  const Eigen::MatrixXd& antiwindup)
      : order_(static_cast<int>(a.rows())) {
    for (const Eigen::MatrixXd* part : {&a, &b, &antiwindup}) ab_.insert(ab_.end(), part->data(), part->data() + part->size());
    for (const Eigen::MatrixXd* part : {&c, &d}) cd_.insert(cd_.end(), part->data(), part->data() + part->size());
    allocate();
    plain_ = is_plain();
  }

  /// Return the same controller for a lane scalar.
  template <class Other>
  [[nodiscard]] BasicStateSpace<Other> cast() const {
    BasicStateSpace<Other> out;
    out.order_ = order_;
    out.ab_ = ab_;
    out.cd_ = cd_;
    out.plain_ = plain_;
    out.normalized_ = normalized_;
    out.normalization_ = BasicStiffnessNormalization<Other>(normalization_.design_stiffness());
    out.allocate();
    return out;
  }

  /// Set the state of one lane; all lanes share the controller.
  void set_lane(int lane, const BasicStateSpace<double>& one) {
    for (std::size_t i = 0; i < xv_.size(); ++i) xv_[i].set(lane, one.xv_[i]);
    normalization_.set_lane(lane, one.normalization_);
  }

  /// Divide reference and object force by the stiffness of their tick, and multiply them by `design_stiffness` [N/m], per axis: the loop
  /// is then the same for every stiffness. See StiffnessNormalization.
  void normalize(const Vector3<>& design_stiffness) {
    normalized_ = true;
    normalization_ = BasicStiffnessNormalization<Scalar>(design_stiffness);
  }

  [[nodiscard]] int order() const { return order_; }

  /// Return the tip force [N] for the signals of a tick.
  [[gnu::always_inline]] Vector3<Scalar> command(const BasicTickInput<Scalar>& input) noexcept {
    if (!normalized_) return output(input.reference, input.object_force);
    const auto [reference, object] = normalization_.apply(input);
    return output(reference, object);
  }

  /// Return the tip force [N] from reference force and object force [N].
  Vector3<Scalar> output(const Vector3<Scalar>& reference, const Vector3<Scalar>& object) noexcept {
    if (plain_) {
      output_ = reference - object;
      return output_;
    }
    const auto n = static_cast<std::size_t>(order_);
    for (std::size_t i = 0; i < 3; ++i) {
      xv_[n + i] = reference[static_cast<int>(i)];
      xv_[n + 3 + i] = object[static_cast<int>(i)];
    }
    // Column by column in registers: at this size calling a general matrix product costs more than the product.
    Vector3<Scalar> u = Vector3<Scalar>::Constant(0.0);
    for (std::size_t j = 0; j < n + 6; ++j) {
      const double* column = cd_.data() + 3 * j;
      for (int i = 0; i < 3; ++i) u[i] += xv_[j] * column[i];
    }
    output_ = u;
    return output_;
  }

  /// Update the state with the force that the drive gave [N].
  void applied(const Vector3<Scalar>& force) noexcept {
    if (order_ == 0) return;
    const auto n = static_cast<std::size_t>(order_);
    for (std::size_t i = 0; i < 3; ++i) xv_[n + 6 + i] = force[static_cast<int>(i)] - output_[static_cast<int>(i)];
    for (std::size_t i = 0; i < n; ++i) next_[i] = 0.0;
    for (std::size_t j = 0; j < n + 9; ++j) {
      const Scalar x = xv_[j];
      const double* column = ab_.data() + j * n;
      for (std::size_t i = 0; i < n; ++i) next_[i] += x * column[i];
    }
    for (std::size_t i = 0; i < n; ++i) xv_[i] = next_[i];
  }

  void reset() noexcept {
    for (Scalar& x : xv_) x = 0.0;
    normalization_.reset();
  }

  [[nodiscard]] Eigen::Map<const Eigen::Matrix<Scalar, Eigen::Dynamic, 1>> state() const { return {xv_.data(), order_}; }

 private:
  template <class Other>
  friend class BasicStateSpace;

  /// Return true for u = reference - object without states.
  [[nodiscard]] bool is_plain() const {
    for (std::size_t i = 0; i < 18; ++i) {
      if (order_ != 0 || cd_[i] != (i % 4 == 0 && i < 9 ? 1.0 : i >= 9 && (i - 9) % 4 == 0 ? -1.0 : 0.0)) return false;
    }
    return true;
  }

  void allocate() {
    xv_.assign(static_cast<std::size_t>(order_) + 9, Scalar(0.0));
    next_.assign(static_cast<std::size_t>(order_), Scalar(0.0));
  }

  int order_ = 0;
  bool plain_ = true;
  bool normalized_ = false;
  BasicStiffnessNormalization<Scalar> normalization_;
  std::vector<double> ab_;    // [A B L], n x (n + 9), column by column
  std::vector<double> cd_;    // [C D], 3 x (n + 6), column by column
  std::vector<Scalar> xv_;    // state, reference, object, applied - output
  std::vector<Scalar> next_;  // state
  Vector3<Scalar> output_ = Vector3<Scalar>::Constant(0.0);
};
using StateSpace = BasicStateSpace<double>;

}  // namespace palpate::control
