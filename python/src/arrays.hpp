#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <initializer_list>
#include <utility>

/// Return a zero-filled numpy array of `shape`, which owns its memory, and the address of its first element.
template <class T>
std::pair<nanobind::ndarray<nanobind::numpy, T>, T*> new_array(std::initializer_list<std::size_t> shape) {
  std::size_t count = 1;
  for (const std::size_t s : shape) count *= s;
  auto* data = new T[count > 0 ? count : 1]();
  const nanobind::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return {nanobind::ndarray<nanobind::numpy, T>(data, shape, owner), data};
}

using Rows = nanobind::ndarray<const double, nanobind::ndim<2>, nanobind::c_contig, nanobind::device::cpu>;

/// Raise ValueError unless both signals are (ticks + 1) x 3.
inline void check_signals(const Rows& reference, const Rows& operator_force) {
  if (reference.shape(0) < 1 || reference.shape(1) != 3 || operator_force.shape(0) != reference.shape(0) || operator_force.shape(1) != 3)
    throw nanobind::value_error("reference and operator_force must both be (ticks + 1) x 3");
}
