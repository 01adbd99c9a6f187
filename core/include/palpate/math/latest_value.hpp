#pragma once

#include <array>

#include "palpate/math/triple_buffer.hpp"

namespace palpate::math {

/// A hand-over whose reader looks at one value at a time: what was published last. What it does not fetch in time is passed over.
template <class T>
class LatestValue {
 public:
  /// Writer: where to put the next value; keeps whatever was there.
  T& next() noexcept { return handover_.writing(); }

  /// Writer: gives it away.
  void publish() noexcept { handover_.publish(); }

  /// Reader: fetches what was published last; false if that is what it has already.
  bool fetch() noexcept {
    if (!handover_.fresh()) return false;
    front_ = handover_.take(front_);
    return true;
  }

  /// Reader: what was fetched last.
  [[nodiscard]] T& value() noexcept { return handover_.at(front_); }

  /// Every place, before any thread uses them.
  [[nodiscard]] std::array<T, 3>& places() noexcept { return handover_.slots(); }

 private:
  TripleBuffer<T> handover_;
  int front_ = 0;
};

}  // namespace palpate::math
