#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/creep.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Coefficients of dry friction between a tip and a body. Without either the tip is smooth.
struct DryFriction {
  double hold = 0.0;   ///< until the whole patch slides
  double slide = 0.0;  ///< from then on, until all of it holds again; at most `hold`

  [[nodiscard]] explicit operator bool() const noexcept { return hold > 0.0; }
};

/// Dry friction of a rigid tip on an elastic surface, node by node: the tip drags each pressed node along, with a force q in the node's
/// tangent plane of at most mu times what presses it, and where that does not do it slips under the node:
///   |q_i| <= mu f_i,   slip_i = (tip's way)_i - (T q)_i's way,   slip_i = 0 inside the cone and along q_i on it,
/// with the tangential compliance T [m/N]. On a half-space that is Cattaneo's (1938) and Mindlin's (1949) contact: it sticks in the
/// middle and slips around. The forces are those that Kalker's (1990) TANG seeks for the step: of all inside their cones, those of least
/// q T q / 2 - q.way; projected Gauss-Seidel, from the last tick's forces on. A node that no longer slips keeps what the sweeps left over
/// for the next tick. As forces and slip never point against each other, friction takes energy and gives none. On a body with a memory
/// nodes move by themselves: where a new one was at the tick's beginning is not known, so friction holds it from the next tick on.
class PartialSlip {
 public:
  static constexpr int capacity = 256;  ///< nodes: those pressed now, and those that were in the last tick

  PartialSlip() = default;

  /// For a body of `nodes` nodes; at most `sweeps` in one tick.
  PartialSlip(DryFriction friction, std::int32_t nodes, int sweeps = 12)
      : friction_(friction), sweeps_(sweeps), place_(static_cast<std::size_t>(nodes), -1), compliance_(2 * capacity + 8, 2 * capacity) {
    compliance_.setZero();
  }

  [[nodiscard]] bool on() const noexcept { return static_cast<bool>(friction_); }

  [[nodiscard]] const DryFriction& friction() const noexcept { return friction_; }

  /// Goes on by one period: the tip has moved by `way` [m] and presses `count` nodes with `forces` [N]; `covers` are the parts of their
  /// patches under a flat end.
  template <class Nodes, class Kind>
  void step(const Nodes& nodes, const Kind& kind, const std::int32_t* pressed, const double* forces, const double* covers, int count,
            const Vector3<>& way) noexcept {
    if (count == 0) return reset();
    const double coefficient = sliding_ ? friction_.slide : friction_.hold;
    const int before = count_;
    std::fill_n(radius_.begin(), count_, 0.0);
    if constexpr (creeps<Kind>) creep_ = kind.creep();
    if constexpr (remembers<Kind>)
      for (int s = 0; s < count_; ++s) relax(kind, s);
    for (int c = 0; c < count; ++c) {
      const int s = place(kind, pressed[c]);
      if (s < 0) continue;
      cover(s, covers[c]);
      radius_[at(s)] = coefficient * forces[c];
    }
    if constexpr (remembers<Kind>)
      for (int s = before; s < count_; ++s) radius_[at(s)] = 0.0;
    for (int s = 0; s < count_; ++s) {
      behind(s) += nodes.across(node_[at(s)]).transpose() * way;
      target_.segment<2>(2 * s) = moved_.segment<2>(2 * s) + behind(s);
    }
    for (int s = 0; s < sweeps_ && !settled(); ++s) {
    }
    moved_.head(2 * count_) = target_.head(2 * count_) - behind_.head(2 * count_);
    slip(remembers<Kind> ? before : count_);
  }

  void reset() noexcept {
    for (int s = 0; s < count_; ++s) place_[static_cast<std::size_t>(node_[at(s)])] = -1;
    count_ = 0;
    sliding_ = false;
  }

