/// Compiled once for each width of vector registers (PALPATE_LANES doubles), with that instruction set's flags. Nothing that another file
/// could share may leave this one: a copy made for AVX-512 would stop an older machine. So its inline functions are local (-fno-weak).
#include <palpate/mechanism/premium.hpp>
#include <palpate/mechanism/slider.hpp>
#include <palpate/servo/batch.hpp>

namespace palpate::batch {

template <class Mechanism, int lanes>
void run_lanes(const servo::JobQueue<Mechanism>& queue, int ticks, const double* reference, const double* operator_force);

template <>
void run_lanes<mechanism::Premium, PALPATE_LANES>(const servo::JobQueue<mechanism::Premium>& queue, int ticks, const double* reference,
                                                  const double* operator_force) {
  servo::simulate_side_by_side<mechanism::Premium, PALPATE_LANES>(queue, ticks, reference, operator_force);
}

template <>
void run_lanes<mechanism::Slider, PALPATE_LANES>(const servo::JobQueue<mechanism::Slider>& queue, int ticks, const double* reference,
                                                 const double* operator_force) {
  servo::simulate_side_by_side<mechanism::Slider, PALPATE_LANES>(queue, ticks, reference, operator_force);
}

}  // namespace palpate::batch
