/// Python bindings of the linear deformable bodies in contact with a rigid tip. The loop over a path runs in C++.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/compliance.hpp>
#include <palpate/deformable/linear/mass_spring_model.hpp>
#include <palpate/deformable/linear/modal.hpp>
#include <palpate/deformable/linear/viscoelastic_solid.hpp>
#include <palpate/object/deformable_object.hpp>
#include <palpate/object/signed_distance_body.hpp>
#include <vector>

#include "body_arrays.hpp"
#include "body_in_loop.hpp"
#include "body_lanes.hpp"
#include "contact_rows.hpp"
#include "surface_frames.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace body_arrays;  // NOLINT(google-build-using-namespace)

namespace {

/// A body with its nodes and the contact of one tip.
template <class Kind>
struct BodyCore : BodyInLoop {
  palpate::deformable::SurfaceNodes nodes;
  Kind body;
  palpate::deformable::TipContact<Kind> contact;

  template <class Make>
  BodyCore(const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
           palpate::deformable::DryFriction friction, Make make)
      : nodes(fitting(at, normals, areas, compliance)), body(make(nodes)), contact(nodes, body, friction) {}

  BodyCore(palpate::deformable::SurfaceNodes at, Kind&& kind, palpate::deformable::DryFriction friction)
      : nodes(std::move(at)), body(std::move(kind)), contact(nodes, body, friction) {}

