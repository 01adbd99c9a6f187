#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace palpate::math {

/// Hands the newest of something from one thread to another. Neither waits, locks or takes memory: each owns slots of its own, and the one
/// between them is exchanged. The reader owns `reader_slots` slots, so that it can look at several at a time.
template <class T, int reader_slots = 1>
class TripleBuffer {
 public:
  /// The writer's: what publish() will hand over. It holds something older.
  T& write_slot() noexcept { return slots_[static_cast<std::size_t>(writer_slot_)]; }
  void publish() noexcept { writer_slot_ = exchange_.exchange(writer_slot_ | new_bit, std::memory_order_acq_rel) & ~new_bit; }

  /// The reader's: whether there is something that it has not taken.
  [[nodiscard]] bool has_new() const noexcept { return (exchange_.load(std::memory_order_relaxed) & new_bit) != 0; }
  /// Gives up slot `released` for the newest; returns that one's.
  int acquire(int released) noexcept { return exchange_.exchange(released, std::memory_order_acq_rel) & ~new_bit; }
  /// The slots that the reader owns at first: 0 to reader_slots - 1.
  T& read_slot(int index) noexcept { return slots_[static_cast<std::size_t>(index)]; }

  /// Every slot, before any thread uses them.
  [[nodiscard]] std::array<T, reader_slots + 2>& slots() noexcept { return slots_; }

 private:
  static constexpr int new_bit = 1024;

  std::array<T, reader_slots + 2> slots_{};
  std::atomic<int> exchange_{reader_slots};
  int writer_slot_ = reader_slots + 1;
};

}  // namespace palpate::math

namespace palpate {
using namespace math;  // vocabulary of every folder
}
