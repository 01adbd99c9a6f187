/// Python bindings of meshes, surfaces and proxies. The loop over a path runs in C++.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <memory>
#include <palpate/mesh/mesh_repair.hpp>
#include <palpate/mesh/proxy.hpp>
#include <vector>

#include "arrays.hpp"
#include "touch_mesh.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

std::vector<palpate::math::Vector3<>> points(const Points& a) {
  std::vector<palpate::math::Vector3<>> list(a.shape(0));
  for (std::size_t i = 0; i < list.size(); ++i) list[i] = {a.data()[3 * i], a.data()[3 * i + 1], a.data()[3 * i + 2]};
  return list;
}

std::vector<palpate::mesh::Triangle> triangles(const Indices& a) {
  const auto index = [](std::int64_t i) { return static_cast<std::int32_t>(i < 0 || i > 0x7fffffff ? -1 : i); };
  std::vector<palpate::mesh::Triangle> list(a.shape(0));
  for (std::size_t i = 0; i < list.size(); ++i) list[i] = {index(a.data()[3 * i]), index(a.data()[3 * i + 1]), index(a.data()[3 * i + 2])};
  return list;
}

/// A proxy that owns the mesh and the surface it refers to.
struct TouchProxy {
  std::unique_ptr<TouchedSurface> on;
  palpate::mesh::Proxy proxy;
  palpate::mesh::SurfaceAttachment attachment{};
  std::int64_t seen;  // moves of the mesh

  explicit TouchProxy(TouchedSurface&& surface)
      : on(std::make_unique<TouchedSurface>(std::move(surface))),
        proxy(on->mesh->mesh, on->mesh->tree, *on->field, on->radius),
        seen(on->mesh->moves) {}

  /// Update the surface and the proxy if the mesh has moved.
  void catch_up() noexcept {
    if (seen == on->mesh->moves) return;
    on->refit(seen);
    proxy.reattach(attachment);
    seen = on->mesh->moves;
  }
};

TouchedSurface touched(std::shared_ptr<const TouchMesh> mesh, const palpate::mesh::Surface& surface, double radius) {
  if (!mesh->mesh.usable() || !palpate::mesh::SurfaceField::is_valid(surface, mesh->mesh) || !(radius >= 0.0))
    throw nb::value_error("the mesh, the surface or the radius is not usable");
  return {std::move(mesh), surface, radius};
}

}  // namespace