  [[nodiscard]] std::unique_ptr<palpate::object::DeformableObject> in_loop() const override {
    return std::make_unique<palpate::object::LinearBodyObject<Kind>>(nodes, body, contact.friction());
  }
};

/// Bind the functions that all models share.
template <class Kind>
nb::class_<BodyCore<Kind>, BodyInLoop> bind_kind(nb::module_& m, const char* name) {
  return nb::class_<BodyCore<Kind>, BodyInLoop>(m, name)
      .def(
          "simulate_path",
          [](BodyCore<Kind>& self, const Points& centers, const Points& outward, double radius, bool flat) {
            return step_path(self.contact, centers, outward, radius, flat);
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, path_text)
      .def(
          "step_durations",
          [](BodyCore<Kind>& self, const Points& centers, const Points& outward, double radius, bool flat) {
            return path_durations(self.contact, centers, outward, radius, flat);
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, durations_text)
      .def(
          "contact_forces", [](const BodyCore<Kind>& self) { return contact_forces(self.contact); },
          "Return the contact nodes of the last step and the forces along their inward normals, N.")
      .def(
          "friction_forces",
          [](const BodyCore<Kind>& self) {
            const auto n = static_cast<std::size_t>(self.contact.last().nodes);
            auto [forces, f] = new_array<double>({n, 3});
            for (std::size_t k = 0; k < n; ++k)
              Eigen::Map<palpate::math::Vector3<>>(f + 3 * k) = self.contact.tangential_force(self.contact.contact_nodes()[k]);
            return forces;
          },
          "Return the friction forces on the contact nodes of the last step (n, 3), N.")
      .def("reset", [](BodyCore<Kind>& self) { self.contact.reset(); })
      .def(
          "node_response",
          [](BodyCore<Kind>& self, std::int32_t node, const Numbers& forces) {
            if (node < 0 || node >= self.nodes.size()) throw nb::value_error("the node does not exist");
            auto [positions, x] = new_array<double>({forces.shape(0)});
            for (std::size_t k = 0; k < forces.shape(0); ++k) {
              x[k] = self.body.free_displacement(node) + self.body.compliance(node, node) * forces.data()[k];
              self.body.advance(&node, forces.data() + k, 1);
            }
            return positions;
          },
          "node"_a, "forces"_a,
          "Return the displacement of a node along its inward normal after each period, m. The forces [N] are constant over each period.");
}

void bind_mass_spring(nb::module_& m) {
  using palpate::deformable::MassSpringModel;
  bind_kind<MassSpringModel>(m, "MassSpringBody")
      .def(
          "__init__",
          [](BodyCore<MassSpringModel>* self, const Points& at, const Points& normals, const Numbers& areas, const Points& positions,
             const Numbers& masses, const Flags& fixed, const IndexRows<2>& springs, const Numbers& stiffness, const Numbers& rest_lengths,
             const Numbers& damping, const IndexRows<4>& tetrahedra, const Numbers& pressure, const Indices& begin, const Indices& vertices,
             const Numbers& shares, const Tensor& patch_compliance, double period, double alpha, double beta, double hardening_strain,
             double exponent, double stiffness_limit, double mu_static, double mu_dynamic, int lanes) {
            if (at.shape(0) == 0 || normals.shape(0) != at.shape(0) || areas.shape(0) != at.shape(0))
              throw nb::value_error("the sizes of the body's arrays do not match");
            palpate::deformable::SurfaceNodes nodes(points(at), points(normals), numbers(areas));
            auto parts = network_parts(positions, masses, fixed, springs, stiffness, rest_lengths, damping, tetrahedra, pressure);
            parts.law = spring_law(hardening_strain, exponent, stiffness_limit);
            MassSpringModel network(nodes, std::move(parts),
                                    network_patches(begin, vertices, shares, patch_compliance, at.shape(0), positions.shape(0)), period,
                                    alpha, beta, palpate::body::widest_spring_kernels(lanes));
            if (!network.definite()) throw nb::value_error("the masses and volumes of a network must be positive");
            new (self) BodyCore<MassSpringModel>(std::move(nodes), std::move(network), {mu_static, mu_dynamic});
          },
          "points"_a, "normals"_a, "areas"_a, "positions"_a, "masses"_a, "fixed"_a, "springs"_a, "stiffness"_a, "rest_lengths"_a,
          "damping"_a, "tetrahedra"_a, "pressure"_a, "patch_begin"_a, "patch_vertices"_a, "patch_weights"_a, "patch_compliance"_a,
          "period"_a, "rayleigh_alpha"_a, "rayleigh_beta"_a, "hardening_strain"_a = 0.0, "exponent"_a = 0.0, "stiffness_limit"_a = 1.0,
          "static_friction"_a = 0.0, "dynamic_friction"_a = 0.0, "lanes"_a = 0,
          "`lanes`: width of the registers as for run_cells, 0: the widest; the forces do not depend on it.")
      .def(
          "displacement",
          [](const BodyCore<MassSpringModel>& self) {
            return new_points(static_cast<std::size_t>(self.nodes.size()),
                              [&](std::size_t i) { return self.body.displacement(static_cast<std::int32_t>(i)); });
          },
          "Return the mean displacement of each node's patch (n, 3), m.")
      .def(
          "positions",
          [](const BodyCore<MassSpringModel>& self) {
            return new_points(self.body.vertices(), [&](std::size_t v) { return self.body.position(v); });
          },
          "Return the positions of the vertices (N, 3), m.")
      .def(
          "set_state",
          [](BodyCore<MassSpringModel>& self, const Points& positions, const Points& velocities) {
            if (positions.shape(0) != self.body.vertices() || velocities.shape(0) != positions.shape(0))
              throw nb::value_error("positions and velocities must have one row for each vertex of the network");
            self.body.set_state(points(positions).data(), points(velocities).data());
          },
          "positions"_a, "velocities"_a, "Set the positions (N, 3), m, and velocities (N, 3), m/s, of the vertices.")
      .def_prop_ro(
          "energy", [](const BodyCore<MassSpringModel>& self) { return self.body.energy(); }, "Kinetic plus stored energy, J.")
      .def_prop_ro(
          "limited_steps", [](const BodyCore<MassSpringModel>& self) { return self.body.limited_steps(); },
          "Number of periods whose speed was reduced to keep the energy from rising.");
}

struct SignedDistanceCore : BodyInLoop {
  std::unique_ptr<palpate::object::SignedDistanceBody> body;

  explicit SignedDistanceCore(std::unique_ptr<palpate::object::SignedDistanceBody> of) : body(std::move(of)) {}
  [[nodiscard]] std::unique_ptr<palpate::object::DeformableObject> in_loop() const override { return body->clone_at_rest(); }

  /// Force on a contact node along its inward normal, N.
  [[nodiscard]] double inward_force(std::size_t k) const {
    const auto c = static_cast<int>(k);
    return -body->node_force(c).dot(body->nodes().normal(body->contact().contact_node(c)));
  }
};

/// Step the tips of a body along their paths; see "simulate_tips".
auto step_tips(palpate::object::SignedDistanceBody& body, const Tensor& centers, const Points& axes, const Numbers& radii,
               const Numbers& lengths) {
  using palpate::deformable::SignedDistanceContact, palpate::deformable::TipGeometry;
  const SignedDistanceContact& contact = body.contact();
  const std::size_t n = centers.shape(0), count = static_cast<std::size_t>(contact.tip_count());
  for (const std::size_t size : {centers.shape(1), axes.shape(0), radii.shape(0), lengths.shape(0)})
    if (size != count) throw nb::value_error("the paths and shapes do not match the number of tips");
  auto [rows, row] = new_array<double>({n, count, result_width});
  const nb::gil_scoped_release unlocked;
  std::array<SignedDistanceContact::PlacedTip, static_cast<std::size_t>(SignedDistanceContact::max_tips)> tips;
  const auto list = points(axes);
  for (std::size_t t = 0; t < count; ++t) tips[t].shape = TipGeometry::capsule(radii.data()[t], lengths.data()[t], list[t]);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t t = 0; t < count; ++t)
      tips[t].center = Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * (count * i + t));
    body.step(tips.data());
    for (std::size_t t = 0; t < count; ++t, row += result_width) write_result(contact.last(static_cast<int>(t)), row);
  }
  return rows;
}

