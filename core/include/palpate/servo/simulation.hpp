#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "palpate/actuation/drive.hpp"
#include "palpate/actuation/tick_schedule.hpp"
#include "palpate/control/state_space.hpp"
#include "palpate/control/virtual_coupling.hpp"
#include "palpate/object/spring_wall.hpp"
#include "palpate/plant/linear_plant.hpp"
#include "palpate/plant/plant_integrator.hpp"
#include "palpate/servo/servo.hpp"

namespace palpate::servo {

/// A whole experiment in virtual time: what to build and how to run it. Plain data; every run builds afresh from it, so the same
/// setup gives the same trace, bit for bit.
template <class Mechanism>
struct SimulationSetup : ServoSetup<Mechanism> {
  static constexpr int dof = Mechanism::dof;

  plant::JointFriction<dof> friction;
  plant::HumanArm hand;

  bool held = false;    ///< the operator holds the tip where it starts: nothing moves
  bool linear = false;  ///< the plant is the next three instead of the mechanism's motion
  Eigen::MatrixXd plant_a, plant_b, plant_c;
  Joints<dof> working_torque = Joints<dof>::Zero();

  double jitter = 0.0;     ///< s, less than a period: ticks come late by up to this (not with a sampled plant)
  std::uint64_t seed = 0;  ///< of what is random: how late each tick comes

  Joints<dof> start_speed = Joints<dof>::Zero();  ///< rad/s
  int substeps = 2;                               ///< of the motion in one period
  int record_every = 1;                           ///< periods between recorded rows
  double speed_limit = 1e3;                       ///< rad/s: past it (or not finite) the loop counts as diverged
};

/// What a run leaves behind. A recorded row holds, at one sample:
/// q (dof), qd (dof), object force (3), command (3), torque (dof), operator's force on the tip (3), touching, saturated;
/// and on a mesh the proxy's position (3) and normal (3), depth, stiffness, triangle;
/// on a body the deflection of the pressed patch (3), the energy stored, the number of pressed nodes, whether the contact was solved, and
/// the level of the energy tank.
struct SimulationOutcome {
  int rows = 0;            ///< written
  int unstable_tick = -1;  ///< the tick at which the loop diverged; -1: never. Nothing is recorded from it on.
};

template <int dof>
constexpr int record_width = 3 * dof + 11;  ///< of a row without a mesh
constexpr int contact_width = 9;            ///< what a mesh adds to it
constexpr int body_width = 7;               ///< what a body adds to it

/// Numbers in a recorded row.
template <class Mechanism>
[[nodiscard]] constexpr int row_width(const SimulationSetup<Mechanism>& setup) noexcept {
  return record_width<Mechanism::dof> + (setup.body ? body_width : setup.touched ? contact_width : 0);
}

namespace detail {

template <class Mechanism, class Scalar = double>
class MovingPlant {
 public:
  static constexpr int dof = Mechanism::dof;
  MovingPlant() = default;
  explicit MovingPlant(const SimulationSetup<Mechanism>& s) : motion_(s.mechanism, s.friction, s.hand), substeps_(s.substeps) {
    state_.q = s.start;
    state_.qd = s.start_speed;
    state_.hand = s.mechanism.forward(s.start);
    track_ = plant::IncrementalKinematics<Mechanism>(s.mechanism.kinematics(s.start));
  }
  [[nodiscard]] const plant::KinematicsCacheOf<Mechanism, Scalar>& kinematics() const { return track_.at; }
  [[nodiscard]] Vector3<Scalar> tip() const { return motion_.mechanism().forward(track_.at); }
  [[nodiscard]] const Joints<dof, Scalar>& angles() const { return state_.q; }
  [[nodiscard]] const Joints<dof, Scalar>& speeds() const { return state_.qd; }
  [[nodiscard]] Vector3<Scalar> hand_force(const Vector3<Scalar>& voluntary) const { return motion_.hand_force(state_, voluntary); }
  void advance(const Joints<dof, Scalar>& torque, const plant::ForceSegment<Scalar>& force,
               const actuation::TickSchedule<Scalar>& clock) noexcept {
    if (clock.jitters()) return motion_.advance(state_, track_, torque, force, clock.ahead(), substeps_);
    motion_.advance(state_, track_, torque, force, clock.period(), substeps_);
  }
  /// Puts one loop's plant into a lane: of the same mechanism and number of substeps.
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
  plant::IncrementalKinematics<Mechanism, Scalar> track_;
  int substeps_ = 1;
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
  void advance(const Joints<dof>& torque, const plant::ForceSegment<>& force, const actuation::TickSchedule<double>& /*clock*/) noexcept {
    plant_.advance(torque + kinematics_.jacobian(angles_).transpose() * force.begin);
    const Joints<dof> angles = plant_.angles();
    speeds_ = (angles - angles_) * per_period_;
    angles_ = angles;
  }

