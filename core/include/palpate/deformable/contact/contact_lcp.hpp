#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace palpate::deformable {

/// One-sided contact of up to `capacity` places on a linear body: forces f with
///   f >= 0,  C f >= g,  f (C f - g) = 0
/// for the symmetric positive definite compliance C [m/N] and the depths g [m] that a tip asks for. Places that were pressed in the
/// last step are tried first; the Cholesky factor of the pressed ones is kept and edited as they come and go.
///
/// Block principal pivoting (Judice & Pires 1994): all wrong places change sides at once, and if that does not lessen them, one at a time,
/// by the highest index (Murty 1974), which ends.
class ContactLcp {
 public:
  static constexpr int capacity = 128;

  ContactLcp()
      : compliance_(capacity, capacity), factor_(capacity, capacity), depth_(capacity), force_(capacity), work_(capacity), all_(capacity) {
    compliance_.setZero();
    factor_.setZero();
    force_.setZero();
  }

  /// C between places a and b; give all of those in use, both triangles, before solve(). A place's own may change at any step.
  double& compliance(int a, int b) noexcept { return compliance_(a, b); }
  double& depth(int a) noexcept { return depth_[a]; }
  [[nodiscard]] double force(int a) const noexcept { return all_[a]; }  ///< N, of solve()

  /// Forgets the factor: every place may have changed. `pressed(a)` tells which ones to try first.
  template <class Pressed>
  void start(int places, Pressed pressed) noexcept {
    places_ = places;
    active_ = edits_ = 0;
    for (int a = 0; a < places; ++a) {
      where_[static_cast<std::size_t>(a)] = -1;
      if (pressed(a)) press(a);
    }
  }

  /// Takes place `a` out; those after it move up. All else stays as it was solved.
  void remove(int a) noexcept {
    if (where_[static_cast<std::size_t>(a)] >= 0) release(a);
    for (int b = 0; b < places_; ++b) {
      if (b == a) continue;
      const int to = b < a ? b : b - 1;
      for (int c = a; c + 1 < places_; ++c) compliance_(b, c) = compliance_(b, c + 1);
      if (to != b) compliance_.row(to).head(places_ - 1) = compliance_.row(b).head(places_ - 1);
    }
    std::copy(where_.begin() + a + 1, where_.begin() + places_, where_.begin() + a);
    for (int p = 0; p < active_; ++p)
      if (order_[static_cast<std::size_t>(p)] > a) --order_[static_cast<std::size_t>(p)];
    --places_;
    edited();
  }

  /// Makes room for a free place `a`; those from there on move down. Give its compliance, both ways, before solve().
  void insert(int a) noexcept {
    for (int b = places_ - 1; b >= 0; --b) {
      for (int c = places_; c > a; --c) compliance_(b, c) = compliance_(b, c - 1);
      if (b >= a) compliance_.row(b + 1).head(places_ + 1) = compliance_.row(b).head(places_ + 1);
    }
    std::copy_backward(where_.begin() + a, where_.begin() + places_, where_.begin() + places_ + 1);
    where_[static_cast<std::size_t>(a)] = -1;
    for (int p = 0; p < active_; ++p)
      if (order_[static_cast<std::size_t>(p)] >= a) ++order_[static_cast<std::size_t>(p)];
    ++places_;
    edited();
  }

  /// Sets what a place gives way by itself [m/N].
  void own(int a, double compliance) noexcept {
    if (compliance_(a, a) == compliance) return;
    compliance_(a, a) = compliance;
    stale_ = stale_ || where_[static_cast<std::size_t>(a)] >= 0;
  }

  /// Presses place `a` before solve() looks, as one of those to try first.
  void attempt(int a) noexcept {
    if (where_[static_cast<std::size_t>(a)] == -1) press(a);
  }

  [[nodiscard]] bool any_pressed() const noexcept { return active_ > 0; }

  /// How many sets of places the last solve() looked at: one if those of the step before were right.
  [[nodiscard]] int looks() const noexcept { return looks_; }