void bind_signed_distance(nb::module_& m) {
  nb::class_<SignedDistanceCore, BodyInLoop>(m, "SignedDistanceBody")
      .def(
          "__init__",
          [](SignedDistanceCore* self, const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
             const Points& vertices, const IndexRows<3>& triangles, const Indices& node, const Moduli& modulus, double poisson,
             const Matrix& shapes, const Numbers& frequencies, double period, double alpha, double beta, double instantaneous_ratio,
             double retardation_time, double sideways, int tips, double mu_static, double mu_dynamic, int lanes,
             const std::optional<Points>& contact_points) {
            using palpate::deformable::Compliance, palpate::deformable::SignedDistanceContact;
            auto nodes = fitting(at, normals, areas, compliance);
            if (modulus.shape(0) != at.shape(0)) throw nb::value_error("the sizes of the body's arrays do not match");
            if (frequencies.shape(0) > 0 && (shapes.shape(0) != compliance.shape(0) || shapes.shape(1) != frequencies.shape(0)))
              throw nb::value_error("the sizes of the modes do not match the compliance");
            if (tips < 1 || tips > SignedDistanceContact::max_tips ||
                (contact_points && contact_points->shape(0) > SignedDistanceContact::max_tips))
              throw nb::value_error("a body has 1 to 8 tips");
            auto surface = contact_surface(vertices, triangles, node, modulus);
            surface.poisson = poisson;
            const palpate::object::SignedDistanceOptions options{
                .sideways = sideways,
                .friction = {mu_static, mu_dynamic},
                .period = period,
                .modes = {shapes.data(), numbers(frequencies), alpha, beta},
                .instantaneous_ratio = instantaneous_ratio,
                .retardation_time = retardation_time,
                .tips = tips,
                .contact_points = contact_points ? points(*contact_points) : std::vector<palpate::math::Vector3<>>(),
            };
            new (self)
                SignedDistanceCore(palpate::body::make_signed_distance_body(std::move(nodes), compliance.data(), surface, options, lanes));
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "vertices"_a, "triangles"_a, "node"_a, "modulus"_a, "poisson"_a, "shapes"_a,
          "frequencies"_a, "period"_a = 1e-3, "rayleigh_alpha"_a = 0.0, "rayleigh_beta"_a = 0.0, "instantaneous_ratio"_a = 1.0,
          "retardation_time"_a = 1.0, "sideways"_a = 1.0, "tips"_a = 1, "static_friction"_a = 0.0, "dynamic_friction"_a = 0.0,
          "lanes"_a = 0, "contact_points"_a = nb::none(),
          "`lanes`: width of the registers as for run_cells, 0: the widest; the forces do not depend on it. `contact_points`: centers of "
          "the equal tips of a rigid tool less the center of a path (k, 3), m; none: one tip, or `tips` of `simulate_tips`.")
      .def(
          "simulate_path",
          [](SignedDistanceCore& self, const Points& centers, const Points& outward, double radius, bool flat,
             const std::optional<Tensor>& tool) { return step_path(*self.body, centers, outward, radius, flat, tool); },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, "tool"_a = nb::none(), tool_path_text)
      .def(
          "step_durations",
          [](SignedDistanceCore& self, const Points& centers, const Points& outward, double radius, bool flat) {
            return path_durations(*self.body, centers, outward, radius, flat);
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, durations_text)
      .def(
          "contact_forces",
          [](const SignedDistanceCore& self) {
            const auto n = static_cast<std::size_t>(self.body->contact().contact_count());
            auto [nodes, i] = new_array<std::int64_t>({n});
            auto [forces, f] = new_array<double>({n});
            for (std::size_t k = 0; k < n; ++k) i[k] = self.body->contact().contact_node(static_cast<int>(k));
            for (std::size_t k = 0; k < n; ++k) f[k] = self.inward_force(k);
            return nb::make_tuple(nodes, forces);
          },
          "Return the contact nodes of the last step and the forces along their inward normals, N.")
      .def(
          "friction_forces",
          [](const SignedDistanceCore& self) {
            return new_points(static_cast<std::size_t>(self.body->contact().contact_count()), [&](std::size_t k) {
              const palpate::math::Vector3<>& n = self.body->nodes().normal(self.body->contact().contact_node(static_cast<int>(k)));
              return palpate::math::Vector3<>(self.body->sideways() *
                                              (self.body->node_force(static_cast<int>(k)) + self.inward_force(k) * n));
            });
          },
          "Return the parts of the forces across the normals that load the body, at the contact nodes of the last step (n, 3), N.")
      .def(
          "simulate_tips",
          [](SignedDistanceCore& self, const Tensor& centers, const Points& axes, const Numbers& radii, const Numbers& lengths) {
            return step_tips(*self.body, centers, axes, radii, lengths);
          },
          "centers"_a, "axes"_a, "radii"_a, "lengths"_a,
          "Step all tips along their paths `centers` (m, tips, 3). A tip is a capsule of a length. "
          "Return rows as `simulate_path` for each step and tip (m, tips, 15).")
      .def_prop_ro(
          "has_memory", [](const SignedDistanceCore& self) { return self.body->has_memory(); },
          "Whether the force depends on the past: inertia or creep.")
      .def("reset", [](SignedDistanceCore& self) { self.body->reset(); });
}

}  // namespace

void bind_supports(nb::module_& m);
void bind_multirate(nb::module_& m);

void bind_body(nb::module_& m) {
  using palpate::deformable::Compliance, palpate::deformable::Modal, palpate::deformable::StandardLinearSolid;
  using palpate::object::ToolMotion;
  nb::class_<BodyInLoop>(m, "DeformableBody", "Interface of deformable bodies to a servo loop.");
  nb::class_<SurfaceFrames>(m, "SurfaceFrames", "Thread that computes the displacements of a body's surface during a servo loop.")
      .def(
          "__init__",
          [](SurfaceFrames* self, const Matrix& compliance, double rate) {
            const std::size_t n = compliance.shape(0) / 3;
            if (n == 0 || compliance.shape(0) != 3 * n || compliance.shape(1) != 3 * n || !(rate > 0.0))
              throw nb::value_error("a compliance has three rows and columns for each node, and a rate is positive");
            new (self) SurfaceFrames(n, compliance.data(), rate);
          },
          "compliance"_a, "rate"_a, nb::keep_alive<1, 2>(), "The compliance is not copied.")
      .def(
          "latest",
          [](SurfaceFrames& self) {
            const SurfaceFrames::Frame& frame = self.latest();
            auto [rows, data] = new_array<double>({self.size(), 3});
            std::copy(frame.displacement.begin(), frame.displacement.end(), data);
            return nb::make_tuple(frame.number, frame.tick, rows);
          },
          "Return the last frame: its number, the tick that it shows (-1: none yet), displacements of the nodes (n, 3), m.");
  nb::class_<ToolMotion>(m, "ToolMotion", "Tips of a tool that turns, opens and closes, relative to the device's tip.")
      .def(
          "__init__",
          [](ToolMotion* self, const Points& open, const Points& closed, const NumberRows<5>& rows) {
            if (closed.shape(0) != open.shape(0)) throw nb::value_error("each contact point has an open and a closed place");
            std::vector<ToolMotion::Row> motion;
            for (const double* r = rows.data(); r != rows.data() + rows.size(); r += 5)
              motion.push_back({r[0], {{r[1], r[2], r[3]}, r[4]}});
            new (self) ToolMotion(points(open), points(closed), std::move(motion));
          },
          "open"_a, "closed"_a, "rows"_a,
          "Places of the tips less the device's tip at the openings 1 and 0 (k, 3), m. Rows of increasing time, s; angles about x, then y, "
          "then z of the device, rad; opening.")
      .def(
          "places",
          [](const ToolMotion& self, const Numbers& times) {
            auto [array, out] = new_array<double>({times.shape(0), self.tips(), 3});
            std::vector<palpate::math::Vector3<>> centers(self.tips());
            for (std::size_t i = 0; i < times.shape(0); ++i) {
              self.place(self.pose(times.data()[i]), centers.data());
              for (const palpate::math::Vector3<>& center : centers) out = std::copy_n(center.data(), 3, out);
            }
            return array;
          },
          "times"_a, "Return the centers of the tips less the device's tip at times (m,), s: (m, k, 3), m.");
  nb::class_<PlacedBody>(m, "PlacedBody", "A body, its pose in the device frame, and the tip that touches it.")
      .def(nb::init<const BodyInLoop&, const palpate::math::Vector3<>&, const Eigen::Matrix3d&, double, bool>(), "body"_a, "origin"_a,
           "rotation"_a, "radius"_a, "flat"_a, nb::keep_alive<1, 2>())
      .def("set_tool", &PlacedBody::set_tool, "motion"_a, "Move the contact points of the body's tool.");
  bind_kind<Compliance>(m, "ComplianceBody")
      .def(
          "__init__",
          [](BodyCore<Compliance>* self, const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
             double mu_static, double mu_dynamic) {
            new (self) BodyCore<Compliance>(
                at, normals, areas, compliance, {mu_static, mu_dynamic},
                [&](const palpate::deformable::SurfaceNodes& nodes) { return Compliance(nodes, compliance.data(), mu_static > 0.0); });
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "static_friction"_a = 0.0, "dynamic_friction"_a = 0.0);
  bind_kind<Modal>(m, "ModalBody")
      .def(
          "__init__",
          [](BodyCore<Modal>* self, const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
             const Matrix& shapes, const Numbers& frequencies, double period, double alpha, double beta, double instantaneous_ratio,
             double retardation_time, double mu_static, double mu_dynamic) {
            if (shapes.shape(0) != compliance.shape(0) || shapes.shape(1) != frequencies.shape(0))
              throw nb::value_error("the sizes of the modes do not match the compliance");
            new (self) BodyCore<Modal>(at, normals, areas, compliance, {mu_static, mu_dynamic},
                                       [&](const palpate::deformable::SurfaceNodes& nodes) {
                                         return Modal(nodes, compliance.data(), shapes.data(), numbers(frequencies), period, alpha, beta,
                                                      instantaneous_ratio, retardation_time, mu_static > 0.0);
                                       });
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "shapes"_a, "frequencies"_a, "period"_a, "rayleigh_alpha"_a,
          "rayleigh_beta"_a, "instantaneous_ratio"_a = 1.0, "retardation_time"_a = 1.0, "static_friction"_a = 0.0,
          "dynamic_friction"_a = 0.0);
  bind_kind<StandardLinearSolid>(m, "StandardLinearSolidBody")
      .def(
          "__init__",
          [](BodyCore<StandardLinearSolid>* self, const Points& at, const Points& normals, const Numbers& areas, const Matrix& compliance,
             double instantaneous_ratio, double retardation_time, double period, double mu_static, double mu_dynamic) {
            new (self) BodyCore<StandardLinearSolid>(at, normals, areas, compliance, {mu_static, mu_dynamic},
                                                     [&](const palpate::deformable::SurfaceNodes& nodes) {
                                                       return StandardLinearSolid(Compliance(nodes, compliance.data(), mu_static > 0.0),
                                                                                  instantaneous_ratio, retardation_time, period);
                                                     });
          },
          "points"_a, "normals"_a, "areas"_a, "compliance"_a, "instantaneous_ratio"_a, "retardation_time"_a, "period"_a,
          "static_friction"_a = 0.0, "dynamic_friction"_a = 0.0);
  bind_signed_distance(m);
  bind_mass_spring(m);
  bind_supports(m);
  bind_multirate(m);
}
