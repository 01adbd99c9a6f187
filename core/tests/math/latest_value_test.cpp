// Exchange of the latest value between threads: complete, never older than the previous one, and
// the last one arrives.
#include <gtest/gtest.h>

#include <cstdint>
#include <palpate/math/latest_value.hpp>
#include <thread>

namespace {

struct Numbers {
  std::int64_t first = 0;
  std::int64_t more[30] = {};
  std::int64_t last = 0;
};

TEST(LatestValue, IsCompleteAndNeverOlder) {
  const std::int64_t count = 200'000;
  palpate::math::LatestValue<Numbers> latest;
  EXPECT_FALSE(latest.acquire());
  std::thread writer([&latest] {
    for (std::int64_t i = 1; i <= count; ++i) {
      Numbers& next = latest.write_slot();
      next.first = i;
      for (std::int64_t& m : next.more) m = i;
      next.last = i;
      latest.publish();
    }
  });
  std::int64_t previous = 0;
  while (previous < count) {
    if (!latest.acquire()) continue;
    const Numbers& value = latest.value();
    ASSERT_GT(value.first, previous);
    ASSERT_EQ(value.first, value.last);
    for (const std::int64_t m : value.more) ASSERT_EQ(m, value.first);
    previous = value.first;
  }
  writer.join();
  EXPECT_FALSE(latest.acquire());
  EXPECT_EQ(latest.value().first, count);
}

}  // namespace
