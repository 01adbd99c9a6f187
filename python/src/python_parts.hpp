#pragma once

/// Controllers and objects written in Python. They run in simulation only: each call acquires the interpreter's lock.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>

#include <Eigen/Core>
#include <exception>
#include <memory>
#include <palpate/control/controller.hpp>
#include <palpate/object/contact_object.hpp>
#include <utility>

/// Signals of one tick as a Python controller sees them. SI units, device frame.
struct TickSignals {
  double time = 0.0;
  palpate::math::Vector3<> reference, object_force, deflection, tip, velocity, normal;
  double depth = 0.0, stiffness = 0.0;
};

/// The first exception that Python code raised in a run. After it the part returns no force.
struct PythonFault {
  std::exception_ptr error;
  void raise() {
    if (std::exception_ptr once = std::exchange(error, nullptr)) std::rethrow_exception(once);
  }
};

/// A Python callable, or an object with a method of the given name, that a loop calls under the interpreter's lock. The first error ends
/// the calls.
class PythonPart {
 public:
  PythonPart(nanobind::object object, const char* method, std::shared_ptr<PythonFault> fault)
      : held_(std::make_shared<Held>(std::move(object), method)), fault_(std::move(fault)) {}

  /// Run `calls(object, method)` unless an error has occurred before.
  template <class Calls>
  void run(Calls calls) const noexcept {
    if (fault_->error) return;
    const nanobind::gil_scoped_acquire locked;
    try {
      calls(held_->object, held_->method);
    } catch (...) {
      fault_->error = std::current_exception();
    }
  }

  /// Call `object.reset()` if there is one.
  void reset() const noexcept {
    run([](const nanobind::object& object, const nanobind::object&) {
      if (nanobind::hasattr(object, "reset")) object.attr("reset")();
    });
  }

 private:
  struct Held {
    nanobind::object object, method;
    Held(nanobind::object o, const char* name)
        : object(std::move(o)), method(nanobind::hasattr(object, name) ? nanobind::object(object.attr(name)) : object) {}
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    Held(Held&&) = delete;
    Held& operator=(Held&&) = delete;
    ~Held() {
      const nanobind::gil_scoped_acquire locked;
      object.reset();
      method.reset();
    }
  };
  std::shared_ptr<Held> held_;
  std::shared_ptr<PythonFault> fault_;
};

/// A controller written in Python: a callable from TickSignals to a force [N], or an object with such a method `command`, and optionally
/// `applied(force)` and `reset()`.
class PythonController {
 public:
  using Scalar = double;

  PythonController(nanobind::object object, std::shared_ptr<PythonFault> fault)
      : hears_(nanobind::hasattr(object, "applied")), part_(std::move(object), "command", std::move(fault)) {
    part_.reset();
  }

  palpate::math::Vector3<> command(const palpate::control::TickInput& in) noexcept {
    palpate::math::Vector3<> force = palpate::math::Vector3<>::Zero();
    part_.run([&](const nanobind::object&, const nanobind::object& call) {
      force = nanobind::cast<palpate::math::Vector3<>>(
          call(TickSignals{in.time, in.reference, in.object_force, in.deflection, in.tip, in.velocity(), in.contact.normal,
                           in.contact.depth, in.contact.stiffness}));
    });
    return force;
  }
  void applied(const palpate::math::Vector3<>& force) noexcept {
    if (hears_) part_.run([&](const nanobind::object& object, const nanobind::object&) { object.attr("applied")(force); });
  }
  void reset() noexcept { part_.reset(); }

 private:
  bool hears_;
  PythonPart part_;
};

/// The tip as a Python object sees it.
struct TipSignals {
  double time = 0.0;
  palpate::math::Vector3<> position, velocity;
};

/// An object written in Python: a callable from TipSignals to the force of the tip on the object [N], or an object with such a method
/// `step`, and optionally `reset()`. It may return a ContactResult instead of a force.
class PythonObject {
 public:
  using Scalar = double;

  PythonObject(nanobind::object object, std::shared_ptr<PythonFault> fault) : part_(std::move(object), "step", std::move(fault)) {}

  void start(const palpate::math::Vector3<>& tip) noexcept {
    tip_ = tip;
    time_ = 0.0;
    started_ = false;
    part_.reset();
  }

  const palpate::object::ContactResult& step(const palpate::object::TipState& tip) noexcept {
    result_ = {};
    if (started_) time_ += 1.0 / tip.rate;
    started_ = true;
    part_.run([&](const nanobind::object&, const nanobind::object& call) {
      const nanobind::object answer = call(TipSignals{time_, tip.position, palpate::math::Vector3<>((tip.position - tip_) * tip.rate)});
      if (!nanobind::try_cast(answer, result_)) {
        result_.force = nanobind::cast<palpate::math::Vector3<>>(answer);
        result_.touching = !result_.force.isZero(0.0);
      }
    });
    tip_ = tip.position;
    return result_;
  }
  void reset() noexcept { start(tip_); }

 private:
  PythonPart part_;
  palpate::object::ContactResult result_;
  palpate::math::Vector3<> tip_ = palpate::math::Vector3<>::Zero();
  double time_ = 0.0;
  bool started_ = false;
};
