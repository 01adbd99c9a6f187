// Reading and repair of triangle meshes.
#include "palpate/mesh/impl/mesh_file.hpp"
#include "palpate/mesh/impl/mesh_repair.hpp"
