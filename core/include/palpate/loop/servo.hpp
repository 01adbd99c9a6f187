#pragma once

#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>

#include "palpate/control/state_space.hpp"
#include "palpate/control/virtual_coupling.hpp"
#include "palpate/device/drive.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/touch/anchor.hpp"
#include "palpate/touch/proxy.hpp"

namespace palpate {

/// Where angles become tip positions and tip forces become torques: exactly, or linearised at a pose (thesis case C and D).
template <class Mechanism>
class Kinematics {
 public:
  static constexpr int dof = Mechanism::dof;

  Kinematics() = default;
  explicit Kinematics(const Mechanism& mechanism) : mechanism_(mechanism) {}

  /// First-order kinematics at `pose` [rad]; `hold` [N] is the constant tip force there, whose torque turns with the pose.
  Kinematics(const Mechanism& mechanism, const Joints<dof>& pose, const Vector3<>& hold)
      : mechanism_(mechanism),
        frozen_(true),
        pose_(pose),
        pose_tip_(mechanism.forward(pose)),
        tip_(pose_tip_),
        jacobian_(mechanism.jacobian(pose)) {
    using Variable = Dual<dof>;
    Joints<dof, Variable> q;
    for (int i = 0; i < dof; ++i) q[i] = Variable::variable(pose[i], i);
    const TipJacobian<dof, Variable> j = mechanism.jacobian(q);
    torque_turn_.setZero();
    for (int i = 0; i < dof; ++i) {
      for (int row = 0; row < 3; ++row) torque_turn_.row(i) += hold[row] * j(row, i).gradient.transpose();
    }
  }

  /// Takes the angles `q` [rad] of one tick.
  void look(const Joints<dof>& q) noexcept {
    if (frozen_) {
      turn_ = q - pose_;
      tip_ = pose_tip_ + jacobian_ * turn_;
      return;
    }
    at_ = mechanism_.posture(q);
    tip_ = mechanism_.forward(at_);
  }

  /// Tip position [m] at the angles last looked at.
  [[nodiscard]] const Vector3<>& tip() const noexcept { return tip_; }

  /// Torques [N*m], at the angles last looked at, of tip force `command` on top of the constant `hold` [N].
  [[nodiscard]] Joints<dof> torque(const Vector3<>& command, const Vector3<>& hold) const noexcept {
    if (frozen_) return jacobian_.transpose() * (command + hold) + torque_turn_ * turn_;
    return mechanism_.torque(at_, command + hold);
  }

 private:
  Mechanism mechanism_;
  bool frozen_ = false;
  Joints<dof> pose_ = Joints<dof>::Zero();
  Vector3<> pose_tip_ = Vector3<>::Zero();
  Joints<dof> turn_ = Joints<dof>::Zero();  // from the frozen pose
  Vector3<> tip_ = Vector3<>::Zero();
  TipJacobian<dof> jacobian_ = TipJacobian<dof>::Zero();  // at the frozen pose
  using Posture = std::decay_t<decltype(std::declval<Mechanism>().posture(std::declval<Joints<dof>>()))>;
  Posture at_ = Mechanism().posture(Joints<dof>(Joints<dof>::Zero()));
  Eigen::Matrix<double, dof, dof> torque_turn_ = Eigen::Matrix<double, dof, dof>::Zero();  // d(J^T hold)/dq
};

/// A mesh in the tip's way, in the device's frame. What it refers to is the caller's, and outlives the servo.
struct TouchedMesh {
  const Mesh* mesh = nullptr;  ///< null: none is there
  const Tree* tree = nullptr;
  const SurfaceField* surface = nullptr;
  double radius = 0.0;  ///< of the tip, m

  [[nodiscard]] explicit operator bool() const noexcept { return mesh != nullptr; }
};

/// What a servo loop is made of. Plain data; a Servo builds from it all that its tick needs.
template <class Mechanism>
struct ServoSetup {
  static constexpr int dof = Mechanism::dof;

  Mechanism mechanism{};
  bool frozen_kinematics = false;  ///< linearise tip and torque at the start pose
  Encoder<dof> encoder{};
  DriveLimits<dof> limits{};
  int delay = 0;  ///< servo periods between computing a torque and its being applied, at most 64

  Anchor anchor{};
  Vector3<> stiffness = Vector3<>::Zero();  ///< N/m
  Vector3<> damping = Vector3<>::Zero();    ///< N*s/m
  VirtualCoupling::Difference difference = VirtualCoupling::Difference::backward;
  TouchedMesh touched{};  ///< instead of the anchor, if there is one

