#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "palpate/actuation/tick_schedule.hpp"
#include "palpate/control/any_controller.hpp"
#include "palpate/guard/any_guard.hpp"
#include "palpate/mechanism/conditioning.hpp"
#include "palpate/mechanism/flexible_mechanism.hpp"
#include "palpate/mechanism/kinematics_cache.hpp"
#include "palpate/object/any_object.hpp"
#include "palpate/plant/plant_integrator.hpp"
#include "palpate/plant/sampled_plant.hpp"
#include "palpate/servo/servo.hpp"

namespace palpate::servo {

/// Setup of a simulated loop and its plant. Plain data: every run builds its own loop from it, so the same setup gives the same trace,
/// bit for bit.
template <class Mechanism>
struct SimulationSetup : ServoSetup<Mechanism> {
  static constexpr int dof = Mechanism::dof;

  object::AnyObject object;
  control::AnyController controller;
  guard::AnyGuard<Mechanism> guard;  ///< none by default; not in SIMD lanes

  plant::JointFriction<dof> friction;
  plant::HumanArm human_arm;
  std::optional<mechanism::FlexibleMode> flexible;  ///< without fault(period); not of a fixed or linear plant, nor in SIMD lanes

  bool fixed = false;   ///< the operator holds the tip at the start: nothing moves
  bool linear = false;  ///< the plant is x' = A x + B u, q = C x instead of the mechanism
  Eigen::MatrixXd plant_a, plant_b, plant_c;
  Joints<dof> working_torque = Joints<dof>::Zero();

  double jitter = 0.0;     ///< largest lateness of a tick, s, less than a period; not with a sampled plant
  std::uint64_t seed = 0;  ///< of the lateness of each tick

  Joints<dof> start_speed = Joints<dof>::Zero();  ///< rad/s
  int substeps = 2;                               ///< integration steps in one period
  int record_every = 1;                           ///< periods between recorded rows
  int window_start = 0;                           ///< first tick of the window that an outcome judges
  double speed_limit = 1e3;                       ///< rad/s: above it (or not finite) the loop counts as diverged

