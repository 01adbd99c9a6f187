#pragma once

#include <utility>
#include <variant>

#include "palpate/control/any_controller.hpp"
#include "palpate/guard/any_guard.hpp"
#include "palpate/object/any_object.hpp"
#include "palpate/servo/servo.hpp"
#include "palpate/servo/simulation.hpp"

namespace palpate::servo {

/// A simulated loop that the caller steps sample by sample. Its results equal those of simulate(), bit for bit.
template <class Mechanism>
class Loop {
 public:
  static constexpr int dof = Mechanism::dof;
  using LoopServo = Servo<Mechanism, object::AnyObject, control::AnyController, guard::AnyGuard<Mechanism>>;
  using Tick = typename LoopServo::Tick;

  explicit Loop(SimulationSetup<Mechanism> setup)
      : setup_(std::move(setup)),
        plant_(plant_of(setup_)),
        servo_(setup_, setup_.object, setup_.controller, setup_.guard),
        schedule_(schedule_of(setup_)) {}

  /// Return to the first sample.
  void reset() {
    plant_ = plant_of(setup_);
    servo_ = LoopServo(setup_, setup_.object, setup_.controller, setup_.guard);
    schedule_ = schedule_of(setup_);
    count_ = 0;
    diverged_ = false;
  }

  /// Run the servo's tick at this sample. Its torque acts until the next sample.
  /// @param reference  force that the object should feel, N
  /// @param voluntary  force of the operator at this sample, N, which an admittance display measures
  const Tick& tick(const Vector3<>& reference, const Vector3<>& voluntary = Vector3<>::Zero()) noexcept {
    std::visit([&](const auto& plant) { detail::tick_of(servo_, plant, reference, voluntary); }, plant_);
    diverged_ = diverged_ || servo_.last().fault;
    return servo_.last();
  }

  /// Move the plant to the next sample under the last tick's torque and the operator's force, linear in time from `begin` to `end` [N].
  /// Return false once the loop has diverged; then the plant stays in its state.
  bool advance(const Vector3<>& begin, const Vector3<>& end) {
    if (diverged_) return false;
    servo_.update();
    std::visit([&](auto& plant) { plant.advance(servo_.last().torque, plant::ForceSegment<>{begin, end}, schedule_); }, plant_);
    schedule_.tick();
    ++count_;
    diverged_ = !std::visit([&](const auto& plant) { return detail::is_bounded(plant, setup_.speed_limit); }, plant_);
    return !diverged_;
  }

  /// Write the row of the present sample, as recorded by simulate(); row_width(setup) numbers.
  void record(const Vector3<>& operator_force, double* row) const noexcept {
    std::visit([&](const auto& plant) { detail::write_row(plant, servo_, operator_force, row); }, plant_);
  }

  [[nodiscard]] Joints<dof> angles() const noexcept {
    return std::visit([](const auto& plant) { return Joints<dof>(plant.angles()); }, plant_);
  }
  [[nodiscard]] Joints<dof> speeds() const noexcept {
    return std::visit([](const auto& plant) { return Joints<dof>(plant.speeds()); }, plant_);
  }
  [[nodiscard]] int count() const noexcept { return count_; }                                           ///< samples since the first
  [[nodiscard]] double time() const noexcept { return count_ * setup_.period + schedule_.lateness(); }  ///< of this sample, s
  [[nodiscard]] bool diverged() const noexcept { return diverged_; }
  [[nodiscard]] const LoopServo& servo() const noexcept { return servo_; }
  [[nodiscard]] LoopServo& servo() noexcept { return servo_; }
  [[nodiscard]] const SimulationSetup<Mechanism>& setup() const noexcept { return setup_; }

 private:
  using Plant = std::variant<detail::MovingPlant<Mechanism>, detail::FlexiblePlant<Mechanism>, detail::SampledPlant<Mechanism>,
                             detail::FixedPlant<Mechanism>>;

  static Plant plant_of(const SimulationSetup<Mechanism>& s) {
    if (s.fixed) return detail::FixedPlant<Mechanism>(s);
    if (s.linear) return detail::SampledPlant<Mechanism>(s);
    if (s.flexible) return detail::FlexiblePlant<Mechanism>(s);
    return detail::MovingPlant<Mechanism>(s);
  }
  static actuation::TickSchedule<double> schedule_of(const SimulationSetup<Mechanism>& s) { return {s.period, s.jitter, s.seed}; }

  SimulationSetup<Mechanism> setup_;
  Plant plant_;
  LoopServo servo_;
  actuation::TickSchedule<double> schedule_;
  int count_ = 0;
  bool diverged_ = false;
};

}  // namespace palpate::servo
