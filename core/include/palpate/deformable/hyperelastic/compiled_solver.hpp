#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/hyperelastic/overstress.hpp"
#include "palpate/deformable/hyperelastic/solver_options.hpp"
#include "palpate/deformable/hyperelastic/tet_mesh.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/deformable/multirate/multi_tip_result.hpp"
#include "palpate/math/vector.hpp"

/// Hyperelastic models and solvers whose material and SIMD width are chosen at run time. The library palpate::hyperelastic defines the
/// functions of this header: it contains a copy of the solver for each width.
namespace palpate::deformable {

/// Material law of a hyperelastic body.
enum class HyperelasticLaw { neo_hookean, corotational };

/// A HyperelasticModel. Vectors are 3 x point + axis.
class AnyHyperelasticModel {
 public:
  AnyHyperelasticModel() = default;
  AnyHyperelasticModel(const AnyHyperelasticModel&) = delete;
  AnyHyperelasticModel& operator=(const AnyHyperelasticModel&) = delete;
  virtual ~AnyHyperelasticModel() = default;

  /// Return the stored energy [J] at a displacement [m], at the end of a step of a duration [s]. Write the internal forces [N] to `forces`.
  virtual double evaluate(const double* displacement, double duration, double* forces) = 0;
  /// Compute the derivative of the internal forces [N] along `motion` [m] at the last displacement, in single precision.
  virtual void tangent(const double* motion, double* forces) = 0;
  /// Iterate with Newton steps until the residual at the end of a step of a duration [s] is below `tolerance` times the load. Return the
  /// number of steps, or -1 if `max_steps` do not suffice; then the body has not advanced.
  virtual int solve_equilibrium(const double* load, double duration, double tolerance, int max_steps) = 0;
  virtual void displacement(double* to) const = 0;
  virtual void reset() = 0;
};

/// Report of one model update.
struct ModelUpdateReport {
  double relative_residual = 0.0;  ///< unbalanced force or change of the contact forces, over the contact forces
  double residual = 0.0;           ///< norm of load minus internal forces before the update, N
  int newton_steps = 0;            ///< conjugate gradient steps of the equilibrium
  int compliance_steps = 0;        ///< conjugate gradient steps of the compliance columns
  double compliance_error = 0.0;   ///< estimated relative error of the worst compliance column, energy norm
};

/// A LocalModelContact compiled like the solver that made it: the contact of BasicPassiveModelSwitch with the solver's local models.
class AnyLocalContact {
 public:
  using Model = LocalModel;

  /// The functions of LocalModelContact.
  class Interface {
   public:
    Interface() = default;
    Interface(const Interface&) = delete;
    Interface& operator=(const Interface&) = delete;
    virtual ~Interface() = default;

    virtual const MultiTipResult& solve(const LocalModel& model, const TipPair& tips, double compliance_scale) noexcept = 0;
    /// `other` was made by the same solver.
    virtual void start_from(const LocalModel& model, const Interface& other) noexcept = 0;
    [[nodiscard]] virtual const MultiTipResult& last() const noexcept = 0;
    [[nodiscard]] virtual const std::int32_t* contact_nodes() const noexcept = 0;
    [[nodiscard]] virtual const double* forces() const noexcept = 0;
    [[nodiscard]] virtual const Vector3<>& node_force(int k) const noexcept = 0;
    [[nodiscard]] virtual double layer_stiffness(int k) const noexcept = 0;
  };

  explicit AnyLocalContact(std::unique_ptr<Interface> contact) : contact_(std::move(contact)) {}

  const MultiTipResult& solve(const LocalModel& model, const TipPair& tips, double compliance_scale) noexcept {
    return contact_->solve(model, tips, compliance_scale);
  }
  void start_from(const LocalModel& model, const AnyLocalContact& other) noexcept { contact_->start_from(model, *other.contact_); }
  [[nodiscard]] const MultiTipResult& last() const noexcept { return contact_->last(); }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept { return contact_->contact_nodes(); }
  [[nodiscard]] const double* forces() const noexcept { return contact_->forces(); }
  [[nodiscard]] const Vector3<>& node_force(int k) const noexcept { return contact_->node_force(k); }
  [[nodiscard]] double layer_stiffness(int k) const noexcept { return contact_->layer_stiffness(k); }

 private:
  std::unique_ptr<Interface> contact_;
};

/// A QuasiStaticSolver, for MultirateCoupling and object::MultirateObject.
class AnyQuasiStaticSolver {
 public:
  using Contact = AnyLocalContact;

  AnyQuasiStaticSolver() = default;
  AnyQuasiStaticSolver(const AnyQuasiStaticSolver&) = delete;
  AnyQuasiStaticSolver& operator=(const AnyQuasiStaticSolver&) = delete;
  virtual ~AnyQuasiStaticSolver() = default;

  virtual ModelUpdateReport step(const TipPair& tips, LocalModel& to) = 0;
  [[nodiscard]] virtual AnyLocalContact make_contact() const = 0;
  /// Write the displacements of all points, 3 x point + axis, m.
  virtual void displacement(double* to) const = 0;
  /// Return the outward normal of the surface at the contact node that is nearest to a place [m].
  [[nodiscard]] virtual Vector3<> normal_near(const Vector3<>& place) const = 0;
  [[nodiscard]] virtual double energy() = 0;
  virtual void reset() = 0;
  /// For bodies with inertia or relaxation, see MultirateCoupling.
  virtual void set_clock(std::int64_t tick) = 0;
  virtual void set_static(bool is_static) = 0;
  /// Return a copy at rest with its own state.
  [[nodiscard]] virtual std::unique_ptr<AnyQuasiStaticSolver> clone_at_rest() const = 0;
};

/// Return the model compiled for the widest SIMD registers of this machine. The mesh must have a point that is not fixed.
/// Throws std::runtime_error where PALPATE_NATIVE_LANES compiled it for a processor with wider registers than this one.
std::unique_ptr<AnyHyperelasticModel> make_hyperelastic_model(HyperelasticLaw law, const TetMesh& mesh, const Relaxation& relaxation = {});

/// Return the solver compiled for the widest SIMD registers of this machine. The mesh must have a point that is not fixed.
/// Throws as make_hyperelastic_model() does.
std::unique_ptr<AnyQuasiStaticSolver> make_quasi_static_solver(HyperelasticLaw law, const TetMesh& mesh, const TetSurface& surface,
                                                               const SolverOptions& options);

}  // namespace palpate::deformable
