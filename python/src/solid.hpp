#pragma once

#include <memory>
#include <palpate/deformable/hyperelastic/hyperelastic_model.hpp>
#include <string>

namespace palpate::solid {

/// A hyperelastic model with the material erased, compiled for one SIMD width. Vectors are 3 x point + axis.
class AnySolid {
 public:
  AnySolid() = default;
  AnySolid(const AnySolid&) = delete;
  AnySolid& operator=(const AnySolid&) = delete;
  virtual ~AnySolid() = default;

  /// Return the energy [J] at a displacement [m]. Write the internal forces [N] to `forces`.
  virtual double evaluate(const double* displacement, double* forces) = 0;
  /// Compute the derivative of the internal forces [N] along `motion` [m] at the last displacement, in single precision.
  virtual void tangent(const double* motion, double* forces) = 0;
  /// Iterate with Newton steps until the residual is below `tolerance` times the load. Return the number of steps, or -1 if `max_steps`
  /// do not suffice.
  virtual int solve_equilibrium(const double* load, double tolerance, int max_steps) = 0;
  virtual void displacement(double* to) const = 0;
  virtual void reset() = 0;
};

template <int lanes>
std::unique_ptr<AnySolid> make(bool corotational, const deformable::TetMesh& mesh);

}  // namespace palpate::solid
