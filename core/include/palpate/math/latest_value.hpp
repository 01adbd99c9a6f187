#pragma once

#include <array>

#include "palpate/math/triple_buffer.hpp"

namespace palpate::math {

/// A hand-over whose reader looks at one value at a time: what was published last. What it does not fetch in time is passed over.
template <class T>
class LatestValue {
 public:
  /// Writer: where to put the next value; keeps whatever was there.
  T& write_slot() noexcept { return buffer_.write_slot(); }

  /// Writer: gives it away.
  void publish() noexcept { buffer_.publish(); }

  /// Reader: fetches what was published last; false if that is what it has already.
  bool acquire() noexcept {
    if (!buffer_.has_new()) return false;
    read_slot_ = buffer_.acquire(read_slot_);
    return true;
  }

  /// Reader: what was fetched last.
  [[nodiscard]] T& value() noexcept { return buffer_.read_slot(read_slot_); }

  /// Every place, before any thread uses them.
  [[nodiscard]] std::array<T, 3>& slots() noexcept { return buffer_.slots(); }

 private:
  TripleBuffer<T> buffer_;
  int read_slot_ = 0;
};

}  // namespace palpate::math