  /// The body yields otherwise from now on: the forces stay, or become smaller, so that they store no more than before.
  template <class Kind>
  void renew(const Kind& kind) noexcept {
    const Eigen::Index size = 2 * count_;
    const double before = force_.head(size).dot(moved_.head(size));
    for (int s = 0; s < count_; ++s) {
      for (int t = 0; t <= s; ++t) {
        const Eigen::Matrix2d block = kind.tangential(node_[at(s)], node_[at(t)]);
        compliance_.block<2, 2>(2 * s, 2 * t) = block;
        compliance_.block<2, 2>(2 * t, 2 * s) = block.transpose();
      }
      own_[at(s)] = compliance_.block<2, 2>(2 * s, 2 * s);
      compliance_.block<2, 2>(2 * s, 2 * s) /= cover_[at(s)];
      soften(s);
    }
    for (int s = 0; s < count_; ++s) moved_.segment<2>(2 * s) = pushed(s, count_);
    const double after = force_.head(size).dot(moved_.head(size));
    if (!(after > before)) return;
    const double less = std::sqrt(std::max(before, 0.0) / after);
    force_.head(size) *= less;
    moved_.head(size) *= less;
  }

  /// Whether the whole patch slid in the last tick and has not come to rest since.
  [[nodiscard]] bool sliding() const noexcept { return sliding_; }

  /// Force [N] on a node of the last step, and how far it has been moved [m], in its tangent plane (BodyNodes::across).
  [[nodiscard]] Eigen::Vector2d force(std::int32_t node) const noexcept {
    const int s = place_[static_cast<std::size_t>(node)];
    return s < 0 ? Eigen::Vector2d::Zero() : Eigen::Vector2d(force_.segment<2>(2 * s));
  }
  [[nodiscard]] Eigen::Vector2d moved(std::int32_t node) const noexcept {
    const int s = place_[static_cast<std::size_t>(node)];
    return s < 0 ? Eigen::Vector2d::Zero() : Eigen::Vector2d(moved_.segment<2>(2 * s));
  }

  /// q.T q of the last step, with the body's compliance T within a period [N m].
  [[nodiscard]] double yielded() const noexcept {
    const Eigen::Index size = 2 * count_;
    double sum = force_.head(size).dot(moved_.head(size) - rest_.head(size));
    for (int s = 0; s < count_; ++s) sum -= (1.0 / cover_[at(s)] - 1.0) * own(s, force_.segment<2>(2 * s));
    return sum;
  }

  /// Energy [J] after the last step in what patches give way more that lie under the tip in part.
  [[nodiscard]] double in_parts() const noexcept {
    double sum = 0.0;
    for (int s = 0; s < count_; ++s) {
      const Eigen::Vector2d q = force_.segment<2>(2 * s), next = creep_.stays * crept_[at(s)] + creep_.gains * q;
      sum += (1.0 / cover_[at(s)] - 1.0) * creep_.energy(own(s, q), own(s, next)) / creep_.share;
    }
    return sum;
  }

  /// Energy [J] that changes per covered part of a node's patch at constant place: what a flat end feels that leaves it.
  [[nodiscard]] double by_cover(std::int32_t node) const noexcept {
    const int s = place_[static_cast<std::size_t>(node)];
    if (s < 0) return 0.0;
    const Eigen::Vector2d q = force_.segment<2>(2 * s);
    const Eigen::Vector2d &crept = crept_[at(s)], whole = own_[at(s)] * crept / creep_.share;
    return (0.5 * q.dot(own_[at(s)] * q) + creep_.stays * q.dot(whole) - creep_.stored(crept.dot(whole))) / (cover_[at(s)] * cover_[at(s)]);
  }

 private:
  using ByPlace = Eigen::Matrix<double, 2 * capacity, 1>;

  template <class Kind>
  static constexpr bool remembers = requires(const Kind& kind) { kind.tangential_at_rest(0); };

  template <class Kind>
  static constexpr bool creeps = requires(const Kind& kind) { kind.creep(); };

  static constexpr double accuracy = 1e-3;  // of forces, by the largest
  static constexpr double rounding = 1e-14;
  static constexpr double edge = 1e-9;  // of a cone, and of the displacement its force makes: slip is not chosen by the last bits

  static std::size_t at(int s) noexcept { return static_cast<std::size_t>(s); }
  Eigen::VectorBlock<ByPlace, 2> behind(int s) noexcept { return behind_.segment<2>(2 * s); }

  /// q.T q with the compliance of a whole patch by itself, N m.
  [[nodiscard]] double own(int s, const Eigen::Vector2d& q) const noexcept { return q.dot(own_[at(s)] * q); }

