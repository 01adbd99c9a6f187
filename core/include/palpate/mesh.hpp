#pragma once

/// Triangle meshes: files, repair, motion, the proxy that follows the tip, and their object for the servo loop.
#include "palpate/mesh/mesh_file.hpp"
#include "palpate/mesh/mesh_repair.hpp"
#include "palpate/mesh/mesh_updater.hpp"
#include "palpate/mesh/proxy.hpp"
#include "palpate/object/mesh_object.hpp"
