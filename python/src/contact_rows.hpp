#pragma once

#include <nanobind/nanobind.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <palpate/deformable/contact/tip_contact.hpp>

#include "arrays.hpp"

/// Conversion of contact results to rows of arrays.

inline palpate::deformable::Tip tip_of(double radius, bool flat, const palpate::math::Vector3<>& center,
                                       const palpate::math::Vector3<>& outward) {
  return {flat ? palpate::deformable::Tip::Kind::flat : palpate::deformable::Tip::Kind::sphere, radius, center, outward};
}

/// Columns of a contact result: force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost.
constexpr std::size_t result_width = 15;

inline void write_result(const palpate::deformable::ContactResult& a, double* row) {
  Eigen::Map<palpate::math::Vector3<>>(row + 0) = a.force;
  Eigen::Map<palpate::math::Vector3<>>(row + 3) = a.deflection;
  row[6] = a.energy;
  row[7] = a.nodes;
  row[8] = a.touching ? 1.0 : 0.0;
  row[9] = a.solved ? 1.0 : 0.0;
  Eigen::Map<palpate::math::Vector3<>>(row + 10) = a.friction;
  row[13] = a.sliding ? 1.0 : 0.0;
  row[14] = a.lost ? 1.0 : 0.0;
}

/// Return the contact nodes of the last step and the forces along their inward normals, N.
template <class Contact>
nanobind::tuple contact_forces(const Contact& contact) {
  const auto n = static_cast<std::size_t>(contact.last().nodes);
  auto [nodes, i] = new_array<std::int64_t>({n});
  auto [forces, f] = new_array<double>({n});
  std::copy_n(contact.contact_nodes(), n, i);
  std::copy_n(contact.forces(), n, f);
  return nanobind::make_tuple(nodes, forces);
}
