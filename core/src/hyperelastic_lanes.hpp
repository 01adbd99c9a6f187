#pragma once

#include <memory>

#include "palpate/deformable/hyperelastic/compiled_solver.hpp"

namespace palpate::deformable::detail {

/// Factories of one SIMD width; hyperelastic_lanes.cpp and local_contact_lanes.cpp are compiled once for each.
template <int lanes>
std::unique_ptr<AnyHyperelasticModel> make_model(HyperelasticLaw law, const TetMesh& mesh, const Relaxation& relaxation);
template <int lanes>
std::unique_ptr<AnyQuasiStaticSolver> make_solver(HyperelasticLaw law, const TetMesh& mesh, const TetSurface& surface,
                                                  const SolverOptions& options);
template <int lanes>
AnyLocalContact make_contact();

}  // namespace palpate::deformable::detail
