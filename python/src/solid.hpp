#pragma once

#include <memory>
#include <palpate/deformable/hyperelastic/hyperelastic_model.hpp>
#include <string>

namespace palpate::solid {

/// A solid of one of the materials, compiled for one width of vector registers. Vectors are 3 x point + axis.
class AnySolid {
 public:
  AnySolid() = default;
  AnySolid(const AnySolid&) = delete;
  AnySolid& operator=(const AnySolid&) = delete;
  virtual ~AnySolid() = default;

  /// Energy [J] at a displacement [m]; the inner forces [N] into `forces`.
  virtual double evaluate(const double* displacement, double* forces) = 0;
  /// Change of the inner forces [N] along `motion` [m], at the displacement of the last evaluate(), in single precision.
  virtual void tangent(const double* motion, double* forces) = 0;
  /// Newton's steps from where it is until the residual is below `tolerance` of the load; returns how many, or -1 if `max_steps` were not
  /// enough.
  virtual int relax(const double* load, double tolerance, int max_steps) = 0;
  virtual void displacement(double* to) const = 0;
  virtual void reset() = 0;
};

template <int lanes>
std::unique_ptr<AnySolid> make(bool corotational, const deformable::TetMesh& mesh);

}  // namespace palpate::solid
