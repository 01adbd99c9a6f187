// Times of late ticks.
#include <gtest/gtest.h>

#include <palpate/actuation/delay.hpp>
#include <palpate/actuation/tick_schedule.hpp>

namespace {

using palpate::actuation::random_number;
using palpate::actuation::TickSchedule;

// The values are those of splitmix64 in exact integers.
TEST(TickSchedule, RandomNumbersAreTheSameEverywhere) {
  EXPECT_EQ(random_number(0, 0), 0x1.c4415072f63b9p-1);
  EXPECT_EQ(random_number(0, 1), 0x1.b9e279aa86e58p-2);
  EXPECT_EQ(random_number(7, 0), 0x1.0c77123e98157p-1);
  EXPECT_EQ(random_number(12345, 99), 0x1.0a210f87d91f1p-1);
}

// Law: tick k is at k periods plus its lateness, so elapsed times add up to that; what remains is the next elapsed time.
TEST(TickSchedule, ElapsedTimesAddUpToTheTimeOfTheTick) {
  const double period = 1e-3, jitter = 0.4e-3;
  TickSchedule<double> schedule(period, jitter, 5);
  double time = schedule.lateness(), sum = 0.0;
  for (int k = 0; k < 1000; ++k) {
    EXPECT_EQ(schedule.lateness(), jitter * random_number(5, k));
    EXPECT_NEAR(time, k * period + schedule.lateness(), 1e-12);
    const double remaining = schedule.remaining(), next = schedule.next_lateness();
    schedule.tick();
    EXPECT_EQ(schedule.lateness(), next);
    EXPECT_NEAR(schedule.elapsed(), remaining, 1e-18);
    time += schedule.elapsed();
    sum += schedule.lateness();
  }
  EXPECT_NEAR(sum / 1000.0, 0.5 * jitter, 0.05 * jitter);
}

TEST(Delay, AResetDelayGivesItsNewInitialValue) {
  for (const int periods : {0, 1, 3}) {
    palpate::actuation::Delay<double> delay(periods, 1.0);
    for (int k = 0; k < 5; ++k) delay.pass(10.0 + k);
    delay.reset(2.0);
    for (int k = 0; k < 6; ++k) EXPECT_EQ(delay.pass(20.0 + k), k < periods ? 2.0 : 20.0 + k - periods) << periods;
  }
}

}  // namespace
