/// Compiled once for each width of vector registers (PALPATE_LANES doubles), with that instruction set's flags. Nothing that another file
/// could share may leave this one: a copy made for AVX-512 would stop an older machine. So its inline functions are local (-fno-weak).
#include <palpate/device/premium.hpp>
#include <palpate/device/slider.hpp>
#include <palpate/loop/batch.hpp>

namespace palpate::batch {

template <class Mechanism, int lanes>
void run_lanes(const Queue<Mechanism>& queue, int ticks, const double* reference, const double* operator_force);

template <>
void run_lanes<Premium, PALPATE_LANES>(const Queue<Premium>& queue, int ticks, const double* reference, const double* operator_force) {
  simulate_side_by_side<Premium, PALPATE_LANES>(queue, ticks, reference, operator_force);
}

template <>
void run_lanes<Slider, PALPATE_LANES>(const Queue<Slider>& queue, int ticks, const double* reference, const double* operator_force) {
  simulate_side_by_side<Slider, PALPATE_LANES>(queue, ticks, reference, operator_force);
}

}  // namespace palpate::batch
