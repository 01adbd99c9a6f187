#pragma once

/// Python bindings of the guards of a servo loop.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>

#include <palpate/guard/any_guard.hpp>
#include <palpate/math/vector.hpp>

template <class Parameters>
void require_valid(const Parameters& parameters) {
  if (const char* fault = parameters.fault()) throw nanobind::value_error(fault);
}

/// Bind the choice of a guard for the setup of a mechanism.
template <class Mechanism, class Setup>
void bind_guards(nanobind::class_<Setup>& setup) {
  using namespace nanobind::literals;
  using Angles = palpate::math::Joints<Mechanism::dof>;
  setup
      .def(
          "set_energy_bound",
          [](Setup& s, const Angles& damping, const Angles& coulomb, double lateness) {
            const palpate::guard::EnergyBoundParameters<Mechanism::dof> parameters{damping, coulomb, lateness};
            require_valid(parameters);
            s.guard = palpate::guard::EnergyBound<Mechanism>(parameters);
          },
          "damping"_a, "coulomb"_a, "lateness"_a, "Guard the loop by an energy bound that relies on this friction of the joints.")
      .def(
          "set_passivity_controller",
          [](Setup& s, double cap) {
            const palpate::guard::PassivityControllerParameters parameters{cap};
            require_valid(parameters);
            s.guard = palpate::guard::PassivityController<Mechanism>(parameters);
          },
          "cap"_a, "Guard the loop by a passivity controller with at most this damping, times tip inertia over period.")
      .def(
          "set_half_sample",
          [](Setup& s, palpate::guard::VelocityEstimate velocity, double horizon, double observer, bool deadbeat) {
            const palpate::guard::HalfSampleParameters parameters{velocity, horizon, observer, deadbeat};
            require_valid(parameters);
            s.guard = palpate::guard::HalfSample<Mechanism>(parameters);
          },
          "velocity"_a, "horizon"_a, "observer"_a, "deadbeat"_a = false,
          "Hand the object the tip position after `horizon` servo periods; rate of the observer in rad/s; deadbeat exit of a wall.")
      .def(
          "set_sample_estimate_hold",
          [](Setup& s, double correction) {
            const palpate::guard::SampleEstimateHoldParameters parameters{correction};
            require_valid(parameters);
            s.guard = palpate::guard::SampleEstimateHold<Mechanism>(parameters);
          },
          "correction"_a, "Hold the estimated mean of the force over the next period.");
}

/// Bind the types that the guards of every mechanism share.
inline void bind_guard_parts(nanobind::module_& m) {
  using palpate::guard::VelocityEstimate;
  nanobind::enum_<VelocityEstimate>(m, "VelocityEstimate")
      .value("backward", VelocityEstimate::backward)
      .value("adaptive_window", VelocityEstimate::adaptive_window)
      .value("observer", VelocityEstimate::observer);
}