void bind_touch(nb::module_& m) {
  using palpate::mesh::Surface;

  nb::enum_<palpate::mesh::FieldKind>(m, "FieldKind")
      .value("discrete", palpate::mesh::FieldKind::discrete)
      .value("continuous", palpate::mesh::FieldKind::continuous);
  nb::class_<Surface>(m, "Surface")
      .def(nb::init<>())
      .def_rw("stiffness", &Surface::stiffness)
      .def_rw("damping", &Surface::damping)
      .def_rw("tangential", &Surface::tangential)
      .def_rw("static_friction", &Surface::static_friction)
      .def_rw("dynamic_friction", &Surface::dynamic_friction)
      .def_rw("viscous", &Surface::viscous)
      .def_rw("field", &Surface::field)
      .def_rw("shading", &Surface::shading)
      .def_rw("period", &Surface::period);

  nb::class_<TouchMesh>(m, "TriangleMesh")
      .def(
          "__init__",
          [](TouchMesh* self, const Points& v, const Indices& t, bool open) { new (self) TouchMesh(points(v), triangles(t), open); },
          "vertices"_a, "triangles"_a, "open"_a)
      .def_prop_ro("usable", [](const TouchMesh& self) { return self.mesh.usable(); })
      .def_prop_ro("fault", [](const TouchMesh& self) { return static_cast<int>(self.mesh.fault()); })
      .def_prop_ro("extent", [](const TouchMesh& self) { return self.mesh.extent(); })
      .def("diagnosis",
           [](const TouchMesh& self) {
             const palpate::mesh::MeshDiagnosis& d = self.mesh.diagnosis();
             nb::dict out;
             const auto add_count = [&out](const char* name, const palpate::mesh::MeshDiagnosis::Count& c) {
               out[name] = nb::make_tuple(c.count, c.first);
             };
             add_count("not_finite", d.not_finite);
             add_count("index_out_of_range", d.index_out_of_range);
             add_count("degenerate", d.degenerate);
             add_count("duplicate", d.duplicate);
             add_count("non_manifold", d.non_manifold);
             add_count("mixed_winding", d.mixed_winding);
             add_count("open", d.open);
             out["components"] = d.components;
             out["volume"] = d.volume;
             return out;
           })
      .def("pinched_vertices",
           [](const TouchMesh& self) {
             const auto c = palpate::mesh::pinched_vertices(self.mesh);
             return nb::make_tuple(c.count, c.first);
           })
      .def("self_intersections",
           [](const TouchMesh& self) {
             const auto c = palpate::mesh::self_intersections(self.mesh, self.tree);
             return nb::make_tuple(c.count, c.first);
           })
      .def(
          "move",
          [](TouchMesh& self, const std::vector<std::int32_t>& vertices, const Points& to) { return self.move(vertices, points(to)); },
          "vertices"_a, "to"_a, "Move vertices. Return -1, or the first triangle that would lose its area; then nothing moves.")
      .def(
          "nearest",
          [](const TouchMesh& self, const Points& x) {
            auto [at, p] = new_array<double>({x.shape(0), 3});
            auto [facet, f] = new_array<std::int64_t>({x.shape(0)});
            for (std::size_t i = 0; i < x.shape(0); ++i) {
              const auto near = self.tree.nearest(self.mesh, Eigen::Map<const palpate::math::Vector3<>>(x.data() + 3 * i));
              Eigen::Map<palpate::math::Vector3<>>(p + 3 * i) = near.at.point;
              f[i] = near.face;
            }
            return nb::make_tuple(at, facet);
          },
          "x"_a);

  m.def(
      "repair_mesh",
      [](const Points& v, const Indices& t) {
        std::vector<palpate::mesh::Triangle> list = triangles(t);
        const palpate::mesh::RepairReport done = palpate::mesh::repair_mesh(points(v), list);
        auto [out, data] = new_array<std::int64_t>({list.size(), 3});
        for (std::size_t f = 0; f < list.size(); ++f)
          for (std::size_t i = 0; i < 3; ++i) data[3 * f + i] = list[f][i];
        return nb::make_tuple(out, done.dropped_degenerate, done.dropped_duplicate, done.flipped);
      },
      "vertices"_a, "triangles"_a);

  nb::class_<TouchedSurface>(m, "MeshModel")
      .def(
          "__init__",
          [](TouchedSurface* self, std::shared_ptr<const TouchMesh> mesh, const Surface& surface, double radius) {
            new (self) TouchedSurface(touched(std::move(mesh), surface, radius));
          },
          "mesh"_a, "surface"_a, "radius"_a);

  nb::class_<TouchProxy>(m, "Proxy")
      .def(
          "__init__",
          [](TouchProxy* self, std::shared_ptr<const TouchMesh> mesh, const Surface& surface, double radius) {
            new (self) TouchProxy(touched(std::move(mesh), surface, radius));
          },
          "mesh"_a, "surface"_a, "radius"_a)
      .def(
          "simulate_path",
          [](TouchProxy& self, const Points& path) {
            const std::size_t n = path.shape(0);
            auto [rows, row] = new_array<double>({n, 11});
            auto [facet, f] = new_array<std::int64_t>({n});
            {
              const nb::gil_scoped_release unlocked;
              self.catch_up();
              for (std::size_t i = 0; i < n; ++i, row += 11) {
                const palpate::mesh::Contact& c = self.proxy.step(Eigen::Map<const palpate::math::Vector3<>>(path.data() + 3 * i));
                Eigen::Map<palpate::math::Vector3<>>(row + 0) = c.position;
                Eigen::Map<palpate::math::Vector3<>>(row + 3) = c.normal;
                Eigen::Map<palpate::math::Vector3<>>(row + 6) = c.force;
                row[9] = c.depth;
                row[10] = c.stiffness;
                f[i] = c.face;
              }
              self.attachment = self.proxy.attach();
            }
            return nb::make_tuple(rows, facet);
          },
          "path"_a,
          "Step along a path (n, 3), m. Return rows of position (3), normal (3), force (3), depth, stiffness; and triangles, -1 without "
          "contact.")
      .def(
          "step_durations",
          [](TouchProxy& self, const Points& path) {
            const std::size_t n = path.shape(0);
            auto [seconds, s] = new_array<double>({n});
            const nb::gil_scoped_release unlocked;
            for (std::size_t i = 0; i < n; ++i) {
              const palpate::math::Vector3<> tip = Eigen::Map<const palpate::math::Vector3<>>(path.data() + 3 * i);
              const auto begin = std::chrono::steady_clock::now();
              self.proxy.step(tip);
              s[i] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
            }
            return seconds;
          },
          "path"_a, "Return the duration of each step, s, including the clock's own.")
      .def("reset", [](TouchProxy& self) { self.proxy.reset(); })
      .def_prop_ro("invalid_input_count", [](const TouchProxy& self) { return self.proxy.invalid_input_count(); })
      .def_prop_ro("iteration_limit_count", [](const TouchProxy& self) { return self.proxy.iteration_limit_count(); })
      .def_prop_ro("sliding", [](const TouchProxy& self) { return self.proxy.sliding(); });
}
