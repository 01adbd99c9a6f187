#pragma once

#include <memory>
#include <palpate/deformable/hyperelastic/quasi_static_solver.hpp>

namespace palpate::solid {

/// Report of one model update.
struct PressedStep {
  double relative_residual = 0.0;  ///< unbalanced force or change of the contact forces, over the contact forces
  double residual = 0.0;           ///< norm of load minus internal forces before the update, N
  int newton_steps = 0;            ///< conjugate gradient steps of the equilibrium
  int compliance_steps = 0;        ///< conjugate gradient steps of the compliance columns
  double compliance_error = 0.0;   ///< estimated relative error of the worst compliance column, energy norm
};

/// A quasi-static solver with the material erased, compiled for one SIMD width.
class AnyPressed {
 public:
  AnyPressed() = default;
  AnyPressed(const AnyPressed&) = delete;
  AnyPressed& operator=(const AnyPressed&) = delete;
  virtual ~AnyPressed() = default;

  virtual PressedStep step(const deformable::TipPair& tips, deformable::LocalModel& to) = 0;
  /// Write the displacements of all points, 3 x point + axis, m.
  virtual void displacement(double* to) const = 0;
  [[nodiscard]] virtual double energy() = 0;
  virtual void reset() = 0;
  /// Return a copy at rest with its own state.
  [[nodiscard]] virtual std::unique_ptr<AnyPressed> clone_at_rest() const = 0;
};

template <int lanes>
std::unique_ptr<AnyPressed> press(bool corotational, const deformable::TetMesh& mesh, const deformable::TetSurface& surface,
                                  const deformable::SolverOptions& options);

}  // namespace palpate::solid
