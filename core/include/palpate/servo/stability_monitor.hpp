#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/actuation/tick_schedule.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/conditioning.hpp"

namespace palpate::servo {

/// Columns of a loop's outcome, see StabilityMonitor for the definitions:
///   0       tick of divergence, -1 if there was none
///   1-3     oscillation early, prior and late, m
///   4       ripple, m
///   5-7     steady tip displacement, m; with a flexible mode, that of the tip that the encoders give
///   8, 9    peak object force and command, N
///   10, 11  fraction of the run in contact and at the limits of the drive
///   12, 13  the same for the last fifth of the judged window
///   14      contacts that begin in that fifth
///   15-     dof numbers each: least and greatest joint angles in the judged window, angles of its pose nearest to a singular one,
///           angles and velocities at the end. A window that comes near no singular pose has the angles of the start there.
template <int dof>
constexpr int outcome_width = 15 + 5 * dof;

namespace detail {

/// Set a scalar value; counterpart of math::set_lane.
inline void set_lane(double& value, int /*lane*/, double one) noexcept {
  value = one;
}
template <int rows, int columns>
void set_lane(Eigen::Matrix<double, rows, columns>& value, int /*lane*/, const Eigen::Matrix<double, rows, columns>& one) noexcept {
  value = one;
}

/// Return the value of one lane.
inline double lane_of(double value, int /*lane*/) noexcept {
  return value;
}
template <int lanes>
double lane_of(const Pack<lanes>& value, int lane) noexcept {
  return value[lane];
}

/// Measures loops in lanes, each at its own tick, or one loop (Scalar double). The judged window goes from tick `from` to the last one. An
/// oscillation is the largest second difference of the tip position over a fifth of the window: "early" the second fifth, "prior" the
/// fourth, "late" the last. Ripple is half the range of the tip over the last fifth, along the axis with the largest range. The excursion
/// of the joints is taken over the whole window.
template <class Mechanism, class Number>
class StabilityMonitor {
 public:
  static constexpr int dof = Mechanism::dof;
  using Scalar = Number;
  using Where = Condition<Scalar>;
  using Vector = Vector3<Scalar>;

  /// @param ticks  number of the last tick
  /// @param from   first tick of the judged window
  StabilityMonitor(int ticks, int from) : ticks_(ticks), from_(from), fifth_((ticks - from) / 5) {}

  /// Restart one lane at the pose `start`, with the tip at `tip` [m]; the encoders give it at `sensed` [m].
  void set_lane(int lane, const Joints<dof>& start, const Vector3<>& tip, const Vector3<>& sensed) noexcept {
    using detail::set_lane;
    using math::set_lane;
    for (Vector* v : {&before_, &last_}) set_lane(*v, lane, tip);
    set_lane(start_, lane, sensed);
    for (Vector* v : {&lowest_, &highest_, &steady_}) set_lane(*v, lane, Vector3<>(Vector3<>::Zero()));
    for (Scalar* x : {&early_, &prior_, &late_, &object_force_, &command_, &touching_, &saturated_, &late_touching_, &late_saturated_,
                      &contacts_, &was_touching_})
      set_lane(*x, lane, 0.0);
    set_lane(share_before_, lane, 1.0);
    set_lane(conditioning_, lane, std::numeric_limits<double>::infinity());
    for (Joints<dof, Scalar>* q : {&least_q_, &greatest_q_, &worst_q_}) set_lane(*q, lane, start);
  }

  /// Observe tick `k` of each lane.
  template <class Plant, class Servo>
  [[gnu::always_inline]] void observe(const Scalar& k, const Plant& plant, const Servo& servo,
                                      const actuation::TickSchedule<Scalar>& clock) noexcept {
    const auto& tick = servo.last();
    const Vector tip = plant.tip();
    const Vector second_difference = clock.has_jitter() ? second_difference_at(tip, clock) : Vector(tip - 2.0 * last_ + before_);
    const Scalar oscillation = second_difference.squaredNorm();
    before_ = last_;
    last_ = tip;
    const double fifth = fifth_;
    early_ = select((k > Scalar(from_ + fifth)) & (k <= Scalar(from_ + 2.0 * fifth)) & (early_ < oscillation), oscillation, early_);
    prior_ = select((k > Scalar(ticks_ - 2.0 * fifth)) & (k <= Scalar(ticks_ - fifth)) & (prior_ < oscillation), oscillation, prior_);
    object_force_ = max_of(object_force_, tick.object_force.squaredNorm());
    command_ = max_of(command_, tick.command.squaredNorm());
    const Scalar touching = select(tick.touching, Scalar(1.0), Scalar(0.0));
    const Scalar saturated = select(tick.saturated, Scalar(1.0), Scalar(0.0));
    touching_ += touching;
    saturated_ += saturated;
    const Where ending = k > Scalar(ticks_ - fifth);
    observe_excursion(k, plant);
    if (any(ending)) observe_ending(ending, k, plant, tip, oscillation, touching, saturated);
    was_touching_ = touching;
  }

