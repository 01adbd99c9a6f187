#pragma once

#include <cstdlib>

/// How often random tests are to repeat what they do, with other numbers: PALPATE_ROUNDS of the environment, once without it.
inline int rounds() {
  const char* asked = std::getenv("PALPATE_ROUNDS");
  return asked != nullptr ? std::atoi(asked) : 1;
}
