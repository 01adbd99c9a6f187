#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/solver_options.hpp"
#include "palpate/deformable/hyperelastic/surface_contact.hpp"

namespace palpate::deformable {

/// Motion of a hyperelastic body with lumped mass M and Rayleigh damping: with the displacements x, the derivative f(x) of its energy W(x),
/// the forces q of the overstress and f_c of the tips,
///   x' = v,   p' = f_c - f(x) - q - alpha M v,   p = M v + beta f(x).
/// The damping matrix is alpha M + beta K(x) with the tangent stiffness K of the long term.
///
/// A step of length h has the two stages of the singly diagonally implicit Runge-Kutta method of second order (Alexander 1977; gamma =
/// 1 - 1/sqrt(2), L-stable). A linear oscillation of frequency w keeps the part (1 + a (w h)^2) / (1 + a (w h)^2 + gamma^4 (w h)^4) of its
/// energy, with a = (1 - 2 gamma)^2. Each stage is the minimum of the potential
///   weight W(x) + potential of the overstress + 1/2 mass |x - base|_M^2 - drive . (x - base) + energy of the contact,
/// and so is the look-ahead by the trapezoidal rule, about which a local model is linearized.
///
/// The overstress takes the same stages (RelaxationStep::stage). A linear vibration then never gains energy: the method is A-stable, and
/// the energy is a norm that the equations do not increase (von Neumann's inequality; Hairer & Wanner 1996, IV.11).
class BodyDynamics {
 public:
  static constexpr double gamma = 0.29289321881345248;  // 1 - 1/sqrt(2)

  /// Coefficients of a minimum: of the mass [1/s^2], and of the body's energy W.
  struct Coefficients {
    double mass = 0.0, weight = 1.0;
  };

  BodyDynamics() = default;
  /// `mass` of each free node [kg], and the number of all nodes.
  BodyDynamics(const Inertia& inertia, std::vector<double> mass, std::size_t nodes)
      : inertia_(inertia),
        mass_(std::move(mass)),
        displacement_(3 * nodes),
        velocity_(3 * mass_.size()),
        momentum_(velocity_),
        base_(velocity_),
        drive_(velocity_),
        rate_(velocity_),
        stage_velocity_(velocity_) {}

  [[nodiscard]] bool enabled() const noexcept { return inertia_.density > 0.0; }
  [[nodiscard]] const Inertia& inertia() const noexcept { return inertia_; }
  [[nodiscard]] const std::vector<double>& displacement() const noexcept { return displacement_; }  ///< of all nodes after the step, m
  [[nodiscard]] double mass(std::size_t unknown) const noexcept { return mass_[unknown / 3]; }

  /// Set the state: displacements of all nodes [m], at rest. `elastic_forces`: f there, N.
  void rest_at(const double* displacement, const double* elastic_forces) noexcept {
    std::copy_n(displacement, displacement_.size(), displacement_.begin());
    for (std::size_t k = 0; k < velocity_.size(); ++k) {
      velocity_[k] = 0.0;
      momentum_[k] = inertia_.rayleigh_beta * elastic_forces[k];
    }
  }

  /// Prepare a stage of a step of length h, 0 or 1. Write an estimate of its displacements to `start`.
  Coefficients begin_stage(int stage, double h, std::vector<double>& start) noexcept {
    const double part = gamma * h;
    start = displacement_;
    for (std::size_t k = 0; k < velocity_.size(); ++k) {
      base_[k] = displacement_[k] + (stage == 0 ? 0.0 : (1.0 - gamma) * h * stage_velocity_[k]);
      drive_[k] = (momentum_[k] + (stage == 0 ? 0.0 : (1.0 - gamma) * h * rate_[k])) / part;
      start[k] = base_[k] + part * (stage == 0 ? velocity_[k] : stage_velocity_[k]);
    }
    return {.mass = (1.0 + inertia_.rayleigh_alpha * part) / (part * part), .weight = 1.0 + inertia_.rayleigh_beta / part};
  }

  /// Complete a stage at its minimum, with f there [N]; after the second one this is the state.
  void end_stage(int stage, double h, const double* displacement, const double* elastic_forces) noexcept {
    const double part = gamma * h;
    for (std::size_t k = 0; k < velocity_.size(); ++k) {
      const double v = (displacement[k] - base_[k]) / part;
      const double momentum = mass(k) * v + inertia_.rayleigh_beta * elastic_forces[k];
      if (stage == 0) rate_[k] = momentum / part - drive_[k];
      stage_velocity_[k] = v;
      if (stage == 1) {
        velocity_[k] = v;
        momentum_[k] = momentum;
        displacement_[k] = displacement[k];
      }
    }
  }

