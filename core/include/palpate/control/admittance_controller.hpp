#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/control/controller.hpp"
#include "palpate/control/tip_positioning.hpp"
#include "palpate/control/workspace_gains.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::control {

/// Virtual tool of an admittance display. Plain data.
struct VirtualTool {
  double mass = 0.0;     ///< kg
  double damping = 0.0;  ///< against the ground, N*s/m

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    if (!(mass > 0.0) || !std::isfinite(mass)) return "the tool's mass must be positive and finite [kg]";
    if (!(damping >= 0.0) || !std::isfinite(damping)) return "the tool's damping must be finite and not negative [N*s/m]";
    return nullptr;
  }
};

/// Admittance display (Adams & Hannaford 1999): the reference of a tick is the measured force F_h of the operator on the tip. It moves a
/// virtual tool, which touches the object in place of the tip, and the tip follows the tool by TipPositioning.
///
/// With the tool's mass m and damping b, its position x where it touches the object, and the object's force F and stiffness K there:
///   v' = v + T a,   x' = x + T v',   m a = F_h - F - (b + T K) v',   K v' = n k (n . v') on a surface
///   x_r = x - T v/2,   v_r = v,   a_r = a
///
/// - The tool is a semi-implicit Euler integration, which keeps the energy of a spring up to k = 4 m/T^2.
/// - A known stiffness is taken at the end of the period. It then adds the damping T k, so that the tool is stable for every k. A surface
///   with a normal does not pull.
/// - A tip that obeys the model passes x_r at the samples exactly while F_h and F are held. F_h is known, so the motors supply the rest:
///   u = weight + L (...) - F_h. The command is that of the motors alone.
/// - At a limit of the drive the tool waits: the acceleration that the motors lack acts on the tool too, so that tip and tool stay
///   together. A pressed tool is then pushed into the object with the tip.
/// - At a singular pose the command is zero. The tool starts again at the tip.
template <class Mechanism>
class AdmittanceController : public TipPositioning<Mechanism, double> {
  using Base = TipPositioning<Mechanism, double>;

 public:
  using Base::dof;
  using typename Base::Angles;
  using typename Base::Scalar;
  using typename Base::Vector;

  AdmittanceController() = default;
  /// @param mechanism  as the controller knows it
  /// @param friction   viscous, of the joints, N*m*s/rad
  /// @param p          of the feedback and its observer; must have no fault(). The others have no effect.
  /// @param tool       must have no fault()
  /// @param period     servo period, s
  AdmittanceController(const Mechanism& mechanism, const Joints<dof>& friction, const WorkspaceParameters& p, const VirtualTool& tool,
                       double period)
      : Base(mechanism, friction, WorkspaceGains(p, period), period), tool_(tool) {}

  /// The command is the force of the motors without that of the operator.
  [[nodiscard]] static constexpr bool motors_alone() noexcept { return true; }

  /// Return the position at which the object is touched [m]; null: that of the tip.
  [[nodiscard]] const Vector* touching() const noexcept { return started_ ? &tool_position_ : nullptr; }

  /// Return the motors' force at the tip [N] for the signals of a tick; zero at a singular pose.
  Vector command(const TickInput& input) noexcept {
    const bool regular = Base::update(input.angles);
    const auto dynamics = Base::dynamics();
    measured_ = input.reference;
    place_tool(input.tip);
    const Vector push = inverse_.reachable(jacobian_, measured_);
    tool_acceleration_ = inverse_.reachable(jacobian_, tool_acceleration(push, input.object_force, input.contact));
    Base::observe(input.tip, Vector::Zero());
    model_position_ = tool_position_ - 0.5 * period_ * tool_velocity_;
    model_velocity_ = tool_velocity_;
    const Angles held = Base::holding_torque(dynamics);
    const Vector weight = Base::weight_force(held, dynamics);
    Base::feed_back(tool_acceleration_);
    return Base::hand_over(regular, Vector(weight + Base::motion_force(held, dynamics) - push - input.gravity_compensation));
  }

  /// Predict the next sample with the force that the drive gave [N], and move the tool.
  void applied(const Vector& force) noexcept {
    const Vector left_out = Base::predict(force, [](const Vector& change) -> const Vector& { return change; });
    tool_velocity_ += period_ * (tool_acceleration_ + left_out);
    tool_position_ += period_ * tool_velocity_;
  }

  void reset() noexcept {
    Base::forget();
    measured_.setZero();
  }

  /// Columns of a recorded row: tool position (3), m, and measured force (3), N.
  [[nodiscard]] static constexpr int record_width() noexcept { return 6; }
  void record(double* row) const noexcept {
    Eigen::Map<Vector>{row} = touched_;
    Eigen::Map<Vector>{row + 3} = measured_;
  }

 private:
  using Base::inverse_, Base::jacobian_, Base::model_position_, Base::model_velocity_;
  using Base::period_, Base::started_;

  /// Start the tool at the tip, or keep it in the directions in which the tip can move.
  void place_tool(const Vector& tip) noexcept {
    if (!started_) {
      tool_position_ = tip;
      tool_velocity_.setZero();
    }
    touched_ = tool_position_;
    if constexpr (dof < 3) {
      tool_position_ = tip + inverse_.reachable(jacobian_, Vector(tool_position_ - tip));
      tool_velocity_ = inverse_.reachable(jacobian_, tool_velocity_);
    }
  }

  /// Return the acceleration of the tool [m/s^2].
  [[nodiscard]] Vector tool_acceleration(const Vector& push, const Vector& object_force,
                                         const object::ContactResult& contact) const noexcept {
    const double inertia = tool_.mass + period_ * tool_.damping;  // of the damper at the end of the period
    const Vector free = push - tool_.damping * tool_velocity_, force = free - object_force;
    if (!contact.touching) return force / inertia;
    if (contact.normal.squaredNorm() == 0.0) {
      const Vector damper = period_ * contact.axis_stiffness;
      return (force - damper.cwiseProduct(tool_velocity_)).cwiseQuotient(Vector(Vector::Constant(inertia) + period_ * damper));
    }
    const Vector& normal = contact.normal;
    const double damper = period_ * contact.stiffness, speed = normal.dot(tool_velocity_), along = normal.dot(force);
    const double pressed = (along - damper * speed) / (inertia + period_ * damper);
    const bool pulls = -normal.dot(object_force) < damper * (speed + period_ * pressed);
    const double wanted = pulls ? normal.dot(free) / inertia : pressed;
    return force / inertia + normal * (wanted - along / inertia);
  }

  VirtualTool tool_;
  Vector tool_position_ = Vector::Zero(), tool_velocity_ = Vector::Zero(), tool_acceleration_ = Vector::Zero();
  Vector touched_ = Vector::Zero(), measured_ = Vector::Zero();  // tool position and operator's force of this tick
};

}  // namespace palpate::control
