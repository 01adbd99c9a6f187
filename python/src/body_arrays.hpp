#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <palpate/deformable/contact/patch_points.hpp>
#include <palpate/deformable/contact/surface_nodes.hpp>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <palpate/math/vector.hpp>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "contact_rows.hpp"

/// Arrays of deformable bodies, and steps along a path.
namespace body_arrays {

using Points = nanobind::ndarray<const double, nanobind::shape<-1, 3>, nanobind::c_contig, nanobind::device::cpu>;
using Moduli = nanobind::ndarray<const double, nanobind::shape<-1, 2>, nanobind::c_contig, nanobind::device::cpu>;
using Numbers = nanobind::ndarray<const double, nanobind::shape<-1>, nanobind::c_contig, nanobind::device::cpu>;
using Matrix = nanobind::ndarray<const float, nanobind::shape<-1, -1>, nanobind::c_contig, nanobind::device::cpu>;
using Flags = nanobind::ndarray<const bool, nanobind::shape<-1>, nanobind::c_contig, nanobind::device::cpu>;
using Indices = nanobind::ndarray<const std::int32_t, nanobind::shape<-1>, nanobind::c_contig, nanobind::device::cpu>;
using Tensor = nanobind::ndarray<const double, nanobind::shape<-1, -1, 3>, nanobind::c_contig, nanobind::device::cpu>;
template <int width>
using NumberRows = nanobind::ndarray<const double, nanobind::shape<-1, width>, nanobind::c_contig, nanobind::device::cpu>;
template <int width>
using IndexRows = nanobind::ndarray<const std::int32_t, nanobind::shape<-1, width>, nanobind::c_contig, nanobind::device::cpu>;

inline std::vector<palpate::math::Vector3<>> points(const Points& a) {
  std::vector<palpate::math::Vector3<>> list(a.shape(0));
  for (std::size_t i = 0; i < list.size(); ++i) list[i] = {a.data()[3 * i], a.data()[3 * i + 1], a.data()[3 * i + 2]};
  return list;
}

inline std::vector<double> numbers(const Numbers& a) {
  return {a.data(), a.data() + a.shape(0)};
}

inline palpate::deformable::SurfaceNodes fitting(const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance) {
  const std::size_t n = at.shape(0);
  if (n == 0 || normals.shape(0) != n || areas.shape(0) != n || compliance.shape(0) != 3 * n || compliance.shape(1) != 3 * n)
    throw nanobind::value_error("the sizes of the body's arrays do not match");
  return {points(at), points(normals), numbers(areas)};
}

template <int width>
std::vector<std::array<std::int32_t, width>> rows(const IndexRows<width>& a, std::size_t below) {
  std::vector<std::array<std::int32_t, width>> list(a.shape(0));
  for (std::size_t r = 0; r < list.size(); ++r)
    for (std::size_t c = 0; c < width; ++c) {
      const std::int32_t i = a.data()[r * width + c];
      if (i < 0 || static_cast<std::size_t>(i) >= below) throw nanobind::value_error("a network refers to a vertex that does not exist");
      list[r][c] = i;
    }
  return list;
}

/// Return an array (n, 3) of n points.
template <class At>
auto new_points(std::size_t n, At at) {
  auto [array, x] = new_array<double>({n, 3});
  for (std::size_t i = 0; i < n; ++i) Eigen::Map<palpate::math::Vector3<>>(x + 3 * i) = at(i);
  return array;
}

/// Return the moduli (n, 2) of the layer of each node under round tips and under flat ends, Pa.
inline std::vector<palpate::deformable::LayerModulus> layer_moduli(const Moduli& modulus) {
  std::vector<palpate::deformable::LayerModulus> layer;
  for (std::size_t i = 0; i < modulus.shape(0); ++i) layer.push_back({modulus(i, 0), modulus(i, 1)});
  return layer;
}

/// Return the contact surface of a body. `node` is the contact node of each vertex, or -1. `modulus` (n, 2) is that of the layer under
/// round tips and under flat ends, Pa.
inline palpate::deformable::ContactSurface contact_surface(const Points& vertices, const IndexRows<3>& triangles, const Indices& node,
                                                           const Moduli& modulus) {
  bool fit = node.shape(0) == vertices.shape(0);
  for (std::size_t i = 0; i < node.shape(0); ++i)
    fit = fit && node.data()[i] >= -1 && node.data()[i] < static_cast<std::int32_t>(modulus.shape(0));
  if (!fit) throw nanobind::value_error("the contact surface does not match the body's nodes");
  return {points(vertices), rows<3>(triangles, vertices.shape(0)), {node.data(), node.data() + node.shape(0)}, layer_moduli(modulus)};
}

inline palpate::deformable::SpringNetworkData network_parts(const Points& positions, const Numbers& masses, const Flags& fixed,
                                                            const IndexRows<2>& springs, const Numbers& stiffness,
                                                            const Numbers& rest_lengths, const Numbers& damping,
                                                            const IndexRows<4>& tetrahedra, const Numbers& pressure) {
  const std::size_t count = positions.shape(0), edges = springs.shape(0);
  if (masses.shape(0) != count || fixed.shape(0) != count || pressure.shape(0) != count || stiffness.shape(0) != edges ||
      rest_lengths.shape(0) != edges || damping.shape(0) != edges)
    throw nanobind::value_error("the sizes of the network's arrays do not match");
  return {points(positions),
          numbers(masses),
          {fixed.data(), fixed.data() + count},
          rows<2>(springs, count),
          numbers(stiffness),
          rows<4>(tetrahedra, count),
          numbers(pressure),
          numbers(rest_lengths),
          numbers(damping),
          {}};
}

/// Return the law of a network's springs: cubic with a hardening strain, exponential with an exponent, linear with neither.
inline palpate::deformable::SpringLaw spring_law(double hardening_strain, double exponent, double limit) {
  using palpate::deformable::SpringLaw;
  if (hardening_strain > 0.0) return {SpringLaw::Kind::cubic, hardening_strain, limit};
  if (exponent != 0.0) return {SpringLaw::Kind::exponential, exponent, limit};
  return {};
}

inline palpate::deformable::PatchWeights network_patches(const Indices& begin, const Indices& vertices, const Numbers& shares,
                                                         const Tensor& compliance, std::size_t nodes, std::size_t below) {
  if (compliance.shape(0) != nodes || compliance.shape(1) != 3) throw nanobind::value_error("each patch has a compliance");
  palpate::deformable::PatchWeights p{
      {begin.data(), begin.data() + begin.shape(0)}, {vertices.data(), vertices.data() + vertices.shape(0)}, numbers(shares), {}};
  for (std::size_t i = 0; i < nodes; ++i)
    p.compliance.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(compliance.data() + 9 * i));
  bool fit = p.begin.size() == nodes + 1 && p.weights.size() == p.vertices.size() && p.begin.front() == 0 &&
             static_cast<std::size_t>(p.begin.back()) == p.vertices.size() && std::is_sorted(p.begin.begin(), p.begin.end());
  for (const std::int32_t v : p.vertices) fit = fit && v >= 0 && static_cast<std::size_t>(v) < below;
  if (!fit) throw nanobind::value_error("the patches of the network do not match its nodes and vertices");
  return p;
}