 private:
  plant::LinearPlant<dof> plant_;
  Mechanism kinematics_;
  Joints<dof> angles_;
  Joints<dof> speeds_;
  double per_period_;
};

/// A device held at its start pose by a hand that does not yield.
template <class Mechanism>
class HeldPlant {
 public:
  static constexpr int dof = Mechanism::dof;
  explicit HeldPlant(const SimulationSetup<Mechanism>& s) : angles_(s.start), speeds_(Joints<dof>::Zero()) {}
  [[nodiscard]] const Joints<dof>& angles() const { return angles_; }
  [[nodiscard]] const Joints<dof>& speeds() const { return speeds_; }
  [[nodiscard]] Vector3<> hand_force(const Vector3<>& voluntary) const { return voluntary; }
  void advance(const Joints<dof>& /*torque*/, const plant::ForceSegment<>& /*force*/,
               const actuation::TickSchedule<double>& /*clock*/) noexcept {}

 private:
  Joints<dof> angles_;
  Joints<dof> speeds_;
};

inline void write_contact(double* row, const mesh::Contact& contact) noexcept {
  Eigen::Map<Vector3<>>{row} = contact.position;
  Eigen::Map<Vector3<>>{row + 3} = contact.normal;
  row[6] = contact.depth;
  row[7] = contact.stiffness;
  row[8] = contact.triangle;
}

inline void write_body(double* row, const object::BodyInstance& touch) noexcept {
  const deformable::ContactResult& answer = touch.result();
  Eigen::Map<Vector3<>>{row} = touch.deflection();
  row[3] = answer.energy;
  row[4] = answer.nodes;
  row[5] = answer.solved ? 1.0 : 0.0;
  row[6] = answer.tank_energy;
}

/// Writes one loop's rows.
template <class Mechanism>
class Recorder {
 public:
  static constexpr int dof = Mechanism::dof;
  Recorder(const SimulationSetup<Mechanism>& s, double* rows) : every_(s.record_every), width_(row_width(s)), rows_(rows) {}

  void lost(int tick) noexcept { outcome_.unstable_tick = tick; }