  StateSpace controller = StateSpace::negative_feedback();
  Vector3<> hold = Vector3<>::Zero();       ///< constant tip force added to every command, N
  Joints<dof> start = Joints<dof>::Zero();  ///< pose at the first tick, rad
  double period = 1e-3;                     ///< s
};

/// One tick of the servo loop, the same in simulation and in real time: angles in, torques out. It takes no memory, no
/// lock, throws nothing and asks nothing of the operating system.
///
///   angles -> counts -> tip -> contact -> object force -> controller -> limits -> torques -> delay
template <class Mechanism>
class Servo {
 public:
  static constexpr int dof = Mechanism::dof;

  /// What one tick saw and did.
  struct Tick {
    Vector3<> tip = Vector3<>::Zero();           ///< measured, m
    Vector3<> object_force = Vector3<>::Zero();  ///< of the tip on the object, N
    Vector3<> command = Vector3<>::Zero();       ///< tip force after the drive's limits, without the hold, N
    Joints<dof> torque = Joints<dof>::Zero();    ///< leaving the delay, N*m
    bool touching = false;
    bool saturated = false;
  };

  explicit Servo(const ServoSetup<Mechanism>& s)
      : kinematics_(s.frozen_kinematics ? Kinematics<Mechanism>(s.mechanism, s.start, s.hold) : Kinematics<Mechanism>(s.mechanism)),
        encoder_(s.encoder),
        anchor_(s.anchor),
        coupling_(s.stiffness, s.damping, s.difference, s.period),
        proxy_(proxy_on(s.touched)),
        controller_(s.controller),
        drive_(s.limits, s.period),
        hold_(s.hold),
        delay_(s.delay, torque_at_rest(s.start)) {}

  /// `angles` [rad] as the joints have them; `reference` [N] is the force the loop shall bring the object force to (zero for an
  /// impedance display).
  const Tick& tick(const Joints<dof>& angles, const Vector3<>& reference) noexcept {
    const Joints<dof> q = encoder_.read(angles);
    kinematics_.look(q);
    tick_.tip = kinematics_.tip();
    const Vector3<> force = proxy_ ? touch_mesh() : touch_anchor();
    tick_.object_force = force;
    const Vector3<> wanted = controller_.output(reference, force);
    tick_.command = drive_.limit_force(wanted + hold_) - hold_;
    Joints<dof> torque = kinematics_.torque(tick_.command, hold_);
    const double part = drive_.possible_part(torque);
    if (part < 1.0) {
      torque *= part;
      tick_.command = part * (tick_.command + hold_) - hold_;
    }
    tick_.saturated = part < 1.0 || (tick_.command - wanted).squaredNorm() > 1e-24 * (1.0 + wanted.squaredNorm());
    if (!tick_.saturated) tick_.command = wanted;
    controller_.advance(tick_.command);
    tick_.torque = delay_.pass(torque);
    return tick_;
  }

  /// Where the tip touches the mesh at this tick; null without a mesh.
  [[nodiscard]] const Contact* contact() const noexcept { return proxy_ ? &proxy_->contact() : nullptr; }

 private:
  static std::optional<Proxy> proxy_on(const TouchedMesh& t) {
    return t ? std::optional<Proxy>(std::in_place, *t.mesh, *t.tree, *t.surface, t.radius) : std::nullopt;
  }

  /// Force of the tip on the object [N], as the next.
  Vector3<> touch_anchor() noexcept {
    const Anchor::Contact contact = anchor_.contact(tick_.tip);
    tick_.touching = contact.touching;
    const Vector3<> force = coupling_.force(contact.deflection);
    if (anchor_.kind != Anchor::Kind::half_space) return force;
    // A wall pushes, it never pulls: neither its damper on the way out nor its memory after contact.
    const double pressed = contact.touching ? std::fmin(0.0, anchor_.normal.dot(force)) : 0.0;
    return pressed * anchor_.normal;
  }

  Vector3<> touch_mesh() noexcept {
    const Contact& contact = proxy_->step(tick_.tip);
    tick_.touching = contact.touching;
    return -contact.force;
  }

  Joints<dof> torque_at_rest(const Joints<dof>& start) {
    kinematics_.look(start);
    const Joints<dof> torque = kinematics_.torque(Vector3<>::Zero(), hold_);
    return drive_.possible_part(torque) * torque;
  }

  Kinematics<Mechanism> kinematics_;
  Encoder<dof> encoder_;
  Anchor anchor_;
  VirtualCoupling coupling_;
  std::optional<Proxy> proxy_;
  StateSpace controller_;
  Drive<dof> drive_;
  Vector3<> hold_ = Vector3<>::Zero();
  Delay<Joints<dof>> delay_;
  Tick tick_;
};

}  // namespace palpate
