#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/compliance.hpp"
#include "palpate/deformable/linear/mass_spring_model.hpp"
#include "palpate/deformable/linear/modal.hpp"
#include "palpate/deformable/linear/viscoelastic_solid.hpp"
#include "palpate/deformable/multirate/linear_body_solver.hpp"
#include "palpate/deformable/multirate/linear_local_slip.hpp"
#include "palpate/object/any_object.hpp"
#include "palpate/object/body_instance.hpp"
#include "palpate/object/deformable_object.hpp"
#include "palpate/object/mesh_object.hpp"
#include "palpate/object/moving_frame.hpp"
#include "palpate/object/multirate_object.hpp"
#include "palpate/object/scene.hpp"
#include "palpate/object/signed_distance_body.hpp"
#include "palpate/object/spring_wall.hpp"
#include "palpate/object/supported_body.hpp"
#include "palpate/object/tool_motion.hpp"
#include "palpate/servo/config_force_objects.hpp"
#include "palpate/servo/config_reader.hpp"
#if defined(PALPATE_HYPERELASTIC)
#include "palpate/deformable/hyperelastic/compiled_solver.hpp"
#endif

namespace palpate::servo::detail {

[[nodiscard]] inline object::AnyObject read_spring_wall(const Section& from) {
  using Kind = object::SpringWallKind;
  using Difference = object::CouplingDifference;
  constexpr std::array kinds = {Kind::none, Kind::point, Kind::half_space};
  object::SpringWallParameters p;
  p.kind = kinds[from.choice("shape", {"none", "point", "half_space"})];
  p.point = from.vector("point");
  p.normal = from.vector("normal");
  p.stiffness = from.vector("stiffness");
  p.damping = from.vector("damping");
  p.difference = from.choice("difference", {"backward", "bilinear"}) == 0 ? Difference::backward : Difference::bilinear;
  return object::SpringWall(p);
}

/// Return rows of indices from 0 to `below` - 1.
template <std::size_t width>
[[nodiscard]] std::vector<std::array<std::int32_t, width>> read_indices(const Section& from, const char* key, std::size_t below) {
  const std::vector<std::int32_t> flat = from.blob<std::int32_t>(key, -1, static_cast<std::int64_t>(width));
  std::vector<std::array<std::int32_t, width>> out(flat.size() / width);
  for (std::size_t i = 0; i < flat.size(); ++i) {
    if (flat[i] < 0 || static_cast<std::size_t>(flat[i]) >= below) {
      from.fail(key, "holds the index " + std::to_string(flat[i]) + ", which does not exist");
      return {};
    }
    out[i / width][i % width] = flat[i];
  }
  return out;
}

[[nodiscard]] inline object::AnyObject read_mesh(ConfigReader& reader, const Section& from) {
  const double radius = from.number("radius", 0.0, 1e3);
  const bool open = from.flag("open");
  std::vector<Vector3<>> vertices = from.points("vertices");
  std::vector<mesh::Triangle> triangles = read_indices<3>(from, "triangles", vertices.size());
  const Section laid = from.section("surface");
  mesh::Surface surface;
  surface.stiffness = laid.blob<double>("stiffness", -1, 1);
  surface.damping = laid.blob<double>("damping", -1, 1);
  surface.tangential = laid.number("tangential");
  surface.static_friction = laid.nonnegative_or_infinite("static_friction");
  surface.dynamic_friction = laid.nonnegative_or_infinite("dynamic_friction");
  surface.viscous = laid.number("viscous");
  surface.field = laid.choice("field", {"discrete", "continuous"}) == 0 ? mesh::FieldKind::discrete : mesh::FieldKind::continuous;
  surface.shading = laid.number("shading");
  surface.period = laid.number("period", 1e-9, 1e3);
  if (!reader.ok()) return {};
  mesh::TriangleMesh mesh(std::move(vertices), std::move(triangles), open);
  if (!mesh.usable()) {
    from.fail("triangles", "do not form a usable mesh");
    return {};
  }
  object::MeshModel model = object::MeshModel::make(std::move(mesh), surface);
  if (!model) {
    from.fail("surface", "does not fit the mesh");
    return {};
  }
  return object::MeshObject(std::move(model), radius);
}

/// A linear body with the nodes that it refers to.
template <class Model>
struct OwningBody {
  deformable::SurfaceNodes nodes;
  object::LinearBodyObject<Model> body;

