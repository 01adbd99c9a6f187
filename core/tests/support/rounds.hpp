#pragma once

#include <cstdlib>

/// Return the number of repetitions of random tests: the environment variable PALPATE_ROUNDS, or 1.
inline int rounds() {
  const char* asked = std::getenv("PALPATE_ROUNDS");
  return asked != nullptr ? std::atoi(asked) : 1;
}