  template <class Plant>
  void see(const Plant& plant, const Servo<Mechanism>& servo, const Vector3<>& force) noexcept {
    const auto& tick = servo.last();
    if (until_next_ == 0) {
      double* row = rows_ + static_cast<std::ptrdiff_t>(outcome_.rows++) * width_;
      Eigen::Map<Joints<dof>>{row} = plant.angles();
      Eigen::Map<Joints<dof>>{row + dof} = plant.speeds();
      Eigen::Map<Vector3<>>{row + 2 * dof} = tick.object_force;
      Eigen::Map<Vector3<>>{row + 2 * dof + 3} = tick.command;
      Eigen::Map<Joints<dof>>{row + 2 * dof + 6} = tick.torque;
      Eigen::Map<Vector3<>>{row + 3 * dof + 6} = plant.hand_force(force);
      row[3 * dof + 9] = tick.touching ? 1.0 : 0.0;
      row[3 * dof + 10] = tick.saturated ? 1.0 : 0.0;
      if (const object::BodyInstance* touch = servo.body())
        write_body(row + record_width<dof>, *touch);
      else if (const mesh::Contact* contact = servo.contact())
        write_contact(row + record_width<dof>, *contact);
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

/// Whether a plant moves no faster than `fastest` and is somewhere; a NaN is not.
template <class Plant>
[[gnu::always_inline]] inline auto calm(const Plant& plant, double fastest) {
  using std::abs;
  using Scalar = std::decay_t<decltype(plant.speeds()[0])>;
  Condition<Scalar> out = true;
  for (int i = 0; i < Plant::dof; ++i) out = out & (abs(plant.speeds()[i]) < Scalar(fastest)) & finite(plant.angles()[i]);
  return out;
}

/// Three numbers of a table of forces.
inline Vector3<> force_at(const double* table, int tick) noexcept {
  return Eigen::Map<const Vector3<>>{table + 3 * static_cast<std::ptrdiff_t>(tick)};
}

/// Force at `late` [s] after a sample, less than a period: linear from there to the next; after the last (`ticks`) it stays.
inline Vector3<> force_after(const double* table, int tick, int ticks, double late, double period) noexcept {
  const Vector3<> here = force_at(table, std::min(tick, ticks));
  const Vector3<> next = force_at(table, std::min(tick + 1, ticks));
  return here + (late / period) * (next - here);
}

/// The operator's force [N] from one tick to the next: between two late ones a straight line, though it may bend at a sample.
inline plant::ForceSegment<> force_during(const double* table, int tick, int ticks, const actuation::TickSchedule<double>& clock) noexcept {
  if (clock.jitters())
    return {force_after(table, tick, ticks, clock.late(), clock.period()),
            force_after(table, tick + 1, ticks, clock.next_late(), clock.period())};
  return {force_at(table, tick), force_at(table, std::min(tick + 1, ticks))};
}

/// The servo's tick at a plant, which may know its posture.
template <class Servo, class Plant, class Vector>
[[gnu::always_inline]] inline const auto& tick_of(Servo& servo, const Plant& plant, const Vector& reference) noexcept {
  if constexpr (requires { plant.kinematics(); })
    return servo.tick(plant.angles(), plant.kinematics(), reference);
  else
    return servo.tick(plant.angles(), reference);
}

/// The loop itself: samples 0 to `ticks`, each shown to `watch`, until it diverges.
template <class Mechanism, class Plant, class StabilityMonitor>
void run(const SimulationSetup<Mechanism>& setup, Plant& plant, int ticks, const double* reference, const double* operator_force,
         StabilityMonitor& watch) noexcept {
  Servo<Mechanism> servo(setup);
  actuation::TickSchedule<double> clock(setup.period, setup.jitter, setup.seed);
  for (int k = 0;; ++k, clock.tick()) {
    if (!calm(plant, setup.speed_limit)) return watch.lost(k);
    const auto& tick = tick_of(servo, plant, force_at(reference, k));
    const plant::ForceSegment<> force = force_during(operator_force, k, ticks, clock);
    watch.see(plant, servo, force.begin);
    if (k == ticks) return;
    servo.in_turn();
    plant.advance(tick.torque, force, clock);
  }
}

}  // namespace detail

/// Runs `ticks` servo periods, samples 0 to `ticks` included.
/// @param reference       force reference at each sample, (ticks + 1) x 3 row by row, N
/// @param operator_force  voluntary force at each sample, (ticks + 1) x 3, N; linear in time between samples, and between late ticks
/// @param rows            room for ticks / record_every + 1 rows of row_width(setup)
template <class Mechanism>
SimulationOutcome simulate(const SimulationSetup<Mechanism>& setup, int ticks, const double* reference, const double* operator_force,
                           double* rows) noexcept {
  detail::Recorder<Mechanism> recorder(setup, rows);
  if (setup.held) {
    detail::HeldPlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  } else if (setup.linear) {
    detail::SampledPlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  } else {
    detail::MovingPlant<Mechanism> plant(setup);
    detail::run(setup, plant, ticks, reference, operator_force, recorder);
  }
  return recorder.outcome();
}

}  // namespace palpate::servo
