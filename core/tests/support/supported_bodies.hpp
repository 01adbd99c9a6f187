#pragma once

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <palpate/object/supported_body.hpp>
#include <utility>
#include <vector>

#include "support/contact_bodies.hpp"

namespace supported_bodies {

using palpate::deformable::CondensedSurface, palpate::deformable::SupportNodes, palpate::deformable::Tip, palpate::math::Vector3;
using palpate::object::BodyWithSupports, palpate::object::NormalContactPhase, palpate::object::SignedDistancePhase,
    palpate::object::SupportedBody;
using Change = BodyWithSupports::Change;

inline constexpr double half_width = 10e-3, radius = 4e-3;  // m

/// Elastic half-space with 81 nodes in a square, 2.5 mm apart.
inline const contact_bodies::SurfaceBody& half_space() {
  static const contact_bodies::SurfaceBody body = contact_bodies::half_space(8, half_width, 1e4);
  return body;
}

inline std::shared_ptr<const CondensedSurface> surface() {
  const contact_bodies::SurfaceBody& body = half_space();
  auto s = std::make_shared<CondensedSurface>();
  const auto n = static_cast<std::size_t>(body.nodes.size());
  s->compliance.resize(9 * n * n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto node = static_cast<std::int32_t>(i);
    s->points.push_back(body.nodes.point(node));
    s->normals.push_back(body.nodes.normal(node));
    s->areas.push_back(2.5e-3 * 2.5e-3);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          s->compliance[(3 * i + a) * 3 * n + 3 * j + b] = body.compliance.block(node, static_cast<std::int32_t>(j))[3 * a + b];
  }
  return s;
}

/// Nodes for which `inside(point)`, and the others.
template <class Inside>
SupportNodes held_where(Inside inside) {
  SupportNodes nodes;
  for (std::int32_t i = 0; i < half_space().nodes.size(); ++i)
    (inside(half_space().nodes.point(i)) ? nodes.held : nodes.touched).push_back(i);
  return nodes;
}
inline SupportNodes free() {
  return held_where([](const Vector3<>&) { return false; });
}
/// The nodes beyond `x` [m] are held.
inline SupportNodes held_beyond(double x) {
  return held_where([x](const Vector3<>& p) { return p[0] > x; });
}

/// The nodes within a distance of (x, y) are held [m].
inline SupportNodes around(double x, double y, double within) {
  return held_where([=](const Vector3<>& p) { return (p - Vector3<>(x, y, 0.0)).norm() < within; });
}

/// By signed distance, with friction.
inline std::unique_ptr<SupportedBody<SignedDistancePhase>> make_rough(const std::vector<Change>& changes, double mu = 0.5) {
  palpate::object::SignedDistanceOptions options;
  options.friction = {mu, mu};
  return std::make_unique<SupportedBody<SignedDistancePhase>>(surface(), changes,
                                                              SignedDistancePhase::Maker(half_space().surface, options));
}

inline constexpr double moduli = 3.0, retardation = 30e-3;  // of the standard linear solid: ratio, s

/// The same as a standard linear solid; ticks of 1 ms.
inline std::unique_ptr<SupportedBody<SignedDistancePhase>> make_relaxing(const std::vector<Change>& changes, double mu = 0.0,
                                                                         double sideways = 1.0) {
  palpate::object::SignedDistanceOptions options;
  options.friction = {mu, mu};
  options.sideways = sideways;
  options.instantaneous_ratio = moduli;
  options.retardation_time = retardation;
  return std::make_unique<SupportedBody<SignedDistancePhase>>(surface(), changes,
                                                              SignedDistancePhase::Maker(half_space().surface, options));
}

inline constexpr double node_mass = 2e-4;  // kg

/// The half-space with equal masses at its nodes: its modes are the eigenvectors of the compliance. The softest `modes`.
inline std::shared_ptr<const CondensedSurface> massive_surface(int modes) {
  auto s = std::make_shared<CondensedSurface>(*surface());
  const auto n = static_cast<Eigen::Index>(3 * s->size());
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> found(Eigen::Map<const Rows>(s->compliance.data(), n, n).cast<double>());
  for (int k = 0; k < modes; ++k) s->frequencies.push_back(1.0 / std::sqrt(node_mass * found.eigenvalues()[n - 1 - k]));
  for (Eigen::Index row = 0; row < n; ++row)
    for (int k = 0; k < modes; ++k) s->shapes.push_back(static_cast<float>(found.eigenvectors()(row, n - 1 - k) / std::sqrt(node_mass)));
  return s;
}

inline constexpr double swing_alpha = 20.0, swing_beta = 2e-4;  // 1/s, s

/// A body with inertia; ticks of 1 ms. `damping` times the constants above.
inline std::unique_ptr<SupportedBody<SignedDistancePhase>> make_swinging(const std::vector<Change>& changes, double damping = 1.0,
                                                                         int modes = 20, double mu = 0.0, double sideways = 1.0) {
  palpate::object::SignedDistanceOptions options;
  options.friction = {mu, mu};
  options.sideways = sideways;
  options.modes.rayleigh_alpha = damping * swing_alpha;
  options.modes.rayleigh_beta = damping * swing_beta;
  return std::make_unique<SupportedBody<SignedDistancePhase>>(massive_surface(modes), changes,
                                                              SignedDistancePhase::Maker(half_space().surface, options));
}

/// Names a body with inertia for make().
struct Swinging {};

template <class Phase>
auto make(std::vector<Change> changes) {
  if constexpr (std::is_same_v<Phase, Swinging>)
    return make_swinging(changes);
  else if constexpr (std::is_same_v<Phase, NormalContactPhase>)
    return std::make_unique<SupportedBody<Phase>>(surface(), changes, typename Phase::Maker());
  else
    return std::make_unique<SupportedBody<Phase>>(surface(), changes, typename Phase::Maker(half_space().surface, {}));
}

/// A sphere at depth `deep` [m] over `x`, `y` [m].
inline Tip sphere(double deep, double x = 0.0, double y = 0.0) {
  return {.kind = Tip::Kind::sphere, .radius = radius, .center = {x, y, radius - deep}};
}

/// Press, drag aside and leave within 50 steps, then stay above for 50.
inline Tip path(int k) {
  const double s = std::min((k % 100) / 50.0, 1.0);
  return sphere(2e-3 * std::sin(M_PI * s) - 0.5e-3, 4e-3 * s - 2e-3, 1e-3 * std::sin(0.05 * k));
}

/// Check that a reset body and a copy at rest repeat a run of `ticks` steps in every bit.
inline void expect_repeats(BodyWithSupports& body, int ticks) {
  const auto tip = [](int k) { return sphere(1e-3 * std::sin(0.1 * k)); };
  const auto copy = body.clone_at_rest();
  std::vector<Vector3<>> forces;
  for (int k = 0; k < ticks; ++k) forces.push_back(body.step(tip(k)).force);
  body.reset();
  for (int k = 0; k < ticks; ++k) {
    EXPECT_EQ(body.step(tip(k)).force, forces[static_cast<std::size_t>(k)]);
    EXPECT_EQ(copy->step(tip(k)).force, forces[static_cast<std::size_t>(k)]);
  }
}

}  // namespace supported_bodies
