// Every header of the core, and a test that instantiates the loop, for clang-tidy. No program contains this file.
#include <palpate/deformable.hpp>
#include <palpate/mesh.hpp>
#include <palpate/palpate.hpp>

#include "servo/simulation_test.cpp"  // NOLINT(bugprone-suspicious-include)
