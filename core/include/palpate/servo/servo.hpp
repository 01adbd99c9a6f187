#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "palpate/actuation/delay.hpp"
#include "palpate/actuation/drive_limits.hpp"
#include "palpate/actuation/encoder.hpp"
#include "palpate/control/controller.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/guard/any_guard.hpp"
#include "palpate/guard/guard.hpp"
#include "palpate/math/inline.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/mechanism/tip_kinematics.hpp"
#include "palpate/object/contact_object.hpp"
#include "palpate/servo/fault_guard.hpp"

namespace palpate::servo {

/// Parameters of a servo loop besides its object and its controller. Plain data.
template <class Mechanism>
struct ServoSetup {
  static constexpr int dof = Mechanism::dof;

  Mechanism mechanism{};
  bool frozen_kinematics = false;  ///< linearize tip position and torque at the start pose
  actuation::Encoder<dof> encoder{};
  actuation::DriveLimits<dof> limits{};
  int delay = 0;                                       ///< servo periods from computing a torque to applying it, at most 64
  Vector3<> gravity_compensation = Vector3<>::Zero();  ///< constant tip force added to every command, N
  Joints<dof> start = Joints<dof>::Zero();             ///< pose at the first tick, rad
  double period = 1e-3;                                ///< s
  FaultLimits faults{};                                ///< what a valid reading is, and how the torque fades without one

  /// Return the first thing that is wrong, as a sentence; null if nothing is.
  [[nodiscard]] const char* fault() const noexcept {
    if (!(period > 0.0) || !std::isfinite(period)) return "period must be positive and finite [s]";
    if (delay < 0 || delay > 64) return "delay must be 0 to 64 servo periods";
    if (!start.allFinite()) return "start must be finite [rad]";
    if (!gravity_compensation.allFinite()) return "gravity_compensation must be finite [N]";
    if (!(faults.speed > 0.0)) return "faults.speed must be positive [rad/s]";
    if (!(faults.fade >= 0.0) || !std::isfinite(faults.fade)) return "faults.fade must not be negative [s]";
    for (int i = 0; i < dof; ++i)
      if (!(encoder.step[i] >= 0.0)) return "encoder.step must not be negative [rad]";
    return nullptr;
  }
};

namespace detail {
template <class T>
concept HasScalar = requires { typename T::Scalar; };
}  // namespace detail

/// One servo loop. A tick takes joint angles and returns joint torques; it does not allocate, lock, throw or call the operating system. The
/// same type runs in simulation and in real time.
///
///   angles -> encoder -> tip -> [prediction] -> object -> controller -> [guard] -> drive limits -> torques -> [guard] -> delay
///
/// A controller with motors_alone() is an admittance display: the reference is the measured force of the operator, the object is touched
/// where the controller says, and command and torque are those of the motors.
///
/// A guard in brackets acts in the time domain, see guard/guard.hpp.
///
/// A sample that FaultGuard refuses is a fault: the object, the controller and the thermal model keep their states, and the last valid
/// torque fades to zero. A force that is not finite is a fault too; it also resets the object and the controller. Lanes have no guard.
///
/// @tparam Mechanism   kinematics, see mechanism::Mechanism
/// @tparam Object      see object::ContactObject; object::AnyObject chooses at run time
/// @tparam Controller  see control::Controller; control::AnyController chooses at run time
/// @tparam Guard       see guard/guard.hpp; guard::AnyGuard chooses at run time
template <class Mechanism, class Object, class Controller = control::StateSpace, class Guard = guard::NoGuard>
class Servo {
  static_assert(detail::HasScalar<Object>, "palpate: an object needs `using Scalar = double;` (see object/contact_object.hpp)");
  static_assert(object::ContactObject<Object>,
                "palpate: an object needs `const object::ContactResult& step(const object::TipState&) noexcept` (see "
                "object/contact_object.hpp)");
  static_assert(detail::HasScalar<Controller>, "palpate: a controller needs `using Scalar = double;` (see control/controller.hpp)");
  static_assert(control::Controller<Controller>,
                "palpate: a controller needs `Vector3<> command(const control::TickInput&) noexcept` (see control/controller.hpp)");
  static_assert(std::same_as<typename Object::Scalar, typename Controller::Scalar>, "palpate: object and controller need the same Scalar");

 public:
  static constexpr int dof = Mechanism::dof;
  using Scalar = typename Object::Scalar;
  using Angles = Joints<dof, Scalar>;
  using Vector = Vector3<Scalar>;

