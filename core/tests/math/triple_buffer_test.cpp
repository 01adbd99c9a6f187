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
TEST(TripleBuffer, ValuesAreCompleteAndOrdered) {
  palpate::math::TripleBuffer<Page, 3> buffer;
  std::atomic<bool> done{false}, seen{false};
  const long last = 50000;
  std::thread writer([&] {
    for (long n = 1; n <= last; ++n) {
      Page& page = buffer.write_slot();
      page.number = n;
      page.copies.fill(n);
      buffer.publish();
      while (n == 1 && !seen) std::this_thread::yield();  // so that the reader acquires more than the last page
    }
    done = true;
  });
  std::array<int, 3> held{0, 1, 2};
  std::array<long, 3> number{};
  long newest = 0, acquired = 0;
  long errors = 0;
  while (newest < last && errors == 0) {
    if (!buffer.has_new()) {
      if (!done) std::this_thread::yield();
      continue;
    }
    const auto k = static_cast<std::size_t>(acquired++ % 3);
    held[k] = buffer.acquire(held[k]);
    number[k] = buffer.read_slot(held[k]).number;
    errors += number[k] > newest ? 0 : 1;
    newest = number[k];
    seen = true;
    for (std::size_t i = 0; i < 3; ++i) {
      const Page& page = buffer.read_slot(held[i]);
      errors += page.number == number[i] ? 0 : 1;
      for (const long copy : page.copies) errors += copy == number[i] ? 0 : 1;
    }
  }
  writer.join();
  EXPECT_EQ(errors, 0);
  EXPECT_GT(acquired, 1);
  EXPECT_FALSE(buffer.has_new());
}

}  // namespace
