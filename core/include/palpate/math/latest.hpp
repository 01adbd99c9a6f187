#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace palpate {

/// Hands the latest value from one thread to one other: a place for the writer, one for the reader, and one between them, exchanged in one
/// step. Neither ever waits, and nothing is read while it is written; what the reader does not fetch in time is passed over.
template <class T>
class Latest {
 public:
  /// Writer: where to put the next value; keeps whatever was there.
  T& next() noexcept { return place_[back_]; }

  /// Writer: gives it away.
  void publish() noexcept { back_ = between_.exchange(back_ | fresh, std::memory_order_acq_rel) & ~fresh; }

  /// Reader: fetches what was published last; false if that is what it has already.
  bool fetch() noexcept {
    if ((between_.load(std::memory_order_relaxed) & fresh) == 0) return false;
    front_ = between_.exchange(front_, std::memory_order_acq_rel) & ~fresh;
    return true;
  }

  /// Reader: what was fetched last.
  [[nodiscard]] T& value() noexcept { return place_[front_]; }

  /// Every place, before any thread uses them.
  [[nodiscard]] std::array<T, 3>& places() noexcept { return place_; }

 private:
  static constexpr std::size_t fresh = 4;  // beside the number of a place

  std::array<T, 3> place_{};
  std::size_t back_ = 0;
  std::size_t front_ = 1;
  std::atomic<std::size_t> between_{2};
};

}  // namespace palpate
