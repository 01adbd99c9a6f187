#pragma once

#include <Eigen/Core>
#include <utility>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Position and orientation of an object's frame in the device's frame.
struct Pose {
  Vector3<> origin = Vector3<>::Zero();                    ///< m
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< object frame to device frame
};

/// An object attached to a frame that may move, for example on a turntable. Contact is quasi-static: the tip's velocity
/// relative to the object follows from successive positions in the object's frame.
template <ContactObject Object>
  requires std::same_as<typename Object::Scalar, double>
class MovingFrame {
 public:
  using Scalar = double;

  explicit MovingFrame(Object object, const Pose& pose = {}) : object_(std::move(object)), pose_(pose) {}

  /// Set the pose for the next step().
  void set_pose(const Pose& pose) noexcept { pose_ = pose; }
  [[nodiscard]] const Pose& pose() const noexcept { return pose_; }

  void start(const Vector3<>& tip) { object::start(object_, to_object(tip)); }

  const ContactResult& step(const TipState& tip) noexcept {
    const ContactResult& local = object_.step({to_object(tip.position), tip.rate});
    result_ = local;
    result_.force = pose_.rotation * local.force;
    result_.deflection = pose_.rotation * local.deflection;
    result_.normal = pose_.rotation * local.normal;
    torque_ = (tip.position - pose_.origin).cross(result_.force);
    return result_;
  }

  /// Torque of the tip on the object about the frame's origin at the last step [N*m], device frame.
  [[nodiscard]] const Vector3<>& torque() const noexcept { return torque_; }
  [[nodiscard]] const ContactResult& result() const noexcept { return result_; }

  void reset() noexcept {
    object::reset(object_);
    result_ = {};
    torque_.setZero();
  }
  void update() { object::update(object_); }
  [[nodiscard]] int record_width() const noexcept { return object::record_width(object_); }
  /// Write the object's own columns, in the object's frame.
  void record(double* row) const noexcept { object::record(object_, row); }

  [[nodiscard]] Object& object() noexcept { return object_; }
  [[nodiscard]] const Object& object() const noexcept { return object_; }

 private:
  [[nodiscard]] Vector3<> to_object(const Vector3<>& x) const noexcept { return pose_.rotation.transpose() * (x - pose_.origin); }

  Object object_;
  Pose pose_;
  ContactResult result_;
  Vector3<> torque_ = Vector3<>::Zero();
};

}  // namespace palpate::object
