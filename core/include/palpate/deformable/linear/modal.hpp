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
#include "palpate/deformable/linear/standard_linear_solid.hpp"
#include "palpate/math/shared_buffer.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// A body with inertia: m vibration modes, each exact over one servo period with the forces held, and all that they leave out as if it had
/// none (static correction): held for long, forces give the deflection of the full compliance.
///   q'' + (alpha + beta w^2) q' + w^2 q = phi . f
/// or of a standard linear solid, the same throughout (Oscillator, and Relaxing for what is left out). With friction each mode is there
/// twice, moved by the forces along the normals and by those along the surface: as in BodyContact, neither moves the other.
class Modal {
 public:
  Modal() = default;

  /// `full` (3n)^2 [m/N] and `shapes` 3n x m [1/sqrt(kg)], row 3 x node + axis; `frequencies` m [rad/s]; `period` [s]; Rayleigh damping by
  /// mass `alpha` [1/s] and stiffness `beta` [s]. At once `instant` times as stiff as at last, where it creeps with the time `creep` [s].
  /// If `tangential`, which friction needs, with the shapes and compliance along the surface too.
  Modal(const SurfaceNodes& nodes, const float* full, const float* shapes, const std::vector<double>& frequencies, double period,
        double alpha, double beta, double instant = 1.0, double creep = 1.0, bool tangential = false)
      : count_(static_cast<std::size_t>(nodes.size())),
        modes_(frequencies.size()),
        stride_((modes_ + lanes - 1) / lanes * lanes),
        instant_(instant),
        shape_(count_ * stride_),
        longest_(count_),
        tail_(count_),
        seen_(count_),
        asked_(count_),
        compliance_(count_ * count_),
        across_(tangential ? 2 * count_ * stride_ : 0),
        free_(tangential ? 2 * stride_ : stride_, 0.0F),
        push_(free_.size(), 0.0F),
        square_(static_cast<Eigen::Index>(free_.size())) {
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t k = 0; k < modes_; ++k) {
        double sum = 0.0;
        for (std::size_t a = 0; a < 3; ++a)
          sum -= nodes.normal(static_cast<std::int32_t>(i))[static_cast<int>(a)] * static_cast<double>(shapes[(3 * i + a) * modes_ + k]);
        shape_[i * stride_ + k] = static_cast<float>(sum);
        if (!tangential) continue;
        const Eigen::Vector3f moved(shapes[3 * i * modes_ + k], shapes[(3 * i + 1) * modes_ + k], shapes[(3 * i + 2) * modes_ + k]);
        const Eigen::Vector2d along = nodes.across(static_cast<std::int32_t>(i)).transpose() * moved.cast<double>();
        for (std::size_t a = 0; a < 2; ++a) across_[(2 * i + a) * stride_ + k] = static_cast<float>(along[static_cast<Eigen::Index>(a)]);
      }
    for (std::size_t i = 0; i < count_; ++i) {
      longest_[i] = length(shape_.data() + i * stride_, 0, stride_);
      tail_[i] = length(shape_.data() + i * stride_, head(), stride_);
    }
    for (std::size_t g = 0; g < nodes.groups(); ++g) {
      Group group;
      group.begin = static_cast<std::int32_t>(members_.size());
      nodes.group(g, [&](std::int32_t node) {
        members_.push_back(node);
        group.longest = std::max(group.longest, longest_[static_cast<std::size_t>(node)]);
      });
      group.end = static_cast<std::int32_t>(members_.size());
      groups_.push_back(group);
    }
    for (Values& v : by_) v = Values::Zero(size());
    for (Values& v : state_) v = Values::Zero(size());
    square_.setOnes();
    Eigen::VectorXd held(modes_), last(modes_);  // what a mode gives within one period and at last, by force
    for (std::size_t k = 0; k < modes_; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      const Oscillator o(frequencies[k], period, alpha, beta, instant, creep);
      for (Eigen::Index twin = at; twin < size(); twin += static_cast<Eigen::Index>(stride_)) {
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) by_[static_cast<std::size_t>(4 * r + c)][twin] = o.by_state(r, c);
          by_[static_cast<std::size_t>(4 * r + 3)][twin] = o.by_force[r];
        }
        square_[twin] = frequencies[k] * frequencies[k];
      }
      held[at] = o.by_force[0];
      last[at] = 1.0 / square_[at];
    }
    Compliance left(nodes, full, tangential);  // of what the modes leave out
    const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> phi(
        shape_.data(), static_cast<Eigen::Index>(count_), static_cast<Eigen::Index>(stride_));
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        const auto a = static_cast<std::int32_t>(i), b = static_cast<std::int32_t>(j);
        const Eigen::VectorXd both = phi.row(a).head(held.size()).cast<double>().cwiseProduct(phi.row(b).head(held.size()).cast<double>());
        left.set(a, b, left.compliance(a, b) - both.dot(last));
        compliance_[i * count_ + j] = compliance_[j * count_ + i] = static_cast<float>(both.dot(held));
      }
    if (tangential)
      between(last, [&left](std::int32_t i, std::int32_t j, const Eigen::Matrix2d& block) {
        left.set_tangential(i, j, left.tangential(i, j) - block);
      });
    if (relaxes()) left_ = StandardLinearSolid(left, instant, creep, period);
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j < count_; ++j) {
        const auto a = static_cast<std::int32_t>(i), b = static_cast<std::int32_t>(j);
        compliance_[i * count_ + j] += static_cast<float>(relaxes() ? left_.compliance(a, b) : left.compliance(a, b));
      }
    if (!tangential) return;
    tangential_ = TangentialCompliance(count_);
    between(held, [&](std::int32_t i, std::int32_t j, const Eigen::Matrix2d& block) {
      tangential_.set(i, j, block + (relaxes() ? left_.tangential(i, j) : left.tangential(i, j)));
    });
  }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(compliance_[static_cast<std::size_t>(i) * count_ + static_cast<std::size_t>(j)]);
  }

  [[nodiscard]] double at_rest(std::int32_t i) noexcept {
    const double moving = asked(i);
    return relaxes() ? moving + left_.at_rest(i) : moving;
  }

  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept { return tangential_(i, j); }

  [[nodiscard]] Eigen::Vector2d tangential_at_rest(std::int32_t i) const noexcept {
    const float* rows = across_.data() + 2 * static_cast<std::size_t>(i) * stride_;
    const float* twins = free_.data() + stride_;
    const Eigen::Vector2d moving(dot(rows, twins, stride_), dot(rows + stride_, twins, stride_));
    return relaxes() ? Eigen::Vector2d(moving + left_.tangential_at_rest(i)) : moving;
  }

  /// Whether at_rest(i) is surely no less than `place` [m]: from where the node surely was, which it leaves no faster than the modes move
  /// (Cauchy and Schwarz), or from the first modes and the lengths of shape and state beyond them. So few of the nodes under a tip ask all
  /// modes.
  [[nodiscard]] bool surely_above(std::int32_t i, double place) noexcept {
    if (relaxes()) return false;
    if (least(i) >= place) return true;
    const auto at = static_cast<std::size_t>(i);
    const double first = stride_ > head() ? sum(i, head()) - tail_[at] * moving_tail_ : -longest_[at] * moving_;
    if (first >= place + soon * longest_[at] * step_) {  // for some ticks to come, too
      seen_[at] = {first - rounding * longest_[at] * moving_, travelled_};
      return true;
    }
    return asked(i) >= place;
  }

  /// The same of all nodes of a group.
  [[nodiscard]] bool surely_above_all(std::size_t group, double place) noexcept {
    if (relaxes()) return false;
    Group& all = groups_[group];
    if (all.seen.place - all.longest * (travelled_ - all.seen.travelled) >= place) return true;
    if (tick_ < all.again) return false;
    double lowest = std::numeric_limits<double>::infinity();
    for (std::int32_t k = all.begin; k < all.end; ++k) lowest = std::min(lowest, least(members_[static_cast<std::size_t>(k)]));
    all.seen = {lowest, travelled_};
    if (lowest < place) all.again = tick_ + pause;
    return lowest >= place;
  }

  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  /// `across` are forces in the nodes' tangent planes, or none.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* across, int count) noexcept {
    std::fill(push_.begin(), push_.end(), 0.0F);
    for (int c = 0; c < count; ++c) {
      const float* shape = shape_.data() + static_cast<std::size_t>(nodes[c]) * stride_;
      const auto force = static_cast<float>(forces[c]);
      for (std::size_t k = 0; k < stride_; ++k) push_[k] += force * shape[k];
      if (across == nullptr) continue;
      const float *one = across_.data() + 2 * static_cast<std::size_t>(nodes[c]) * stride_, *two = one + stride_;
      const auto first = static_cast<float>(across[c][0]), second = static_cast<float>(across[c][1]);
      float* twins = push_.data() + stride_;
      for (std::size_t k = 0; k < stride_; ++k) twins[k] += first * one[k] + second * two[k];
    }
    rung_ = count > 0 ? (by_[3] * Eigen::Map<const Eigen::ArrayXf>(push_.data(), size()).cast<double>().square()).sum() : 0.0;
    double* const q = state_[0].data();
    double* const v = state_[1].data();
    double* const z = state_[2].data();
    if (relaxes()) {
      left_.advance(nodes, forces, across, count);
      for (Eigen::Index k = 0; k < size(); ++k) {
        const auto f = static_cast<double>(push_[static_cast<std::size_t>(k)]);
        const double a = q[k], b = v[k], c = z[k];
        q[k] = faded(by_[0][k] * a + by_[1][k] * b + by_[2][k] * c + by_[3][k] * f);
        v[k] = faded(by_[4][k] * a + by_[5][k] * b + by_[6][k] * c + by_[7][k] * f);
        z[k] = faded(by_[8][k] * a + by_[9][k] * b + by_[10][k] * c + by_[11][k] * f);
        go(static_cast<std::size_t>(k), by_[0][k] * q[k] + by_[1][k] * v[k] + by_[2][k] * z[k]);
      }
    } else {
      for (std::size_t k = 0; k < free_.size(); k += lanes) ring(k);
    }
    ++tick_;
    step_ = length(push_.data(), 0, stride_);
    travelled_ += step_;
    moving_tail_ = length(free_.data(), head(), stride_);
    moving_ = std::hypot(moving_tail_, length(free_.data(), 0, head()));
  }

  void reset() noexcept {
    for (Values& v : state_) v.setZero();
    std::fill(free_.begin(), free_.end(), 0.0F);
    moving_ = moving_tail_ = travelled_ = step_ = rung_ = 0.0;
    tick_ = 0;
    std::fill(asked_.begin(), asked_.end(), Asked());
    std::fill(seen_.begin(), seen_.end(), Seen());
    for (Group& group : groups_) {
      group.seen = Seen();
      group.again = 0;
    }
    left_.reset();
  }

  /// Energy in the body at the end of the last period, J; `yielded` is f.C f with the compliance C within the period [N m]. To that of the
  /// modes comes what they leave out, without inertia: what its springs hold under the last forces.
  [[nodiscard]] double energy(double yielded) const noexcept {
    const double rest = yielded - rung_;
    return energy() + (relaxes() ? left_.energy(rest) : 0.5 * rest);
  }

  /// Kinetic and elastic energy of the modes, J.
  [[nodiscard]] double energy() const noexcept {
    const double late = relaxes() ? (instant_ - 1.0) * (square_ * (state_[0] - state_[2]).square()).sum() : 0.0;
    return 0.5 * ((state_[1].square() + square_ * state_[0].square()).sum() + late);
  }

 private:
  using Values = Eigen::ArrayXd;
  static constexpr std::size_t lanes = 16;
  static constexpr double rounding = 4e-6;  // of a sum over thousands of modes in single precision, side by side in lanes
  static constexpr double soon = 16.0;      // ticks
  static constexpr std::int64_t pause = 8;  // ticks in which a group that is not all above is left to its nodes

  /// A node was surely no lower than `place` [m] when the modes had travelled so far [sqrt(kg) m].
  struct Seen {
    double place = 0.0, travelled = 0.0;
  };
  /// Where a node was in a tick, by all modes.
  struct Asked {
    double place = 0.0;
    std::int64_t tick = -1;
  };
  /// Neighbours: members_ from begin to end, the longest of their shapes' rows, and the lowest of them.
  struct Group {
    std::int32_t begin = 0, end = 0;
    double longest = 0.0;
    Seen seen;
    std::int64_t again = 0;  // the tick from which on it is looked at once more
  };

  /// Displacement of a node by all modes, m; they are asked once in a tick.
  [[nodiscard]] double asked(std::int32_t i) noexcept {
    const auto at = static_cast<std::size_t>(i);
    if (asked_[at].tick != tick_) {
      asked_[at] = {sum(i, stride_), tick_};
      seen_[at] = {asked_[at].place - rounding * longest_[at] * moving_, travelled_};
    }
    return asked_[at].place;
  }

  /// A node is surely no lower than this without forces, m.
  [[nodiscard]] double least(std::int32_t i) const noexcept {
    const Seen& seen = seen_[static_cast<std::size_t>(i)];
    return seen.place - longest_[static_cast<std::size_t>(i)] * (travelled_ - seen.travelled);
  }

  /// One period of the elastic modes from `first` on, as many as there are lanes, side by side in vector registers.
  void ring(std::size_t first) noexcept {
    const auto at = static_cast<Eigen::Index>(first);
    const double *const qq = &by_[0][at], *const qv = &by_[1][at], *const qf = &by_[3][at];
    const double *const vq = &by_[4][at], *const vv = &by_[5][at], *const vf = &by_[7][at];
    double *const q = &state_[0][at], *const v = &state_[1][at];
    float *const free = &free_[first], *const push = &push_[first];
    double place[lanes], speed[lanes];
    float next[lanes], change[lanes];
    for (std::size_t l = 0; l < lanes; ++l) {
      const auto f = static_cast<double>(push[l]);
      place[l] = faded(qq[l] * q[l] + qv[l] * v[l] + qf[l] * f);
      speed[l] = faded(vq[l] * q[l] + vv[l] * v[l] + vf[l] * f);
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      next[l] = static_cast<float>(qq[l] * place[l] + qv[l] * speed[l]);
      change[l] = next[l] - free[l];
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      q[l] = place[l];
      v[l] = speed[l];
      free[l] = next[l];
      push[l] = change[l];
    }
  }

  /// A mode's next place; how far that is from the last one is left where its push was.
  void go(std::size_t k, double place) noexcept {
    const auto next = static_cast<float>(place);
    push_[k] = next - free_[k];
    free_[k] = next;
  }

  /// Nothing of it is left below 1e-34: a mode that has rung out must not slow the tick down by numbers below the normal ones.
  [[nodiscard]] static double faded(double x) noexcept { return (x + 1e-18) - 1e-18; }

  [[nodiscard]] bool relaxes() const noexcept { return instant_ > 1.0; }
  [[nodiscard]] Eigen::Index size() const noexcept { return static_cast<Eigen::Index>(free_.size()); }
  [[nodiscard]] std::size_t head() const noexcept { return std::min<std::size_t>(stride_, 2 * lanes); }

  /// Displacement of a node by the first modes, m.
  [[nodiscard]] double sum(std::int32_t i, std::size_t modes) const noexcept {
    return dot(shape_.data() + static_cast<std::size_t>(i) * stride_, free_.data(), modes);
  }

  [[nodiscard]] static double dot(const float* one, const float* other, std::size_t count) noexcept {
    float part[lanes] = {};  // sums side by side, for vector registers
    for (std::size_t k = 0; k < count; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) part[l] += one[k + l] * other[k + l];
    return added(part);
  }

  /// Of the lanes, pair by pair.
  [[nodiscard]] static double added(float* part) noexcept {
    for (std::size_t half = lanes / 2; half >= 1; half /= 2)
      for (std::size_t l = 0; l < half; ++l) part[l] += part[l + half];
    return static_cast<double>(part[0]);
  }

  using Shapes = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// The modes' shapes along the surface, 2n x modes.
  [[nodiscard]] Shapes shapes_across() const {
    const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> phi(
        across_.data(), static_cast<Eigen::Index>(2 * count_), static_cast<Eigen::Index>(stride_));
    return phi.leftCols(static_cast<Eigen::Index>(modes_)).cast<double>();
  }

  /// Calls take(i, j, block) for all nodes j <= i with the modes' compliance along the surface, `each` of them giving so much by force.
  template <class Take>
  void between(const Eigen::VectorXd& each, Take take) const {
    const Shapes phi = shapes_across();
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(count_); ++i) {
      const Shapes row = phi.middleRows(2 * i, 2) * each.asDiagonal() * phi.topRows(2 * i + 2).transpose();
      for (std::int32_t j = 0; j <= i; ++j) take(i, j, Eigen::Matrix2d(row.block<2, 2>(0, 2 * j)));
    }
  }

  /// Of a row from mode `first` to `last`, rounded up.
  [[nodiscard]] static double length(const float* row, std::size_t first, std::size_t last) noexcept {
    float part[lanes] = {};
    for (std::size_t k = first; k < last; k += lanes)
      for (std::size_t l = 0; l < lanes; ++l) {
        const float x = 0x1p40F * row[k + l];  // squares that are no numbers below the normal ones
        part[l] += x * x;
      }
    return (1.00001 * 0x1p-40) * std::sqrt(added(part));
  }

  std::size_t count_ = 0;  // nodes
  std::size_t modes_ = 0;
  std::size_t stride_ = 0;  // modes, filled up with zeros
  double instant_ = 1.0;
  SharedBuffer<float> shape_;           // n x stride: displacement along the inward normal, 1/sqrt(kg)
  std::vector<double> longest_, tail_;  // lengths of the shapes' rows, whole and beyond the first modes, 1/sqrt(kg)
  std::vector<Seen> seen_;              // by node
  std::vector<Asked> asked_;            // by node
  std::vector<Group> groups_;
  std::vector<std::int32_t> members_;        // nodes, by group
  SharedBuffer<float> compliance_;           // n x n, m/N: at the end of a period, by a force held over it
  SharedBuffer<float> across_;               // 2n x stride: the shapes in the tangent planes, or nothing
  TangentialCompliance tangential_;          // as compliance_, in the tangent planes, or nothing
  std::vector<float> free_;                  // where each mode will be after the next period without forces, sqrt(kg) m; then the twins
  std::vector<float> push_;                  // on each mode, N/sqrt(kg); then on the twins
  double moving_ = 0.0, moving_tail_ = 0.0;  // lengths of free_, whole and beyond the first modes, sqrt(kg) m
  double travelled_ = 0.0;                   // sum of the lengths of its changes, sqrt(kg) m
  double step_ = 0.0;                        // the last of them, sqrt(kg) m
  double rung_ = 0.0;                        // f.C f with what the modes give within the last period, N m
  std::int64_t tick_ = 0;
  Values square_;                // of the frequencies, 1/s^2
  std::array<Values, 12> by_;    // of each mode: next place, speed, dashpot by place, speed, dashpot, force
  std::array<Values, 3> state_;  // place, speed, dashpot
  StandardLinearSolid left_;     // what the modes leave out, where it creeps
};

}  // namespace palpate::deformable
