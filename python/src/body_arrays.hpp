#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <palpate/deformable/contact/patch_points.hpp>
#include <palpate/deformable/contact/surface_nodes.hpp>
#include <palpate/math/vector.hpp>
#include <vector>

#include "arrays.hpp"
#include "contact_rows.hpp"

/// Arrays of deformable bodies, and steps along a path.
namespace body_arrays {

using Points = nanobind::ndarray<const double, nanobind::shape<-1, 3>, nanobind::c_contig, nanobind::device::cpu>;
using Numbers = nanobind::ndarray<const double, nanobind::shape<-1>, nanobind::c_contig, nanobind::device::cpu>;
using Matrix = nanobind::ndarray<const float, nanobind::shape<-1, -1>, nanobind::c_contig, nanobind::device::cpu>;
using Flags = nanobind::ndarray<const bool, nanobind::shape<-1>, nanobind::c_contig, nanobind::device::cpu>;
using Indices = nanobind::ndarray<const std::int32_t, nanobind::shape<-1>, nanobind::c_contig, nanobind::device::cpu>;
using Tensor = nanobind::ndarray<const double, nanobind::shape<-1, -1, 3>, nanobind::c_contig, nanobind::device::cpu>;
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

/// Return the contact surface of a body. `node` is the contact node of each vertex, or -1.
inline palpate::deformable::ContactSurface contact_surface(const Points& vertices, const IndexRows<3>& triangles, const Indices& node,
                                                           const Numbers& modulus) {
  bool fit = node.shape(0) == vertices.shape(0);
  for (std::size_t i = 0; i < node.shape(0); ++i)
    fit = fit && node.data()[i] >= -1 && node.data()[i] < static_cast<std::int32_t>(modulus.shape(0));
  if (!fit) throw nanobind::value_error("the contact surface does not match the body's nodes");
  return {points(vertices), rows<3>(triangles, vertices.shape(0)), {node.data(), node.data() + node.shape(0)}, numbers(modulus)};
}

/// Step a contact along a path; see "simulate_path".
template <class Contact>
auto step_path(Contact& contact, const Points& centers, const Points& outward, double radius, bool flat) {
  const std::size_t n = centers.shape(0);
  const bool faces = outward.shape(0) == 0 && !flat;
  if (outward.shape(0) != n && !faces) throw nanobind::value_error("the path needs one direction for each position");
  auto [rows, row] = new_array<double>({n, result_width});
  const nanobind::gil_scoped_release unlocked;
  palpate::deformable::Tip tip = tip_of(radius, flat, palpate::math::Vector3<>::Zero(), palpate::math::Vector3<>::UnitZ());
  for (std::size_t i = 0; i < n; ++i, row += result_width) {
    tip.center = Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * i);
    tip.outward =
        faces ? contact.outward(tip) : palpate::math::Vector3<>(Eigen::Map<const palpate::math::Vector3<>>(outward.data() + 3 * i));
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
inline constexpr const char* durations_text = "Return the duration of each step, s, including the clock's own.";

}  // namespace body_arrays
