#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "palpate/deformable/contact/partial_slip.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Coulomb friction of one tip on a sequence of local models, node by node (PartialSlip), in the plane normal to the contact direction.
///
/// Between its nodes a local model has normal compliance C only. The tangential compliance is that of the body at rest in this plane, times
/// a scale, plus a displacement common to all nodes. The contact as a whole then yields by LocalModel::contact_compliance, which counts
/// stiffening and softening under load. The scale is the ratio of C to the normal compliance at rest, or the largest one that leaves a
/// positive common displacement. For a body with inertia or relaxation, whose C holds for a moment only, the ratio is 1: it yields as in
/// the long term.
/// The plane of a sticking contact follows the contact direction with a play of 0.05 rad.
///
/// The elastic layer yields in shear in series with the body: its shear stiffness is h 2 (1 - nu) / (2 - nu) (Mindlin 1949), with the
/// largest stiffness h of its points in contact since the node carries a force. Points that come into contact begin without force. When the
/// model changes, PartialSlip::update_compliance() corrects the forces, without energy; when the plane rotates, they rotate with it.
class LocalModelSlip {
 public:
  static constexpr bool new_points_are_unloaded = true;  ///< for PartialSlip

  LocalModelSlip() = default;

  /// For the nodes of `rest`, the compliance of the body at rest, with Poisson's ratio `poisson`.
  LocalModelSlip(DryFriction friction, FullCompliance rest, double poisson)
      : slip_(friction, rest.size()), rest_(std::move(rest)), shear_ratio_(2.0 * (1.0 - poisson) / (2.0 - poisson)) {}

  [[nodiscard]] bool enabled() const noexcept { return slip_.enabled(); }
  [[nodiscard]] bool sliding() const noexcept { return slip_.sliding(); }

