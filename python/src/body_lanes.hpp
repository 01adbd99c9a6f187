#pragma once

#include <memory>
#include <palpate/object/signed_distance_body.hpp>

#include "batch.hpp"

namespace palpate::body {

/// Body whose tick is compiled for one width of vector registers; body_lanes.cpp is compiled once for each. The results are the same bits.
template <int lanes>
std::unique_ptr<object::SignedDistanceBody> make_in_lanes(deformable::SurfaceNodes&& nodes, const float* full,
                                                          const deformable::ContactSurface& surface,
                                                          const object::SignedDistanceOptions& options);

/// The same for at most `lanes` double-precision numbers in a register; 0: the widest of this machine and this build.
inline std::unique_ptr<object::SignedDistanceBody> make_signed_distance_body(deformable::SurfaceNodes&& nodes, const float* full,
                                                                             const deformable::ContactSurface& surface,
                                                                             const object::SignedDistanceOptions& options, int lanes) {
  const int wide = lanes > 0 ? std::min(lanes, batch::most_lanes()) : batch::most_lanes();
  auto make = make_in_lanes<2>;
#if defined(PALPATE_LANES_4)
  if (wide >= 4) make = make_in_lanes<4>;
#endif
#if defined(PALPATE_LANES_8)
  if (wide >= 8) make = make_in_lanes<8>;
#endif
  (void)wide;
  return make(std::move(nodes), full, surface, options);
}

}  // namespace palpate::body
