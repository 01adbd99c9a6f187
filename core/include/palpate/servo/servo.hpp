#pragma once

#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "palpate/actuation/drive.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/control/virtual_coupling.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mesh/proxy.hpp"
#include "palpate/object/deformable_object.hpp"
#include "palpate/object/spring_wall.hpp"
#include "palpate/plant/plant_integrator.hpp"

namespace palpate::servo {

/// Where angles become tip positions and tip forces become torques: exactly, or linearised at a pose (thesis case C and D).
template <class Mechanism, class Scalar = double>
class TipKinematics {
 public:
  static constexpr int dof = Mechanism::dof;
  using Angles = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;

  TipKinematics() = default;
  explicit TipKinematics(const Mechanism& mechanism) : mechanism_(mechanism) {}

  /// First-order kinematics at `pose` [rad]; `hold` [N] is the constant tip force there, whose torque turns with the pose.
  TipKinematics(const Mechanism& mechanism, const Angles& pose, const Vector& hold)
      : mechanism_(mechanism),
        frozen_(true),
        pose_(pose),
        pose_tip_(mechanism.forward(pose)),
        tip_(pose_tip_),
        jacobian_(mechanism.jacobian(pose)) {
    using Variable = Dual<dof, Scalar>;
    Joints<dof, Variable> q;
    for (int i = 0; i < dof; ++i) q[i] = Variable::variable(pose[i], i);
    const TipJacobian<dof, Variable> j = mechanism.jacobian(q);
    torque_turn_.setConstant(0.0);
    for (int i = 0; i < dof; ++i) {
      for (int row = 0; row < 3; ++row) torque_turn_.row(i) += hold[row] * j(row, i).gradient.transpose();
    }
  }

  /// Puts one loop's kinematics into a lane; all lanes have the same mechanism, and frozen kinematics or not.
  void set_lane(int lane, const TipKinematics<Mechanism>& one) {
    using math::set_lane;
    mechanism_ = one.mechanism_;
    frozen_ = one.frozen_;
    set_lane(pose_, lane, one.pose_);
    set_lane(pose_tip_, lane, one.pose_tip_);
    set_lane(jacobian_, lane, one.jacobian_);
    set_lane(torque_turn_, lane, one.torque_turn_);
  }

  /// Takes the angles `q` [rad] of one tick.
  void look(const Angles& q) noexcept {
    if (frozen_) {
      turn_ = q - pose_;
      tip_ = pose_tip_ + jacobian_ * turn_;
      return;
    }
    at_ = mechanism_.kinematics(q);
    tip_ = mechanism_.forward(at_);
  }

  /// The same, for whoever has the posture already.
  void look_at(const plant::KinematicsCacheOf<Mechanism, Scalar>& at) noexcept {
    at_ = at;
    tip_ = mechanism_.forward(at_);
  }

  /// Tip position [m] at the angles last looked at.
  [[nodiscard]] const Vector& tip() const noexcept { return tip_; }

  /// Torques [N*m], at the angles last looked at, of tip force `force` [N], the constant hold in it.
  [[nodiscard, gnu::always_inline]] Angles torque(const Vector& force) const noexcept {
    if (frozen_) [[unlikely]]
      return jacobian_.transpose() * force + torque_turn_ * turn_;
    return mechanism_.torque(at_, force);
  }

 private:
  template <class, class>
  friend class TipKinematics;

  Mechanism mechanism_;
  bool frozen_ = false;
  Angles pose_ = Angles::Constant(0.0);
  Vector pose_tip_ = Vector::Constant(0.0);
  Angles turn_ = Angles::Constant(0.0);  // from the frozen pose
  Vector tip_ = Vector::Constant(0.0);
  TipJacobian<dof, Scalar> jacobian_ = TipJacobian<dof, Scalar>::Constant(0.0);  // at the frozen pose
  plant::KinematicsCacheOf<Mechanism, Scalar> at_ = Mechanism().kinematics(Angles(Angles::Constant(0.0)));
  Eigen::Matrix<Scalar, dof, dof> torque_turn_ = Eigen::Matrix<Scalar, dof, dof>::Constant(0.0);  // d(J^T hold)/dq
};

/// A mesh in the tip's way, in the device's frame. What it refers to is the caller's, and outlives the servo.
struct MeshPlacement {
  const mesh::TriangleMesh* mesh = nullptr;  ///< null: none is there
  const mesh::AabbTree* tree = nullptr;
  const mesh::SurfaceField* surface = nullptr;
  double radius = 0.0;  ///< of the tip, m

  [[nodiscard]] explicit operator bool() const noexcept { return mesh != nullptr; }
};

/// What a servo loop is made of. Plain data; a Servo builds from it all that its tick needs.
template <class Mechanism>
struct ServoSetup {
  static constexpr int dof = Mechanism::dof;

  Mechanism mechanism{};
  bool frozen_kinematics = false;  ///< linearise tip and torque at the start pose
  actuation::Encoder<dof> encoder{};
  actuation::DriveLimits<dof> limits{};
  int delay = 0;  ///< servo periods between computing a torque and its being applied, at most 64

