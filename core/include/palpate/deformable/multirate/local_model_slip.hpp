#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "palpate/deformable/contact/partial_slip.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Dry friction of one tip on a body's snapshots, node by node (PartialSlip), in one plane: across the way that the tip is pushed out.
///
/// A snapshot has columns along the normals only. Along the surface nodes yield by T = ratio C + sway, alike in both directions, definite
/// as C is: near by as along the normals, but for a ratio as Cattaneo's (1938) and Mindlin's (1949), and by swaying all together, as a body
/// does that is held elsewhere. From snapshot to snapshot the forces stay, or become smaller, so that they never store more than the tip
/// put in; as the plane turns, they turn with it.
class LocalModelSlip {
 public:
  LocalModelSlip() = default;

  /// For a surface of `nodes` nodes; `sway` [m/N], neither it nor the ratio below zero.
  LocalModelSlip(DryFriction friction, double ratio, double sway, std::size_t nodes)
      : slip_(friction, static_cast<std::int32_t>(nodes)), ratio_(ratio), sway_(sway), place_(nodes, -1) {
    whole_.fill(1.0);
  }

  [[nodiscard]] bool on() const noexcept { return slip_.on(); }
  [[nodiscard]] bool sliding() const noexcept { return slip_.sliding(); }

  /// Goes on by one period: the tip has moved by `way` [m], is pushed out along `outward`, and presses `count` nodes, by their names on the
  /// surface, with `forces` [N]; `body` is the newest snapshot.
  void step(const LocalModel& body, const Vector3<>& outward, const std::int32_t* pressed, const double* forces, int count,
            const Vector3<>& way) noexcept {
    body_ = &body;
    if (body.number != number_) look(body);
    if (count > 0) turn(outward);
    slip_.step(*this, *this, pressed, forces, whole_.data(), count, way);
  }

  /// Force [N] on a node of the last step, and how far it has been moved [m].
  [[nodiscard]] Vector3<> force(std::int32_t name) const noexcept { return plane_ * slip_.force(name); }
  [[nodiscard]] Vector3<> moved(std::int32_t name) const noexcept { return plane_ * slip_.moved(name); }

  void reset() noexcept {
    slip_.reset();
    number_ = -1;
  }

  /// What PartialSlip asks: the plane, and how the body yields in it.
  [[nodiscard]] const Eigen::Matrix<double, 3, 2>& across(std::int32_t /*name*/) const noexcept { return plane_; }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t one, std::int32_t other) const noexcept {
    const std::int32_t i = place_[static_cast<std::size_t>(one)], j = place_[static_cast<std::size_t>(other)];
    const double normal = i >= 0 && j >= 0 ? body_->between(i, j) : one == other ? own_ : 0.0;
    return (ratio_ * normal + sway_) * Eigen::Matrix2d::Identity();
  }

 private:
  /// Another snapshot: other places of the names.
  void look(const LocalModel& body) noexcept {
    number_ = body.number;
    std::fill(place_.begin(), place_.end(), static_cast<std::int16_t>(-1));
    own_ = 0.0;
    for (std::int32_t i = 0; i < body.nodes.size(); ++i) {
      place_[static_cast<std::size_t>(body.name[static_cast<std::size_t>(i)])] = static_cast<std::int16_t>(i);
      own_ += body.between(i, i) / static_cast<double>(body.nodes.size());
    }
    slip_.renew(*this);
  }

  /// The plane turns as little as it can.
  void turn(const Vector3<>& outward) noexcept {
    Vector3<> one = plane_.col(0) - outward.dot(plane_.col(0)) * outward;
    if (one.squaredNorm() < 0.01) one = outward.unitOrthogonal();
    plane_.col(0) = one.normalized();
    plane_.col(1) = outward.cross(plane_.col(0));
  }

  PartialSlip slip_;
  double ratio_ = 1.0;
  double sway_ = 0.0;  // m/N
  const LocalModel* body_ = nullptr;
  long number_ = -1;
  double own_ = 0.0;                 // mean compliance of a node by itself, m/N
  std::vector<std::int16_t> place_;  // in the snapshot, of each node of the surface; -1: it is not in there
  Eigen::Matrix<double, 3, 2> plane_ = (Eigen::Matrix<double, 3, 2>() << 1.0, 0.0, 0.0, 1.0, 0.0, 0.0).finished();
  std::array<double, 2 * static_cast<std::size_t>(LocalModel::capacity)> whole_{};
};

}  // namespace palpate::deformable