  /// How far the forces on the first places move one, m.
  [[nodiscard]] Eigen::Vector2d pushed(int s, int places) const noexcept {
    const auto forces = force_.head(2 * places);
    return {compliance_.col(2 * s).head(2 * places).dot(forces), compliance_.col(2 * s + 1).head(2 * places).dot(forces)};
  }

  /// The place of a node; a new one is where the others' forces hold it, without a force of its own. -1 if there is no room.
  template <class Kind>
  int place(const Kind& kind, std::int32_t node) noexcept {
    int s = place_[static_cast<std::size_t>(node)];
    if (s >= 0 || count_ == capacity) return s;
    s = count_++;
    place_[static_cast<std::size_t>(node)] = static_cast<std::int16_t>(s);
    node_[at(s)] = node;
    for (int t = 0; t <= s; ++t) {
      const Eigen::Matrix2d block = kind.tangential(node, node_[at(t)]);
      compliance_.block<2, 2>(2 * s, 2 * t) = block;
      compliance_.block<2, 2>(2 * t, 2 * s) = block.transpose();
    }
    own_[at(s)] = compliance_.block<2, 2>(2 * s, 2 * s);
    cover_[at(s)] = 1.0;
    crept_[at(s)].setZero();
    soften(s);
    force_.segment<2>(2 * s).setZero();
    behind(s).setZero();
    rest_.segment<2>(2 * s).setZero();
    if constexpr (remembers<Kind>) rest_.segment<2>(2 * s) = kind.tangential_at_rest(node);
    moved_.segment<2>(2 * s) = pushed(s, s) + rest_.segment<2>(2 * s);
    return s;
  }

  /// A body that remembers has moved the node under the forces of the last tick; what it has not gone with the tip is behind.
  template <class Kind>
  void relax(const Kind& kind, int s) noexcept {
    crept_[at(s)] = creep_.stays * crept_[at(s)] + creep_.gains * force_.segment<2>(2 * s);
    rest_.segment<2>(2 * s) = kind.tangential_at_rest(node_[at(s)]) + besides(s, cover_[at(s)]);
    const Eigen::Vector2d now = rest_.segment<2>(2 * s) + pushed(s, count_);
    behind(s) += moved_.segment<2>(2 * s) - now;
    moved_.segment<2>(2 * s) = now;
  }

  /// A smaller part of the patch yields more.
  void cover(int s, double part) noexcept {
    if (part == cover_[at(s)]) return;
    const Eigen::Vector2d crept = besides(s, part) - besides(s, cover_[at(s)]);
    cover_[at(s)] = part;
    rest_.segment<2>(2 * s) += crept;
    const Eigen::Matrix2d block = own_[at(s)] / part;
    const Eigen::Vector2d more = (block - compliance_.block<2, 2>(2 * s, 2 * s)) * force_.segment<2>(2 * s) + crept;
    behind(s) -= more;
    moved_.segment<2>(2 * s) += more;
    compliance_.block<2, 2>(2 * s, 2 * s) = block;
    soften(s);
  }

  /// How far a node has crept farther than a whole patch, because a part of it only is under the tip, m (BodyContact::creep).
  [[nodiscard]] Eigen::Vector2d besides(int s, double part) const noexcept {
    return ((1.0 / part - 1.0) * creep_.stays / creep_.share) * (own_[at(s)] * crept_[at(s)]);
  }

  /// The larger eigenvalue of a node's own compliance, m/N.
  void soften(int s) noexcept {
    const double a = compliance_(2 * s, 2 * s), b = compliance_(2 * s, 2 * s + 1), d = compliance_(2 * s + 1, 2 * s + 1);
    softest_[at(s)] = 0.5 * (a + d) + std::hypot(0.5 * (a - d), b);
  }