  object::SpringWall anchor{};
  Vector3<> stiffness = Vector3<>::Zero();  ///< N/m
  Vector3<> damping = Vector3<>::Zero();    ///< N*s/m
  control::CouplingDifference difference = control::CouplingDifference::backward;
  MeshPlacement touched{};       ///< instead of the anchor, if there is one; for one loop alone
  object::BodyPlacement body{};  ///< instead of both, if there is one; for one loop alone

  control::StateSpace controller{};         ///< reference less object force unless given
  Vector3<> hold = Vector3<>::Zero();       ///< constant tip force added to every command, N
  Joints<dof> start = Joints<dof>::Zero();  ///< pose at the first tick, rad
  double period = 1e-3;                     ///< s
};

/// One tick of the servo loop, the same in simulation and in real time: angles in, torques out. It takes no memory, no
/// lock, throws nothing and asks nothing of the operating system.
///
///   angles -> counts -> tip -> contact -> object force -> controller -> limits -> torques -> delay
template <class Mechanism, class Scalar = double>
class Servo {
 public:
  static constexpr int dof = Mechanism::dof;
  using Angles = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;

  /// What one tick saw and did.
  struct Tick {
    Vector tip = Vector::Constant(0.0);           ///< measured, m
    Vector object_force = Vector::Constant(0.0);  ///< of the tip on the object, N
    Vector command = Vector::Constant(0.0);       ///< tip force after the drive's limits, without the hold, N
    Angles torque = Angles::Constant(0.0);        ///< leaving the delay, N*m
    Condition<Scalar> touching = false;
    Condition<Scalar> saturated = false;
  };

  Servo() = default;
  explicit Servo(const ServoSetup<Mechanism>& s)
      : kinematics_(s.frozen_kinematics ? TipKinematics<Mechanism>(s.mechanism, s.start, s.hold) : TipKinematics<Mechanism>(s.mechanism)),
        encoder_(s.encoder),
        anchor_(s.anchor),
        coupling_(s.stiffness, s.damping, s.difference, s.period),
        proxy_(proxy_on(s.touched)),
        touch_(touch_on(s.body)),
        controller_(s.controller),
        drive_(s.limits, s.period),
        hold_(s.hold),
        delay_(s.delay, torque_at_rest(s.start)),
        reads_exactly_(!s.frozen_kinematics && s.encoder.exact()) {
    if constexpr (alone)
      if (touch_) touch_->initialize(kinematics_.tip());  // torque_at_rest has looked at the start
  }

  /// The same loop as `one`, for several side by side: each lane is to be put in.
  template <class One>
  explicit Servo(const Servo<Mechanism, One>& one) : controller_(one.controller_.template cast<Scalar>()), reads_exactly_(true) {}

  /// Puts one loop, at its beginning, into a lane: of the same mechanism, kinematics, controller, kind of surface and period.
  void set_lane(int lane, const Servo<Mechanism>& one) {
    using math::set_lane;
    kinematics_.set_lane(lane, one.kinematics_);
    encoder_.set_lane(lane, one.encoder_);
    anchor_.set_lane(lane, one.anchor_);
    coupling_.set_lane(lane, one.coupling_);
    controller_.set_lane(lane, one.controller_);
    drive_.set_lane(lane, one.drive_);
    set_lane(hold_, lane, one.hold_);
    delay_.set_lane(lane, one.delay_);
    reads_exactly_ = reads_exactly_ && one.reads_exactly_;
  }

  /// `angles` [rad] as the joints have them; `reference` [N] is the force the loop shall bring the object force to (zero for an
  /// impedance display).
  const Tick& tick(const Angles& angles, const Vector& reference) noexcept {
    kinematics_.look(encoder_.read(angles));
    return act(reference);
  }

  /// The same for whoever has the posture `at` of these angles already: a servo that reads exactly need not compute it again.
  const Tick& tick(const Angles& angles, const plant::KinematicsCacheOf<Mechanism, Scalar>& at, const Vector& reference) noexcept {
    if (!reads_exactly_) return tick(angles, reference);
    kinematics_.look_at(at);
    return act(reference);
  }

  /// After each tick in virtual time: a body's slow steps, in turn with the ticks. They may take memory. In real time a thread of its own
  /// takes them instead: body()->object().update_model(), over and over.
  void in_turn() {
    if constexpr (alone)
      if (touch_) touch_->object().step_synchronously();
  }

  /// What the last tick saw and did.
  [[nodiscard]] const Tick& last() const noexcept { return tick_; }

  /// Where the tip touches the mesh at this tick; null without a mesh.
  [[nodiscard]] const mesh::Contact* contact() const noexcept
    requires std::is_same_v<Scalar, double>
  {
    return proxy_ ? &proxy_->contact() : nullptr;
  }

