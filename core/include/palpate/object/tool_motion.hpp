#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "palpate/math/rotation.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::object {

/// Orientation and opening of a tool of several tips.
struct ToolPose {
  Vector3<> angles = Vector3<>::Zero();  ///< of rotations about x, then y, then z of the device, about the device's tip, rad
  double opening = 1.0;                  ///< of a gripper: 1 at its open points, 0 at its closed ones
};

/// Tips of a tool that turns, opens and closes, relative to the device's tip. The motion is linear between rows, at rest before the first
/// and after the last.
class ToolMotion {
 public:
  struct Row {
    double time = 0.0;  ///< s
    ToolPose pose;
  };

  ToolMotion() = default;
  /// @param open    centers of the tips less the device's tip at the opening 1, without rotation, device frame, m
  /// @param closed  the same at the opening 0; none: the tool neither opens nor closes
  /// @param rows    their times increase; none: open, without rotation
  ToolMotion(std::vector<Vector3<>> open, std::vector<Vector3<>> closed, std::vector<Row> rows)
      : open_(std::move(open)), closed_(closed.size() == open_.size() ? std::move(closed) : open_), rows_(std::move(rows)) {}

  [[nodiscard]] bool empty() const noexcept { return open_.empty(); }
  [[nodiscard]] std::size_t tips() const noexcept { return open_.size(); }

  /// Return the pose at a time [s].
  [[nodiscard]] ToolPose pose(double time) const noexcept {
    if (rows_.empty()) return {};
    const auto next = std::upper_bound(rows_.begin(), rows_.end(), time, [](double t, const Row& row) { return t < row.time; });
    if (next == rows_.begin()) return next->pose;
    const Row& from = *(next - 1);
    if (next == rows_.end()) return from.pose;
    const double part = (time - from.time) / (next->time - from.time);
    return {from.pose.angles + part * (next->pose.angles - from.pose.angles),
            from.pose.opening + part * (next->pose.opening - from.pose.opening)};
  }

  /// Write the centers of the tips less the device's tip, device frame, m: tips() entries.
  void place(const ToolPose& pose, Vector3<>* centers) const noexcept {
    const Eigen::Matrix3d turn = math::rotation_xyz(pose.angles);
    for (std::size_t t = 0; t < open_.size(); ++t) centers[t] = turn * (closed_[t] + pose.opening * (open_[t] - closed_[t]));
  }

 private:
  std::vector<Vector3<>> open_, closed_;
  std::vector<Row> rows_;
};

}  // namespace palpate::object
