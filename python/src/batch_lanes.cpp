/// Compiled once for each width of vector registers (PALPATE_LANES doubles), with that instruction set's flags. Nothing that another file
/// could share may leave this one: a copy made for AVX-512 would stop an older machine. So its inline functions are local (-fno-weak).
#include <cstddef>
#include <palpate/mechanism/registry.hpp>
#include <palpate/servo/batch.hpp>

namespace palpate::batch {

template <int lanes>
void run_lanes(std::size_t index, const void* queue, int ticks, const double* reference, const double* operator_force);

template <>
void run_lanes<PALPATE_LANES>(std::size_t index, const void* queue, int ticks, const double* reference, const double* operator_force) {
  mechanism::Registry::for_each([=]<class Mechanism>() {
    if (index == mechanism::Registry::index_of<Mechanism>())
      servo::simulate_side_by_side<Mechanism, PALPATE_LANES>(*static_cast<const servo::JobQueue<Mechanism>*>(queue), ticks, reference,
                                                             operator_force);
  });
}

}  // namespace palpate::batch
