#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/control/state_space.hpp"
#include "palpate/control/virtual_coupling.hpp"
#include "palpate/device/drive.hpp"
#include "palpate/device/motion.hpp"
#include "palpate/loop/linear_plant.hpp"
#include "palpate/loop/servo.hpp"
#include "palpate/touch/anchor.hpp"

namespace palpate {

/// A whole experiment in virtual time: what to build and how to run it. Plain data; every run builds afresh from it, so the same
/// setup gives the same trace, bit for bit.
template <class Mechanism>
struct SimulationSetup : ServoSetup<Mechanism> {
  static constexpr int dof = Mechanism::dof;

  Friction<dof> friction;
  Hand hand;

  bool held = false;    ///< the operator holds the tip where it starts: nothing moves
  bool linear = false;  ///< the plant is the next three instead of the mechanism's motion
  Eigen::MatrixXd plant_a, plant_b, plant_c;
  Joints<dof> working_torque = Joints<dof>::Zero();

  Joints<dof> start_speed = Joints<dof>::Zero();  ///< rad/s
  int substeps = 2;                               ///< of the motion in one period
  int record_every = 1;                           ///< periods between recorded rows
  double speed_limit = 1e3;                       ///< rad/s: past it (or not finite) the loop counts as diverged
};

/// What a run leaves behind. A recorded row holds, at one sample:
/// q (dof), qd (dof), object force (3), command (3), torque (dof), operator's force on the tip (3), touching, saturated;
/// and on a mesh the proxy's position (3) and normal (3), depth, stiffness, triangle.
struct SimulationOutcome {
  int rows = 0;            ///< written
  int unstable_tick = -1;  ///< the tick at which the loop diverged; -1: never. Nothing is recorded from it on.
};

template <int dof>
constexpr int record_width = 3 * dof + 11;  ///< of a row without a mesh
constexpr int contact_width = 9;            ///< what a mesh adds to it

/// Numbers in a recorded row.
template <class Mechanism>
[[nodiscard]] constexpr int row_width(const SimulationSetup<Mechanism>& setup) noexcept {
  return record_width<Mechanism::dof> + (setup.touched ? contact_width : 0);
}

namespace detail {

template <class Mechanism>
class MovingPlant {
 public:
  explicit MovingPlant(const SimulationSetup<Mechanism>& s)
      : motion_(s.mechanism, s.friction, s.hand), substeps_(s.substeps), period_(s.period) {
    state_.q = s.start;
    state_.qd = s.start_speed;
    state_.hand = s.mechanism.forward(s.start);
  }
  [[nodiscard]] const Joints<Mechanism::dof>& angles() const { return state_.q; }
  [[nodiscard]] const Joints<Mechanism::dof>& speeds() const { return state_.qd; }
  [[nodiscard]] Vector3<> hand_force(const Vector3<>& voluntary) const { return motion_.hand_force(state_, voluntary); }
  void advance(const Joints<Mechanism::dof>& torque, const ForceSegment& force) noexcept {
    motion_.advance(state_, torque, force, period_, substeps_);
  }

 private:
  Motion<Mechanism> motion_;
  MotionState<Mechanism::dof> state_;
  int substeps_;
  double period_;
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
  void advance(const Joints<dof>& torque, const ForceSegment& force) noexcept {
    plant_.advance(torque + kinematics_.jacobian(angles_).transpose() * force.begin);
    const Joints<dof> angles = plant_.angles();
    speeds_ = (angles - angles_) * per_period_;
    angles_ = angles;
  }

 private:
  LinearPlant<dof> plant_;
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
  void advance(const Joints<dof>& /*torque*/, const ForceSegment& /*force*/) noexcept {}

 private:
  Joints<dof> angles_;
  Joints<dof> speeds_;
};

inline void write_contact(double* row, const Contact& contact) noexcept {
  Eigen::Map<Vector3<>>{row} = contact.position;
  Eigen::Map<Vector3<>>{row + 3} = contact.normal;
  row[6] = contact.depth;
  row[7] = contact.stiffness;
  row[8] = contact.triangle;
}

template <class Mechanism, class Plant>
SimulationOutcome run(const SimulationSetup<Mechanism>& setup, Plant& plant, int ticks, const double* reference,
                      const double* operator_force, double* rows) noexcept {
  constexpr int dof = Mechanism::dof;
  const int width = row_width(setup);
  Servo<Mechanism> servo(setup);
  SimulationOutcome outcome;
  const double fastest = setup.speed_limit;
  int until_record = 0;
  for (int k = 0;; ++k) {
    // Written so that a NaN fails it.
    if (!((plant.speeds().array().abs() < fastest).all() && plant.angles().allFinite())) {
      outcome.unstable_tick = k;
      return outcome;
    }
    const auto& tick = servo.tick(plant.angles(), Eigen::Map<const Vector3<>>(reference + 3 * k));
    ForceSegment force;
    force.begin = Eigen::Map<const Vector3<>>(operator_force + 3 * k);
    if (until_record == 0) {
      double* row = rows + static_cast<std::ptrdiff_t>(outcome.rows++) * width;
      Eigen::Map<Joints<dof>>{row} = plant.angles();
      Eigen::Map<Joints<dof>>{row + dof} = plant.speeds();
      Eigen::Map<Vector3<>>{row + 2 * dof} = tick.object_force;
      Eigen::Map<Vector3<>>{row + 2 * dof + 3} = tick.command;
      Eigen::Map<Joints<dof>>{row + 2 * dof + 6} = tick.torque;
      Eigen::Map<Vector3<>>{row + 3 * dof + 6} = plant.hand_force(force.begin);
      row[3 * dof + 9] = tick.touching ? 1.0 : 0.0;
      row[3 * dof + 10] = tick.saturated ? 1.0 : 0.0;
      if (const Contact* contact = servo.contact()) write_contact(row + record_width<dof>, *contact);
      until_record = setup.record_every;
    }
    --until_record;
    if (k == ticks) return outcome;
    force.end = Eigen::Map<const Vector3<>>(operator_force + 3 * (k + 1));
    plant.advance(tick.torque, force);
  }
}

}  // namespace detail

/// Runs `ticks` servo periods, samples 0 to `ticks` included.
/// @param reference       force reference at each sample, (ticks + 1) x 3 row by row, N
/// @param operator_force  voluntary force at each sample, (ticks + 1) x 3, N; linear in time between samples
/// @param rows            room for ticks / record_every + 1 rows of row_width(setup)
template <class Mechanism>
SimulationOutcome simulate(const SimulationSetup<Mechanism>& setup, int ticks, const double* reference, const double* operator_force,
                           double* rows) noexcept {
  if (setup.held) {
    detail::HeldPlant<Mechanism> plant(setup);
    return detail::run(setup, plant, ticks, reference, operator_force, rows);
  }
  if (setup.linear) {
    detail::SampledPlant<Mechanism> plant(setup);
    return detail::run(setup, plant, ticks, reference, operator_force, rows);
  }
  detail::MovingPlant<Mechanism> plant(setup);
  return detail::run(setup, plant, ticks, reference, operator_force, rows);
}

}  // namespace palpate
