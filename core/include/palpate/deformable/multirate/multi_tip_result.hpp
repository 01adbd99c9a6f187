#pragma once

#include <array>

#include "palpate/deformable/contact/contact_result.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"

namespace palpate::deformable {

/// Rigid tips that indent one body at the same time.
struct TipPair {
  static constexpr int max_tips = 2;
  int count = 0;
  std::array<Tip, max_tips> tip{};
};

/// Result of a contact step with several tips.
struct MultiTipResult {
  std::array<ContactResult, TipPair::max_tips> tip{};
  double energy = 0.0;  ///< released when all tips leave, J
  int nodes = 0;        ///< number of contact nodes
  bool solved = true;   ///< the forces have converged, and the model has the nodes that bear them
};

}  // namespace palpate::deformable
