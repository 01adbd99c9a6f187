/// Compiled once for each width of vector registers (PALPATE_LANES doubles), with that instruction set's flags. A loop reaches the tick of
/// a body through its virtual functions, which are those of this file. Its inline functions are local (-fno-weak), so that none of them
/// runs on a machine without these registers.
#include <memory>
#include <palpate/deformable/linear/spring_kernels.hpp>
#include <palpate/object/signed_distance_body.hpp>
#include <palpate/object/supported_body.hpp>
#include <utility>
#include <vector>

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

template <int lanes>
std::unique_ptr<object::BodyWithSupports> make_supported_in_lanes(std::shared_ptr<const deformable::CondensedSurface> nodes,
                                                                  const std::vector<object::BodyWithSupports::Change>& changes,
                                                                  const deformable::ContactSurface& surface,
                                                                  const object::SignedDistanceOptions& options);

template <>
std::unique_ptr<object::BodyWithSupports> make_supported_in_lanes<PALPATE_LANES>(
    std::shared_ptr<const deformable::CondensedSurface> nodes, const std::vector<object::BodyWithSupports::Change>& changes,
    const deformable::ContactSurface& surface, const object::SignedDistanceOptions& options) {
  using Body = object::SupportedBody<object::SignedDistancePhase>;
  auto body = std::make_unique<Body>(std::move(nodes), changes, object::SignedDistancePhase::Maker(surface, options));
  if (!body->usable()) return nullptr;
  return body;
}

template <int lanes>
const deformable::SpringKernels& spring_kernels_in_lanes() noexcept;

template <>
const deformable::SpringKernels& spring_kernels_in_lanes<PALPATE_LANES>() noexcept {
  return deformable::spring_kernels();
}

}  // namespace palpate::body
