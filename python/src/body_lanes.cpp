/// Compiled once for each width of vector registers (PALPATE_LANES doubles), with that instruction set's flags. A loop reaches the tick of
/// a body through its virtual functions, which are those of this file. Its inline functions are local (-fno-weak), so that none of them
/// runs on a machine without these registers.
#include <memory>
#include <palpate/object/signed_distance_body.hpp>
#include <utility>

namespace palpate::body {

template <int lanes>
std::unique_ptr<object::SignedDistanceBody> make_in_lanes(deformable::SurfaceNodes&& nodes, const float* full,
                                                          const deformable::ContactSurface& surface,
                                                          const object::SignedDistanceOptions& options);

template <>
std::unique_ptr<object::SignedDistanceBody> make_in_lanes<PALPATE_LANES>(deformable::SurfaceNodes&& nodes, const float* full,
                                                                         const deformable::ContactSurface& surface,
                                                                         const object::SignedDistanceOptions& options) {
  using Body = object::SignedDistanceBody;
  return std::make_unique<Body>(std::make_shared<const Body::Data>(std::move(nodes), full, surface, options));
}

}  // namespace palpate::body
