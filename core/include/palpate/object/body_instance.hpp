#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "palpate/deformable/contact/signed_distance_contact.hpp"
#include "palpate/math/latest_value.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"
#include "palpate/object/deformable_object.hpp"
#include "palpate/object/tool_motion.hpp"

namespace palpate::object {

/// A deformable body, its pose in the device's frame, and the tip that touches it. Plain data. The number of tips of a tool belongs to the
/// body (SignedDistanceOptions::contact_points); `tool` moves them.
struct BodyPlacement {
  std::shared_ptr<const DeformableObject> body;            ///< at rest; every BodyInstance has a state of its own
  Vector3<> origin = Vector3<>::Zero();                    ///< of the body's frame, m
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< body frame to device frame
  deformable::Tip::Kind tip = deformable::Tip::Kind::sphere;
  double radius = 5e-3;                 ///< of the tip, m
  Vector3<> axis = Vector3<>::UnitZ();  ///< of a flat end, unit, out of the body, body frame
  ToolMotion tool;                      ///< of as many tips as the body's contact points; empty: these stay where they are

  std::shared_ptr<LatestValue<ContactFrame>> contact_frames;          ///< optional observer of every tick; of one loop at a time
  std::shared_ptr<LatestValue<DeformationFrame>> deformation_frames;  ///< optional observer of every model update; of one loop at a time
};

/// A deformable body touched by one tip. A copy is a body at rest.
class BodyInstance {
 public:
  using Scalar = double;
  static constexpr double shallow = 50e-6;  ///< depth up to which the local stiffness is taken as at least the last one, m
  static constexpr std::size_t max_tips = static_cast<std::size_t>(deformable::SignedDistanceContact::max_tips);
  static constexpr double unknown = 1e3;  ///< stiffness before the first deeper contact, N/m
  /// Deflection (3), stored energy, contact nodes, solved, energy of the tank, contact lost, moment about the tip (3). Then of a tool the
  /// force of each tip on the body (3).
  static constexpr int columns = 11;

  /// @param placement  its body must not be null; a tool of another number of tips than the body's is ignored
  explicit BodyInstance(BodyPlacement placement) : placement_(std::move(placement)), body_(placement_.body->clone_at_rest()) {
    if (placement_.tool.tips() != static_cast<std::size_t>(body_->tool_tips())) placement_.tool = {};
    tip_.kind = placement_.tip;
    tip_.radius = placement_.radius;
    tip_.outward = placement_.axis;
    body_->set_observer(placement_.deformation_frames.get());
  }
  BodyInstance(const BodyInstance& o) : BodyInstance(o.placement_) {}
  BodyInstance& operator=(const BodyInstance& o) { return *this = BodyInstance(o); }
  BodyInstance(BodyInstance&&) noexcept = default;
  BodyInstance& operator=(BodyInstance&&) noexcept = default;
  ~BodyInstance() = default;

  /// Set the pose of a tool that has a motion for the steps from now on, in place of that motion: as gimbal and gripper are measured.
  void set_tool(const ToolPose& pose) noexcept { tool_pose_ = pose; }
  [[nodiscard]] bool has_moving_tool() const noexcept { return !placement_.tool.empty(); }

  /// Prepare the first tick with the tip's center at `tip` [m].
  void start(const Vector3<>& tip) {
    move_tool(0.0);
    move_tip(tip);
    body_->initialize(tip_);
  }

  const ContactResult& step(const TipState& tip) noexcept {
    move_tool(tip.time);
    move_tip(tip.position);
    const deformable::ContactResult& contact = body_->step(tip_);
    if (placement_.contact_frames) publish(contact.nodes);
    result_.force = -(placement_.rotation * contact.force);
    result_.deflection = placement_.rotation * contact.deflection;
    result_.touching = contact.touching;
    result_.normal = contact.touching && !contact.opposed ? Vector3<>(placement_.rotation * tip_.outward) : Vector3<>(Vector3<>::Zero());
    result_.depth = -result_.normal.dot(result_.deflection);
    update_stiffness();
    return result_;
  }

  [[nodiscard]] const ContactResult& result() const noexcept { return result_; }

  /// Return to rest. Allocates.
  void reset() noexcept {
    body_ = placement_.body->clone_at_rest();
    body_->set_observer(placement_.deformation_frames.get());
    result_ = {};
    last_stiffness_ = unknown;
    tool_pose_.reset();
    tick_ = 0;
  }

  /// Update the body's slow model in virtual time, after each tick.
  void update() { body_->step_synchronously(); }

  [[nodiscard]] int record_width() const noexcept { return columns + 3 * body_->tool_tips(); }
  void record(double* row) const noexcept {
    const deformable::ContactResult& contact = body_->last();
    Eigen::Map<Vector3<>>{row} = result_.deflection;
    row[3] = contact.energy;
    row[4] = contact.nodes;
    row[5] = contact.solved ? 1.0 : 0.0;
    row[6] = contact.tank_energy;
    row[7] = contact.lost ? 1.0 : 0.0;
    Eigen::Map<Vector3<>>{row + 8} = -(placement_.rotation * contact.moment);
    for (int t = 0; t < body_->tool_tips(); ++t)
      Eigen::Map<Vector3<>>{row + columns + 3 * t} = -(placement_.rotation * body_->tool_force(t));
  }

  [[nodiscard]] const DeformableObject& body() const noexcept { return *body_; }
  [[nodiscard]] DeformableObject& body() noexcept { return *body_; }
  [[nodiscard]] const BodyPlacement& placement() const noexcept { return placement_; }

 private:
  void move_tool(double time) noexcept {
    if (placement_.tool.empty()) return;
    std::array<Vector3<>, max_tips> centers;
    placement_.tool.place(tool_pose_ ? *tool_pose_ : placement_.tool.pose(time), centers.data());
    for (std::size_t t = 0; t < placement_.tool.tips(); ++t) centers[t] = placement_.rotation.transpose() * centers[t];
    body_->place_tool(centers.data());
  }
  void move_tip(const Vector3<>& position) noexcept {
    tip_.center = placement_.rotation.transpose() * (position - placement_.origin);
    if (tip_.kind == deformable::Tip::Kind::sphere) tip_.outward = body_->outward(tip_);
  }

  /// Set the secant stiffness along the normal. At first touch a body is softer than a little deeper, where it will rest.
  void update_stiffness() noexcept {
    if (body_->last().opposed) {
      result_.stiffness = 0.0;  // not known
      return;
    }
    const double secant = result_.depth > 0.0 ? -result_.normal.dot(result_.force) / result_.depth : 0.0;
    result_.stiffness = result_.depth > shallow ? secant : result_.touching ? std::max(secant, last_stiffness_) : 0.0;
    if (result_.depth > shallow) last_stiffness_ = secant;
  }

  void publish(int count) noexcept {
    ContactFrame& next = placement_.contact_frames->write_slot();
    next.tick = tick_++;
    next.count = std::min(count, ContactFrame::capacity);
    std::copy_n(body_->contact_nodes(), next.count, next.node.begin());
    for (int k = 0; k < next.count; ++k) next.force[static_cast<std::size_t>(k)] = body_->node_force(k);
    placement_.contact_frames->publish();
  }

  BodyPlacement placement_;
  std::unique_ptr<DeformableObject> body_;
  deformable::Tip tip_;
  ContactResult result_;
  std::optional<ToolPose> tool_pose_;  // set_tool
  double last_stiffness_ = unknown;    // at the last depth beyond shallow, N/m
  std::int64_t tick_ = 0;
};

}  // namespace palpate::object