  /// Signals of one tick.
  struct Tick {
    Vector tip = Vector::Constant(0.0);           ///< measured, m
    Vector object_force = Vector::Constant(0.0);  ///< of the tip on the object, N
    Vector command = Vector::Constant(0.0);  ///< tip force of hand and motors after the drive's limits, without gravity compensation, N
    Angles torque = Angles::Constant(0.0);   ///< of hand and motors, after the delay, N*m; of an admittance display, of the motors
    Condition<Scalar> touching = false;
    Condition<Scalar> saturated = false;
    bool guarded = false;  ///< the guard has changed the force
    bool fault = false;    ///< the sample or the computed force was invalid
  };

  Servo() = default;
  /// Build a loop that owns its object and its controller. The setup must have no fault().
  explicit Servo(const ServoSetup<Mechanism>& s, Object object = {}, Controller controller = {}, Guard guard = {});

  /// Build the same loop for lanes; each lane is set by set_lane().
  template <class OneObject, class OneController>
  explicit Servo(const Servo<Mechanism, OneObject, OneController>& one)
      : controller_(one.controller_.template cast<Scalar>()), rate_(one.rate_), period_(one.period_), exact_encoders_(true) {}

  /// Set one lane from a loop at its first tick: same mechanism, kinematics, controller, kind of object and period.
  template <class OneObject, class OneController>
  void set_lane(int lane, const Servo<Mechanism, OneObject, OneController>& one) {
    using math::set_lane;
    kinematics_.set_lane(lane, one.kinematics_);
    encoder_.set_lane(lane, one.encoder_);
    object_.set_lane(lane, one.object_);
    controller_.set_lane(lane, one.controller_);
    drive_.set_lane(lane, one.drive_);
    set_lane(gravity_compensation_, lane, one.gravity_compensation_);
    delay_.set_lane(lane, one.delay_);
    exact_encoders_ = exact_encoders_ && one.exact_encoders_;
  }

  /// Run one tick, one period after the last.
  /// @param angles     joint angles [rad]
  /// @param reference  force that the object should feel [N], exerted by the operator; zero for an impedance display, the measured force
  ///                   of the operator for an admittance display
  const Tick& tick(const Angles& angles, const Vector& reference) noexcept;

  /// Run one tick, `elapsed` [s] after the last: object damping and velocities use the true time. The controller's own dynamics still
  /// assume the period.
  const Tick& tick(const Angles& angles, const Vector& reference, double elapsed) noexcept;

  /// Run one tick with the kinematics `at` of the angles, if the caller has them: exact encoders need not compute them again.
  const Tick& tick(const Angles& angles, const mechanism::KinematicsCacheOf<Mechanism, Scalar>& at, const Vector& reference) noexcept;

  /// Update the object after a tick in virtual time (for example the slow model of a deformable body). May allocate. In real time a worker
  /// thread does this work.
  void update() { object::update(object_); }

  /// Return to the state before the first tick, at the pose `start` [rad].
  void reset(const Angles& start) noexcept;

  /// Number of ticks with a fault since the first tick or the last reset.
  [[nodiscard]] std::int64_t faults() const noexcept { return fault_guard_.faults(); }

  /// Signals of the last tick.
  [[nodiscard]] const Tick& last() const noexcept { return tick_; }

  [[nodiscard]] Object& object() noexcept { return object_; }
  [[nodiscard]] const Object& object() const noexcept { return object_; }
  [[nodiscard]] Controller& controller() noexcept { return controller_; }
  [[nodiscard]] const Controller& controller() const noexcept { return controller_; }
  [[nodiscard]] const Guard& guard() const noexcept { return guard_; }

 private:
  template <class, class, class, class>
  friend class Servo;
  static constexpr bool is_scalar = std::same_as<Scalar, double>;
  static constexpr bool guarded = guard::may_guard<Guard>;
  static_assert(is_scalar || !guarded, "palpate: lanes have no guard");
  struct Nothing {};

