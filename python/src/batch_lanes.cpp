/// Compiled once for each width of vector registers (PALPATE_LANES doubles), with that instruction set's flags. Nothing that another file
/// could share may leave this one: a copy made for AVX-512 would stop an older machine. So its inline functions are local (-fno-weak).
#include <cstddef>
#include <palpate/mechanism/registry.hpp>
#include <palpate/servo/batch.hpp>

namespace palpate::batch {

template <int lanes>
void run_lanes(std::size_t index, bool workspace, const void* queue, int ticks, const double* reference, const double* operator_force);

template <>
void run_lanes<PALPATE_LANES>(std::size_t index, bool workspace, const void* queue, int ticks, const double* reference,
                              const double* operator_force) {
  mechanism::Registry::for_each([=]<class Mechanism>() {
    using Linear = control::StateSpace;
    using Workspace = control::WorkspaceController<Mechanism>;
    if (index != mechanism::Registry::index_of<Mechanism>()) return;
    if (workspace)
      servo::simulate_side_by_side<Mechanism, Workspace, PALPATE_LANES>(*static_cast<const servo::JobQueue<Mechanism, Workspace>*>(queue),
                                                                        ticks, reference, operator_force);
    else
      servo::simulate_side_by_side<Mechanism, Linear, PALPATE_LANES>(*static_cast<const servo::JobQueue<Mechanism, Linear>*>(queue), ticks,
                                                                     reference, operator_force);
  });
}

}  // namespace palpate::batch
