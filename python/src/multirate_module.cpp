/// Python bindings of the linear bodies whose model is updated at a low rate.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <chrono>
#include <memory>
#include <palpate/deformable/linear/compliance.hpp>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <palpate/deformable/linear/modal.hpp>
#include <palpate/deformable/linear/viscoelastic_solid.hpp>
#include <palpate/deformable/multirate/linear_body_solver.hpp>
#include <palpate/deformable/multirate/linear_local_slip.hpp>
#include <palpate/object/multirate_object.hpp>
#include <utility>

#include "body_arrays.hpp"
#include "body_in_loop.hpp"
#include "body_lanes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using namespace body_arrays;
using palpate::deformable::Compliance, palpate::deformable::DryFriction, palpate::deformable::LinearBodySolver,
    palpate::deformable::LinearLocalSlip, palpate::deformable::MassSpringModel, palpate::deformable::Modal,
    palpate::deformable::StandardLinearSolid, palpate::deformable::SurfaceNodes, palpate::deformable::TangentialCompliance,
    palpate::deformable::Tip;

/// A linear body with one tip and synchronous model updates.
struct MultirateCore : BodyInLoop {
  std::unique_ptr<SurfaceNodes> nodes;
  std::unique_ptr<palpate::object::DeformableObject> body;
  bool initialized = false;

  /// Return a body that the caller owns.
  template <class Model, class Make>
  static MultirateCore* of(SurfaceNodes at, const Make& make, double period, int update_interval, DryFriction friction = {},
                           const float* full = nullptr) {
    if (update_interval < 1 || !(period > 0.0)) throw nb::value_error("period and update_interval must be positive");
    auto core = std::make_unique<MultirateCore>();
    core->nodes = std::make_unique<SurfaceNodes>(std::move(at));
    const SurfaceNodes& nodes = *core->nodes;
    using Solver = LinearBodySolver<Model>;
    auto solver = std::make_unique<Solver>(nodes, [&](double tick) { return make(nodes, tick); }, period, update_interval);
    LinearLocalSlip slip;
    if (friction) slip = LinearLocalSlip(friction, nodes, TangentialCompliance(nodes, full));
    core->body =
        std::make_unique<palpate::object::MultirateObject<Solver, LinearLocalSlip>>(std::move(solver), update_interval, std::move(slip));
    return core.release();
  }

  [[nodiscard]] std::unique_ptr<palpate::object::DeformableObject> in_loop() const override { return body->clone_at_rest(); }

  [[nodiscard]] palpate::math::Vector3<> outward(const Tip& tip) const { return body->outward(tip); }
  const palpate::deformable::ContactResult& step(const Tip& tip) {
    start(tip);
    const palpate::deformable::ContactResult& result = body->step(tip);
    body->step_synchronously();
    return result;
  }
  /// Step. Return the duration without that of the update, s.
  double time_step(const Tip& tip) {
    start(tip);
    const auto begin = std::chrono::steady_clock::now();
    body->step(tip);
    const auto end = std::chrono::steady_clock::now();
    body->step_synchronously();
    return std::chrono::duration<double>(end - begin).count();
  }
  /// Force on a contact node along its inward normal, N.
  [[nodiscard]] double inward_force(std::size_t k) const {
    return -body->node_force(static_cast<int>(k)).dot(nodes->normal(body->contact_nodes()[k]));
  }

 private:
  void start(const Tip& tip) {
    if (!initialized) body->initialize(tip);
    initialized = true;
  }
};

MultirateCore* spring_body(const Points& at, const Points& normals, const Numbers& areas, const Points& positions, const Numbers& masses,
                           const Flags& fixed, const IndexRows<2>& springs, const Numbers& stiffness, const Numbers& rest_lengths,
                           const Numbers& damping, const IndexRows<4>& tetrahedra, const Numbers& pressure, const Indices& begin,
                           const Indices& vertices, const Numbers& shares, const Tensor& patch_compliance, const Matrix& compliance,
                           double period, double alpha, double beta, double hardening_strain, double exponent, double stiffness_limit,
                           double mu_static, double mu_dynamic, int update_interval) {
  if (at.shape(0) == 0 || normals.shape(0) != at.shape(0) || areas.shape(0) != at.shape(0))
    throw nb::value_error("the sizes of the body's arrays do not match");
  if (mu_static > 0.0 && (compliance.shape(0) != 3 * at.shape(0) || compliance.shape(1) != compliance.shape(0)))
    throw nb::value_error("friction needs the compliance of all nodes");
  auto parts = network_parts(positions, masses, fixed, springs, stiffness, rest_lengths, damping, tetrahedra, pressure);
  parts.law = spring_law(hardening_strain, exponent, stiffness_limit);
  const auto make = [&](const SurfaceNodes& nodes, double tick) {
    MassSpringModel network(nodes, parts, network_patches(begin, vertices, shares, patch_compliance, at.shape(0), positions.shape(0)), tick,
                            alpha, beta, palpate::body::widest_spring_kernels(0));
    if (!network.definite()) throw nb::value_error("the masses and volumes of a network must be positive");
    return network;
  };
  return MultirateCore::of<MassSpringModel>({points(at), points(normals), numbers(areas)}, make, period, update_interval,
                                            {mu_static, mu_dynamic}, compliance.data());
}

}  // namespace

