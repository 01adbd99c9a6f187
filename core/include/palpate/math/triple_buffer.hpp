#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace palpate::math {

/// Hands the newest of something from one thread to another. Neither waits, locks or takes memory: each owns slots of its own, and the one
/// between them is exchanged. The reader owns `held` slots, so that it can look at several at a time.
template <class T, int held = 1>
class TripleBuffer {
 public:
  /// The writer's: what publish() will hand over. It holds something older.
  T& writing() noexcept { return slot_[static_cast<std::size_t>(writer_)]; }
  void publish() noexcept { writer_ = between_.exchange(writer_ | fresh_bit, std::memory_order_acq_rel) & ~fresh_bit; }

  /// The reader's: whether there is something that it has not taken.
  [[nodiscard]] bool fresh() const noexcept { return (between_.load(std::memory_order_relaxed) & fresh_bit) != 0; }
  /// Gives up slot `mine` for the newest; returns that one's.
  int take(int mine) noexcept { return between_.exchange(mine, std::memory_order_acq_rel) & ~fresh_bit; }
  /// The slots that the reader owns at first: 0 to held - 1.
  T& at(int slot) noexcept { return slot_[static_cast<std::size_t>(slot)]; }

  /// Every slot, before any thread uses them.
  [[nodiscard]] std::array<T, held + 2>& slots() noexcept { return slot_; }

 private:
  static constexpr int fresh_bit = 1024;

  std::array<T, held + 2> slot_{};
  std::atomic<int> between_{held};
  int writer_ = held + 1;
};

}  // namespace palpate::math

namespace palpate {
using namespace math;  // vocabulary of every folder
}