  /// Whether the plant moves with its flexible mode.
  [[nodiscard]] bool is_flexible() const noexcept { return flexible.has_value() && !fixed && !linear; }
};

/// Result of a run. A recorded row holds, at one sample: q (dof), qd (dof), object force (3), command (3), torque (dof), operator's force
/// on the tip (3), touching, saturated, guarded; then the columns of the object, see object::ContactObject; then with a flexible mode the
/// joint coordinates at the tip (dof) and their velocities (dof), see mechanism::FlexibleMechanism; then the columns of the controller, see
/// control::Controller.
struct SimulationOutcome {
  int rows = 0;            ///< written
  int unstable_tick = -1;  ///< tick at which the loop diverged, -1: never; the record ends before it
};

template <int dof>
constexpr int record_width = 3 * dof + 12;  ///< columns of a row without those of the object, of a flexible mode and of the controller

/// Return the number of columns of a recorded row.
template <class Mechanism>
[[nodiscard]] int row_width(const SimulationSetup<Mechanism>& setup) noexcept {
  return record_width<Mechanism::dof> + setup.object.record_width() + (setup.is_flexible() ? 2 * Mechanism::dof : 0) +
         setup.controller.record_width();
}

namespace detail {

template <class Mechanism, class Scalar = double>
class MovingPlant {
 public:
  static constexpr int dof = Mechanism::dof;
  MovingPlant() = default;
  explicit MovingPlant(const SimulationSetup<Mechanism>& s) : motion_(s.mechanism, s.friction, s.human_arm), substeps_(s.substeps) {
    state_.q = s.start;
    state_.qd = s.start_speed;
    state_.hand_position = s.mechanism.forward(s.start);
    track_ = mechanism::IncrementalKinematics<Mechanism>(s.mechanism.kinematics(s.start));
  }
  [[nodiscard]] const mechanism::KinematicsCacheOf<Mechanism, Scalar>& kinematics() const { return track_.current; }
  [[nodiscard]] Vector3<Scalar> tip() const { return motion_.mechanism().forward(track_.current); }
  [[nodiscard]] TipJacobian<dof, Scalar> jacobian() const { return motion_.mechanism().jacobian(track_.current); }
  [[nodiscard, gnu::always_inline]] mechanism::JacobianSize<Scalar> jacobian_size() const {
    if constexpr (requires { motion_.mechanism().jacobian_size(track_.current); })
      return motion_.mechanism().jacobian_size(track_.current);
    else
      return mechanism::jacobian_size<dof, Scalar>(jacobian());
  }
  [[nodiscard]] const Joints<dof, Scalar>& angles() const { return state_.q; }
  [[nodiscard]] const Joints<dof, Scalar>& speeds() const { return state_.qd; }
  [[nodiscard]] Vector3<Scalar> hand_force(const Vector3<Scalar>& voluntary) const { return motion_.operator_force(state_, voluntary); }
  /// Force of the operator on the tip [N] as a sensor in the stylus reads it, under these motor torques [N*m].
  [[nodiscard]] Vector3<Scalar> sensed_force(const Joints<dof, Scalar>& torque, const Vector3<Scalar>& voluntary) const {
    return motion_.sensed_force(state_, track_, torque, voluntary);
  }
  void advance(const Joints<dof, Scalar>& torque, const plant::ForceSegment<Scalar>& force,
               const actuation::TickSchedule<Scalar>& clock) noexcept {
    if (clock.has_jitter()) return motion_.advance(state_, track_, torque, force, clock.remaining(), substeps_);
    motion_.advance(state_, track_, torque, force, clock.period(), substeps_);
  }
  /// Set one lane from the plant of a loop with the same mechanism and number of substeps.
  void set_lane(int lane, const MovingPlant<Mechanism>& one) {
    motion_.set_lane(lane, one.motion_);
    state_.set_lane(lane, one.state_);
    track_.set_lane(lane, one.track_);
    substeps_ = one.substeps_;
  }

 private:
  template <class, class>
  friend class MovingPlant;

  plant::PlantIntegrator<Mechanism, Scalar> motion_;
  plant::PlantState<dof, Scalar> state_;
  mechanism::IncrementalKinematics<Mechanism, Scalar> track_;
  int substeps_ = 1;
};

/// A moving device with its flexible mode. Its angles and kinematics are those of motors and encoders; its tip is the true one.
template <class Mechanism>
class FlexiblePlant {
 public:
  static constexpr int dof = Mechanism::dof;
  using Flexible = mechanism::FlexibleMechanism<Mechanism>;

