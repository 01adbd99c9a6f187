#pragma once

#include <memory>
#include <palpate/deformable/hyperelastic/quasi_static_solver.hpp>

namespace palpate::solid {

/// What a slow step did.
struct PressedStep {
  double relative_residual = 0.0;  ///< what the contact's forces differ by from the inner ones, or from those before, over them
  double residual = 0.0;           ///< load less inner forces before it, N
  int newton_steps = 0;            ///< of conjugate gradients
  int compliance_steps = 0;        ///< of conjugate gradients
  double compliance_left = 0.0;    ///< how far the worst column of the compliance was from itself, in the energy's norm, about
};

/// A pressed solid of one of the materials, compiled for one width of vector registers.
class AnyPressed {
 public:
  AnyPressed() = default;
  AnyPressed(const AnyPressed&) = delete;
  AnyPressed& operator=(const AnyPressed&) = delete;
  virtual ~AnyPressed() = default;

  virtual PressedStep step(const deformable::TipPair& tips, deformable::LocalModel& to) = 0;
  /// Of all points, 3 x point + axis, m.
  virtual void displacement(double* to) const = 0;
  [[nodiscard]] virtual double energy() = 0;
  virtual void reset() = 0;
  /// The same at rest, with a state of its own.
  [[nodiscard]] virtual std::unique_ptr<AnyPressed> clone_at_rest() const = 0;
};

template <int lanes>
std::unique_ptr<AnyPressed> press(bool corotational, const deformable::TetMesh& mesh, const deformable::TetSurface& surface,
                                  const deformable::SolverOptions& options);

}  // namespace palpate::solid