  /// Run the tick once the tip position is known.
  [[gnu::always_inline]] const Tick& finish_tick(const Angles& angles, const Vector& reference, double rate) noexcept {
    const Vector previous = tick_.tip;
    tick_.tip = kinematics_.tip();
    const double time = static_cast<double>(count_++) * period_;
    const object::BasicContactResult<Scalar>& contact = object_.step({touching_point(angles, rate), rate, time});
    if constexpr (guarded)
      if (guard::active(guard_)) guard::contact(guard_, contact);
    tick_.object_force = contact.force;
    tick_.touching = contact.touching;
    Vector wanted = controller_.command({reference, contact.force, contact.deflection, tick_.tip, previous, rate, time, contact,
                                         angles.data(), gravity_compensation_, drive_.force_limit()});
    if constexpr (guarded)
      if (guard::active(guard_)) guard_command(angles, wanted, Vector(tick_.tip - previous));
    if constexpr (is_scalar) {
      tick_.fault = false;
      if (!FaultGuard<dof>::usable(contact.force) || !FaultGuard<dof>::usable(wanted)) [[unlikely]]
        return start_again();
    }
    tick_.command = wanted;
    tick_.saturated = false;
    Vector applied = wanted + gravity_compensation_;
    Angles torque;
    if (drive_.limits()) {
      torque = limit(applied, control::motors_alone(controller_) ? Vector(Vector::Constant(0.0)) : reference);
      tick_.command = select_each(tick_.saturated, Vector(applied - gravity_compensation_), wanted);
    } else {
      torque = kinematics_.torque(applied);
    }
    if constexpr (guarded)
      if (guard::active(guard_)) bound(angles, torque);
    if constexpr (is_scalar) {
      fault_guard_.torque = torque;
      fault_guard_.command = tick_.command;
      if (!fault_guard_.full()) [[unlikely]]
        torque = scaled(fault_guard_.rise());
    }
    control::applied(controller_, tick_.command);
    if constexpr (guarded)
      if (guard::active(guard_)) guard::commit(guard_, Angles(torque - compensation_));
    tick_.torque = delay_.pass(torque);
    return tick_;
  }

  /// Return the position at which the object is touched [m].
  [[gnu::always_inline]] Vector touching_point(const Angles& angles, double rate) noexcept {
    if constexpr (requires { controller_.touching(); }) {
      if (control::motors_alone(controller_)) [[unlikely]] {
        const Vector* tool = controller_.touching();
        return tool != nullptr ? *tool : tick_.tip;
      }
    }
    if constexpr (guarded)
      if (guard::active(guard_) && guard::predicts(guard_)) return kinematics_.tip_at(guard::predict(guard_, angles, rate));
    return tick_.tip;
  }

  /// Replace a usable command [N] by the guard's.
  void guard_command(const Angles& angles, Vector& wanted, const Vector& moved) noexcept
    requires guarded
  {
    tick_.guarded = false;
    if (!FaultGuard<dof>::usable(wanted)) return;
    const Vector own = wanted;
    wanted = guard::command(guard_, angles, own, moved);
    tick_.guarded = wanted != own;
  }

  /// Reduce the torque of the command [N*m], and the command, to the share that the guard admits.
  void bound(const Angles& angles, Angles& torque) noexcept
    requires guarded
  {
    compensation_ = kinematics_.torque(gravity_compensation_);
    const Angles own = torque - compensation_;
    const double share = guard::share(guard_, angles, own);
    if (share >= 1.0) return;
    tick_.guarded = true;
    torque = compensation_ + share * own;
    tick_.command *= share;
  }

  /// Return the rate at which velocities are taken [1/s]: over the time since the last valid sample.
  [[nodiscard]] double rate() const noexcept {
    if constexpr (is_scalar)
      if (fault_guard_.elapsed() != period_) return 1.0 / fault_guard_.elapsed();
    return rate_;
  }

  /// Run a tick without a valid sample: hold all states and let the last valid torque fade.
  const Tick& hold() noexcept {
    ++count_;
    tick_.fault = true;
    const Angles torque = scaled(fault_guard_.fall());
    if constexpr (guarded)
      if (guard::active(guard_)) {
        guard::lose_sample(guard_);
        guard::commit(guard_, Angles(torque - compensation_));
      }
    tick_.torque = delay_.pass(torque);
    return tick_;
  }

  /// Forget the states of object and controller, which are not finite, and hold.
  const Tick& start_again() noexcept {
    object::reset(object_);
    object::start(object_, tick_.tip);
    control::reset(controller_);
    --count_;  // hold() counts this tick
    tick_.object_force.setZero();
    tick_.touching = false;
    return hold();
  }

  /// Set the command to a share of the last valid one. Return its torque [N*m].
  Angles scaled(double share) noexcept {
    tick_.command = share * (fault_guard_.command + gravity_compensation_) - gravity_compensation_;
    return share * fault_guard_.torque;
  }

  /// Limit the tip force `wanted` [N], of operator and motors, by the drive. Return the torques of both [N*m].
  /// @param share  reference force [N], which the operator exerts; the motors deliver the rest
  Angles limit(Vector& wanted, const Vector& share) noexcept;

  Angles torque_at_rest(const Angles& start);