  /// The tip starts at rest behind the motors, and a spring of the operator's arm at the same distance from it as with a rigid device.
  /// `s.flexible` must be set.
  // NOLINTBEGIN(bugprone-unchecked-optional-access): required of the caller
  explicit FlexiblePlant(const SimulationSetup<Mechanism>& s) : substeps_(s.flexible->substeps(s.period, s.substeps)) {
    const Flexible mechanism(s.mechanism, *s.flexible);
    // NOLINTEND(bugprone-unchecked-optional-access)
    state_.q = mechanism.at_rest(s.start);
    state_.qd = Flexible::joined(s.start_speed, s.start_speed);
    track_ = mechanism::IncrementalKinematics<Flexible>(mechanism.kinematics(state_.q));
    state_.hand_position = tip_ = mechanism.forward(track_.current);
    plant::HumanArm arm = s.human_arm;
    arm.rest += tip_ - s.mechanism.forward(s.start);
    plant::JointFriction<2 * dof> friction;
    friction.viscous.template head<dof>() = s.friction.viscous;
    friction.coulomb.template head<dof>() = s.friction.coulomb;
    friction.breakaway.template head<dof>() = s.friction.breakaway;
    friction.stribeck_speed.template head<dof>() = s.friction.stribeck_speed;
    motion_ = plant::PlantIntegrator<Flexible>(mechanism, friction, arm);
    angles_ = s.start;
    speeds_ = s.start_speed;
  }
  [[nodiscard]] const mechanism::KinematicsCacheOf<Mechanism>& kinematics() const { return track_.current.motors; }
  [[nodiscard]] const Vector3<>& tip() const { return tip_; }
  [[nodiscard]] Vector3<> sensed_tip() const { return motion_.mechanism().rigid().forward(kinematics()); }
  [[nodiscard]] TipJacobian<dof> jacobian() const { return motion_.mechanism().rigid().jacobian(kinematics()); }
  [[nodiscard]] mechanism::JacobianSize<double> jacobian_size() const { return mechanism::jacobian_size<dof, double>(jacobian()); }
  [[nodiscard]] const Joints<dof>& angles() const { return angles_; }
  [[nodiscard]] const Joints<dof>& speeds() const { return speeds_; }
  [[nodiscard]] Joints<dof> tip_angles() const { return Flexible::tip(state_.q); }
  [[nodiscard]] Joints<dof> tip_speeds() const { return Flexible::tip(state_.qd); }
  [[nodiscard]] Vector3<> hand_force(const Vector3<>& voluntary) const { return motion_.operator_force(state_, voluntary); }
  [[nodiscard]] Vector3<> sensed_force(const Joints<dof>& torque, const Vector3<>& voluntary) const {
    return motion_.sensed_force(state_, track_, Flexible::joined(torque, Joints<dof>(Joints<dof>::Zero())), voluntary);
  }
  [[gnu::noinline]] void advance(const Joints<dof>& torque, const plant::ForceSegment<>& force,
                                 const actuation::TickSchedule<double>& clock) noexcept {
    const double period = clock.has_jitter() ? clock.remaining() : clock.period();
    motion_.advance(state_, track_, Flexible::joined(torque, Joints<dof>(Joints<dof>::Zero())), force, period, substeps_);
    angles_ = Flexible::motors(state_.q);
    speeds_ = Flexible::motors(state_.qd);
    tip_ = motion_.mechanism().forward(track_.current);
  }

 private:
  plant::PlantIntegrator<Flexible> motion_;
  plant::PlantState<2 * dof> state_;
  mechanism::IncrementalKinematics<Flexible> track_;
  Vector3<> tip_;
  Joints<dof> angles_, speeds_;
  int substeps_;
};

template <class Mechanism>
class SampledPlant {
 public:
  static constexpr int dof = Mechanism::dof;
  explicit SampledPlant(const SimulationSetup<Mechanism>& s)
      : plant_(s.plant_a, s.plant_b, s.plant_c, s.start, s.working_torque),
        kinematics_(s.mechanism),
        angles_(s.start),
        per_period_(1.0 / s.period) {
    speeds_.setZero();
  }
  [[nodiscard]] const Joints<dof>& angles() const { return angles_; }
  [[nodiscard]] const Joints<dof>& speeds() const { return speeds_; }
  [[nodiscard]] Vector3<> hand_force(const Vector3<>& voluntary) const { return voluntary; }
  [[nodiscard]] Vector3<> sensed_force(const Joints<dof>& /*torque*/, const Vector3<>& voluntary) const { return voluntary; }
  void advance(const Joints<dof>& torque, const plant::ForceSegment<>& force, const actuation::TickSchedule<double>& /*clock*/) noexcept {
    plant_.advance(torque + kinematics_.jacobian(angles_).transpose() * force.begin);
    const Joints<dof> angles = plant_.angles();
    speeds_ = (angles - angles_) * per_period_;
    angles_ = angles;
  }