  OwningBody(deformable::SurfaceNodes at, const Model& model, deformable::DryFriction friction)
      : nodes(std::move(at)), body(nodes, model, friction) {}
};

/// Return a body that owns its nodes; copies at rest refer to the same nodes, so the placement must keep this one.
template <class Model>
[[nodiscard]] std::shared_ptr<const object::DeformableObject> own(deformable::SurfaceNodes nodes, const Model& model,
                                                                  deformable::DryFriction friction) {
  const auto owner = std::make_shared<const OwningBody<Model>>(std::move(nodes), model, friction);
  return {owner, &owner->body};
}

/// A linear body at two rates with the nodes that it refers to.
template <class Model>
struct OwningMultirateBody {
  using Solver = deformable::LinearBodySolver<Model>;
  deformable::SurfaceNodes nodes;
  object::MultirateObject<Solver, deformable::LinearLocalSlip> body;

  template <class Make>
  OwningMultirateBody(deformable::SurfaceNodes at, const Make& make, double period, int interval, deformable::DryFriction friction,
                      const float* full)
      : nodes(std::move(at)),
        body(std::make_unique<Solver>(
                 nodes, [&](double tick) { return make(nodes, tick); }, period, interval),
             interval,
             friction ? deformable::LinearLocalSlip(friction, nodes, deformable::TangentialCompliance(nodes, full))
                      : deformable::LinearLocalSlip()) {}
};

/// Return a body of the model that `make(nodes, period)` returns, at two rates if the section has an update interval. `full` is its
/// compliance, for friction at two rates.
template <class Model, class Make>
[[nodiscard]] std::shared_ptr<const object::DeformableObject> own(ConfigReader& reader, const Section& from, deformable::SurfaceNodes nodes,
                                                                  const Make& make, double period, deformable::DryFriction friction,
                                                                  const float* full) {
  {
    const Model model = make(nodes, period);
    if constexpr (requires { model.definite(); })
      if (!model.definite()) {
        from.fail("masses", "and volumes of a network must be positive");
        return nullptr;
      }
    if (!from.has("update_interval")) return own(std::move(nodes), model, friction);
  }
  const auto interval = static_cast<int>(from.integer("update_interval", 1, 1'000'000));
  if (!reader.ok()) return nullptr;
  const auto owner = std::make_shared<const OwningMultirateBody<Model>>(std::move(nodes), make, period, interval, friction, full);
  return {owner, &owner->body};
}

[[nodiscard]] inline std::vector<double> read_frequencies(const Section& from) {
  std::vector<double> out = from.blob<double>("frequencies", -1, 1);
  const bool in_range = std::all_of(out.begin(), out.end(), [](double w) { return w > 1e-9 && w < 1e9; });
  if (out.empty() || !in_range) from.fail("frequencies", "must hold at least one mode, and numbers from 1e-9 to 1e9 rad/s only");
  return out;
}

/// Return the law of springs: cubic with "hardening_strain", exponential with "exponent", linear with neither.
[[nodiscard]] inline deformable::SpringLaw read_spring_law(const Section& from) {
  using Kind = deformable::SpringLaw::Kind;
  const bool cubic = from.has("hardening_strain"), exponential = from.has("exponent");
  if (!cubic && !exponential) return {};
  const double limit = from.number("stiffness_limit", 1.0, 100.0);
  if (cubic && exponential) from.fail("exponent", "does not go with hardening_strain");
  if (cubic) return {Kind::cubic, from.number("hardening_strain", 1e-3, 1e3), limit};
  const double exponent = from.number("exponent", -1e3, 1e3);
  if (!(std::abs(exponent) >= 1e-3)) from.fail("exponent", "must not be zero");
  return {Kind::exponential, exponent, limit};
}

[[nodiscard]] inline deformable::SpringNetworkData read_network(const Section& from) {
  deformable::SpringNetworkData out;
  out.rest_positions = from.points("positions");
  const std::size_t count = out.rest_positions.size();
  const auto vertices = static_cast<std::int64_t>(count);
  out.masses = from.blob<double>("masses", vertices, 1);
  out.fixed = from.blob<std::uint8_t>("fixed", vertices, 1);
  out.springs = read_indices<2>(from, "springs", count);
  out.stiffness = from.blob<double>("stiffness", static_cast<std::int64_t>(out.springs.size()), 1);
  out.tetrahedra = read_indices<4>(from, "tetrahedra", count);
  out.pressure = from.blob<double>("pressure", vertices, 1);
  const auto springs = static_cast<std::int64_t>(out.springs.size());
  if (from.has("rest_lengths")) out.rest_lengths = from.blob<double>("rest_lengths", springs, 1);
  if (from.has("damping")) out.damping = from.blob<double>("damping", springs, 1);
  const auto not_positive = [](double length) { return !(length > 0.0); };
  const auto negative = [](double damper) { return !(damper >= 0.0); };
  if (std::any_of(out.rest_lengths.begin(), out.rest_lengths.end(), not_positive)) from.fail("rest_lengths", "must be positive");
  if (std::any_of(out.damping.begin(), out.damping.end(), negative)) from.fail("damping", "must not be negative");
  out.law = read_spring_law(from);
  return out;
}

[[nodiscard]] inline deformable::PatchWeights read_patches(ConfigReader& reader, const Section& from, std::int64_t nodes,
                                                           std::size_t vertices) {
  deformable::PatchWeights out;
  out.begin = from.blob<std::int32_t>("patch_begin", nodes + 1, 1);
  out.weights = from.blob<double>("patch_weights", -1, 1);
  const auto entries = static_cast<std::int64_t>(out.weights.size());
  for (const auto& row : read_indices<1>(from, "patch_vertices", vertices)) out.vertices.push_back(row[0]);
  const std::vector<double> compliance = from.blob<double>("patch_compliance", 3 * nodes, 3);
  for (std::size_t k = 0; k + 9 <= compliance.size(); k += 9)
    out.compliance.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(compliance.data() + k));
  if (!reader.ok()) return out;
  if (static_cast<std::int64_t>(out.vertices.size()) != entries || out.begin.front() != 0 || out.begin.back() != entries ||
      !std::is_sorted(out.begin.begin(), out.begin.end()))
    from.fail("patch_begin", "does not fit the patches' vertices and weights");
  const auto stiff = [](const Matrix3<>& each) { return Eigen::LLT<Matrix3<>>(each).info() == Eigen::Success; };
  if (!std::all_of(out.compliance.begin(), out.compliance.end(), stiff)) from.fail("patch_compliance", "is not positive definite");
  return out;
}

