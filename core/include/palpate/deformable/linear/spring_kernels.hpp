#pragma once

#include <cstddef>

#include "palpate/deformable/linear/spring_network.hpp"
#include "palpate/math/supernodal_cholesky.hpp"

namespace palpate::deformable {

/// A force on a node of the surface, and the displacements of the free vertices per unit force on it.
struct ResponseColumn {
  const float* displacement = nullptr;  ///< of each free vertex, m/N
  PaddedVector force = 0.0;             ///< N
};

/// The sums over all springs and vertices in a tick of the mass-spring model, as compiled for one width of vector registers. The results
/// are the same bits.
struct SpringKernels {
  double (*accumulate_forces)(SpringNetwork& network, const PaddedVector* x, const PaddedVector* v, PaddedVector* force) noexcept;
  void (*solve)(math::SupernodalCholesky& factor, PaddedVector* right_hand_sides) noexcept;
  /// Add the displacements of `count` columns to `step` (vertices).
  void (*add_columns)(const ResponseColumn* columns, std::size_t count, PaddedVector* step, std::size_t vertices) noexcept;
};

/// Return the kernels as this translation unit is compiled.
[[nodiscard]] inline const SpringKernels& spring_kernels() noexcept {
  static constexpr SpringKernels kernels{
      [](SpringNetwork& network, const PaddedVector* x, const PaddedVector* v, PaddedVector* force) noexcept {
        return network.accumulate_forces(x, v, force);
      },
      [](math::SupernodalCholesky& factor, PaddedVector* right_hand_sides) noexcept { factor.solve(right_hand_sides); },
      [](const ResponseColumn* columns, std::size_t count, PaddedVector* step, std::size_t vertices) noexcept {
        for (std::size_t k = 0; k < vertices; ++k) {
          PaddedVector sum = step[k];
          for (std::size_t c = 0; c < count; ++c) sum += static_cast<double>(columns[c].displacement[k]) * columns[c].force;
          step[k] = sum;
        }
      }};
  return kernels;
}

}  // namespace palpate::deformable