 private:
  plant::SampledPlant<dof> plant_;
  Mechanism kinematics_;
  Joints<dof> angles_;
  Joints<dof> speeds_;
  double per_period_;
};

/// A device fixed at its start pose.
template <class Mechanism>
class FixedPlant {
 public:
  static constexpr int dof = Mechanism::dof;
  explicit FixedPlant(const SimulationSetup<Mechanism>& s) : angles_(s.start), speeds_(Joints<dof>::Zero()) {}
  [[nodiscard]] const Joints<dof>& angles() const { return angles_; }
  [[nodiscard]] const Joints<dof>& speeds() const { return speeds_; }
  [[nodiscard]] Vector3<> hand_force(const Vector3<>& voluntary) const { return voluntary; }
  [[nodiscard]] Vector3<> sensed_force(const Joints<dof>& /*torque*/, const Vector3<>& voluntary) const { return voluntary; }
  void advance(const Joints<dof>& /*torque*/, const plant::ForceSegment<>& /*force*/,
               const actuation::TickSchedule<double>& /*clock*/) noexcept {}

 private:
  Joints<dof> angles_;
  Joints<dof> speeds_;
};

/// Write one recorded row.
template <class Plant, class Servo>
void write_row(const Plant& plant, const Servo& servo, const Vector3<>& operator_force, double* row) noexcept {
  constexpr int dof = Plant::dof;
  const auto& tick = servo.last();
  Eigen::Map<Joints<dof>>{row} = plant.angles();
  Eigen::Map<Joints<dof>>{row + dof} = plant.speeds();
  Eigen::Map<Vector3<>>{row + 2 * dof} = tick.object_force;
  Eigen::Map<Vector3<>>{row + 2 * dof + 3} = tick.command;
  Eigen::Map<Joints<dof>>{row + 2 * dof + 6} = tick.torque;
  Eigen::Map<Vector3<>>{row + 3 * dof + 6} = plant.hand_force(operator_force);
  row[3 * dof + 9] = tick.touching ? 1.0 : 0.0;
  row[3 * dof + 10] = tick.saturated ? 1.0 : 0.0;
  row[3 * dof + 11] = tick.guarded ? 1.0 : 0.0;
  object::record(servo.object(), row + record_width<dof>);
  double* own = row + record_width<dof> + object::record_width(servo.object());
  if constexpr (requires { plant.tip_angles(); }) {
    Eigen::Map<Joints<dof>>{own} = plant.tip_angles();
    Eigen::Map<Joints<dof>>{own + dof} = plant.tip_speeds();
    own += 2 * dof;
  }
  control::record(servo.controller(), own);
}

/// Writes the rows of one loop.
template <class Mechanism>
class Recorder {
 public:
  static constexpr int dof = Mechanism::dof;
  Recorder(const SimulationSetup<Mechanism>& s, double* rows) : every_(s.record_every), width_(row_width(s)), rows_(rows) {}

  void mark_diverged(int tick) noexcept { outcome_.unstable_tick = tick; }

  template <class Plant, class Servo>
  void observe(const Plant& plant, const Servo& servo, const Vector3<>& force) noexcept {
    if (until_next_ == 0) {
      write_row(plant, servo, force, rows_ + static_cast<std::ptrdiff_t>(outcome_.rows++) * width_);
      until_next_ = every_;
    }
    --until_next_;
  }

  [[nodiscard]] const SimulationOutcome& outcome() const { return outcome_; }