/// Read the modulus of the layer of each node under round tips and under flat ends.
[[nodiscard]] inline std::vector<deformable::LayerModulus> read_layer_moduli(const Section& from, std::int64_t nodes) {
  std::vector<deformable::LayerModulus> out;
  const std::vector<double> modulus = from.blob<double>("modulus", nodes, 2);
  if (std::any_of(modulus.begin(), modulus.end(), [](double each) { return !(each > 0.0 && each < 1e15); }))
    from.fail("modulus", "must hold numbers from 0 to 1e15 Pa");
  for (std::size_t i = 0; i + 1 < modulus.size(); i += 2) out.push_back({modulus[i], modulus[i + 1]});
  return out;
}

#if defined(PALPATE_HYPERELASTIC)
/// Return positive elastic constants of each tetrahedron, and fail if a tetrahedron has no volume.
[[nodiscard]] inline deformable::TetMesh read_tetrahedra(ConfigReader& reader, const Section& from) {
  deformable::TetMesh out;
  out.points = from.points("points");
  out.tetrahedra = read_indices<4>(from, "tetrahedra", out.points.size());
  const auto count = static_cast<std::int64_t>(out.tetrahedra.size());
  out.shear = from.blob<double>("shear", count, 1);
  out.lame = from.blob<double>("lame", count, 1);
  for (const std::uint8_t fixed : from.blob<std::uint8_t>("fixed", static_cast<std::int64_t>(out.points.size()), 1))
    out.fixed.push_back(fixed != 0);
  if (!reader.ok()) return out;
  if (std::find(out.fixed.begin(), out.fixed.end(), false) == out.fixed.end()) from.fail("fixed", "leaves no free point");
  for (const auto& t : out.tetrahedra) {
    const auto edge = [&](std::size_t corner) {
      return Vector3<>(out.points[static_cast<std::size_t>(t[corner])] - out.points[static_cast<std::size_t>(t[0])]);
    };
    if (!(edge(1).cross(edge(2)).dot(edge(3)) > 0.0)) from.fail("tetrahedra", "holds one without volume, or turned inside out");
  }
  const auto positive = [](double modulus) { return modulus > 0.0 && modulus < 1e15; };
  if (out.tetrahedra.empty() || !std::all_of(out.shear.begin(), out.shear.end(), positive)) from.fail("shear", "must be positive");
  if (!std::all_of(out.lame.begin(), out.lame.end(), [](double modulus) { return modulus >= 0.0 && modulus < 1e15; }))
    from.fail("lame", "must not be negative");
  return out;
}