  mechanism::TipKinematics<Mechanism, Scalar> kinematics_;
  actuation::Encoder<dof, Scalar> encoder_;
  Object object_;
  Controller controller_;
  [[no_unique_address]] Guard guard_;
  [[no_unique_address]] std::conditional_t<guarded, Angles, Nothing> compensation_{};  // torque of the gravity compensation, N*m
  actuation::Drive<dof, Scalar> drive_;
  Vector gravity_compensation_ = Vector::Constant(0.0);
  typename actuation::DelayOf<Angles, Scalar>::Type delay_;
  double rate_ = 0.0;  // 1 / period, 1/s
  double period_ = 0.0;
  bool exact_encoders_ = false;
  std::int64_t count_ = 0;  // ticks
  Tick tick_;
  FaultGuard<dof> fault_guard_;
};

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE Servo<Mechanism, Object, Controller, Guard>::Servo(const ServoSetup<Mechanism>& s, Object object, Controller controller,
                                                                  Guard guard)
    : kinematics_(s.frozen_kinematics ? mechanism::TipKinematics<Mechanism>(s.mechanism, s.start, s.gravity_compensation)
                                      : mechanism::TipKinematics<Mechanism>(s.mechanism)),
      encoder_(s.encoder),
      object_(std::move(object)),
      controller_(std::move(controller)),
      guard_(std::move(guard)),
      drive_(s.limits, s.period),
      gravity_compensation_(s.gravity_compensation),
      delay_(s.delay, torque_at_rest(s.start)),
      rate_(1.0 / s.period),
      period_(s.period),
      exact_encoders_(!s.frozen_kinematics && s.encoder.exact()),
      fault_guard_(s.faults, s.period) {
  tick_.tip = kinematics_.tip();  // torque_at_rest has set the start pose
  if constexpr (is_scalar) tick_.torque = fault_guard_.torque = delay_.initial();
  if constexpr (guarded) {
    compensation_ = delay_.initial();
    guard_.prepare({s.mechanism, s.encoder.step, s.period, s.delay});
  }
  if constexpr (is_scalar) object::start(object_, tick_.tip);
}

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE auto Servo<Mechanism, Object, Controller, Guard>::tick(const Angles& angles,
                                                                      const Vector& reference) noexcept -> const Tick& {
  return tick(angles, reference, period_);
}

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE auto Servo<Mechanism, Object, Controller, Guard>::tick(const Angles& angles, const Vector& reference,
                                                                      double elapsed) noexcept -> const Tick& {
  if constexpr (is_scalar)
    if (!fault_guard_.accept(angles, reference, elapsed)) [[unlikely]]
      return hold();
  const Angles measured = encoder_.read(angles);
  kinematics_.update(measured);
  return finish_tick(measured, reference, rate());
}

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE auto Servo<Mechanism, Object, Controller, Guard>::tick(const Angles& angles,
                                                                      const mechanism::KinematicsCacheOf<Mechanism, Scalar>& at,
                                                                      const Vector& reference) noexcept -> const Tick& {
  if (!exact_encoders_) return tick(angles, reference);
  if constexpr (is_scalar)
    if (!fault_guard_.accept(angles, reference, period_)) [[unlikely]]
      return hold();
  kinematics_.update(at);
  return finish_tick(angles, reference, rate());
}

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE void Servo<Mechanism, Object, Controller, Guard>::reset(const Angles& start) noexcept {
  object::reset(object_);
  control::reset(controller_);
  drive_.reset();
  delay_.reset(torque_at_rest(start));
  tick_ = {};
  tick_.tip = kinematics_.tip();
  fault_guard_.reset();
  if constexpr (is_scalar) tick_.torque = fault_guard_.torque = delay_.initial();
  if constexpr (guarded) {
    compensation_ = delay_.initial();
    guard_.reset();
  }
  count_ = 0;
  if constexpr (is_scalar) object::start(object_, tick_.tip);
}

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE auto Servo<Mechanism, Object, Controller, Guard>::limit(Vector& wanted, const Vector& share) noexcept -> Angles {
  const Vector asked = wanted - share;
  Vector motors = drive_.limit_force(asked);
  const Angles torque = kinematics_.torque(motors);
  const Scalar scale = drive_.torque_scale(torque);
  const auto limited = scale < Scalar(1.0);
  motors = select_each(limited, Vector(motors * scale), motors);
  for (int i = 0; i < 3; ++i) tick_.saturated = tick_.saturated | (motors[i] != asked[i]);
  wanted = select_each(tick_.saturated, Vector(motors + share), wanted);
  return kinematics_.torque(wanted);
}

template <class Mechanism, class Object, class Controller, class Guard>
PALPATE_INLINE auto Servo<Mechanism, Object, Controller, Guard>::torque_at_rest(const Angles& start) -> Angles {
  kinematics_.update(start);
  const Angles torque = kinematics_.torque(gravity_compensation_);
  return drive_.torque_scale(torque) * torque;
}

}  // namespace palpate::servo
