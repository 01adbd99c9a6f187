#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <cstdint>
#include <palpate/deformable/linear/support_phase.hpp>

/// Return the nodes of a phase from their roles: 0 deforms only, 1 is touched, 2 is held.
inline palpate::deformable::SupportNodes support_nodes(const std::uint8_t* role, std::size_t count) {
  palpate::deformable::SupportNodes nodes;
  for (std::size_t i = 0; i < count; ++i) {
    if (role[i] > 2) throw nanobind::value_error("the role of a node is 0, 1 or 2");
    if (role[i] == 2) nodes.held.push_back(static_cast<std::int32_t>(i));
    if (role[i] == 1) nodes.touched.push_back(static_cast<std::int32_t>(i));
  }
  if (nodes.touched.empty()) throw nanobind::value_error("a phase needs a node that can be touched");
  return nodes;
}