[[nodiscard]] inline deformable::TetSurface read_tet_surface(ConfigReader& reader, const Section& from, std::size_t points) {
  deformable::TetSurface out;
  for (const auto& row : read_indices<1>(from, "node_points", points)) out.point.push_back(row[0]);
  out.triangles = read_indices<3>(from, "triangles", points);
  if (reader.ok() && out.point.empty()) from.fail("node_points", "is empty");
  out.modulus = read_layer_moduli(from, static_cast<std::int64_t>(out.point.size()));
  return out;
}

[[nodiscard]] inline std::shared_ptr<const object::DeformableObject> read_hyperelastic(ConfigReader& reader, const Section& from,
                                                                                       deformable::DryFriction friction) {
  using Body = object::MultirateObject<deformable::AnyQuasiStaticSolver>;
  const auto law = from.choice("law", {"neo-hookean", "corotational"}) == 0 ? deformable::HyperelasticLaw::neo_hookean
                                                                            : deformable::HyperelasticLaw::corotational;
  deformable::SolverOptions options;
  options.nodes_per_tip = static_cast<int>(from.integer("nodes_per_tip", 4, 64));
  const auto interval = static_cast<int>(from.integer("update_interval", 1, 1'000'000));
  if (from.has("density")) {
    options.inertia.density = from.positive("density");
    options.inertia.rayleigh_alpha = from.number("rayleigh_alpha", 0.0, 1e9);
    options.inertia.rayleigh_beta = from.number("rayleigh_beta", 0.0, 1e9);
  }
  if (from.has("instantaneous_ratio")) {
    options.relaxation.instantaneous_ratio = from.number("instantaneous_ratio", 1.0, 1e9);
    options.relaxation.retardation_time = from.number("retardation_time", 1e-9, 1e9);
  }
  if (from.has("density") || from.has("instantaneous_ratio")) options.tick_period = from.number("period", 1e-9, 1e3);
  options.update_interval = interval;
  const deformable::TetMesh mesh = read_tetrahedra(reader, from);
  const deformable::TetSurface surface = read_tet_surface(reader, from, mesh.points.size());
  options.contact_compliance = static_cast<bool>(friction);
  deformable::LocalModelSlip slip;
  if (friction) {
    const double poisson = from.number("poisson", -1.0, 0.5);
    const auto nodes = static_cast<std::int64_t>(surface.point.size());
    const std::vector<float> full = from.blob<float>("compliance", 3 * nodes, 3 * nodes);
    if (reader.ok()) slip = deformable::LocalModelSlip(friction, deformable::FullCompliance(surface.point.size(), full.data()), poisson);
  }
  if (!reader.ok()) return nullptr;
  return std::make_shared<const Body>(deformable::make_quasi_static_solver(law, mesh, surface, options), interval, std::move(slip));
}
#else
[[nodiscard]] inline std::shared_ptr<const object::DeformableObject> read_hyperelastic(ConfigReader& /*reader*/, const Section& from,
                                                                                       deformable::DryFriction /*friction*/) {
  from.fail("model", "is \"hyperelastic\"; link palpate::hyperelastic (configure palpate with -DPALPATE_HYPERELASTIC=ON)");
  return nullptr;
}
#endif

