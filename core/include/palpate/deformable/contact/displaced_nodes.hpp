#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Displacements of all nodes of a body that bends, each as of the tick that last looked at it, some nodes per tick. Without nodes all
/// displacements are zero.
class DisplacedNodes {
 public:
  DisplacedNodes() = default;
  explicit DisplacedNodes(std::int32_t count) : displacement_(static_cast<std::size_t>(count), Vector3<float>::Zero()) {}

  [[nodiscard]] std::int32_t size() const noexcept { return static_cast<std::int32_t>(displacement_.size()); }
  [[nodiscard]] Vector3<> get(std::int32_t node) const noexcept {
    return size() > 0 ? Vector3<>(displacement_[at(node)].cast<double>()) : Vector3<>(Vector3<>::Zero());
  }
  /// Record a node's displacement [m]. Return the size of its change since it was last looked at, m.
  double set(std::int32_t node, const Vector3<>& displacement) noexcept {
    const double change = (displacement - get(node)).norm();
    displacement_[at(node)] = displacement.cast<float>();
    return change;
  }
  /// Node to look at next, another at each call.
  [[nodiscard]] std::int32_t next() noexcept {
    if (++last_ >= size()) last_ = 0;
    return last_;
  }

  /// Continue those of the same body `before` with other touched nodes; `node_after(i)` is the node i of `before`, or -1.
  template <class NodeAfter>
  void take_over(const DisplacedNodes& before, NodeAfter node_after) noexcept {
    if (size() == 0) return;
    for (std::int32_t i = 0; i < before.size(); ++i)
      if (const std::int32_t node = node_after(i); node >= 0) displacement_[at(node)] = before.displacement_[at(i)];
  }
  void reset() noexcept {
    std::fill(displacement_.begin(), displacement_.end(), Vector3<float>::Zero());
    last_ = -1;
  }

 private:
  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  std::vector<Vector3<float>> displacement_;  // m
  std::int32_t last_ = -1;
};

}  // namespace palpate::deformable