  /// Write the row of one lane, outcome_width<dof> numbers; `unstable` is the tick of divergence, -1 if there was none.
  void write(int lane, double unstable, double* row) const noexcept {
    const double fifth = std::max(fifth_, 1);
    const bool ended = unstable < 0.0;
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    const double samples = ended ? ticks_ + 1.0 : std::max(unstable, 1.0);
    double ripple = 0.0;
    for (int i = 0; i < 3; ++i) ripple = std::max(ripple, 0.5 * (lane_of(highest_[i], lane) - lane_of(lowest_[i], lane)));
    row[0] = unstable;
    row[1] = std::sqrt(lane_of(early_, lane));
    row[2] = ended ? std::sqrt(lane_of(prior_, lane)) : unknown;
    row[3] = ended ? std::sqrt(lane_of(late_, lane)) : unknown;
    row[4] = ended ? ripple : unknown;
    for (int i = 0; i < 3; ++i) row[5 + i] = ended ? lane_of(steady_[i], lane) / fifth : unknown;
    row[8] = std::sqrt(lane_of(object_force_, lane));
    row[9] = std::sqrt(lane_of(command_, lane));
    row[10] = lane_of(touching_, lane) / samples;
    row[11] = lane_of(saturated_, lane) / samples;
    row[12] = ended ? lane_of(late_touching_, lane) / fifth : unknown;
    row[13] = ended ? lane_of(late_saturated_, lane) / fifth : unknown;
    row[14] = ended ? lane_of(contacts_, lane) : unknown;
    for (int i = 0; i < dof; ++i) {
      int column = 15 + i;
      for (const auto* of : {&least_q_, &greatest_q_, &worst_q_, &q_, &qd_}) {
        row[column] = ended ? lane_of((*of)[i], lane) : unknown;
        column += dof;
      }
    }
  }

 private:
  template <class Plant>
  [[gnu::always_inline]] static Vector sensed_tip(const Plant& plant, const Vector& tip) noexcept {
    if constexpr (requires { plant.sensed_tip(); })
      return plant.sensed_tip();
    else
      return tip;
  }

  /// Second difference of the tip's position where times between ticks differ: the change of mean speed, times the period.
  Vector second_difference_at(const Vector& tip, const actuation::TickSchedule<Scalar>& clock) noexcept {
    const Scalar share = clock.period() / clock.elapsed();
    const Vector second_difference = share * (tip - last_) - share_before_ * (last_ - before_);
    share_before_ = share;
    return second_difference;
  }

  /// Observe the pose at tick `k`.
  template <class Plant>
  [[gnu::always_inline]] void observe_excursion(const Scalar& k, const Plant& plant) noexcept {
    const Joints<dof, Scalar>& q = plant.angles();
    const Scalar first = from_;
    for (int i = 0; i < dof; ++i) {
      least_q_[i] = min_of(least_q_[i], q[i]);
      greatest_q_[i] = max_of(greatest_q_[i], q[i]);
    }
    if (const Where begins = k == first; any(begins)) [[unlikely]] {  // forget the ticks before
      least_q_ = select_each(begins, q, least_q_);
      greatest_q_ = select_each(begins, q, greatest_q_);
    }
    if (const Where near = mechanism::may_be_singular<dof>(plant.jacobian_size()); any(near)) [[unlikely]] {
      const Scalar conditioning = mechanism::squared_conditioning(plant.jacobian());
      const Where worse = near & (k >= first) & (conditioning < conditioning_);
      conditioning_ = select(worse, conditioning, conditioning_);
      worst_q_ = select_each(worse, q, worst_q_);
    }
  }

  /// Observe a tick of the last fifth.
  template <class Plant>
  void observe_ending(const Where& ending, const Scalar& k, const Plant& plant, const Vector& tip, const Scalar& oscillation,
                      const Scalar& touching, const Scalar& saturated) noexcept {
    const Where first = ending & (k <= Scalar(ticks_ - fifth_ + 1.0));
    late_touching_ = select(ending, late_touching_ + touching, late_touching_);
    late_saturated_ = select(ending, late_saturated_ + saturated, late_saturated_);
    contacts_ = select(ending & (was_touching_ < touching), contacts_ + 1.0, contacts_);
    late_ = select(ending & (late_ < oscillation), oscillation, late_);
    for (int i = 0; i < 3; ++i) {
      lowest_[i] = select(first | (ending & (tip[i] < lowest_[i])), tip[i], lowest_[i]);
      highest_[i] = select(first | (ending & (highest_[i] < tip[i])), tip[i], highest_[i]);
    }
    const Vector sensed = sensed_tip(plant, tip);
    for (int i = 0; i < 3; ++i) steady_[i] = select(ending, steady_[i] + (sensed[i] - start_[i]), steady_[i]);
    const Where last = k == Scalar(ticks_);
    q_ = select_each(last, plant.angles(), q_);
    qd_ = select_each(last, plant.speeds(), qd_);
  }

  int ticks_, from_, fifth_;
  Vector start_, before_, last_;
  Vector lowest_, highest_, steady_;
  Scalar share_before_, early_, prior_, late_, object_force_, command_, touching_, saturated_;
  Scalar late_touching_, late_saturated_, contacts_, was_touching_;
  Scalar conditioning_;
  Joints<dof, Scalar> least_q_, greatest_q_, worst_q_, q_, qd_;
};

}  // namespace detail

}  // namespace palpate::servo