[[nodiscard]] inline deformable::ContactSurface read_contact_surface(ConfigReader& reader, const Section& from, std::int64_t nodes) {
  deformable::ContactSurface out;
  out.vertices = from.points("vertices");
  out.triangles = read_indices<3>(from, "triangles", out.vertices.size());
  out.node = from.blob<std::int32_t>("vertex_nodes", static_cast<std::int64_t>(out.vertices.size()), 1);
  out.modulus = read_layer_moduli(from, nodes);
  out.poisson = from.number("poisson", -1.0, 0.5);
  if (!reader.ok()) return out;
  if (std::any_of(out.node.begin(), out.node.end(), [&](std::int32_t node) { return node < -1 || node >= nodes; }))
    from.fail("vertex_nodes", "must hold contact nodes, or -1");
  return out;
}

/// Read the phases of a body's supports: the first step of each, and the role of each node (0: deforms only, 1: touched, 2: held).
[[nodiscard]] inline std::vector<object::BodyWithSupports::Change> read_support_changes(const Section& from, std::size_t nodes) {
  const std::vector<std::int32_t> steps = from.blob<std::int32_t>("support_steps", -1, 1);
  const auto phases = static_cast<std::int64_t>(steps.size());
  const std::vector<std::uint8_t> roles = from.blob<std::uint8_t>("support_roles", phases, static_cast<std::int64_t>(nodes));
  std::vector<object::BodyWithSupports::Change> changes;
  const bool ordered = std::adjacent_find(steps.begin(), steps.end(), std::greater_equal<>()) == steps.end();
  if (steps.empty() || steps.front() != 0 || !ordered) from.fail("support_steps", "must increase from 0 on");
  for (std::size_t p = 0; p < steps.size() && roles.size() == steps.size() * nodes; ++p) {
    changes.push_back({steps[p], {}});
    deformable::SupportNodes& of = changes.back().nodes;
    for (std::size_t i = 0; i < nodes; ++i) {
      const std::uint8_t role = roles[p * nodes + i];
      if (role == 2) of.held.push_back(static_cast<std::int32_t>(i));
      if (role == 1) of.touched.push_back(static_cast<std::int32_t>(i));
      if (role > 2) from.fail("support_roles", "must be 0, 1 or 2");
    }
    if (of.touched.empty()) from.fail("support_roles", "must leave a node that can be touched");
  }
  return changes;
}

/// Return a body whose supports change.
template <class Phase>
[[nodiscard]] std::shared_ptr<const object::DeformableObject> read_supported(ConfigReader& reader, const Section& from,
                                                                             deformable::CondensedSurface surface,
                                                                             typename Phase::Maker make) {
  const auto changes = read_support_changes(from, surface.size());
  if (!reader.ok()) return nullptr;
  auto body = std::make_shared<object::SupportedBody<Phase>>(std::make_shared<const deformable::CondensedSurface>(std::move(surface)),
                                                             changes, std::move(make));
  if (!body->usable()) {
    from.fail("support_roles", "hold nodes whose compliance is singular");
    return nullptr;
  }
  return body;
}