void bind_multirate(nb::module_& m) {
  nb::class_<MultirateCore, BodyInLoop>(m, "MultirateBody", "Linear body whose model is updated at a low rate, after the ticks.")
      .def_static("mass_spring", &spring_body, "points"_a, "normals"_a, "areas"_a, "positions"_a, "masses"_a, "fixed"_a, "springs"_a,
                  "stiffness"_a, "rest_lengths"_a, "damping"_a, "tetrahedra"_a, "pressure"_a, "patch_begin"_a, "patch_vertices"_a,
                  "patch_weights"_a, "patch_compliance"_a, "compliance"_a, "period"_a, "rayleigh_alpha"_a, "rayleigh_beta"_a,
                  "hardening_strain"_a = 0.0, "exponent"_a = 0.0, "stiffness_limit"_a = 1.0, nb::kw_only(), "static_friction"_a,
                  "dynamic_friction"_a, "update_interval"_a, "`compliance`: static, of the nodes, for friction only.")
      .def_static(
          "modal",
          [](const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance, const Matrix& shapes,
             const Numbers& frequencies, double period, double alpha, double beta, double instantaneous_ratio, double retardation_time,
             double mu_static, double mu_dynamic, int update_interval) {
            if (shapes.shape(0) != compliance.shape(0) || shapes.shape(1) != frequencies.shape(0))
              throw nb::value_error("the sizes of the modes do not match the compliance");
            const auto make = [&](const SurfaceNodes& nodes, double tick) {
              return Modal(nodes, compliance.data(), shapes.data(), numbers(frequencies), tick, alpha, beta, instantaneous_ratio,
                           retardation_time);
            };
            return MultirateCore::of<Modal>(fitting(at, normals, areas, compliance), make, period, update_interval, {mu_static, mu_dynamic},
                                            compliance.data());
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "shapes"_a, "frequencies"_a, "period"_a, "rayleigh_alpha"_a,
          "rayleigh_beta"_a, "instantaneous_ratio"_a, "retardation_time"_a, "static_friction"_a, "dynamic_friction"_a, "update_interval"_a)
      .def_static(
          "viscoelastic",
          [](const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance, double instantaneous_ratio,
             double retardation_time, double period, double mu_static, double mu_dynamic, int update_interval) {
            const auto make = [&](const SurfaceNodes& nodes, double tick) {
              return StandardLinearSolid(Compliance(nodes, compliance.data()), instantaneous_ratio, retardation_time, tick);
            };
            return MultirateCore::of<StandardLinearSolid>(fitting(at, normals, areas, compliance), make, period, update_interval,
                                                          {mu_static, mu_dynamic}, compliance.data());
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "instantaneous_ratio"_a, "retardation_time"_a, "period"_a,
          "static_friction"_a, "dynamic_friction"_a, "update_interval"_a)
      .def(
          "simulate_path",
          [](MultirateCore& self, const Points& centers, const Points& outward, double radius, bool flat) {
            return step_path(self, centers, outward, radius, flat);
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, path_text)
      .def(
          "step_durations",
          [](MultirateCore& self, const Points& centers, const Points& outward, double radius, bool flat) {
            const std::size_t n = centers.shape(0);
            if (outward.shape(0) != n) throw nb::value_error("the path needs one direction for each position");
            auto [seconds, s] = new_array<double>({n});
            const nb::gil_scoped_release unlocked;
            for (std::size_t i = 0; i < n; ++i)
              s[i] = self.time_step(tip_of(radius, flat, Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * i),
                                           Eigen::Map<const palpate::math::Vector3<>>(outward.data() + 3 * i)));
            return seconds;
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a,
          "Return the duration of each step without the model updates, s, including the clock's own.")
      .def(
          "contact_forces",
          [](const MultirateCore& self) {
            const auto n = static_cast<std::size_t>(self.body->last().nodes);
            auto [nodes, i] = new_array<std::int64_t>({n});
            auto [forces, f] = new_array<double>({n});
            for (std::size_t k = 0; k < n; ++k) i[k] = self.body->contact_nodes()[k];
            for (std::size_t k = 0; k < n; ++k) f[k] = self.inward_force(k);
            return nb::make_tuple(nodes, forces);
          },
          "Return the contact nodes of the last step and the forces along their inward normals, N.")
      .def(
          "friction_forces",
          [](const MultirateCore& self) {
            const auto n = static_cast<std::size_t>(self.body->last().nodes);
            auto [forces, f] = new_array<double>({n, 3});
            for (std::size_t k = 0; k < n; ++k)
              Eigen::Map<palpate::math::Vector3<>>(f + 3 * k) =
                  self.body->node_force(static_cast<int>(k)) + self.inward_force(k) * self.nodes->normal(self.body->contact_nodes()[k]);
            return forces;
          },
          "Return the friction forces on the contact nodes of the last step (n, 3), N.")
      .def_prop_ro(
          "tank_energy", [](const MultirateCore& self) { return self.body->last().tank_energy; },
          "Level of the energy tank after the last step, J.")
      .def("reset", [](MultirateCore& self) {
        self.body = self.body->clone_at_rest();
        self.initialized = false;
      });
}
