#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/layer_modulus.hpp"

namespace palpate::deformable {

/// Effort of a step of ComplianceColumnCache. Errors are relative, in the energy norm (approximate).
struct ColumnRefinement {
  float tolerance = 0.05F;       ///< columns below this error are not refined
  float batch_tolerance = 0.3F;  ///< columns above this error are refined even beyond the sixteen worst
  int max_steps = 6;             ///< of conjugate gradients per refinement; a new column takes several
};

/// Contact surface of a tetrahedral body: n nodes and the surface triangles.
struct TetSurface {
  std::vector<std::int32_t> point;                     ///< mesh point of each node, n
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< mesh points, counterclockwise seen from outside
  std::vector<LayerModulus> modulus;                   ///< of the elastic layer of each node, n
};

/// Inertia of a body: lumped mass, and Rayleigh damping by rayleigh_alpha times the mass plus rayleigh_beta times the tangent stiffness.
struct Inertia {
  double density = 0.0;         ///< kg/m^3; 0: the body is quasi-static
  double rayleigh_alpha = 0.0;  ///< 1/s
  double rayleigh_beta = 0.0;   ///< s
};

/// Standard linear solid: under a step the body is `instantaneous_ratio` times as stiff as in the long term; at small strains it creeps
/// with the `retardation_time` under a constant force.
struct Relaxation {
  double instantaneous_ratio = 1.0;  ///< at least 1; 1: elastic
  double retardation_time = 1.0;     ///< s

  [[nodiscard]] bool enabled() const noexcept { return instantaneous_ratio > 1.0; }
};

/// Effort of a step of QuasiStaticSolver, and the body's inertia and relaxation.
struct SolverOptions {
  int nodes_per_tip = 32;         ///< nodes with compliance columns, nearest to each tip; at most LocalModel::max_inner in total
  float newton_tolerance = 0.1F;  ///< relative error of the Newton direction, in the energy norm
  int max_newton_steps = 60;      ///< of conjugate gradients per Newton step
  ColumnRefinement compliance{};
  Inertia inertia{};
  Relaxation relaxation{};
  double tick_period = 1e-3;  ///< of the servo, s; of bodies with inertia or relaxation
  int update_interval = 20;   ///< ticks that a model update is expected to take; same
  /// Whether the local models have LocalModel::contact_compliance, for friction.
  bool contact_compliance = false;

  /// Whether the body may hold energy that no tip holds.
  [[nodiscard]] bool has_memory() const noexcept { return inertia.density > 0.0 || relaxation.enabled(); }
};

}  // namespace palpate::deformable