[[nodiscard]] inline std::shared_ptr<const object::DeformableObject> read_signed_distance(ConfigReader& reader, const Section& from,
                                                                                          deformable::SurfaceNodes nodes,
                                                                                          deformable::CondensedSurface condensed,
                                                                                          deformable::DryFriction friction) {
  const std::int64_t count = nodes.size();
  object::SignedDistanceOptions options;
  options.sideways = from.number("sideways_fraction", 0.0, 1.0);
  options.friction = friction;
  const deformable::ContactSurface surface = read_contact_surface(reader, from, count);
  options.period = from.number("period", 1e-9, 1e3);
  options.instantaneous_ratio = from.number("instantaneous_ratio", 1.0, 1e9);
  options.retardation_time = from.number("retardation_time", 1e-9, 1e9);
  std::vector<float> shapes;
  if (from.has("frequencies")) {
    options.modes.rayleigh_alpha = from.number("rayleigh_alpha", 0.0, 1e9);
    options.modes.rayleigh_beta = from.number("rayleigh_beta", 0.0, 1e9);
    options.modes.frequencies = read_frequencies(from);
    shapes = from.blob<float>("shapes", 3 * count, static_cast<std::int64_t>(options.modes.frequencies.size()));
    options.modes.shapes = shapes.data();
  }
  if (from.has("contact_points")) options.contact_points = from.points("contact_points");
  if (options.contact_points.size() > static_cast<std::size_t>(deformable::SignedDistanceContact::max_tips))
    from.fail("contact_points", "are at most " + std::to_string(deformable::SignedDistanceContact::max_tips));
  if (!reader.ok()) return nullptr;
  if (from.has("support_steps")) {
    if (!options.modes.frequencies.empty() && options.instantaneous_ratio > 1.0) {
      from.fail("support_steps", "need a body without inertia, or one that does not relax");
      return nullptr;
    }
    condensed.shapes = std::move(shapes);
    condensed.frequencies = options.modes.frequencies;
    return read_supported<object::SignedDistancePhase>(reader, from, std::move(condensed),
                                                       object::SignedDistancePhase::Maker(surface, options));
  }
  return std::make_shared<object::SignedDistanceBody>(
      std::make_shared<const object::SignedDistanceBody::Data>(std::move(nodes), condensed.compliance.data(), surface, options));
}

