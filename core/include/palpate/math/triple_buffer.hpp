#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace palpate::math {

/// Lock-free exchange of the newest value from one writer thread to one reader thread.
///
/// Neither thread waits, locks or allocates. The writer owns one slot, the reader owns
/// `reader_slots` slots, and one slot is exchanged atomically between them. Several reader slots
/// let the reader keep older values.
template <class T, int reader_slots = 1>
class TripleBuffer {
 public:
  static constexpr std::size_t slot_count = static_cast<std::size_t>(reader_slots) + 2;

  /// Writer: return the slot that publish() will publish. It contains an older value.
  T& write_slot() noexcept { return slots_[static_cast<std::size_t>(writer_slot_)]; }
  void publish() noexcept { writer_slot_ = exchange_.exchange(writer_slot_ | new_bit, std::memory_order_acq_rel) & ~new_bit; }

  /// Reader: return whether a value was published that acquire() has not returned.
  [[nodiscard]] bool has_new() const noexcept { return (exchange_.load(std::memory_order_relaxed) & new_bit) != 0; }
  /// Reader: release slot `released` and return the index of the slot with the newest value.
  int acquire(int released) noexcept { return exchange_.exchange(released, std::memory_order_acq_rel) & ~new_bit; }
  /// Reader: return an owned slot. Initially the reader owns slots 0 to reader_slots - 1.
  T& read_slot(int index) noexcept { return slots_[static_cast<std::size_t>(index)]; }

  /// Return all slots, for initialization before the threads start.
  [[nodiscard]] std::array<T, slot_count>& slots() noexcept { return slots_; }

 private:
  static constexpr int new_bit = 1024;

  std::array<T, slot_count> slots_{};
  std::atomic<int> exchange_{reader_slots};
  int writer_slot_ = reader_slots + 1;
};

}  // namespace palpate::math

namespace palpate {
using namespace math;  // shared vocabulary of all folders
}