  /// Solves for all places of the last start(). False if the bound on moves was reached: the forces are then those of a smaller or larger
  /// set of places, with none of them pulling.
  bool solve() noexcept {
    if (stale_ || edits_ > most_edits) anew();
    int fewest = places_ + 1, patience = 3;
    bool found = false;
    for (looks_ = 0; looks_ < 10 * capacity && !found; ++looks_) {
      solve_active();
      const int wrong = look();
      if (wrong == 0) {
        found = true;
      } else if (wrong < fewest) {
        fewest = wrong;
        patience = 3;
        change_all();
      } else if (patience > 0) {
        --patience;
        change_all();
      } else {
        change_last();
      }
    }
    all_.head(places_).setZero();
    for (int p = 0; p < active_; ++p) all_[order_[static_cast<std::size_t>(p)]] = std::max(force_[p], 0.0);
    return found;
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static constexpr int most_edits = 64;  // of the factor, by places that come and go: its rounding does not add up

  /// Factorises once more, with the same places.
  void anew() noexcept {
    std::array<bool, capacity> pressed{};
    for (int a = 0; a < places_; ++a) pressed[static_cast<std::size_t>(a)] = where_[static_cast<std::size_t>(a)] >= 0;
    start(places_, [&pressed](int a) { return pressed[static_cast<std::size_t>(a)]; });
    stale_ = false;
  }

  /// Another place may be independent now of those that it was not.
  void edited() noexcept {
    ++edits_;
    for (int a = 0; a < places_; ++a)
      if (where_[static_cast<std::size_t>(a)] == -2) where_[static_cast<std::size_t>(a)] = -1;
  }

  /// Adds place `a` at the end: one row of the factor. A place that is not independent of the others to rounding stays out.
  void press(int a) noexcept {
    const int k = active_;
    double square = compliance_(a, a);
    for (int p = 0; p < k; ++p) {
      const double sum = compliance_(a, order_[static_cast<std::size_t>(p)]) - factor_.row(k).head(p).dot(factor_.row(p).head(p));
      factor_(k, p) = sum / factor_(p, p);
      square -= factor_(k, p) * factor_(k, p);
    }
    if (!(square > 1e-7 * compliance_(a, a))) {
      where_[static_cast<std::size_t>(a)] = -2;
      return;
    }
    factor_(k, k) = std::sqrt(square);
    order_[static_cast<std::size_t>(k)] = a;
    where_[static_cast<std::size_t>(a)] = k;
    ++active_;
  }

  /// Takes place `a` out: its row goes, and rotations of the columns make the rows after it triangular again.
  void release(int a) noexcept {
    const int at = where_[static_cast<std::size_t>(a)];
    for (int r = at; r + 1 < active_; ++r) {
      factor_.row(r).head(r + 2) = factor_.row(r + 1).head(r + 2);
      order_[static_cast<std::size_t>(r)] = order_[static_cast<std::size_t>(r) + 1];
      where_[static_cast<std::size_t>(order_[static_cast<std::size_t>(r)])] = r;
    }
    --active_;
    where_[static_cast<std::size_t>(a)] = -1;
    for (int c = at; c < active_; ++c) {
      const double x = factor_(c, c), y = factor_(c, c + 1), length = std::hypot(x, y), cosine = x / length, sine = y / length;
      for (int r = c; r < active_; ++r) {
        const double u = factor_(r, c), v = factor_(r, c + 1);
        factor_(r, c) = cosine * u + sine * v;
        factor_(r, c + 1) = cosine * v - sine * u;
      }
    }
  }

  /// Forces of the pressed places, as if they stuck.
  void solve_active() noexcept {
    for (int p = 0; p < active_; ++p)
      force_[p] = (depth_[order_[static_cast<std::size_t>(p)]] - factor_.row(p).head(p).dot(force_.head(p).transpose())) / factor_(p, p);
    for (int p = active_ - 1; p >= 0; --p) {
      force_[p] /= factor_(p, p);
      force_.head(p) -= force_[p] * factor_.row(p).head(p).transpose();
    }
  }

  /// Marks places that pull, or that the tip is still in although they are free; returns how many.
  int look() noexcept {
    int wrong = 0;
    const double most = active_ > 0 ? force_.head(active_).cwiseAbs().maxCoeff() : 0.0;
    work_.head(places_) = depth_.head(places_);
    const double deepest = places_ > 0 ? depth_.head(places_).maxCoeff() : 0.0;
    for (int p = 0; p < active_; ++p)
      work_.head(places_) -= force_[p] * compliance_.row(order_[static_cast<std::size_t>(p)]).head(places_).transpose();
    for (int a = 0; a < places_; ++a) {
      const int p = where_[static_cast<std::size_t>(a)];
      const bool bad = p >= 0 ? force_[p] < -1e-12 * most : (p == -1 && work_[a] > 1e-9 * deepest);
      wrong_[static_cast<std::size_t>(a)] = bad;
      wrong += bad ? 1 : 0;
    }
    return wrong;
  }

  void change(int a) noexcept {
    if (where_[static_cast<std::size_t>(a)] >= 0)
      release(a);
    else
      press(a);
  }

  void change_all() noexcept {
    int out = 0;
    for (int a = 0; a < places_; ++a) out += wrong_[static_cast<std::size_t>(a)] && where_[static_cast<std::size_t>(a)] >= 0 ? 1 : 0;
    if (2 * out > active_) {  // cheaper anew
      std::array<bool, capacity> next{};
      for (int a = 0; a < places_; ++a)
        next[static_cast<std::size_t>(a)] = (where_[static_cast<std::size_t>(a)] >= 0) != wrong_[static_cast<std::size_t>(a)];
      start(places_, [&next](int a) { return next[static_cast<std::size_t>(a)]; });
      return;
    }
    for (int a = 0; a < places_; ++a) {
      bool& wrong = wrong_[static_cast<std::size_t>(a)];
      if (!wrong || where_[static_cast<std::size_t>(a)] < 0) continue;
      release(a);
      wrong = false;  // and is not pressed again below
    }
    for (int a = 0; a < places_; ++a)
      if (wrong_[static_cast<std::size_t>(a)] && where_[static_cast<std::size_t>(a)] == -1) press(a);
  }

  void change_last() noexcept {
    for (int a = places_ - 1; a >= 0; --a)
      if (wrong_[static_cast<std::size_t>(a)]) return change(a);
  }

  int places_ = 0;
  int active_ = 0;
  int looks_ = 0;
  int edits_ = 0;                               // since the factor was made
  bool stale_ = false;                          // the factor is of another compliance
  std::array<std::int32_t, capacity> order_{};  // place at each row of the factor
  std::array<std::int32_t, capacity> where_{};  // row of each place; -1 free; -2 free because not independent
  std::array<bool, capacity> wrong_{};
  RowMajor compliance_;    // places x places, m/N
  RowMajor factor_;        // lower, of the pressed ones
  Eigen::VectorXd depth_;  // by place, m
  Eigen::VectorXd force_;  // by row of the factor, N
  Eigen::VectorXd work_;   // by place
  Eigen::VectorXd all_;    // by place, N
};

}  // namespace palpate::deformable