  /// One sweep over all nodes; whether hardly any force has changed.
  bool settled() noexcept {
    double most = 0.0, largest = 0.0;  // squares
    const Eigen::Index size = 2 * count_;
    for (int s = 0; s < count_; ++s) {
      const Eigen::Vector2d old = force_.segment<2>(2 * s);
      Eigen::Vector2d next = old + behind(s) / softest_[at(s)];
      const double square = next.squaredNorm(), radius = radius_[at(s)];
      if (square > radius * radius) next *= radius / std::sqrt(square);
      const Eigen::Vector2d change = next - old;
      const double length = change.squaredNorm();
      largest = std::max(largest, next.squaredNorm());
      if (!(length > rounding * rounding * largest)) continue;
      most = std::max(most, length);
      force_.segment<2>(2 * s) = next;
      behind_.head(size) -= change[0] * compliance_.col(2 * s).head(size) + change[1] * compliance_.col(2 * s + 1).head(size);
    }
    return !(most > accuracy * accuracy * largest);
  }

  /// Nodes on their cones have slipped as far as they are behind; nodes that nothing presses leave. Those from `loose` on are not held yet.
  void slip(int loose) noexcept {
    bool all = true, any = false;
    for (int s = loose; s < count_; ++s) behind(s).setZero();
    for (int s = loose - 1; s >= 0; --s) {
      const double radius = radius_[at(s)];
      if (!(radius > 0.0)) {
        leave(s);
        continue;
      }
      const auto q = force_.segment<2>(2 * s);
      const double along = q.dot(behind(s));
      const bool on_cone = q.squaredNorm() >= (1.0 - edge) * radius * radius;
      const bool slips = on_cone && along > edge * softest_[at(s)] * radius * radius;
      all = all && slips;
      any = any || slips;
      if (on_cone && along > 0.0) behind(s).setZero();
    }
    sliding_ = any && (all || sliding_);
  }

  /// Takes out a node without force; the last one takes its place.
  void leave(int s) noexcept {
    place_[static_cast<std::size_t>(node_[at(s)])] = -1;
    const int last = --count_;
    if (s == last) return;
    node_[at(s)] = node_[at(last)];
    place_[static_cast<std::size_t>(node_[at(s)])] = static_cast<std::int16_t>(s);
    radius_[at(s)] = radius_[at(last)];
    softest_[at(s)] = softest_[at(last)];
    cover_[at(s)] = cover_[at(last)];
    own_[at(s)] = own_[at(last)];
    crept_[at(s)] = crept_[at(last)];
    force_.segment<2>(2 * s) = force_.segment<2>(2 * last);
    behind_.segment<2>(2 * s) = behind_.segment<2>(2 * last);
    moved_.segment<2>(2 * s) = moved_.segment<2>(2 * last);
    rest_.segment<2>(2 * s) = rest_.segment<2>(2 * last);
    const Eigen::Index size = 2 * last;
    compliance_.block(2 * s, 0, 2, size) = compliance_.block(2 * last, 0, 2, size);
    compliance_.block(0, 2 * s, size, 2) = compliance_.block(0, 2 * last, size, 2);
    compliance_.block<2, 2>(2 * s, 2 * s) = compliance_.block<2, 2>(2 * last, 2 * last);
  }

  DryFriction friction_;
  int sweeps_ = 0;
  bool sliding_ = false;
  int count_ = 0;                    // places in use
  std::vector<std::int16_t> place_;  // of each node of the body, or -1
  Eigen::MatrixXd compliance_;       // m/N, by place, in tangent planes; eight rows more, so that columns do not share cache lines
  std::array<std::int32_t, capacity> node_{};
  std::array<double, capacity> radius_{};   // of the cones, N
  std::array<double, capacity> softest_{};  // m/N
  std::array<double, capacity> cover_{};
  std::array<Eigen::Matrix2d, capacity> own_{};    // compliance of a whole patch by itself, m/N
  std::array<Eigen::Vector2d, capacity> crept_{};  // as the body's memory, of each patch, N
  Creep creep_;
  ByPlace force_ = ByPlace::Zero();   // q, N
  ByPlace behind_ = ByPlace::Zero();  // how far the node is behind the tip, m
  ByPlace moved_ = ByPlace::Zero();   // how far the node has moved, m
  ByPlace rest_ = ByPlace::Zero();    // the part of it that forces of earlier ticks did, m
  ByPlace target_ = ByPlace::Zero();  // where it would have gone with the tip, m
};

}  // namespace palpate::deformable
