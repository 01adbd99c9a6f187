#pragma once

#include <memory>
#include <palpate/deformable/linear/spring_kernels.hpp>
#include <palpate/math/machine_lanes.hpp>
#include <palpate/object/signed_distance_body.hpp>
#include <palpate/object/supported_body.hpp>
#include <utility>
#include <vector>

namespace palpate::body {

/// Body whose tick is compiled for one width of vector registers; body_lanes.cpp is compiled once for each. The results are the same bits.
template <int lanes>
std::unique_ptr<object::SignedDistanceBody> make_in_lanes(deformable::SurfaceNodes&& nodes, const float* full,
                                                          const deformable::ContactSurface& surface,
                                                          const object::SignedDistanceOptions& options);

/// The same for a body whose supports change; null if the nodes of a phase cannot be held together.
template <int lanes>
std::unique_ptr<object::BodyWithSupports> make_supported_in_lanes(std::shared_ptr<const deformable::CondensedSurface> nodes,
                                                                  const std::vector<object::BodyWithSupports::Change>& changes,
                                                                  const deformable::ContactSurface& surface,
                                                                  const object::SignedDistanceOptions& options);

/// The same for at most `lanes` double-precision numbers in a register; 0: the widest of this machine and this build.
inline std::unique_ptr<object::SignedDistanceBody> make_signed_distance_body(deformable::SurfaceNodes&& nodes, const float* full,
                                                                             const deformable::ContactSurface& surface,
                                                                             const object::SignedDistanceOptions& options, int lanes) {
  return math::with_widest_lanes([&](auto n) { return make_in_lanes<n()>(std::move(nodes), full, surface, options); }, lanes);
}

inline std::unique_ptr<object::BodyWithSupports> make_supported_signed_distance(
    std::shared_ptr<const deformable::CondensedSurface> nodes, const std::vector<object::BodyWithSupports::Change>& changes,
    const deformable::ContactSurface& surface, const object::SignedDistanceOptions& options, int lanes) {
  return math::with_widest_lanes([&](auto n) { return make_supported_in_lanes<n()>(std::move(nodes), changes, surface, options); }, lanes);
}

/// Sums of the mass-spring model, compiled in the same way.
template <int lanes>
const deformable::SpringKernels& spring_kernels_in_lanes() noexcept;

inline const deformable::SpringKernels& widest_spring_kernels(int lanes) {
  return math::with_widest_lanes([](auto n) -> const deformable::SpringKernels& { return spring_kernels_in_lanes<n()>(); }, lanes);
}

}  // namespace palpate::body
