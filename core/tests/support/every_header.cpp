// Every header of the core, for clang-tidy. No program contains this file.
#include <palpate/deformable.hpp>
#include <palpate/mesh.hpp>
#include <palpate/palpate.hpp>
