#pragma once

#include <array>

#include "palpate/math/triple_buffer.hpp"

namespace palpate::math {

/// Lock-free exchange of the most recent value from one writer thread to one reader thread.
///
/// Values that the reader does not acquire before the next publish() are dropped.
template <class T>
class LatestValue {
 public:
  /// Writer: return the slot for the next value. It contains an older value.
  T& write_slot() noexcept { return buffer_.write_slot(); }

  /// Writer: publish the slot returned by write_slot().
  void publish() noexcept { buffer_.publish(); }

  /// Reader: acquire the newest value. Return false if no new value was published.
  bool acquire() noexcept {
    if (!buffer_.has_new()) return false;
    read_slot_ = buffer_.acquire(read_slot_);
    return true;
  }

  /// Reader: return the value acquired last.
  [[nodiscard]] T& value() noexcept { return buffer_.read_slot(read_slot_); }

  /// Return all slots, for initialization before the threads start.
  [[nodiscard]] std::array<T, 3>& slots() noexcept { return buffer_.slots(); }

 private:
  TripleBuffer<T> buffer_;
  int read_slot_ = 0;
};

}  // namespace palpate::math
