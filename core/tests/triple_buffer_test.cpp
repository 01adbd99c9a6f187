// Exchange between a slow writer and a reader: values are complete and arrive newest first, without
// locks. Runs under the thread sanitizer if sanitizers are enabled.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <palpate/math/triple_buffer.hpp>
#include <thread>
#include <utility>

namespace {

struct Page {
  long number = 0;
  std::array<long, 200> copies{};
};

// Property: each page is complete, pages arrive in order without repetition, and slots owned by the
// reader do not change.
TEST(TripleBuffer, PagesAreWholeAndInTurn) {
  palpate::math::TripleBuffer<Page, 3> box;
  std::atomic<bool> done{false};
  const long last = 50000;
  std::thread writer([&] {
    for (long n = 1; n <= last; ++n) {
      Page& page = box.write_slot();
      page.number = n;
      page.copies.fill(n);
      box.publish();
    }
    done = true;
  });
  std::array<int, 3> held{0, 1, 2};
  std::array<long, 3> number{};
  long newest = 0, taken = 0;
  long wrong = 0;
  while (newest < last && wrong == 0) {
    if (!box.has_new()) {
      if (!done) std::this_thread::yield();
      continue;
    }
    const auto k = static_cast<std::size_t>(taken++ % 3);
    held[k] = box.acquire(held[k]);
    number[k] = box.read_slot(held[k]).number;
    wrong += number[k] > newest ? 0 : 1;
    newest = number[k];
    for (std::size_t i = 0; i < 3; ++i) {
      const Page& page = box.read_slot(held[i]);
      wrong += page.number == number[i] ? 0 : 1;
      for (const long copy : page.copies) wrong += copy == number[i] ? 0 : 1;
    }
  }
  writer.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(taken, 1);
  EXPECT_FALSE(box.has_new());
}

}  // namespace
