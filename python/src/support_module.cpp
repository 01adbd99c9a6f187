/// Python binding of linear bodies whose supports and touched nodes change.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <palpate/object/supported_body.hpp>
#include <utility>
#include <vector>

#include "body_arrays.hpp"
#include "body_in_loop.hpp"
#include "body_lanes.hpp"
#include "support_nodes.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace body_arrays;  // NOLINT(google-build-using-namespace)

namespace {

using palpate::object::BodyWithSupports, palpate::object::NormalContactPhase, palpate::object::SupportedBody;

struct SupportedCore : BodyInLoop {
  std::unique_ptr<BodyWithSupports> body;
  std::vector<palpate::math::Vector3<>> normals;

  [[nodiscard]] std::unique_ptr<palpate::object::DeformableObject> in_loop() const override { return body->clone_at_rest(); }
};

std::shared_ptr<palpate::deformable::CondensedSurface> condensed(const Points& at, const Points& normals, const Numbers& areas,
                                                                 const Matrix& compliance) {
  const std::size_t n = at.shape(0);
  if (n == 0 || normals.shape(0) != n || areas.shape(0) != n || compliance.shape(0) != 3 * n || compliance.shape(1) != 3 * n)
    throw nb::value_error("the sizes of the body's arrays do not match");
  auto surface = std::make_shared<palpate::deformable::CondensedSurface>();
  surface->points = points(at);
  surface->normals = points(normals);
  surface->areas = numbers(areas);
  surface->compliance.assign(compliance.data(), compliance.data() + compliance.size());
  return surface;
}

using Roles = nb::ndarray<const std::uint8_t, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using Role = nb::ndarray<const std::uint8_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

std::vector<BodyWithSupports::Change> changes_of(const std::vector<std::int64_t>& steps, const Roles& roles, std::size_t count) {
  if (steps.empty() || steps.front() != 0 || roles.shape(0) != steps.size() || roles.shape(1) != count ||
      std::adjacent_find(steps.begin(), steps.end(), [](std::int64_t a, std::int64_t b) { return a >= b; }) != steps.end())
    throw nb::value_error("the phases begin at increasing steps from 0 on, with a role for each node");
  std::vector<BodyWithSupports::Change> changes;
  for (std::size_t p = 0; p < steps.size(); ++p) changes.push_back({steps[p], support_nodes(roles.data() + p * count, count)});
  return changes;
}

void require(bool possible) {
  if (!possible) throw nb::value_error("the compliance of the held nodes is singular to rounding; hold fewer nodes");
}

}  // namespace

