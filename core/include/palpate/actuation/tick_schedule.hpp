#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "palpate/math/pack.hpp"
#include "palpate/math/select.hpp"

namespace palpate::actuation {

namespace detail {

/// Every bit of what comes out depends on every bit of what goes in (the finaliser of splitmix64, Stafford's variant 13).
[[gnu::always_inline]] inline std::uint64_t splitmix64_mix(std::uint64_t bits) noexcept {
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebULL;
  return bits ^ (bits >> 31);
}

}  // namespace detail

/// Number `index` of a seed's sequence, uniform in [0, 1). It is computed from seed and index alone, so that it depends neither on who
/// asks nor on what was asked before.
[[gnu::always_inline]] inline double random_number(std::uint64_t seed, int index) noexcept {
  const std::uint64_t place = (static_cast<std::uint64_t>(index) + 1) * 0x9e3779b97f4a7c15ULL;
  return static_cast<double>(detail::splitmix64_mix(detail::splitmix64_mix(seed) + place) >> 11) * 0x1p-53;
}

/// When a servo's ticks come: tick k at k periods, or late by up to `jitter`, each by itself and uniformly. A late tick does not delay
/// the next one.
template <class Scalar>
class TickSchedule {
 public:
  TickSchedule() = default;
  /// @param jitter  s, at least 0 and less than a period
  TickSchedule(double period, double jitter, std::uint64_t seed) : period_(period), jitter_(jitter), seed_(seed), jitters_(jitter > 0.0) {
    draw();
    tick();
  }

  /// Goes on to the next tick.
  void tick() noexcept {
    if (!jitters_) return;
    past_ = period_ + (next_ - late_);
    late_ = next_;
    draw();
  }

  /// Puts one loop's clock into a lane: all lanes have the same period, and jitter or do not.
  void set_lane(int lane, const TickSchedule<double>& one) {
    using math::set_lane;
    period_ = one.period_;
    set_lane(jitter_, lane, one.jitter_);
    set_lane(seed_, lane, one.seed_);
    jitters_ = one.jitters_;
    set_lane(index_, lane, one.index_);
    set_lane(late_, lane, one.late_);
    set_lane(next_, lane, one.next_);
    set_lane(past_, lane, one.past_);
  }

  [[nodiscard]] bool jitters() const noexcept { return jitters_; }
  [[nodiscard]] double period() const noexcept { return period_; }

  /// How late this tick is [s], and the next.
  [[nodiscard]] const Scalar& late() const noexcept { return late_; }
  [[nodiscard]] const Scalar& next_late() const noexcept { return next_; }

  /// Time from the tick before to this one [s], and to the next.
  [[nodiscard]] const Scalar& past() const noexcept { return past_; }
  [[nodiscard]] Scalar ahead() const noexcept { return period_ + (next_ - late_); }

 private:
  template <class>
  friend class TickSchedule;

  /// How late the tick after will be.
  void draw() noexcept {
    if constexpr (std::is_same_v<Scalar, double>) {
      next_ = jitter_ * random_number(seed_, index_++);
    } else {
      Scalar number;
      for (std::size_t i = 0; i < seed_.size(); ++i) number.set(static_cast<int>(i), random_number(seed_[i], index_[i]++));
      next_ = jitter_ * number;
    }
  }

  double period_ = 0.0;
  Scalar jitter_ = 0.0;
  Seed<Scalar> seed_{};
  bool jitters_ = false;
  LaneIndex<Scalar> index_{};  // of the next number to draw
  Scalar late_ = 0.0;
  Scalar next_ = 0.0;
  Scalar past_ = 0.0;
};

}  // namespace palpate::actuation
