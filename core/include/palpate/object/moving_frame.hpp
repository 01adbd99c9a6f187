#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <concepts>
#include <utility>
#include <vector>

#include "palpate/math/rotation.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Position and orientation of an object's frame in the device's frame.
struct Pose {
  Vector3<> origin = Vector3<>::Zero();                    ///< m
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< object frame to device frame
};

/// Motion of a frame over time: linear between rows, at rest before the first and after the last.
class FrameMotion {
 public:
  struct Row {
    double time = 0.0;                           ///< s
    Vector3<> displacement = Vector3<>::Zero();  ///< of the origin, device frame, m
    Vector3<> angles = Vector3<>::Zero();        ///< of rotations about x, then y, then z of the device, rad
  };

  FrameMotion() = default;
  /// @param origin  of the frame without displacement, m
  /// @param rows    their times increase; none: a frame at rest
  FrameMotion(const Vector3<>& origin, std::vector<Row> rows) : origin_(origin), rows_(std::move(rows)) {}

  [[nodiscard]] bool empty() const noexcept { return rows_.empty(); }

  /// Return the pose at a time [s]; the origin without rotation if there are no rows.
  [[nodiscard]] Pose pose(double time) const noexcept {
    const auto next = std::upper_bound(rows_.begin(), rows_.end(), time, [](double t, const Row& row) { return t < row.time; });
    if (rows_.empty()) return {origin_, Eigen::Matrix3d::Identity()};
    if (next == rows_.begin()) return pose_of(next->displacement, next->angles);
    const Row& from = *(next - 1);
    if (next == rows_.end()) return pose_of(from.displacement, from.angles);
    const double part = (time - from.time) / (next->time - from.time);
    return pose_of(from.displacement + part * (next->displacement - from.displacement), from.angles + part * (next->angles - from.angles));
  }

 private:
  [[nodiscard]] Pose pose_of(const Vector3<>& displacement, const Vector3<>& angles) const noexcept {
    return {origin_ + displacement, math::rotation_xyz(angles)};
  }

  Vector3<> origin_ = Vector3<>::Zero();
  std::vector<Row> rows_;
};

/// An object attached to a frame that may move, for example on a turntable or on a beating heart. Contact is
/// quasi-static: the tip's velocity relative to the object follows from successive positions in the object's frame.
/// The frame follows its motion, or is set by set_pose().
template <ContactObject Object>
  requires std::same_as<typename Object::Scalar, double>
class MovingFrame {
 public:
  using Scalar = double;

  static constexpr int pose_columns = 12;  ///< origin (3), rotation matrix by rows (9)

  // A template: a conversion to an AnyObject must not be tried for this type itself.
  template <std::same_as<Object> Same>
  explicit MovingFrame(Same object, const Pose& pose = {}) : object_(std::move(object)), pose_(pose) {}
  template <std::same_as<Object> Same>
  MovingFrame(Same object, FrameMotion motion) : object_(std::move(object)), motion_(std::move(motion)), pose_(motion_.pose(0.0)) {}

  /// Set the pose for the next step(); only of a frame without a motion.
  void set_pose(const Pose& pose) noexcept { pose_ = pose; }
  [[nodiscard]] const Pose& pose() const noexcept { return pose_; }

  void start(const Vector3<>& tip) { object::start(object_, to_object(tip)); }

  const ContactResult& step(const TipState& tip) noexcept {
    if (!motion_.empty()) pose_ = motion_.pose(tip.time);
    const ContactResult& local = object_.step({to_object(tip.position), tip.rate, tip.time});
    result_ = local;
    result_.force = pose_.rotation * local.force;
    result_.deflection = pose_.rotation * local.deflection;
    result_.normal = pose_.rotation * local.normal;
    result_.axis_stiffness = pose_.rotation.cwiseAbs2() * local.axis_stiffness;  // diagonal of the rotated stiffness
    torque_ = (tip.position - pose_.origin).cross(result_.force);
    return result_;
  }

  /// Torque of the tip on the object about the frame's origin at the last step [N*m], device frame.
  [[nodiscard]] const Vector3<>& torque() const noexcept { return torque_; }
  [[nodiscard]] const ContactResult& result() const noexcept { return result_; }

  void reset() noexcept {
    object::reset(object_);
    if (!motion_.empty()) pose_ = motion_.pose(0.0);
    result_ = {};
    torque_.setZero();
  }
  void update() { object::update(object_); }
  [[nodiscard]] int record_width() const noexcept { return pose_columns + object::record_width(object_); }
  /// Write the pose of the last step, then the object's own columns, in the object's frame.
  void record(double* row) const noexcept {
    Eigen::Map<Vector3<>>{row} = pose_.origin;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{row + 3} = pose_.rotation;
    object::record(object_, row + pose_columns);
  }

  [[nodiscard]] Object& object() noexcept { return object_; }
  [[nodiscard]] const Object& object() const noexcept { return object_; }

 private:
  [[nodiscard]] Vector3<> to_object(const Vector3<>& x) const noexcept { return pose_.rotation.transpose() * (x - pose_.origin); }

  Object object_;
  FrameMotion motion_;
  Pose pose_;
  ContactResult result_;
  Vector3<> torque_ = Vector3<>::Zero();
};

}  // namespace palpate::object