[[nodiscard]] inline std::shared_ptr<const object::DeformableObject> read_body(ConfigReader& reader, const Section& from) {
  using deformable::SurfaceNodes;
  const std::vector<std::string> models = {"compliance",  "modal",        "standard_linear_solid",
                                           "mass_spring", "hyperelastic", "signed_distance"};
  const std::string model = models[from.choice("model", models)];
  const deformable::DryFriction friction = {from.number("static_friction", 0.0, 1e6), from.number("dynamic_friction", 0.0, 1e6)};
  if (model == "hyperelastic") return read_hyperelastic(reader, from, friction);
  const std::vector<Vector3<>> points = from.points("points");
  const auto count = static_cast<std::int64_t>(points.size());
  const std::vector<Vector3<>> normals = from.points("normals", count);
  const std::vector<double> areas = from.blob<double>("areas", count, 1);
  if (!reader.ok()) return nullptr;
  if (friction.mu_dynamic > friction.mu_static) from.fail("dynamic_friction", "exceeds static_friction");
  if (count == 0 || count > 1'000'000) from.fail("points", "must be 1 to a million nodes");
  bool usable = true;
  for (std::int64_t i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    usable =
        usable && points[k].cwiseAbs().maxCoeff() < 1e6 && std::abs(normals[k].norm() - 1.0) < 1e-6 && areas[k] > 0.0 && areas[k] < 1e12;
  }
  if (!usable) from.fail("points", "need positions within 1000 km, unit normals and positive areas");
  if (!reader.ok()) return nullptr;
  SurfaceNodes nodes(points, normals, areas);
  if (model == "mass_spring") {
    const double period = from.number("period", 1e-9, 1e3);
    const double alpha = from.number("rayleigh_alpha", 0.0, 1e9), beta = from.number("rayleigh_beta", 0.0, 1e9);
    deformable::SpringNetworkData network = read_network(from);
    deformable::PatchWeights patches = read_patches(reader, from, count, network.rest_positions.size());
    if (4e-9 * static_cast<double>(count) * static_cast<double>(network.rest_positions.size()) > 4.0)
      from.fail("positions", "and nodes are too many: the model would take more than 4 GB");
    if (!reader.ok()) return nullptr;
    const auto make = [&](const SurfaceNodes& at, double tick) {
      return deformable::MassSpringModel(at, network, patches, tick, alpha, beta);
    };
    std::vector<float> compliance;  // static, of friction at two rates
    if (friction && from.has("update_interval")) compliance = from.blob<float>("compliance", 3 * count, 3 * count);
    if (!reader.ok()) return nullptr;
    return own<deformable::MassSpringModel>(reader, from, std::move(nodes), make, period, friction, compliance.data());
  }
  std::vector<float> full = from.blob<float>("compliance", 3 * count, 3 * count);
  const bool rough = friction.mu_static > 0.0;
  if (model == "signed_distance") {
    if (!reader.ok()) return nullptr;
    return read_signed_distance(reader, from, std::move(nodes), {points, normals, areas, std::move(full), {}, {}}, friction);
  }
  if (model == "compliance") {
    if (!reader.ok()) return nullptr;
    if (from.has("support_steps")) {
      if (rough) from.fail("support_steps", "of a body with friction need the model signed_distance");
      return read_supported<object::NormalContactPhase>(reader, from, {points, normals, areas, std::move(full), {}, {}}, {});
    }
    const deformable::Compliance body(nodes, full.data(), rough);
    return own(std::move(nodes), body, friction);
  }
  const double period = from.number("period", 1e-9, 1e3);
  const double ratio = from.number("instantaneous_ratio", 1.0, 1e9), retardation = from.number("retardation_time", 1e-9, 1e9);
  if (model == "standard_linear_solid") {
    if (!reader.ok()) return nullptr;
    const auto make = [&](const SurfaceNodes& at, double tick) {
      return deformable::StandardLinearSolid(deformable::Compliance(at, full.data(), rough), ratio, retardation, tick);
    };
    return own<deformable::StandardLinearSolid>(reader, from, std::move(nodes), make, period, friction, full.data());
  }
  const double alpha = from.number("rayleigh_alpha", 0.0, 1e9), beta = from.number("rayleigh_beta", 0.0, 1e9);
  const std::vector<double> frequencies = read_frequencies(from);
  const std::vector<float> shapes = from.blob<float>("shapes", 3 * count, static_cast<std::int64_t>(frequencies.size()));
  if (!reader.ok()) return nullptr;
  const auto make = [&](const SurfaceNodes& at, double tick) {
    return deformable::Modal(at, full.data(), shapes.data(), frequencies, tick, alpha, beta, ratio, retardation, rough);
  };
  return own<deformable::Modal>(reader, from, std::move(nodes), make, period, friction, full.data());
}

/// Read the motion of a tool of so many tips.
[[nodiscard]] inline object::ToolMotion read_tool(const Section& from, int tips) {
  std::vector<Vector3<>> open = from.points("open", tips), closed = from.points("closed", tips);
  const std::vector<double> flat = from.blob<double>("motion", -1, 5);
  std::vector<object::ToolMotion::Row> rows;
  for (std::size_t i = 0; i + 5 <= flat.size(); i += 5) rows.push_back({flat[i], {{flat[i + 1], flat[i + 2], flat[i + 3]}, flat[i + 4]}});
  const auto later = [](const object::ToolMotion::Row& a, const object::ToolMotion::Row& b) { return a.time >= b.time; };
  if (std::adjacent_find(rows.begin(), rows.end(), later) != rows.end()) from.fail("motion", "has times that do not increase");
  if (tips == 0) from.fail("open", "are of a tool, but the body has no contact_points");
  return {std::move(open), std::move(closed), std::move(rows)};
}

