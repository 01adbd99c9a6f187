// Choice of the hyperelastic solver for this machine. A build contains some of the widths: PALPATE_LANES_4 and PALPATE_LANES_8 tell which.
// PALPATE_NATIVE_SOLVERS: only the widest that the machine of the build runs, without the portable one.
#include <palpate/math/machine_lanes.hpp>
#include <stdexcept>
#include <type_traits>

#include "hyperelastic_lanes.hpp"

namespace palpate::deformable {

namespace {

template <class Make>
auto widest(Make make) {
  return math::with_widest_lanes([&make](auto lanes) {
#if defined(PALPATE_NATIVE_SOLVERS)
    if constexpr (lanes() == 2) {
      throw std::runtime_error("palpate was compiled for a processor with wider registers; compile it again on this machine");
      return decltype(make(lanes))();
    } else
#endif
      return make(lanes);
  });
}

}  // namespace

std::unique_ptr<AnyHyperelasticModel> make_hyperelastic_model(HyperelasticLaw law, const TetMesh& mesh, const Relaxation& relaxation) {
  return widest([&](auto lanes) { return detail::make_model<lanes()>(law, mesh, relaxation); });
}

std::unique_ptr<AnyQuasiStaticSolver> make_quasi_static_solver(HyperelasticLaw law, const TetMesh& mesh, const TetSurface& surface,
                                                               const SolverOptions& options) {
  return widest([&](auto lanes) { return detail::make_solver<lanes()>(law, mesh, surface, options); });
}

}  // namespace palpate::deformable
