/// The Python face of solids that deform as far as they are pushed.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>

#include "batch.hpp"
#include "solid.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using palpate::solid::AnySolid;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Cells = nb::ndarray<const std::int64_t, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;

struct SolidCore {
  std::size_t points;
  std::unique_ptr<AnySolid> solid;
};

std::unique_ptr<AnySolid> make(bool corotational, const palpate::SolidMesh& mesh) {
#if defined(PALPATE_WIDE_LANES)
  if (palpate::batch::most_lanes() == 8) return palpate::solid::make<8>(corotational, mesh);
  if (palpate::batch::most_lanes() == 4) return palpate::solid::make<4>(corotational, mesh);
#endif
  return palpate::solid::make<2>(corotational, mesh);
}

palpate::SolidMesh mesh_of(const Points& points, const Cells& cells, const Numbers& shear, const Numbers& lame, const Flags& held) {
  const std::size_t n = points.shape(0), m = cells.shape(0);
  if (n == 0 || m == 0 || shear.shape(0) != m || lame.shape(0) != m || held.shape(0) != n)
    throw nb::value_error("the sizes of a solid's arrays do not fit each other");
  palpate::SolidMesh mesh;
  for (std::size_t i = 0; i < n; ++i) mesh.points.emplace_back(points.data()[3 * i], points.data()[3 * i + 1], points.data()[3 * i + 2]);
  for (std::size_t c = 0; c < m; ++c) {
    auto& corners = mesh.tetrahedra.emplace_back();
    for (std::size_t k = 0; k < 4; ++k) {
      const std::int64_t p = cells.data()[4 * c + k];
      if (p < 0 || p >= static_cast<std::int64_t>(n)) throw nb::value_error("a tetrahedron names a point that does not exist");
      corners[k] = static_cast<std::int32_t>(p);
    }
  }
  mesh.shear.assign(shear.data(), shear.data() + m);
  mesh.lame.assign(lame.data(), lame.data() + m);
  mesh.held.assign(held.data(), held.data() + n);
  if (std::find(mesh.held.begin(), mesh.held.end(), false) == mesh.held.end()) throw nb::value_error("all points are held");
  return mesh;
}

void check(const SolidCore& self, const Points& vectors) {
  if (vectors.shape(0) != self.points) throw nb::value_error("one vector for each point is needed");
}

std::pair<Out, double*> vectors(std::size_t points) {
  auto* data = new double[3 * points]();
  const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return {Out(data, {points, 3}, owner), data};
}

}  // namespace

void bind_solid(nb::module_& m) {
  nb::class_<SolidCore>(m, "Solid")
      .def(
          "__init__",
          [](SolidCore* self, const Points& points, const Cells& cells, const Numbers& shear, const Numbers& lame, const Flags& held,
             bool corotational) {
            auto solid = make(corotational, mesh_of(points, cells, shear, lame, held));
            new (self) SolidCore{points.shape(0), std::move(solid)};
          },
          "points"_a, "tetrahedra"_a, "shear"_a, "lame"_a, "held"_a, "corotational"_a)
      .def(
          "evaluate",
          [](SolidCore& self, const Points& displacement) {
            check(self, displacement);
            auto [forces, f] = vectors(self.points);
            return nb::make_tuple(self.solid->evaluate(displacement.data(), f), forces);
          },
          "displacement"_a, "Energy, J, and inner forces on the free points, N.")
      .def(
          "tangent",
          [](SolidCore& self, const Points& way) {
            check(self, way);
            auto [forces, f] = vectors(self.points);
            self.solid->tangent(way.data(), f);
            return forces;
          },
          "way"_a, "Change of the inner forces along `way`, N, where it was evaluated last; single precision.")
      .def(
          "relax",
          [](SolidCore& self, const Points& load, double tolerance, int most) {
            check(self, load);
            const nb::gil_scoped_release unlocked;
            return self.solid->relax(load.data(), tolerance, most);
          },
          "load"_a, "tolerance"_a = 1e-8, "most"_a = 60,
          "Newton's steps to rest under a load, N; how many, or -1 if it did not come to rest.")
      .def("displacement",
           [](const SolidCore& self) {
             auto [out, data] = vectors(self.points);
             self.solid->displacement(data);
             return out;
           })
      .def("reset", [](SolidCore& self) { self.solid->reset(); });
}
