#pragma once

#include <memory>

#include "palpate/deformable/hyperelastic/compiled_solver.hpp"

namespace palpate::deformable::detail {

/// Factories of one SIMD width; hyperelastic_lanes.cpp is compiled once for each.
template <int lanes>
std::unique_ptr<AnyHyperelasticModel> make_model(HyperelasticLaw law, const TetMesh& mesh, const Relaxation& relaxation);
template <int lanes>
std::unique_ptr<AnyQuasiStaticSolver> make_solver(HyperelasticLaw law, const TetMesh& mesh, const TetSurface& surface,
                                                  const SolverOptions& options);

}  // namespace palpate::deformable::detail