void bind_supports(nb::module_& m) {
  nb::class_<SupportedCore, BodyInLoop>(m, "SupportedBody", "A linear body whose supports and touched nodes change.")
      .def(
          "__init__",
          [](SupportedCore* self, const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
             const std::vector<std::int64_t>& steps, const Roles& roles) {
            auto body = std::make_unique<SupportedBody<NormalContactPhase>>(
                condensed(at, normals, areas, compliance), changes_of(steps, roles, at.shape(0)), NormalContactPhase::Maker());
            require(body->usable());
            new (self) SupportedCore();
            self->body = std::move(body);
            self->normals = points(normals);
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "steps"_a, "roles"_a,
          "`steps`: first step of each phase. `roles`: of each node in each phase, 0: deforms only, 1: touched, 2: held.")
      .def(
          "__init__",
          [](SupportedCore* self, const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
             const std::vector<std::int64_t>& steps, const Roles& roles, const Points& vertices, const IndexRows<3>& triangles,
             const Indices& node, const Moduli& modulus, double poisson, double sideways, int lanes,
             const std::optional<Points>& contact_points, double mu_static, double mu_dynamic, double period, double instantaneous_ratio,
             double retardation_time, const std::optional<Matrix>& shapes, const std::optional<Numbers>& frequencies, double alpha,
             double beta) {
            const std::size_t modes = shapes ? shapes->shape(1) : 0;
            if (modulus.shape(0) != at.shape(0) || (frequencies ? frequencies->shape(0) : 0) != modes ||
                (modes > 0 && (shapes->shape(0) != 3 * at.shape(0) || instantaneous_ratio > 1.0)) ||
                (contact_points && contact_points->shape(0) > palpate::deformable::SignedDistanceContact::max_tips))
              throw nb::value_error("the sizes of the body's arrays do not match");
            auto surface = contact_surface(vertices, triangles, node, modulus);
            surface.poisson = poisson;
            const palpate::object::SignedDistanceOptions options{
                .sideways = sideways,
                .friction = {mu_static, mu_dynamic},
                .period = period,
                .modes = {.rayleigh_alpha = alpha, .rayleigh_beta = beta},
                .instantaneous_ratio = instantaneous_ratio,
                .retardation_time = retardation_time,
                .contact_points = contact_points ? points(*contact_points) : std::vector<palpate::math::Vector3<>>(),
            };
            auto nodes = condensed(at, normals, areas, compliance);
            if (modes > 0) {
              nodes->shapes.assign(shapes->data(), shapes->data() + shapes->size());
              nodes->frequencies = numbers(*frequencies);
            }
            auto body = palpate::body::make_supported_signed_distance(std::move(nodes), changes_of(steps, roles, at.shape(0)), surface,
                                                                      options, lanes);
            require(body != nullptr);
            new (self) SupportedCore();
            self->body = std::move(body);
            self->normals = points(normals);
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "steps"_a, "roles"_a, "vertices"_a, "triangles"_a, "node"_a, "modulus"_a,
          "poisson"_a, "sideways"_a = 1.0, "lanes"_a = 0, "contact_points"_a = nb::none(), "static_friction"_a = 0.0,
          "dynamic_friction"_a = 0.0, "period"_a = 1e-3, "instantaneous_ratio"_a = 1.0, "retardation_time"_a = 1.0, "shapes"_a = nb::none(),
          "frequencies"_a = nb::none(), "rayleigh_alpha"_a = 0.0, "rayleigh_beta"_a = 0.0,
          "The same with contact by signed distance; a standard linear solid if `instantaneous_ratio` exceeds 1. With the `shapes` (3n, m) "
          "and `frequencies` of modes it has inertia; it does not relax then.")
      .def(
          "simulate_path",
          [](SupportedCore& self, const Points& centers, const Points& outward, double radius, bool flat,
             const std::optional<Tensor>& tool) { return step_path(*self.body, centers, outward, radius, flat, tool); },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, "tool"_a = nb::none(), tool_path_text)
      .def(
          "step_durations",
          [](SupportedCore& self, const Points& centers, const Points& outward, double radius, bool flat) {
            return path_durations(*self.body, centers, outward, radius, flat);
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, durations_text)
      .def(
          "contact_forces",
          [](const SupportedCore& self) {
            const auto n = static_cast<std::size_t>(self.body->contact_count());
            auto [nodes, i] = new_array<std::int64_t>({n});
            auto [forces, f] = new_array<double>({n});
            for (std::size_t k = 0; k < n; ++k) {
              i[k] = self.body->contact_nodes()[k];
              f[k] = -self.body->node_force(static_cast<int>(k)).dot(self.normals[static_cast<std::size_t>(i[k])]);
            }
            return nb::make_tuple(nodes, forces);
          },
          "Return the contact nodes of the last step and the forces along their inward normals, N.")
      .def(
          "displacement",
          [](SupportedCore& self) {
            auto [array, u] = new_array<double>({self.body->size(), 3});
            self.body->displacement(u);
            return array;
          },
          "Return the displacement of each node after the last step (n, 3), m.")
      .def(
          "change_supports",
          [](SupportedCore& self, const Role& role) {
            if (role.shape(0) != self.body->size()) throw nb::value_error("each node has one role");
            require(self.body->change_supports(support_nodes(role.data(), role.shape(0))));
          },
          "role"_a, "Change the roles of the nodes at the next step: 0: deforms only, 1: touched, 2: held.")
      .def_prop_ro(
          "has_memory", [](const SupportedCore& self) { return self.body->has_memory(); }, "Whether the body creeps or swings.")
      .def_prop_ro(
          "changes", [](const SupportedCore& self) { return self.body->changes(); }, "Number of changes since the body was at rest.")
      .def("reset", [](SupportedCore& self) { self.body->reset(); });
}