 private:
  int every_;
  int width_;
  int until_next_ = 0;
  double* rows_;
  SimulationOutcome outcome_;
};

/// Return whether all joint speeds are below `fastest` [rad/s] and all angles are finite.
template <class Plant>
[[gnu::always_inline]] inline auto is_bounded(const Plant& plant, double fastest) {
  using std::abs;
  using Scalar = std::decay_t<decltype(plant.speeds()[0])>;
  Condition<Scalar> out = true;
  for (int i = 0; i < Plant::dof; ++i) out = out & (abs(plant.speeds()[i]) < Scalar(fastest)) & is_finite(plant.angles()[i]);
  return out;
}

/// Return the force of sample `k` in a table.
[[gnu::always_inline]] inline Vector3<> force_at(const double* table, int tick) noexcept {
  return Eigen::Map<const Vector3<>>{table + 3 * static_cast<std::ptrdiff_t>(tick)};
}

/// Return the force `late` [s] after a sample, by linear interpolation to the next sample; constant after sample `ticks`.
[[gnu::noinline]] inline Vector3<> force_after(const double* table, int tick, int ticks, double late, double period) noexcept {
  const Vector3<> here = force_at(table, std::min(tick, ticks));
  const Vector3<> next = force_at(table, std::min(tick + 1, ticks));
  return here + (late / period) * (next - here);
}

/// Return the operator's force [N] between two ticks. It is linear in time, even if a sample lies between two late ticks.
[[gnu::always_inline]] inline plant::ForceSegment<> force_during(const double* table, int tick, int ticks,
                                                                 const actuation::TickSchedule<double>& clock) noexcept {
  if (clock.has_jitter())
    return {force_after(table, tick, ticks, clock.lateness(), clock.period()),
            force_after(table, tick + 1, ticks, clock.next_lateness(), clock.period())};
  return {force_at(table, tick), force_at(table, std::min(tick + 1, ticks))};
}

/// Run the servo's tick at a plant, with the plant's kinematics cache if it has one.
template <class Servo, class Plant, class Vector>
[[gnu::always_inline]] inline const auto& tick_of(Servo& servo, const Plant& plant, const Vector& reference) noexcept {
  if constexpr (requires { plant.kinematics(); })
    return servo.tick(plant.angles(), plant.kinematics(), reference);
  else
    return servo.tick(plant.angles(), reference);
}

/// As above. An admittance display measures the operator's force under the torque of the last tick, in place of the reference.
/// @param voluntary  force of the operator at this sample, N
template <class Servo, class Plant, class Vector>
[[gnu::always_inline]] inline const auto& tick_of(Servo& servo, const Plant& plant, const Vector& reference,
                                                  const Vector& voluntary) noexcept {
  if (control::motors_alone(servo.controller())) [[unlikely]]
    return tick_of(servo, plant, Vector(plant.sensed_force(servo.last().torque, voluntary)));
  return tick_of(servo, plant, reference);
}

/// Run samples 0 to `ticks` until the loop diverges. Pass each sample to `monitor`.
template <class Mechanism, class Plant, class Monitor>
void run(const SimulationSetup<Mechanism>& setup, Plant& plant, int ticks, const double* reference, const double* operator_force,
         Monitor& monitor) noexcept {
  Servo<Mechanism, object::AnyObject, control::AnyController, guard::AnyGuard<Mechanism>> servo(setup, setup.object, setup.controller,
                                                                                                setup.guard);
  actuation::TickSchedule<double> clock(setup.period, setup.jitter, setup.seed);
  for (int k = 0;; ++k, clock.tick()) {
    if (!is_bounded(plant, setup.speed_limit)) return monitor.mark_diverged(k);
    const plant::ForceSegment<> force = force_during(operator_force, k, ticks, clock);
    const auto& tick = tick_of(servo, plant, force_at(reference, k), force.begin);
    if (tick.fault) return monitor.mark_diverged(k);  // a simulated loop has no faulty sensor: its numbers have overflowed
    monitor.observe(plant, servo, force.begin);
    if (k == ticks) return;
    servo.update();
    plant.advance(tick.torque, force, clock);
  }
}

}  // namespace detail

/// Run `ticks` servo periods: samples 0 to `ticks`.
/// @param reference       force reference at each sample, (ticks + 1) x 3 row by row, N
/// @param operator_force  voluntary force at each sample, (ticks + 1) x 3, N; linear in time between samples, and between late ticks
/// @param rows            array for ticks / record_every + 1 rows of row_width(setup)
template <class Mechanism>
SimulationOutcome simulate(const SimulationSetup<Mechanism>& setup, int ticks, const double* reference, const double* operator_force,
                           double* rows) noexcept {
  detail::Recorder<Mechanism> recorder(setup, rows);
  if (setup.fixed) {
    detail::FixedPlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  } else if (setup.linear) {
    detail::SampledPlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  } else if (setup.flexible) {
    detail::FlexiblePlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  } else {
    detail::MovingPlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  }
  return recorder.outcome();
}

}  // namespace palpate::servo