  /// The body that the tip touches, as it is at this tick; null without one.
  [[nodiscard]] const object::BodyInstance* body() const noexcept
    requires std::is_same_v<Scalar, double>
  {
    return touch_ ? &*touch_ : nullptr;
  }
  [[nodiscard]] object::BodyInstance* body() noexcept
    requires std::is_same_v<Scalar, double>
  {
    return touch_ ? &*touch_ : nullptr;
  }

 private:
  template <class, class>
  friend class Servo;

  /// The tick, once it is known where the tip is.
  [[gnu::always_inline]] const Tick& act(const Vector& reference) noexcept {
    tick_.tip = kinematics_.tip();
    const Vector force = on_body() ? touch_body() : on_mesh() ? touch_mesh() : touch_anchor();
    tick_.object_force = force;
    const Vector wanted = controller_.output(reference, force);
    tick_.command = wanted;
    tick_.saturated = false;
    Vector given = wanted + hold_;
    Angles torque;
    if (drive_.limits()) {
      torque = limit(given);
      tick_.command = select_each(tick_.saturated, Vector(given - hold_), wanted);
    } else {
      torque = kinematics_.torque(given);
    }
    controller_.advance(tick_.command);
    tick_.torque = delay_.pass(torque);
    return tick_;
  }

  /// Torques of the tip force `wanted` [N] that the drive can give, and that force; all the rest of it is lost in saturation.
  Angles limit(Vector& wanted) noexcept {
    const Vector asked = wanted;
    wanted = drive_.limit_force(asked);
    Angles torque = kinematics_.torque(wanted);
    const Scalar part = drive_.possible_part(torque);
    const auto short_of_torque = part < Scalar(1.0);
    torque = select_each(short_of_torque, Angles(torque * part), torque);
    wanted = select_each(short_of_torque, Vector(wanted * part), wanted);
    for (int i = 0; i < 3; ++i) tick_.saturated = tick_.saturated | (wanted[i] != asked[i]);
    return torque;
  }

  static constexpr bool alone = std::is_same_v<Scalar, double>;  // meshes and bodies go by branches: no two lanes alike
  using PossibleProxy = std::conditional_t<alone, std::optional<mesh::Proxy>, std::monostate>;
  using PossibleBody = std::conditional_t<alone, std::optional<object::BodyInstance>, std::monostate>;

  static PossibleProxy proxy_on(const MeshPlacement& t) {
    if constexpr (alone) {
      if (t) return std::optional<mesh::Proxy>(std::in_place, *t.mesh, *t.tree, *t.surface, t.radius);
    }
    return {};
  }

  static PossibleBody touch_on(const object::BodyPlacement& t) {
    if constexpr (alone) {
      if (t) return std::optional<object::BodyInstance>(std::in_place, t);
    }
    return {};
  }

  [[nodiscard]] bool on_body() const noexcept {
    if constexpr (alone) return touch_.has_value();
    return false;
  }

  [[nodiscard]] bool on_mesh() const noexcept {
    if constexpr (alone) return proxy_.has_value();
    return false;
  }

  /// Force of the tip on the object [N], as the next.
  [[gnu::always_inline]] Vector touch_anchor() noexcept {
    const typename object::BasicSpringWall<Scalar>::Contact contact = anchor_.contact(tick_.tip);
    tick_.touching = contact.touching;
    Vector force = coupling_.force(contact.deflection);
    if (anchor_.kind != object::SpringWallKind::half_space) return force;
    // A wall pushes, it never pulls: neither its damper on the way out nor its memory after contact.
    const Scalar none = 0.0;
    const Scalar along = anchor_.normal.dot(force);
    return select(contact.touching & (along < none), along, none) * anchor_.normal;
  }

  Vector touch_mesh() noexcept {
    if constexpr (alone) {
      if (proxy_) {
        const mesh::Contact& contact = proxy_->step(tick_.tip);
        tick_.touching = contact.touching;
        return -contact.force;
      }
    }
    return Vector::Constant(0.0);
  }

  Vector touch_body() noexcept {
    if constexpr (alone) {
      if (touch_) {
        const Vector force = touch_->step(tick_.tip);
        tick_.touching = touch_->result().touching;
        return force;
      }
    }
    return Vector::Constant(0.0);
  }

  Angles torque_at_rest(const Angles& start) {
    kinematics_.look(start);
    const Angles torque = kinematics_.torque(hold_);
    return drive_.possible_part(torque) * torque;
  }

  TipKinematics<Mechanism, Scalar> kinematics_;
  actuation::Encoder<dof, Scalar> encoder_;
  object::BasicSpringWall<Scalar> anchor_;
  control::BasicVirtualCoupling<Scalar> coupling_;
  PossibleProxy proxy_;
  PossibleBody touch_;
  control::BasicStateSpace<Scalar> controller_;
  actuation::Drive<dof, Scalar> drive_;
  Vector hold_ = Vector::Constant(0.0);
  typename actuation::DelayOf<Angles, Scalar>::Type delay_;
  bool reads_exactly_ = false;
  Tick tick_;
};

}  // namespace palpate::servo
