#pragma once

/// Loops side by side in the lanes of this machine's vector registers, chosen when the program runs.
#include <cstddef>
#include <palpate/mechanism/registry.hpp>
#include <palpate/servo/batch.hpp>

namespace palpate::batch {

/// Runs a servo::JobQueue of the mechanism at `index` in the registry, compiled for one width: 2 lanes run everywhere, 4 need AVX2, 8 need
/// AVX-512 (F, DQ, VL). `workspace`: of loops with a workspace controller instead of a state space.
template <int lanes>
void run_lanes(std::size_t index, bool workspace, const void* queue, int ticks, const double* reference, const double* operator_force);

/// Runs any number of cells, each a row of outcome_width<dof> in `rows`, on `threads` threads with at most `lanes` lanes each (0: all that
/// there are), with a flexible mode without lanes. What a cell finds depends on neither. `cell(i, setup)` puts cell i's own values into a
/// copy of the base setup.
template <class Mechanism, class Setup, class Cell>
void run_cells(const Setup& base, const Cell& cell, std::ptrdiff_t count, int ticks, const double* reference, const double* operator_force,
               double* rows, int threads, int lanes);

}  // namespace palpate::batch

#include "batch_threads.hpp"
