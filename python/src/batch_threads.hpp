#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <palpate/loop/batch.hpp>
#include <thread>
#include <vector>

namespace palpate::batch {

template <class Mechanism>
using RunLanes = void (*)(const SimulationSetup<Mechanism>* const*, int, int, const double*, const double*, double*);

template <class Mechanism>
RunLanes<Mechanism> lanes_of(int lanes) {
#if defined(PALPATE_WIDE_LANES)
  if (lanes == 8) return run_lanes<Mechanism, 8>;
  if (lanes == 4) return run_lanes<Mechanism, 4>;
#endif
  (void)lanes;
  return run_lanes<Mechanism, 2>;
}

template <class Mechanism, class Cell>
void run_cells(const SimulationSetup<Mechanism>& base, const Cell& cell, std::ptrdiff_t count, int ticks, const double* reference,
               const double* operator_force, double* rows, int threads, int lanes) {
  constexpr int width = outcome_width<Mechanism::dof>;
  int wide = most_lanes();
  while (lanes > 0 && wide > std::max(lanes, 2)) wide /= 2;
  const RunLanes<Mechanism> run = lanes_of<Mechanism>(wide);
  constexpr std::ptrdiff_t share = 64;  // cells that a thread takes at a time
  std::atomic<std::ptrdiff_t> next = 0;
  const auto work = [&] {
    std::vector<SimulationSetup<Mechanism>> setups(static_cast<std::size_t>(wide), base);
    std::vector<const SimulationSetup<Mechanism>*> pack;
    for (const auto& s : setups) pack.push_back(&s);
    for (std::ptrdiff_t from = next.fetch_add(share); from < count; from = next.fetch_add(share)) {
      const std::ptrdiff_t to = std::min(from + share, count);
      for (std::ptrdiff_t i = from; i < to;) {
        int together = 0;
        while (together < wide && i + together < to) {
          SimulationSetup<Mechanism>& setup = setups[static_cast<std::size_t>(together)];
          cell(i + together, setup);
          if (together > 0 && !alike(setups[0], setup)) break;
          ++together;
        }
        run(pack.data(), together, ticks, reference, operator_force, rows + i * width);
        i += together;
      }
    }
  };
  const auto most = static_cast<int>((count + share - 1) / share);
  std::vector<std::thread> others;
  for (int i = 1; i < std::min(threads, most); ++i) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
}

}  // namespace palpate::batch
