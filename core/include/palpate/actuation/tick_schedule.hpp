#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"

namespace palpate::actuation {

namespace detail {

/// Mix the bits of an integer: the finalizer of splitmix64 (variant 13 of Stafford).
[[gnu::always_inline]] inline std::uint64_t splitmix64_mix(std::uint64_t bits) noexcept {
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebULL;
  return bits ^ (bits >> 31);
}

}  // namespace detail

/// Return number `index` of the random sequence of a seed, uniform in [0, 1). It depends only on seed and index (counter-based).
[[gnu::always_inline]] inline double random_number(std::uint64_t seed, int index) noexcept {
  const std::uint64_t offset = (static_cast<std::uint64_t>(index) + 1) * 0x9e3779b97f4a7c15ULL;
  return static_cast<double>(detail::splitmix64_mix(detail::splitmix64_mix(seed) + offset) >> 11) * 0x1p-53;
}

/// Times of the servo ticks in simulation: tick k at k periods, plus a lateness that is uniform in [0, jitter) and independent for each
/// tick. A late tick does not delay the next one.
template <class Scalar>
class TickSchedule {
 public:
  TickSchedule() = default;
  /// @param jitter  s, at least 0 and less than a period
  TickSchedule(double period, double jitter, std::uint64_t seed)
      : period_(period), jitter_(jitter), seed_(seed), has_jitter_(jitter > 0.0) {
    draw();
    tick();
  }

  /// Advance to the next tick.
  void tick() noexcept {
    if (!has_jitter_) return;
    elapsed_ = period_ + (next_lateness_ - lateness_);
    lateness_ = next_lateness_;
    draw();
  }

  /// Copy the schedule of one loop into a lane. All lanes have the same period, and all or none have jitter.
  void set_lane(int lane, const TickSchedule<double>& one) {
    using math::set_lane;
    period_ = one.period_;
    set_lane(jitter_, lane, one.jitter_);
    set_lane(seed_, lane, one.seed_);
    has_jitter_ = one.has_jitter_;
    set_lane(index_, lane, one.index_);
    set_lane(lateness_, lane, one.lateness_);
    set_lane(next_lateness_, lane, one.next_lateness_);
    set_lane(elapsed_, lane, one.elapsed_);
  }

  [[nodiscard]] bool has_jitter() const noexcept { return has_jitter_; }
  [[nodiscard]] double period() const noexcept { return period_; }

  /// Lateness of this tick [s].
  [[nodiscard]] const Scalar& lateness() const noexcept { return lateness_; }
  /// Lateness of the next tick [s].
  [[nodiscard]] const Scalar& next_lateness() const noexcept { return next_lateness_; }

  /// Time from the previous tick to this one [s].
  [[nodiscard]] const Scalar& elapsed() const noexcept { return elapsed_; }
  /// Time from this tick to the next [s].
  [[nodiscard]] Scalar remaining() const noexcept { return period_ + (next_lateness_ - lateness_); }

 private:
  template <class>
  friend class TickSchedule;

  /// Draw the lateness of the next tick.
  void draw() noexcept {
    if constexpr (std::is_same_v<Scalar, double>) {
      next_lateness_ = jitter_ * random_number(seed_, index_++);
    } else {
      Scalar number;
      for (std::size_t i = 0; i < seed_.size(); ++i) number.set(static_cast<int>(i), random_number(seed_[i], index_[i]++));
      next_lateness_ = jitter_ * number;
    }
  }

  double period_ = 0.0;
  Scalar jitter_ = 0.0;
  Seed<Scalar> seed_{};
  bool has_jitter_ = false;
  LaneIndex<Scalar> index_{};  // of the next number to draw
  Scalar lateness_ = 0.0;
  Scalar next_lateness_ = 0.0;
  Scalar elapsed_ = 0.0;
};

}  // namespace palpate::actuation