template <class Contact>
concept has_tool = requires(Contact contact, const palpate::math::Vector3<>* places) { contact.place_tool(places); };

/// Return the centers of a tool's tips less its position, (m, tips, 3), as rows; `n` steps.
template <class Contact>
std::vector<palpate::math::Vector3<>> tool_places(const Contact& contact, const Tensor& tool, std::size_t n) {
  std::vector<palpate::math::Vector3<>> places;
  if constexpr (has_tool<Contact>) {
    if (contact.tool_tips() == 0 || tool.shape(0) != n || tool.shape(1) != static_cast<std::size_t>(contact.tool_tips()))
      throw nanobind::value_error("the tool has one place for each position and contact point");
    for (std::size_t k = 0; k < n * tool.shape(1); ++k)
      places.emplace_back(Eigen::Map<const palpate::math::Vector3<>>(tool.data() + 3 * k));
  }
  return places;
}

/// Step a contact along a path; see "simulate_path".
template <class Contact>
auto step_path(Contact& contact, const Points& centers, const Points& outward, double radius, bool flat,
               const std::optional<Tensor>& tool = std::nullopt) {
  const std::size_t n = centers.shape(0);
  const bool faces = outward.shape(0) == 0 && !flat;
  if (outward.shape(0) != n && !faces) throw nanobind::value_error("the path needs one direction for each position");
  const std::vector<palpate::math::Vector3<>> places = tool ? tool_places(contact, *tool, n) : std::vector<palpate::math::Vector3<>>();
  auto [rows, row] = new_array<double>({n, result_width});
  const nanobind::gil_scoped_release unlocked;
  palpate::deformable::Tip tip = tip_of(radius, flat, palpate::math::Vector3<>::Zero(), palpate::math::Vector3<>::UnitZ());
  for (std::size_t i = 0; i < n; ++i, row += result_width) {
    tip.center = Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * i);
    tip.outward =
        faces ? contact.outward(tip) : palpate::math::Vector3<>(Eigen::Map<const palpate::math::Vector3<>>(outward.data() + 3 * i));
    if constexpr (has_tool<Contact>)
      if (tool) contact.place_tool(places.data() + i * (places.size() / n));
    write_result(contact.step(tip), row);
  }
  return rows;
}

/// Return the duration of each step of a contact along a path, s.
template <class Contact>
auto path_durations(Contact& contact, const Points& centers, const Points& outward, double radius, bool flat) {
  const std::size_t n = centers.shape(0);
  if (outward.shape(0) != n) throw nanobind::value_error("the path needs one direction for each position");
  auto [seconds, s] = new_array<double>({n});
  const nanobind::gil_scoped_release unlocked;
  for (std::size_t i = 0; i < n; ++i) {
    const palpate::deformable::Tip tip = tip_of(radius, flat, Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * i),
                                                Eigen::Map<const palpate::math::Vector3<>>(outward.data() + 3 * i));
    const auto begin = std::chrono::steady_clock::now();
    contact.step(tip);
    s[i] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  return seconds;
}

inline constexpr const char* path_text =
    "Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without "
    "directions, a sphere takes the mean normal of its contact nodes, or that of the nearest node.";
inline constexpr const char* tool_path_text =
    "Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding, lost. Without "
    "directions, a sphere takes the direction of the normal force, or the normal of the nearest node. `tool`: centers of the tips of a "
    "tool less the position of the path (m, tips, 3), m; none: where they are.";
inline constexpr const char* durations_text = "Return the duration of each step, s, including the clock's own.";

}  // namespace body_arrays
