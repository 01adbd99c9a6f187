#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tangential_compliance.hpp"
#include "palpate/deformable/linear/compliance.hpp"
#include "palpate/deformable/linear/oscillator.hpp"
#include "palpate/deformable/linear/viscoelastic_solid.hpp"
#include "palpate/math/shared_buffer.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Modal model: m vibration modes, each integrated exactly over one period with constant force, plus a massless static correction for the
/// truncated modes. Static forces therefore give the deflection of the full compliance.
///   q'' + (alpha + beta w^2) q' + w^2 q = phi . f
/// Optionally viscoelastic, a uniform standard linear solid (Oscillator for the modes, StandardLinearSolid for the correction). With
/// friction each mode exists twice, driven by normal and by tangential forces: as in TipContact these are not coupled.
class Modal {
 public:
  Modal() = default;

  /// `full` is 3n x 3n [m/N], `shapes` 3n x m [1/sqrt(kg)] (mass-normalized), row 3 x node + axis; `frequencies` m [rad/s]; `period` [s];
  /// Rayleigh damping by mass `alpha` [1/s] and stiffness `beta` [s]. `instantaneous_ratio` of the instantaneous to the long-term modulus;
  /// `retardation_time` [s]. `tangential` adds tangential shapes and compliance (required by friction).
  Modal(const SurfaceNodes& nodes, const float* full, const float* shapes, const std::vector<double>& frequencies, double period,
        double alpha, double beta, double instantaneous_ratio = 1.0, double retardation_time = 1.0, bool tangential = false)
      : count_(static_cast<std::size_t>(nodes.size())),
        modes_(frequencies.size()),
        stride_((modes_ + lanes - 1) / lanes * lanes),
        instantaneous_ratio_(instantaneous_ratio),
        normal_shape_(count_ * stride_),
        shape_norms_(count_),
        tail_norms_(count_),
        bounds_(count_),
        evaluations_(count_),
        compliance_(count_ * count_),
        tangential_shape_(tangential ? 2 * count_ * stride_ : 0),
        next_free_(tangential ? 2 * stride_ : stride_, 0.0F),
        modal_force_(next_free_.size(), 0.0F),
        omega2_(static_cast<Eigen::Index>(next_free_.size())) {
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t k = 0; k < modes_; ++k) {
        double sum = 0.0;
        for (std::size_t a = 0; a < 3; ++a)
          sum -= nodes.normal(static_cast<std::int32_t>(i))[static_cast<int>(a)] * static_cast<double>(shapes[(3 * i + a) * modes_ + k]);
        normal_shape_[i * stride_ + k] = static_cast<float>(sum);
        if (!tangential) continue;
        const Eigen::Vector3f moved(shapes[3 * i * modes_ + k], shapes[(3 * i + 1) * modes_ + k], shapes[(3 * i + 2) * modes_ + k]);
        const Eigen::Vector2d in_plane = nodes.tangent_basis(static_cast<std::int32_t>(i)).transpose() * moved.cast<double>();
        for (std::size_t a = 0; a < 2; ++a)
          tangential_shape_[(2 * i + a) * stride_ + k] = static_cast<float>(in_plane[static_cast<Eigen::Index>(a)]);
      }
    for (std::size_t i = 0; i < count_; ++i) {
      shape_norms_[i] = norm_upper_bound(normal_shape_.data() + i * stride_, 0, stride_);
      tail_norms_[i] = norm_upper_bound(normal_shape_.data() + i * stride_, head_modes(), stride_);
    }
    for (std::size_t g = 0; g < nodes.group_count(); ++g) {
      Group group;
      group.begin = static_cast<std::int32_t>(group_nodes_.size());
      nodes.for_each_in_group(g, [&](std::int32_t node) {
        group_nodes_.push_back(node);
        group.max_shape_norm = std::max(group.max_shape_norm, shape_norms_[static_cast<std::size_t>(node)]);
      });
      group.end = static_cast<std::int32_t>(group_nodes_.size());
      groups_.push_back(group);
    }
    for (Values& v : transition_) v = Values::Zero(size());
    for (Values& v : state_) v = Values::Zero(size());
    omega2_.setOnes();
    Eigen::VectorXd period_response(modes_), static_response(modes_);  // modal compliance within one period and in the static limit
    for (std::size_t k = 0; k < modes_; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      const Oscillator o(frequencies[k], period, alpha, beta, instantaneous_ratio, retardation_time);
      for (Eigen::Index copy = at; copy < size(); copy += static_cast<Eigen::Index>(stride_)) {
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) transition_[static_cast<std::size_t>(4 * r + c)][copy] = o.transition(r, c);
          transition_[static_cast<std::size_t>(4 * r + 3)][copy] = o.input[r];
        }
        omega2_[copy] = frequencies[k] * frequencies[k];
      }
      period_response[at] = o.input[0];
      static_response[at] = 1.0 / omega2_[at];
    }
    Compliance correction(nodes, full, tangential);  // compliance of the truncated modes
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      layer_.push_back(correction.compliance(i, i));
      if (tangential) tangential_layer_.push_back(correction.tangential(i, i));
    }
    const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> phi(
        normal_shape_.data(), static_cast<Eigen::Index>(count_), static_cast<Eigen::Index>(stride_));
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        const auto a = static_cast<std::int32_t>(i), b = static_cast<std::int32_t>(j);
        const Eigen::VectorXd both =
            phi.row(a).head(period_response.size()).cast<double>().cwiseProduct(phi.row(b).head(period_response.size()).cast<double>());
        correction.set(a, b, correction.compliance(a, b) - both.dot(static_response));
        compliance_[i * count_ + j] = compliance_[j * count_ + i] = static_cast<float>(both.dot(period_response));
      }
    if (tangential)
      for_each_tangential_block(static_response, [&correction](std::int32_t i, std::int32_t j, const Eigen::Matrix2d& block) {
        correction.set_tangential(i, j, correction.tangential(i, j) - block);
      });
    if (viscoelastic()) {
      correction_ = StandardLinearSolid(correction, instantaneous_ratio, retardation_time, period);
      creep_ = correction_.creep();
    }
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j < count_; ++j) {
        const auto a = static_cast<std::int32_t>(i), b = static_cast<std::int32_t>(j);
        compliance_[i * count_ + j] += static_cast<float>(viscoelastic() ? correction_.compliance(a, b) : correction.compliance(a, b));
      }
    if (!tangential) return;
    tangential_ = TangentialCompliance(count_);
    for_each_tangential_block(period_response, [&](std::int32_t i, std::int32_t j, const Eigen::Matrix2d& block) {
      tangential_.set(i, j, block + (viscoelastic() ? correction_.tangential(i, j) : correction.tangential(i, j)));
    });
  }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j)]);
  }

  [[nodiscard]] double free_displacement(std::int32_t i) noexcept {
    const double moving = modal_displacement(i);
    return viscoelastic() ? moving + correction_.free_displacement(i) : moving;
  }

  /// Static compliance of a node by itself, which a partial coverage of its patch divides, m/N; creeps as `creep()`.
  [[nodiscard]] double layer_compliance(std::int32_t i) const noexcept { return creep_.period_ratio * layer_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] Eigen::Matrix2d tangential_layer(std::int32_t i) const noexcept {
    return creep_.period_ratio * tangential_layer_[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] const Creep& creep() const noexcept { return creep_; }

  [[nodiscard]] bool has_tangential() const noexcept { return !tangential_.empty(); }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept { return tangential_(i, j); }

  [[nodiscard]] Eigen::Vector2d free_tangential_displacement(std::int32_t i) const noexcept {
    const float* rows = tangential_shape_.data() + 2 * static_cast<std::size_t>(i) * stride_;
    const float* tangential_part = next_free_.data() + stride_;
    const Eigen::Vector2d moving(dot(rows, tangential_part, stride_), dot(rows + stride_, tangential_part, stride_));
    return viscoelastic() ? Eigen::Vector2d(moving + correction_.free_tangential_displacement(i)) : moving;
  }

  /// Whether free_displacement(i) is certainly at least `value` [m]. Uses bounds by the Cauchy-Schwarz inequality: an earlier lower bound
  /// less the distance the modes moved since, or the partial sum of the first modes less the norms of the rest. Few nodes need all modes.
  [[nodiscard]] bool free_displacement_at_least(std::int32_t i, double value) noexcept {
    if (viscoelastic()) return false;
    if (lower_bound(i) >= value) return true;
    const auto at = static_cast<std::size_t>(i);
    const double first = stride_ > head_modes() ? partial_displacement(i, head_modes()) - tail_norms_[at] * next_free_tail_norm_
                                                : -shape_norms_[at] * next_free_norm_;
    if (first >= value + lookahead_ticks * shape_norms_[at] * step_norm_) {  // valid for some ticks to come
      bounds_[at] = {first - round_off * shape_norms_[at] * next_free_norm_, path_length_};
      return true;
    }
    return modal_displacement(i) >= value;
  }

  /// Same for all nodes of a group.
  [[nodiscard]] bool group_free_displacement_at_least(std::size_t group, double value) noexcept {
    if (viscoelastic()) return false;
    Group& all = groups_[group];
    if (all.bound.value - all.max_shape_norm * (path_length_ - all.bound.path_length) >= value) return true;
    if (tick_ < all.next_check) return false;
    double lowest = std::numeric_limits<double>::infinity();
    for (std::int32_t k = all.begin; k < all.end; ++k) lowest = std::min(lowest, lower_bound(group_nodes_[static_cast<std::size_t>(k)]));
    all.bound = {lowest, path_length_};
    if (lowest < value) all.next_check = tick_ + group_check_interval;
    return lowest >= value;
  }

  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  /// `tangential` are forces in the nodes' tangent planes, or null.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* tangential, int count) noexcept {
    std::fill(modal_force_.begin(), modal_force_.end(), 0.0F);
    for (int c = 0; c < count; ++c) {
      const float* shape = normal_shape_.data() + static_cast<std::size_t>(nodes[c]) * stride_;
      const auto force = static_cast<float>(forces[c]);
      for (std::size_t k = 0; k < stride_; ++k) modal_force_[k] += force * shape[k];
      if (tangential == nullptr) continue;
      const float *one = tangential_shape_.data() + 2 * static_cast<std::size_t>(nodes[c]) * stride_, *two = one + stride_;
      const auto first = static_cast<float>(tangential[c][0]), second = static_cast<float>(tangential[c][1]);
      float* tangential_part = modal_force_.data() + stride_;
      for (std::size_t k = 0; k < stride_; ++k) tangential_part[k] += first * one[k] + second * two[k];
    }
    modal_work_ =
        count > 0 ? (transition_[3] * Eigen::Map<const Eigen::ArrayXf>(modal_force_.data(), size()).cast<double>().square()).sum() : 0.0;
    double* const q = state_[0].data();
    double* const v = state_[1].data();
    double* const z = state_[2].data();
    if (viscoelastic()) {
      correction_.advance(nodes, forces, tangential, count);
      for (Eigen::Index k = 0; k < size(); ++k) {
        const auto f = static_cast<double>(modal_force_[static_cast<std::size_t>(k)]);
        const double a = q[k], b = v[k], c = z[k];
        q[k] = flush_denormal(transition_[0][k] * a + transition_[1][k] * b + transition_[2][k] * c + transition_[3][k] * f);
        v[k] = flush_denormal(transition_[4][k] * a + transition_[5][k] * b + transition_[6][k] * c + transition_[7][k] * f);
        z[k] = flush_denormal(transition_[8][k] * a + transition_[9][k] * b + transition_[10][k] * c + transition_[11][k] * f);
        set_next_free(static_cast<std::size_t>(k), transition_[0][k] * q[k] + transition_[1][k] * v[k] + transition_[2][k] * z[k]);
      }
    } else {
      for (std::size_t k = 0; k < next_free_.size(); k += lanes) step_elastic(k);
    }
    update_bounds();
  }

  /// Adopt the state of the same body with another period.
  void take_state(const Modal& other) noexcept {
    for (std::size_t s = 0; s < state_.size(); ++s) state_[s] = other.state_[s];
    correction_.take_state(other.correction_);
    modal_work_ = other.modal_work_;
    for (Eigen::Index k = 0; k < size(); ++k)
      set_next_free(static_cast<std::size_t>(k),
                    transition_[0][k] * state_[0][k] + transition_[1][k] * state_[1][k] + transition_[2][k] * state_[2][k]);
    update_bounds();
  }

  void reset() noexcept {
    for (Values& v : state_) v.setZero();
    std::fill(next_free_.begin(), next_free_.end(), 0.0F);
    next_free_norm_ = next_free_tail_norm_ = path_length_ = step_norm_ = modal_work_ = 0.0;
    tick_ = 0;
    std::fill(evaluations_.begin(), evaluations_.end(), Evaluation());
    std::fill(bounds_.begin(), bounds_.end(), Bound());
    for (Group& group : groups_) {
      group.bound = Bound();
      group.next_check = 0;
    }
    correction_.reset();
  }

  /// Energy at the end of the last period, J. `compliance_work` is f.C f with the compliance C within the period [N m]. The massless
  /// correction adds the elastic energy under the last forces.
  [[nodiscard]] double energy(double compliance_work) const noexcept {
    const double remainder = compliance_work - modal_work_;
    return energy() + (viscoelastic() ? correction_.energy(remainder) : 0.5 * remainder);
  }

  /// Kinetic and elastic energy of the modes, J.
  [[nodiscard]] double energy() const noexcept {
    const double delayed = viscoelastic() ? (instantaneous_ratio_ - 1.0) * (omega2_ * (state_[0] - state_[2]).square()).sum() : 0.0;
    return 0.5 * ((state_[1].square() + omega2_ * state_[0].square()).sum() + delayed);
  }

 private:
  using Values = Eigen::ArrayXd;
  static constexpr std::size_t lanes = 16;
  static constexpr double round_off = 4e-6;                // bound for a sum over thousands of modes in single precision
  static constexpr double lookahead_ticks = 16.0;          // ticks for which a new bound should hold
  static constexpr std::int64_t group_check_interval = 8;  // ticks between tests of a group whose bound failed

  /// Lower bound of a node's displacement: `value` [m] when the modal path length was `path_length` [sqrt(kg) m].
  struct Bound {
    double value = 0.0, path_length = 0.0;
  };
  /// Displacement [m] of a node by all modes, and the tick of its evaluation.
  struct Evaluation {
    double value = 0.0;
    std::int64_t tick = -1;
  };
  /// Range of group_nodes_ with the largest shape norm and a common bound.
  struct Group {
    std::int32_t begin = 0, end = 0;
    double max_shape_norm = 0.0;
    Bound bound;
    std::int64_t next_check = 0;  // earliest tick of the next test
  };

  /// Begin the next tick with the bounds of next_free_, whose change is in modal_force_.
  void update_bounds() noexcept {
    ++tick_;
    step_norm_ = norm_upper_bound(modal_force_.data(), 0, stride_);
    path_length_ += step_norm_;
    next_free_tail_norm_ = norm_upper_bound(next_free_.data(), head_modes(), stride_);
    next_free_norm_ = std::hypot(next_free_tail_norm_, norm_upper_bound(next_free_.data(), 0, head_modes()));
  }

  /// Displacement of a node by all modes, m; evaluated once per tick.
  [[nodiscard]] double modal_displacement(std::int32_t i) noexcept {
    const auto at = static_cast<std::size_t>(i);
    if (evaluations_[at].tick != tick_) {
      evaluations_[at] = {partial_displacement(i, stride_), tick_};
      bounds_[at] = {evaluations_[at].value - round_off * shape_norms_[at] * next_free_norm_, path_length_};
    }
    return evaluations_[at].value;
  }

  /// Lower bound of a node's free displacement, m.
  [[nodiscard]] double lower_bound(std::int32_t i) const noexcept {
    const Bound& bound = bounds_[static_cast<std::size_t>(i)];
    return bound.value - shape_norms_[static_cast<std::size_t>(i)] * (path_length_ - bound.path_length);
  }

  /// Advance the elastic modes `first` to `first + lanes - 1` by one period, in vector registers.
  void step_elastic(std::size_t first) noexcept {
    const auto at = static_cast<Eigen::Index>(first);
    const double *const qq = &transition_[0][at], *const qv = &transition_[1][at], *const qf = &transition_[3][at];
    const double *const vq = &transition_[4][at], *const vv = &transition_[5][at], *const vf = &transition_[7][at];
    double *const q = &state_[0][at], *const v = &state_[1][at];
    float *const free = &next_free_[first], *const push = &modal_force_[first];
    double position[lanes], velocity[lanes];
    float next[lanes], change[lanes];
    for (std::size_t l = 0; l < lanes; ++l) {
      const auto f = static_cast<double>(push[l]);
      position[l] = flush_denormal(qq[l] * q[l] + qv[l] * v[l] + qf[l] * f);
      velocity[l] = flush_denormal(vq[l] * q[l] + vv[l] * v[l] + vf[l] * f);
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      next[l] = static_cast<float>(qq[l] * position[l] + qv[l] * velocity[l]);
      change[l] = next[l] - free[l];
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      q[l] = position[l];
      v[l] = velocity[l];
      free[l] = next[l];
      push[l] = change[l];
    }
  }

  /// Store a mode's next free value; its change replaces the modal force.
  void set_next_free(std::size_t k, double value) noexcept {
    const auto next = static_cast<float>(value);
    modal_force_[k] = next - next_free_[k];
    next_free_[k] = next;
  }

  /// Flush values below 1e-34 to zero: denormal numbers of decayed modes would slow the tick down.
  [[nodiscard]] static double flush_denormal(double x) noexcept { return (x + 1e-18) - 1e-18; }

  [[nodiscard]] bool viscoelastic() const noexcept { return instantaneous_ratio_ > 1.0; }
  [[nodiscard]] Eigen::Index size() const noexcept { return static_cast<Eigen::Index>(next_free_.size()); }
  [[nodiscard]] std::size_t head_modes() const noexcept { return std::min<std::size_t>(stride_, 2 * lanes); }

  /// Displacement of a node by the first `modes` modes, m.
  [[nodiscard]] double partial_displacement(std::int32_t i, std::size_t modes) const noexcept {
    return dot(normal_shape_.data() + static_cast<std::size_t>(i) * stride_, next_free_.data(), modes);
  }

  [[nodiscard]] static double dot(const float* one, const float* other, std::size_t count) noexcept {
    float part[lanes] = {};  // partial sums, one per lane
    for (std::size_t k = 0; k < count; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) part[l] += one[k + l] * other[k + l];
    return pairwise_sum(part);
  }

  /// Sum of the lanes, pairwise.
  [[nodiscard]] static double pairwise_sum(float* part) noexcept {
    for (std::size_t half = lanes / 2; half >= 1; half /= 2)
      for (std::size_t l = 0; l < half; ++l) part[l] += part[l + half];
    return static_cast<double>(part[0]);
  }

  using Shapes = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// Mode shapes in the tangent planes, 2n x modes.
  [[nodiscard]] Shapes tangential_shapes() const {
    const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> phi(
        tangential_shape_.data(), static_cast<Eigen::Index>(2 * count_), static_cast<Eigen::Index>(stride_));
    return phi.leftCols(static_cast<Eigen::Index>(modes_)).cast<double>();
  }

  /// Call visit(i, j, block) for all nodes j <= i with the tangential compliance of the modes, `response` being each mode's compliance.
  template <class Visit>
  void for_each_tangential_block(const Eigen::VectorXd& response, Visit visit) const {
    const Shapes phi = tangential_shapes();
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(count_); ++i) {
      const Shapes row = phi.middleRows(2 * i, 2) * response.asDiagonal() * phi.topRows(2 * i + 2).transpose();
      for (std::int32_t j = 0; j <= i; ++j) visit(i, j, Eigen::Matrix2d(row.block<2, 2>(0, 2 * j)));
    }
  }

  /// Norm of a row from mode `first` to `end`, rounded up.
  [[nodiscard]] static double norm_upper_bound(const float* row, std::size_t first, std::size_t end) noexcept {
    float part[lanes] = {};
    for (std::size_t k = first; k < end; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) {
        const float x = 0x1p40F * row[k + l];  // scaled: squares stay out of the denormal range
        part[l] += x * x;
      }
    return (1.00001 * 0x1p-40) * std::sqrt(pairwise_sum(part));
  }

  std::size_t count_ = 0;  // nodes
  std::size_t modes_ = 0;
  std::size_t stride_ = 0;  // modes, padded with zeros
  double instantaneous_ratio_ = 1.0;
  SharedBuffer<float> normal_shape_;              // n x stride: displacement along the inward normal, 1/sqrt(kg)
  std::vector<double> shape_norms_, tail_norms_;  // by node: norm of the shape row, whole and without the first modes, 1/sqrt(kg)
  std::vector<Bound> bounds_;                     // by node
  std::vector<Evaluation> evaluations_;           // by node
  std::vector<Group> groups_;
  std::vector<std::int32_t> group_nodes_;  // nodes sorted by group
  SharedBuffer<float> compliance_;         // n x n, m/N: at the end of a period, under a constant force
  SharedBuffer<float> tangential_shape_;   // 2n x stride: shapes in the tangent planes, or empty
  TangentialCompliance tangential_;        // like compliance_, in the tangent planes, or empty
  std::vector<float> next_free_;           // mode values after the next period without force, sqrt(kg) m; normal, then tangential copies
  std::vector<float> modal_force_;         // N/sqrt(kg); normal, then tangential copies
  double next_free_norm_ = 0.0, next_free_tail_norm_ = 0.0;  // norms of next_free_, whole and without the first modes, sqrt(kg) m
  double path_length_ = 0.0;                                 // sum of the norms of its changes, sqrt(kg) m
  double step_norm_ = 0.0;                                   // norm of the last change, sqrt(kg) m
  double modal_work_ = 0.0;                                  // f.C f with the modal compliance within the last period, N m
  std::int64_t tick_ = 0;
  Values omega2_;                      // squared frequencies, 1/s^2
  std::array<Values, 12> transition_;  // by mode: next value, velocity and dashpot by value, velocity, dashpot and force
  std::array<Values, 3> state_;        // value, velocity, dashpot
  StandardLinearSolid correction_;     // static correction, if viscoelastic
  Creep creep_;
  std::vector<double> layer_;                      // by node: static compliance along the normal, m/N
  std::vector<Eigen::Matrix2d> tangential_layer_;  // same in the tangent plane, or empty
};

}  // namespace palpate::deformable
