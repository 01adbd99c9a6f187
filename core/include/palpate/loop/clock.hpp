#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "palpate/math/choose.hpp"

namespace palpate {

namespace detail {

/// Every bit of what comes out depends on every bit of what goes in (the finaliser of splitmix64, Stafford's variant 13).
[[gnu::always_inline]] inline std::uint64_t stirred(std::uint64_t bits) noexcept {
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9ULL;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebULL;
  return bits ^ (bits >> 31);
}

}  // namespace detail

/// Number `index` of a seed's sequence, uniform in [0, 1). It is computed from seed and index alone, so that it depends neither on who
/// asks nor on what was asked before.
[[gnu::always_inline]] inline double random_number(std::uint64_t seed, int index) noexcept {
  const std::uint64_t place = (static_cast<std::uint64_t>(index) + 1) * 0x9e3779b97f4a7c15ULL;
  return static_cast<double>(detail::stirred(detail::stirred(seed) + place) >> 11) * 0x1p-53;
}

/// When a servo's ticks come: tick k at k periods, or late by up to `jitter`, each by itself and uniformly. A late tick does not delay
/// the next one.
template <class Scalar>
class Clock {
 public:
  /// @param jitter  s, at least 0 and less than a period
  Clock(double period, const Scalar& jitter, const Seed<Scalar>& seed)
      : period_(period), jitter_(jitter), seed_(seed), jitters_(any(jitter > Scalar(0.0))), next_(drawn(0)) {
    tick();
  }

  /// Goes on to the next tick.
  void tick() noexcept {
    if (!jitters_) return;
    past_ = period_ + (next_ - late_);
    late_ = next_;
    next_ = drawn(++index_);
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
  [[nodiscard]] Scalar drawn(int index) const noexcept {
    if (!jitters_) return 0.0;
    if constexpr (std::is_same_v<Scalar, double>) {
      return jitter_ * random_number(seed_, index);
    } else {
      Scalar out;
      for (std::size_t lane = 0; lane < seed_.size(); ++lane) out.set(static_cast<int>(lane), random_number(seed_[lane], index));
      return jitter_ * out;
    }
  }

  double period_;
  Scalar jitter_;
  Seed<Scalar> seed_;
  bool jitters_;
  int index_ = 0;
  Scalar late_ = 0.0;
  Scalar next_;
  Scalar past_ = period_;
};

}  // namespace palpate