  /// Prepare the look-ahead by `horizon` from the state, with the forces f_c and f + q there [N].
  Coefficients begin_look_ahead(double horizon, const double* contact_forces, const double* internal_forces) noexcept {
    for (std::size_t k = 0; k < velocity_.size(); ++k) {
      base_[k] = displacement_[k];
      drive_[k] = 2.0 / horizon * (momentum_[k] + mass(k) * velocity_[k]) + (contact_forces[k] - internal_forces[k]);
    }
    return {.mass = 4.0 / (horizon * horizon) + 2.0 * inertia_.rayleigh_alpha / horizon,
            .weight = 1.0 + 2.0 * inertia_.rayleigh_beta / horizon};
  }

  [[nodiscard]] double base(std::size_t k) const noexcept { return base_[k]; }
  [[nodiscard]] double drive(std::size_t k) const noexcept { return drive_[k]; }
  [[nodiscard]] const std::vector<double>& velocity() const noexcept { return velocity_; }  ///< m/s

  [[nodiscard]] double kinetic_energy() const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < velocity_.size(); ++k) sum += 0.5 * mass(k) * velocity_[k] * velocity_[k];
    return sum;
  }

 private:
  Inertia inertia_;
  std::vector<double> mass_;                 // by free node, kg
  std::vector<double> displacement_;         // of all nodes, m
  std::vector<double> velocity_, momentum_;  // of the state: v, m/s, and p, N s
  std::vector<double> base_, drive_;         // of the minimum, m and N
  std::vector<double> rate_;                 // p' of the first stage, N
  std::vector<double> stage_velocity_;       // of the last stage, m/s
};

/// Forces of the tips and of inertia, for HyperelasticModel::step(): those of the minimum of BodyDynamics.
class DynamicForces {
 public:
  DynamicForces(SurfaceContact& contact, const BodyDynamics& dynamics, BodyDynamics::Coefficients coefficients, std::vector<double>& force)
      : contact_(contact), dynamics_(dynamics), coefficients_(coefficients), force_(force) {}

  /// Evaluate the forces at a displacement.
  void linearize(const double* displacement) noexcept {
    contact_.linearize(displacement);
    double inertial = 0.0;
    for (std::size_t k = 0; k < force_.size(); ++k) {
      const double f = dynamics_.drive(k) - coefficients_.mass * dynamics_.mass(k) * (displacement[k] - dynamics_.base(k));
      force_[k] = contact_.force()[k] + f;
      inertial += f * f;
    }
    norm_ = contact_.force_norm() + std::sqrt(inertial);
  }
  /// Sum of the norms of both forces, N.
  [[nodiscard]] double norm() const noexcept { return norm_; }

  [[nodiscard]] const double* right_side() const noexcept { return force_.data(); }
  [[nodiscard]] const double* force() const noexcept { return force_.data(); }
  [[nodiscard]] const double* reference() const noexcept { return nullptr; }
  void add_stiffness(BlockMatrix& tangent) const noexcept { contact_.add_stiffness(tangent); }
  void add_mass(BlockMatrix& tangent) const noexcept {
    for (std::size_t i = 0; 3 * i < force_.size(); ++i) {
      const auto node = static_cast<std::int32_t>(i);
      float* block = tangent.block(tangent.block_index(node, node));
      const auto mass = static_cast<float>(coefficients_.mass * dynamics_.mass(3 * i));
      for (std::size_t a = 0; a < 3; ++a) block[4 * a] += mass;
    }
  }
  [[nodiscard]] double energy(const double* displacement) const noexcept {
    double sum = contact_.energy(displacement);
    for (std::size_t k = 0; k < force_.size(); ++k) {
      const double moved = displacement[k] - dynamics_.base(k);
      sum += (0.5 * coefficients_.mass * dynamics_.mass(k) * moved - dynamics_.drive(k)) * moved;
    }
    return sum;
  }

 private:
  SurfaceContact& contact_;
  const BodyDynamics& dynamics_;
  BodyDynamics::Coefficients coefficients_;
  std::vector<double>& force_;  // N
  double norm_ = 0.0;
};

}  // namespace palpate::deformable
