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

/// Coulomb friction of one tip on a sequence of local models, node by node (PartialSlip), in the plane normal to the contact direction.
///
/// A local model has normal compliance C only. The tangential compliance is approximated as T = tangential_ratio C + common_compliance,
/// isotropic and positive definite as C: locally proportional to C as in Cattaneo (1938) and Mindlin (1949), plus a uniform displacement of
/// a body fixed elsewhere. When the model changes, the forces are kept or reduced, so that they never store more energy than the tip
/// supplied; when the plane rotates, they rotate with it.
class LocalModelSlip {
 public:
  LocalModelSlip() = default;

  /// For a surface of `nodes` nodes; `common_compliance` [m/N] and `tangential_ratio` must not be negative.
  LocalModelSlip(DryFriction friction, double tangential_ratio, double common_compliance, std::size_t nodes)
      : slip_(friction, static_cast<std::int32_t>(nodes)),
        tangential_ratio_(tangential_ratio),
        common_compliance_(common_compliance),
        index_of_(nodes, -1) {
    full_coverage_.fill(1.0);
  }

  [[nodiscard]] bool enabled() const noexcept { return slip_.enabled(); }
  [[nodiscard]] bool sliding() const noexcept { return slip_.sliding(); }

  /// Advance by one period. The tip moved by `tip_motion` [m] and presses `count` nodes (surface ids) with `forces` [N] along -`outward`;
  /// `model` is the newest local model.
  void step(const LocalModel& model, const Vector3<>& outward, const std::int32_t* contact_nodes, const double* forces, int count,
            const Vector3<>& tip_motion) noexcept {
    model_ = &model;
    if (model.version != version_) update_model(model);
    if (count > 0) rotate_plane(outward);
    slip_.step(*this, *this, contact_nodes, forces, full_coverage_.data(), count, tip_motion);
  }

  /// Friction force [N] on a node of the last step, and its displacement [m].
  [[nodiscard]] Vector3<> force(std::int32_t node) const noexcept { return tangent_plane_ * slip_.force(node); }
  [[nodiscard]] Vector3<> displacement(std::int32_t node) const noexcept { return tangent_plane_ * slip_.displacement(node); }

  void reset() noexcept {
    slip_.reset();
    version_ = -1;
  }

  /// Interface for PartialSlip: tangent plane and tangential compliance.
  [[nodiscard]] const Eigen::Matrix<double, 3, 2>& tangent_basis(std::int32_t /*node*/) const noexcept { return tangent_plane_; }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t one, std::int32_t other) const noexcept {
    const std::int32_t i = index_of_[static_cast<std::size_t>(one)], j = index_of_[static_cast<std::size_t>(other)];
    const double normal = i >= 0 && j >= 0 ? model_->compliance(i, j) : one == other ? mean_self_compliance_ : 0.0;
    return (tangential_ratio_ * normal + common_compliance_) * Eigen::Matrix2d::Identity();
  }

 private:
  /// Adopt a new local model.
  void update_model(const LocalModel& model) noexcept {
    version_ = model.version;
    std::fill(index_of_.begin(), index_of_.end(), static_cast<std::int16_t>(-1));
    mean_self_compliance_ = 0.0;
    for (std::int32_t i = 0; i < model.nodes.size(); ++i) {
      index_of_[static_cast<std::size_t>(model.node_ids[static_cast<std::size_t>(i)])] = static_cast<std::int16_t>(i);
      mean_self_compliance_ += model.compliance(i, i) / static_cast<double>(model.nodes.size());
    }
    slip_.update_compliance(*this);
  }

  /// Rotate the tangent plane by the smallest angle.
  void rotate_plane(const Vector3<>& outward) noexcept {
    Vector3<> one = tangent_plane_.col(0) - outward.dot(tangent_plane_.col(0)) * outward;
    if (one.squaredNorm() < 0.01) one = outward.unitOrthogonal();
    tangent_plane_.col(0) = one.normalized();
    tangent_plane_.col(1) = outward.cross(tangent_plane_.col(0));
  }

  PartialSlip slip_;
  double tangential_ratio_ = 1.0;
  double common_compliance_ = 0.0;  // m/N
  const LocalModel* model_ = nullptr;
  long version_ = -1;
  double mean_self_compliance_ = 0.0;   // m/N
  std::vector<std::int16_t> index_of_;  // index in the local model by surface node; -1: absent
  Eigen::Matrix<double, 3, 2> tangent_plane_ = (Eigen::Matrix<double, 3, 2>() << 1.0, 0.0, 0.0, 1.0, 0.0, 0.0).finished();
  std::array<double, 2 * static_cast<std::size_t>(LocalModel::capacity)> full_coverage_{};
};

}  // namespace palpate::deformable
