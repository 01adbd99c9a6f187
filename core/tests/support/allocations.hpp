#pragma once

// Counts every allocation of the program that includes this header by replacing malloc. Include it in one program only, and not with the
// address sanitizer, which replaces malloc too.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <atomic>
#include <cstdlib>

extern "C" void* __libc_malloc(std::size_t);

namespace {
std::atomic<long> allocations{0};
}

extern "C" void* malloc(std::size_t size) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}

// A counter that cannot count would let anything pass.
TEST(Allocations, TheCounterCounts) {
  const long before = allocations;
  void* volatile kept = std::malloc(static_cast<std::size_t>(before) % 7 + 100);  // volatile: a compiler may remove an unused pair
  std::free(kept);
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(20, 20);
  EXPECT_GE(allocations - before, 2) << m(0, 0);
}