[[nodiscard]] inline object::AnyObject read_placed_body(ConfigReader& reader, const Section& from) {
  object::BodyPlacement placement;
  const Section pose = from.section("placement");
  placement.origin = pose.vector("origin");
  const std::vector<double> rotation = pose.numbers("rotation", 9);
  placement.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.data());
  placement.tip = pose.choice("tip", {"sphere", "flat"}) == 0 ? deformable::Tip::Kind::sphere : deformable::Tip::Kind::flat;
  placement.radius = pose.number("radius", 1e-9, 1e3);
  placement.body = read_body(reader, from);
  if (!reader.ok() || !placement.body) return {};
  if (pose.has("tool")) placement.tool = read_tool(pose.section("tool"), placement.body->tool_tips());
  if (!reader.ok()) return {};
  return object::BodyInstance(std::move(placement));
}

/// Return the kinds of an object that rests, and `more`.
[[nodiscard]] inline std::vector<std::string> object_kinds(const std::vector<std::string>& more = {}) {
  std::vector<std::string> out = {"spring_wall",  "mesh",      "body",         "force_law",    "constant_field",
                                  "gravity_well", "vibration", "virtual_mass", "textured_wall"};
  out.insert(out.end(), more.begin(), more.end());
  return out;
}

/// Build an object that rests.
[[nodiscard]] inline object::AnyObject read_single_object(ConfigReader& reader, const Section& from, const std::string& kind) {
  if (kind == "mesh") return read_mesh(reader, from);
  if (kind == "body") return read_placed_body(reader, from);
  if (kind == "force_law") return read_force_law(reader, from);
  if (kind == "constant_field") return object::ConstantField(from.vector("force"));
  if (kind == "gravity_well") return read_gravity_well(from);
  if (kind == "vibration") return read_vibration(from);
  if (kind == "virtual_mass") return read_virtual_mass(from);
  if (kind == "textured_wall") return read_textured_wall(from);
  return read_spring_wall(from);
}

[[nodiscard]] inline object::AnyObject read_moving_frame(ConfigReader& reader, const Section& from) {
  const Section inner = from.section("object");
  const Vector3<> origin = from.vector("origin");
  const std::vector<double> flat = from.blob<double>("motion", -1, 7);
  std::vector<object::FrameMotion::Row> rows;
  for (std::size_t i = 0; i + 7 <= flat.size(); i += 7)
    rows.push_back({flat[i], {flat[i + 1], flat[i + 2], flat[i + 3]}, {flat[i + 4], flat[i + 5], flat[i + 6]}});
  const auto later = [](const object::FrameMotion::Row& a, const object::FrameMotion::Row& b) { return a.time >= b.time; };
  if (reader.ok() && rows.empty()) from.fail("motion", "has no rows");
  if (std::adjacent_find(rows.begin(), rows.end(), later) != rows.end()) from.fail("motion", "has times that do not increase");
  const std::vector<std::string> kinds = object_kinds();
  object::AnyObject moved = read_single_object(reader, inner, kinds[inner.choice("kind", kinds)]);
  return object::MovingFrame<object::AnyObject>(std::move(moved), object::FrameMotion(origin, std::move(rows)));
}

[[nodiscard]] inline object::AnyObject read_scene(ConfigReader& reader, const Section& from) {
  const Section parts = from.section("objects");
  const std::vector<std::string> kinds = object_kinds({"moving_frame"});
  object::Scene scene;
  for (const std::string& name : parts.keys()) {
    const Section part = parts.section(name.c_str());
    const std::string& kind = kinds[part.choice("kind", kinds)];
    scene.add(kind == "moving_frame" ? read_moving_frame(reader, part) : read_single_object(reader, part, kind));
    if (!reader.ok()) return {};
  }
  return scene;
}

/// Build the object or objects that the tip touches. They own everything that they refer to.
[[nodiscard]] inline object::AnyObject read_object(ConfigReader& reader, const Section& from) {
  const std::vector<std::string> kinds = object_kinds({"moving_frame", "scene"});
  const std::string& kind = kinds[from.choice("kind", kinds)];
  if (kind == "moving_frame") return read_moving_frame(reader, from);
  if (kind == "scene") return read_scene(reader, from);
  return read_single_object(reader, from, kind);
}

}  // namespace palpate::servo::detail
