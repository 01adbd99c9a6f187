#pragma once

#include <Eigen/Core>
#include <memory>
#include <palpate/object/deformable_object.hpp>

/// What every kind of body in Python gives a servo loop.
struct BodyInLoop {
  BodyInLoop() = default;
  BodyInLoop(const BodyInLoop&) = delete;
  BodyInLoop& operator=(const BodyInLoop&) = delete;
  BodyInLoop(BodyInLoop&&) = delete;
  BodyInLoop& operator=(BodyInLoop&&) = delete;
  virtual ~BodyInLoop() = default;

  /// A copy at rest, on the same nodes.
  [[nodiscard]] virtual std::unique_ptr<palpate::object::DeformableObject> in_loop() const = 0;
};

/// A body at its place, with the tip that meets it; a flat end's axis is the body's own z. The body outlives it.
struct BodyPlacement {
  std::unique_ptr<palpate::object::DeformableObject> body;
  palpate::object::BodyPlacement placed;

  BodyPlacement(const BodyInLoop& kind, const palpate::math::Vector3<>& origin, const Eigen::Matrix3d& turn, double radius, bool flat)
      : body(kind.in_loop()), placed{body.get(), origin,
                                     turn,       flat ? palpate::deformable::Tip::Kind::flat : palpate::deformable::Tip::Kind::sphere,
                                     radius,     palpate::math::Vector3<>::UnitZ()} {}
};