  /// Advance by one period. The tip moved by `tip_motion` [m] and presses `count` nodes (surface ids) with `forces` [N] along -`outward`,
  /// through a layer of the stiffness `layer_stiffness` [N/m]; `model` is the newest local model.
  void step(const LocalModel& model, const Vector3<>& outward, const std::int32_t* contact_nodes, const double* forces,
            const double* layer_stiffness, int count, const Vector3<>& tip_motion) noexcept {
    if (count > 0) follow(outward);
    if (model.version != version_ || (count > 0 && slip_.empty())) adopt(model);
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
      const double shear = std::max(shear_ratio_ * layer_stiffness[k], least_stiffness) * tangential_layer_compliance;
      coverages_[k] = shear / (1.0 + shear);
    }
    slip_.step(*this, *this, contact_nodes, forces, coverages_.data(), count, tip_motion);
  }

  /// Friction force [N] on a node of the last step, and its displacement with that of the layer [m].
  [[nodiscard]] Vector3<> force(std::int32_t node) const noexcept { return tangent_plane_ * slip_.force(node); }
  [[nodiscard]] Vector3<> displacement(std::int32_t node) const noexcept { return tangent_plane_ * slip_.displacement(node); }

  /// Energy that friction stores, J.
  [[nodiscard]] double energy() const noexcept { return slip_.energy(); }

  void reset() noexcept {
    slip_.reset();
    tangent_plane_ = model_plane_ = world_plane();
    version_ = -1;
  }

  /// Interface for PartialSlip: tangent plane, tangential compliance, and the layer's, of which a coverage c adds (1 / c - 1).
  [[nodiscard]] const Eigen::Matrix<double, 3, 2>& tangent_basis(std::int32_t /*node*/) const noexcept { return tangent_plane_; }
  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    return scale_ * (model_plane_.transpose() * rest(i, j) * model_plane_) + common_;
  }
  [[nodiscard]] Eigen::Matrix2d tangential_layer(std::int32_t /*node*/) const noexcept {
    return tangential_layer_compliance * Eigen::Matrix2d::Identity();
  }

 private:
  static constexpr double tangential_layer_compliance = 1.0;  // m/N: any, as the coverage is chosen for it
  static constexpr double least_stiffness = 1e-9;             // N/m
  static constexpr double play = 0.05;                        // rad
  static constexpr double alignment = 1e-3;                   // of a sliding contact per tick, rad

  [[nodiscard]] static Eigen::Matrix<double, 3, 2> world_plane() noexcept { return Eigen::Matrix<double, 3, 2>::Identity(); }

  [[nodiscard]] Matrix3<> rest(std::int32_t i, std::int32_t j) const noexcept {
    return Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(rest_.block(i, j)).cast<double>();
  }

  /// Adopt a new local model.
  void adopt(const LocalModel& model) noexcept {
    version_ = model.version;
    model_plane_ = tangent_plane_;
    double now = 0.0, at_rest = 0.0;
    for (std::int32_t i = 0; i < model.nodes.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!model.inner[k]) continue;
      const Vector3<>& n = model.nodes.normal(i);
      now += model.compliance(i, i);
      at_rest += n.dot(rest(model.node_ids[k], model.node_ids[k]) * n);
    }
    scale_ = now > 0.0 && at_rest > 0.0 && !model.has_memory ? now / at_rest : 1.0;
    share_common(model);
    slip_.update_compliance(*this);
  }

  /// Choose scale and common displacement so that the contact as a whole yields as in the model, if that says how.
  void share_common(const LocalModel& model) noexcept {
    common_.setZero();
    if (model.contact_compliance.isZero(0.0)) return;
    double total = 0.0;
    Matrix3<> sum = Matrix3<>::Zero();
    for (std::size_t i = 0; i < static_cast<std::size_t>(model.nodes.size()); ++i) {
      if (!(model.force[i] > 0.0)) continue;
      total += model.force[i];
      for (std::size_t j = 0; j < static_cast<std::size_t>(model.nodes.size()); ++j)
        if (const double f = model.force[i] * model.force[j]; f > 0.0) sum += f * rest(model.node_ids[i], model.node_ids[j]);
    }
    if (!(total > 0.0)) return;
    const Eigen::Matrix2d whole = model_plane_.transpose() * model.contact_compliance * model_plane_;
    const Eigen::Matrix2d was = model_plane_.transpose() * (sum / (total * total)) * model_plane_;
    const Eigen::Matrix2d ratio = was.inverse() * whole;
    const double half = 0.5 * ratio.trace(), least = half - std::sqrt(std::max(half * half - ratio.determinant(), 0.0));
    if (!(least > 0.0)) return;
    scale_ = std::min(scale_, least);
    common_ = whole - scale_ * was;
  }

  /// Let the tangent plane follow the contact direction: at once in a new contact, gradually while the contact slides, and otherwise by as
  /// much as leaves an angle of `play`. The direction is that of an older model; if a swing of a sticking tip rotated the plane with it,
  /// the delay would drain the force.
  void follow(const Vector3<>& outward) noexcept {
    if (slip_.empty()) return rotate_plane(outward);
    const Vector3<> normal = tangent_plane_.col(0).cross(tangent_plane_.col(1)), away = normal - outward.dot(normal) * outward;
    const double sine = away.norm(), left = std::max(std::min(sine, play) - (slip_.sliding() ? alignment : 0.0), 0.0);
    if (left >= sine) return;
    rotate_plane(outward.dot(normal) > 0.0 ? Vector3<>((outward + left / sine * away).normalized()) : outward);
  }

  /// Rotate the tangent plane to a normal by the smallest angle.
  void rotate_plane(const Vector3<>& normal) noexcept {
    Vector3<> one = tangent_plane_.col(0) - normal.dot(tangent_plane_.col(0)) * normal;
    if (one.squaredNorm() < 0.01) one = normal.unitOrthogonal();
    tangent_plane_.col(0) = one.normalized();
    tangent_plane_.col(1) = normal.cross(tangent_plane_.col(0));
  }

  PartialSlip slip_;
  FullCompliance rest_;
  double shear_ratio_ = 1.0;                          // of the layer's shear stiffness to its normal stiffness
  double scale_ = 1.0;                                // of the compliance at rest
  Eigen::Matrix2d common_ = Eigen::Matrix2d::Zero();  // displacement of all nodes per force on any, m/N
  long version_ = -1;
  Eigen::Matrix<double, 3, 2> tangent_plane_ = world_plane();
  Eigen::Matrix<double, 3, 2> model_plane_ = tangent_plane_;  // when the model was adopted
  std::array<double, 2 * static_cast<std::size_t>(LocalModel::capacity)> coverages_{};
};

}  // namespace palpate::deformable
