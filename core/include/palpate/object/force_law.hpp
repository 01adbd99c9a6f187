#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Force as a rising function of the penetration depth: linear between the entries of a table, and beyond the last one with the last slope.
/// Force, slope and energy are exact: the force is the derivative of the energy.
class ForceLawTable {
 public:
  /// Values at one depth.
  struct Point {
    double force = 0.0;   ///< N
    double slope = 0.0;   ///< N/m
    double energy = 0.0;  ///< stored, J
  };

  /// Return the first thing that is wrong with a table, as a sentence; null if nothing is.
  [[nodiscard]] static const char* fault(const std::vector<double>& depth, const std::vector<double>& force) noexcept {
    if (depth.size() != force.size() || depth.size() < 2) return "depth and force need the same number of entries, at least two";
    if (depth[0] != 0.0 || force[0] != 0.0) return "the first depth and the first force must be 0";
    for (std::size_t i = 1; i < depth.size(); ++i) {
      if (!std::isfinite(depth[i]) || !std::isfinite(force[i])) return "every entry must be finite";
      if (!(depth[i] > depth[i - 1]) || !(force[i] > force[i - 1])) return "depth and force must rise from entry to entry";
      if (!std::isfinite((force[i] - force[i - 1]) / (depth[i] - depth[i - 1]))) return "a slope is not finite";
    }
    return nullptr;
  }

  /// @param depth  m; must have no fault()
  /// @param force  N
  ForceLawTable(std::vector<double> depth, const std::vector<double>& force) : depth_(std::move(depth)) {
    points_.resize(depth_.size());
    for (std::size_t i = 0; i < depth_.size(); ++i) {
      points_[i].force = force[i];
      if (i == 0) continue;
      const double width = depth_[i] - depth_[i - 1];
      points_[i - 1].slope = points_[i].slope = (force[i] - force[i - 1]) / width;
      points_[i].energy = points_[i - 1].energy + 0.5 * width * (force[i] + force[i - 1]);
    }
  }

  /// Return the values at a depth [m]; outside, without force and with the first slope.
  [[nodiscard]] Point at(double depth) const noexcept {
    if (!(depth > 0.0)) return {0.0, points_.front().slope, 0.0};
    const auto next = std::upper_bound(depth_.begin(), depth_.end(), depth);
    const auto i = static_cast<std::size_t>(next - depth_.begin()) - 1;
    const Point& from = points_[i];
    const double beyond = depth - depth_[i];
    return {from.force + from.slope * beyond, from.slope, from.energy + beyond * (from.force + 0.5 * from.slope * beyond)};
  }

 private:
  std::vector<double> depth_;
  std::vector<Point> points_;  // the slope is that after the entry; of the last one, that before it
};

/// A plane that resists by a ForceLawTable along its normal. Its stiffness is force over depth. The tick does not allocate.
class ForceLaw {
 public:
  using Scalar = double;
  static constexpr int columns = 3;  ///< depth, slope, stored energy

  /// @param table   must not be null
  /// @param point   on the plane, m
  /// @param normal  outward, unit
  ForceLaw(std::shared_ptr<const ForceLawTable> table, const Vector3<>& point, const Vector3<>& normal)
      : table_(std::move(table)), point_(point), normal_(normal) {}

  const ContactResult& step(const TipState& tip) noexcept {
    const double depth = normal_.dot(point_ - tip.position);
    at_ = table_->at(depth);
    result_.force = -at_.force * normal_;
    result_.touching = depth > 0.0;
    result_.deflection = -std::max(depth, 0.0) * normal_;
    result_.normal = normal_;
    result_.depth = depth;
    result_.stiffness = result_.touching ? at_.force / depth : at_.slope;
    return result_;
  }

  [[nodiscard]] const ContactResult& result() const noexcept { return result_; }
  void reset() noexcept {
    result_ = {};
    at_ = {};
  }
  [[nodiscard]] int record_width() const noexcept { return columns; }
  void record(double* row) const noexcept {
    row[0] = result_.depth;
    row[1] = at_.slope;
    row[2] = at_.energy;
  }

 private:
  std::shared_ptr<const ForceLawTable> table_;
  Vector3<> point_, normal_;
  ContactResult result_;
  ForceLawTable::Point at_;
};

}  // namespace palpate::object
