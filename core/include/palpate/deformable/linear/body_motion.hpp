#pragma once

#include <cstdint>
#include <memory>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Memory of a linear body: displacements at the end of a period without force, in all directions. The displacement under forces that are
/// constant over the period is free_displacement() + C f, with the compliance C of the period, which the contact holds.
class BodyMotion {
 public:
  /// Forces of a period on `count` nodes [N] (a node may occur twice) and their products with displacements.
  struct Period {
    const std::int32_t* nodes = nullptr;
    const Vector3<>* forces = nullptr;
    int count = 0;
    double compliance_work = 0.0;  ///< f.C f, N m
    double free_work = 0.0;        ///< f.(free displacement), N m
  };

  BodyMotion() = default;
  BodyMotion& operator=(const BodyMotion&) = delete;
  BodyMotion(BodyMotion&&) = delete;
  BodyMotion& operator=(BodyMotion&&) = delete;
  virtual ~BodyMotion() = default;

  /// Displacement of a node at the end of the next period without force, m.
  [[nodiscard]] virtual Vector3<> free_displacement(std::int32_t node) const noexcept = 0;

  /// The same after advance(), from the node's free displacement in the last period and its displacement by that period's forces [m].
  [[nodiscard]] virtual Vector3<> next_free(std::int32_t node, const Vector3<>& free, const Vector3<>& by_forces) const noexcept = 0;

  /// Whether next_free() is free_displacement(): it takes long and does not depend on its further arguments.
  [[nodiscard]] virtual bool costly() const noexcept { return false; }

  /// Advance by one period. Return the energy at its end, kinetic and elastic, J.
  virtual double advance(const Period& period) noexcept = 0;

  virtual void reset() noexcept = 0;

  /// Return a copy at rest.
  [[nodiscard]] virtual std::unique_ptr<BodyMotion> clone_at_rest() const = 0;

 protected:
  BodyMotion(const BodyMotion&) = default;
};

}  // namespace palpate::deformable
