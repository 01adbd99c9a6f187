/// Python bindings of the hyperelastic bodies.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <palpate/deformable/hyperelastic/compiled_solver.hpp>
#include <palpate/deformable/multirate/multirate_coupling.hpp>
#include <palpate/object/multirate_object.hpp>
#include <thread>

#include "body_arrays.hpp"
#include "body_in_loop.hpp"
#include "contact_rows.hpp"
#include "slow_thread.hpp"
#include "solid_frames.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using palpate::deformable::AnyHyperelasticModel;
using palpate::deformable::AnyQuasiStaticSolver;
using palpate::deformable::HyperelasticLaw;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Cells = nb::ndarray<const std::int64_t, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Integers = nb::ndarray<const std::int32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Triangles = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Paths = nb::ndarray<const double, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;

struct ModelCore {
  std::size_t points;
  std::unique_ptr<AnyHyperelasticModel> model;
};

palpate::deformable::TetMesh mesh_of(const Points& points, const Cells& cells, const Numbers& shear, const Numbers& lame,
                                     const Flags& fixed) {
  const std::size_t n = points.shape(0), m = cells.shape(0);
  if (n == 0 || m == 0 || shear.shape(0) != m || lame.shape(0) != m || fixed.shape(0) != n)
    throw nb::value_error("the sizes of the body's arrays do not match");
  palpate::deformable::TetMesh mesh;
  for (std::size_t i = 0; i < n; ++i) mesh.points.emplace_back(points.data()[3 * i], points.data()[3 * i + 1], points.data()[3 * i + 2]);
  for (std::size_t c = 0; c < m; ++c) {
    auto& corners = mesh.tetrahedra.emplace_back();
    for (std::size_t k = 0; k < 4; ++k) {
      const std::int64_t p = cells.data()[4 * c + k];
      if (p < 0 || p >= static_cast<std::int64_t>(n)) throw nb::value_error("a tetrahedron refers to a point that does not exist");
      corners[k] = static_cast<std::int32_t>(p);
    }
  }
  mesh.shear.assign(shear.data(), shear.data() + m);
  mesh.lame.assign(lame.data(), lame.data() + m);
  mesh.fixed.assign(fixed.data(), fixed.data() + n);
  if (std::find(mesh.fixed.begin(), mesh.fixed.end(), false) == mesh.fixed.end()) throw nb::value_error("all points are fixed");
  return mesh;
}

void check(const ModelCore& self, const Points& vectors) {
  if (vectors.shape(0) != self.points) throw nb::value_error("the array must have one row for each point");
}

void check(double instantaneous_ratio, double retardation_time) {
  if (!(instantaneous_ratio >= 1.0 && retardation_time > 0.0))
    throw nb::value_error("the instantaneous ratio must be 1 or more, and the retardation time positive");
}

palpate::deformable::TetSurface surface_of(std::size_t points, const Integers& point, const Triangles& triangles,
                                           const body_arrays::Moduli& modulus) {
  const std::size_t n = point.shape(0);
  const auto fits = [points](const auto& numbers, std::size_t count) {
    return std::all_of(numbers.data(), numbers.data() + count,
                       [points](std::int32_t p) { return p >= 0 && p < static_cast<std::int32_t>(points); });
  };
  if (n == 0 || modulus.shape(0) != n || !fits(point, n) || !fits(triangles, 3 * triangles.shape(0)))
    throw nb::value_error("the arrays of the body's surface do not match");
  palpate::deformable::TetSurface surface;
  surface.point.assign(point.data(), point.data() + n);
  for (std::size_t t = 0; t < triangles.shape(0); ++t)
    surface.triangles.push_back({triangles.data()[3 * t], triangles.data()[3 * t + 1], triangles.data()[3 * t + 2]});
  surface.modulus = body_arrays::layer_moduli(modulus);
  return surface;
}

HyperelasticLaw law_of(bool corotational) {
  return corotational ? HyperelasticLaw::corotational : HyperelasticLaw::neo_hookean;
}

std::unique_ptr<AnyQuasiStaticSolver> solver_of(const palpate::deformable::TetMesh& mesh, bool corotational,
                                                const palpate::deformable::TetSurface& surface, int nodes_per_tip,
                                                palpate::deformable::SolverOptions options = {}) {
  options.nodes_per_tip = nodes_per_tip;
  return palpate::deformable::make_quasi_static_solver(law_of(corotational), mesh, surface, options);
}

struct SolverCore {
  std::size_t points;
  palpate::deformable::MultirateCoupling<AnyQuasiStaticSolver> coupling;
};

/// The tips at each tick of a path (ticks, tips, 3).
class Ways {
 public:
  Ways(const Paths& centers, const Paths& outward, const Numbers& radii, bool flat)
      : centers_(centers.data()), outward_(outward.data()), ticks_(centers.shape(0)) {
    const std::size_t count = centers.shape(1);
    if (count == 0 || count > palpate::deformable::TipPair::max_tips) throw nb::value_error("the path must have one or two tips");
    if (outward.shape(0) != ticks_ || outward.shape(1) != count || radii.shape(0) != count)
      throw nb::value_error("the path needs one direction for each position and one radius for each tip");
    tips_.count = static_cast<int>(count);
    for (std::size_t t = 0; t < count; ++t) {
      tips_.tip[t].kind = flat ? palpate::deformable::Tip::Kind::flat : palpate::deformable::Tip::Kind::sphere;
      tips_.tip[t].radius = radii.data()[t];
    }
  }
  [[nodiscard]] std::size_t ticks() const { return ticks_; }
  [[nodiscard]] std::size_t columns() const { return 10 * static_cast<std::size_t>(tips_.count) + 4; }
  const palpate::deformable::TipPair& at(std::size_t tick) {
    const auto count = static_cast<std::size_t>(tips_.count);
    for (std::size_t t = 0; t < count; ++t) {
      tips_.tip[t].center = Eigen::Map<const palpate::math::Vector3<>>(centers_ + 3 * (tick * count + t));
      tips_.tip[t].outward = Eigen::Map<const palpate::math::Vector3<>>(outward_ + 3 * (tick * count + t));
    }
    return tips_;
  }
  /// Write the row of the last tick.
  void write(const palpate::deformable::MultirateCoupling<AnyQuasiStaticSolver>::Switch& servo, double* row) const {
    for (std::size_t t = 0; t < static_cast<std::size_t>(tips_.count); ++t, row += 10) {
      const palpate::deformable::ContactResult& a = servo.last().tip[t];
      Eigen::Map<palpate::math::Vector3<>>(row + 0) = a.force;
      Eigen::Map<palpate::math::Vector3<>>(row + 3) = a.deflection;
      row[6] = a.energy;
      row[7] = a.nodes;
      row[8] = a.touching ? 1.0 : 0.0;
      row[9] = servo.last().solved ? 1.0 : 0.0;
    }
    const auto& tank = servo.tank();
    row[0] = tank.potential;
    row[1] = tank.level;
    row[2] = tank.blend;
    row[3] = tank.empty ? 1.0 : 0.0;
  }

 private:
  const double* centers_;
  const double* outward_;
  std::size_t ticks_;
  palpate::deformable::TipPair tips_;
};

Out step_row(const palpate::deformable::ModelUpdateReport& step) {
  auto [out, row] = new_array<double>({1, 4});
  row[0] = step.residual;
  row[1] = step.newton_steps;
  row[2] = step.compliance_steps;
  row[3] = step.compliance_error;
  return out;
}

void bind_solver(nb::module_& m) {
  nb::class_<SolverCore>(m, "QuasiStaticSolver")
      .def(
          "__init__",
          [](SolverCore* self, const Points& points, const Cells& cells, const Numbers& shear, const Numbers& lame, const Flags& fixed,
             bool corotational, const Integers& point, const Triangles& triangles, const body_arrays::Moduli& modulus, int nodes_per_tip) {
            auto solid = solver_of(mesh_of(points, cells, shear, lame, fixed), corotational,
                                   surface_of(points.shape(0), point, triangles, modulus), nodes_per_tip);
            new (self) SolverCore{points.shape(0), palpate::deformable::MultirateCoupling<AnyQuasiStaticSolver>(std::move(solid))};
          },
          "points"_a, "tetrahedra"_a, "shear"_a, "lame"_a, "fixed"_a, "corotational"_a, "node_points"_a, "triangles"_a, "modulus"_a,
          "nodes_per_tip"_a)
      .def(
          "simulate_path",
          [](SolverCore& self, const Paths& centers, const Paths& outward, const Numbers& radii, bool flat, int update_interval) {
            Ways ways(centers, outward, radii, flat);
            if (update_interval < 1) throw nb::value_error("update_interval must be 1 or more");
            auto [rows, row] = new_array<double>({ways.ticks(), ways.columns()});
            const nb::gil_scoped_release unlocked;
            for (std::size_t k = 0; k < ways.ticks(); ++k, row += ways.columns()) {
              if (k % static_cast<std::size_t>(update_interval) == 0 && self.coupling.update_count() > 0) self.coupling.publish_model();
              self.coupling.tick(ways.at(k));
              if (k % static_cast<std::size_t>(update_interval) == 0) self.coupling.compute_model();
              ways.write(self.coupling.model_switch(), row);
            }
            return rows;
          },
          "centers"_a, "outward"_a, "radii"_a, "flat"_a, "update_interval"_a,
          "Step along a path; update the model every `update_interval` ticks and publish it after as many. Return rows: for each tip force "
          "(3), "
          "deflection (3), energy, nodes, touching, solved; then potential energy, tank level, blend, tank empty.")
      .def(
          "settle",
          [](SolverCore& self, const Paths& centers, const Paths& outward, const Numbers& radii, bool flat, int max_updates) {
            Ways ways(centers, outward, radii, flat);
            auto [rows, row] = new_array<double>({ways.ticks(), ways.columns() + 1});
            const nb::gil_scoped_release unlocked;
            for (std::size_t k = 0; k < ways.ticks(); ++k, row += ways.columns() + 1) {
              row[ways.columns()] = self.coupling.settle(ways.at(k), max_updates) ? 1.0 : 0.0;
              ways.write(self.coupling.model_switch(), row);
            }
            return rows;
          },
          "centers"_a, "outward"_a, "radii"_a, "flat"_a, "max_updates"_a,
          "Return the equilibrium at each position, after at most `max_updates` model updates: rows as of simulate_path, and whether it "
          "converged.")
      .def(
          "simulate_realtime",
          [](SolverCore& self, const Paths& centers, const Paths& outward, const Numbers& radii, bool flat, double period, bool thread) {
            using Clock = SlowThread::Clock;
            Ways ways(centers, outward, radii, flat);
            auto [rows, row] = new_array<double>({ways.ticks(), ways.columns()});
            auto [times, t] = new_array<double>({ways.ticks(), 2});
            std::vector<double> slow;
            {
              const nb::gil_scoped_release unlocked;
              std::unique_ptr<SlowThread> other;
              if (ways.ticks() > 0 && (thread || self.coupling.update_count() == 0)) {
                self.coupling.tick(ways.at(0));
                if (thread)
                  other = std::make_unique<SlowThread>([&self] { self.coupling.update_model(); });
                else
                  self.coupling.update_model();
              }
              const auto begin = Clock::now();
              for (std::size_t k = 0; k < ways.ticks(); ++k, row += ways.columns(), t += 2) {
                const palpate::deformable::TipPair& tips = ways.at(k);
                const auto due =
                    begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period * static_cast<double>(k)));
                std::this_thread::sleep_until(due);
                const auto woken = Clock::now();
                self.coupling.tick(tips);
                t[1] = std::chrono::duration<double>(Clock::now() - woken).count();
                t[0] = std::chrono::duration<double>(woken - due).count();
                ways.write(self.coupling.model_switch(), row);
              }
              if (other) slow = other->join();
            }
            auto [seconds, s] = new_array<double>({slow.size(), 1});
            std::copy(slow.begin(), slow.end(), s);
            return nb::make_tuple(rows, times, seconds);
          },
          "centers"_a, "outward"_a, "radii"_a, "flat"_a, "period"_a, "thread"_a,
          "Step along a path, one tick each period of wall-clock time, with model updates in a thread, or with none but the first. Return "
          "rows as of simulate_path; lateness and duration of each tick, s; duration of each model update, s.")
      .def(
          "last_report", [](const SolverCore& self) { return step_row(self.coupling.last_report()); },
          "Return the report of the last model update: residual before it, N; conjugate gradient steps of the equilibrium and of the "
          "compliance; error of the compliance.")
      .def("displacement",
           [](SolverCore& self) {
             auto [out, data] = new_array<double>({self.points, 3});
             self.coupling.solver().displacement(data);
             return out;
           })
      .def("energy", [](SolverCore& self) { return self.coupling.solver().energy(); })
      .def(
          "local_model",
          [](SolverCore& self) {
            const palpate::deformable::LocalModel& s = self.coupling.current_model();
            const auto n = static_cast<std::size_t>(s.nodes.size());
            auto [names, i] = new_array<double>({n, 1});
            auto [compliance, c] = new_array<double>({n, n});
            auto [normals, o] = new_array<double>({n, 3});
            auto [inner, e] = new_array<double>({n, 1});
            for (std::size_t a = 0; a < n; ++a) {
              e[a] = s.inner[a] ? 1.0 : 0.0;
              i[a] = s.node_ids[a];
              for (std::size_t b = 0; b < n; ++b) c[a * n + b] = s.compliance(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b));
              for (std::size_t b = 0; b < 3; ++b) o[3 * a + b] = s.nodes.normal(static_cast<std::int32_t>(a))[static_cast<int>(b)];
            }
            return nb::make_tuple(names, normals, compliance, inner);
          },
          "Return the local model of the servo: surface nodes, their normals, compliance along the inward normals, m/N, and a mask of "
          "inner "
          "nodes.")
      .def("reset", [](SolverCore& self) { self.coupling.reset(); });
}

/// A hyperelastic body with one tip and synchronous model updates.
struct HyperelasticCore : BodyInLoop {
  std::size_t points;
  palpate::object::MultirateObject<AnyQuasiStaticSolver> body;
  bool initialized = false;

  HyperelasticCore(std::size_t count, std::unique_ptr<AnyQuasiStaticSolver> solid, int update_interval,
                   palpate::deformable::LocalModelSlip slip)
      : points(count), body(std::move(solid), update_interval, std::move(slip)) {}

  [[nodiscard]] std::unique_ptr<palpate::object::DeformableObject> in_loop() const override { return body.clone_at_rest(); }

  const palpate::deformable::ContactResult& tick(palpate::deformable::Tip tip) {
    if (tip.kind == palpate::deformable::Tip::Kind::sphere) tip.outward = body.outward(tip);
    if (!initialized) body.initialize(tip);
    initialized = true;
    const palpate::deformable::ContactResult& answer = body.step(tip);
    body.step_synchronously();
    return answer;
  }
};

void bind_hyperelastic(nb::module_& m) {
  nb::class_<SolidFrames>(m, "DeformationFrames", "Displacements of all points of a hyperelastic body after its last model update.")
      .def(nb::init<std::size_t>(), "points"_a)
      .def(
          "latest",
          [](SolidFrames& self) {
            const palpate::object::DeformationFrame& moved = self.latest();
            auto [rows, data] = new_array<double>({self.points(), 3});
            std::copy(moved.displacement.begin(), moved.displacement.end(), data);
            return nb::make_tuple(moved.step, moved.tick, rows);
          },
          "Return the last frame: number of model updates, servo tick of their tip position, displacements of all points (p, 3), m.");
  nb::class_<HyperelasticCore, BodyInLoop>(m, "HyperelasticBody")
      .def(
          "__init__",
          [](HyperelasticCore* self, const Points& points, const Cells& cells, const Numbers& shear, const Numbers& lame,
             const Flags& fixed, bool corotational, const Integers& point, const Triangles& triangles, const body_arrays::Moduli& modulus,
             int nodes_per_tip, int update_interval, double mu_static, double mu_dynamic, const body_arrays::Matrix& compliance,
             double poisson, double density, double rayleigh_alpha, double rayleigh_beta, double instantaneous_ratio,
             double retardation_time, double period) {
            if (update_interval < 1) throw nb::value_error("update_interval must be 1 or more");
            if (!(density >= 0.0 && rayleigh_alpha >= 0.0 && rayleigh_beta >= 0.0 && period > 0.0))
              throw nb::value_error("density and damping must not be negative, and the period must be positive");
            check(instantaneous_ratio, retardation_time);
            palpate::deformable::SolverOptions options;
            options.inertia = {density, rayleigh_alpha, rayleigh_beta};
            options.relaxation = {instantaneous_ratio, retardation_time};
            options.tick_period = period;
            options.update_interval = update_interval;
            options.contact_compliance = mu_static > 0.0;
            auto solid = solver_of(mesh_of(points, cells, shear, lame, fixed), corotational,
                                   surface_of(points.shape(0), point, triangles, modulus), nodes_per_tip, options);
            palpate::deformable::LocalModelSlip slip;
            if (mu_static > 0.0) {
              if (compliance.shape(0) != 3 * point.shape(0) || compliance.shape(1) != 3 * point.shape(0))
                throw nb::value_error("friction needs the compliance of the nodes (3n, 3n)");
              slip = {{mu_static, mu_dynamic}, palpate::deformable::FullCompliance(point.shape(0), compliance.data()), poisson};
            }
            new (self) HyperelasticCore(points.shape(0), std::move(solid), update_interval, std::move(slip));
          },
          "points"_a, "tetrahedra"_a, "shear"_a, "lame"_a, "fixed"_a, "corotational"_a, "node_points"_a, "triangles"_a, "modulus"_a,
          "nodes_per_tip"_a, "update_interval"_a, "static_friction"_a, "dynamic_friction"_a, "compliance"_a, "poisson"_a, "density"_a = 0.0,
          "rayleigh_alpha"_a = 0.0, "rayleigh_beta"_a = 0.0, "instantaneous_ratio"_a = 1.0, "retardation_time"_a = 1.0, "period"_a = 1e-3)
      .def(
          "simulate_path",
          [](HyperelasticCore& self, const Points& centers, const Points& outward, double radius, bool flat) {
            const std::size_t n = centers.shape(0);
            const bool mean_normal = outward.shape(0) == 0 && !flat;
            if (outward.shape(0) != n && !mean_normal) throw nb::value_error("the path needs one direction for each position");
            auto [rows, row] = new_array<double>({n, result_width});
            const nb::gil_scoped_release unlocked;
            for (std::size_t i = 0; i < n; ++i, row += result_width) {
              const palpate::math::Vector3<> out =
                  mean_normal ? palpate::math::Vector3<>::UnitZ()
                              : palpate::math::Vector3<>(Eigen::Map<const palpate::math::Vector3<>>(outward.data() + 3 * i));
              write_result(self.tick(tip_of(radius, flat, Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * i), out)), row);
            }
            return rows;
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a,
          "Step along a path. Return rows of force (3), deflection (3), energy, nodes, touching, solved, friction (3), sliding. Without "
          "directions, a sphere takes the mean normal of its contact nodes, as in a loop.")
      .def(
          "settle",
          [](HyperelasticCore& self, const Points& centers, const Points& outward, double radius, bool flat, int max_updates) {
            const std::size_t n = centers.shape(0);
            if (outward.shape(0) != n) throw nb::value_error("the path needs one direction for each position");
            auto [rows, row] = new_array<double>({n, result_width + 1});
            const nb::gil_scoped_release unlocked;
            for (std::size_t i = 0; i < n; ++i, row += result_width + 1) {
              const palpate::deformable::Tip tip = tip_of(radius, flat, Eigen::Map<const palpate::math::Vector3<>>(centers.data() + 3 * i),
                                                          Eigen::Map<const palpate::math::Vector3<>>(outward.data() + 3 * i));
              self.initialized = true;
              row[result_width] = self.body.settle(tip, max_updates) ? 1.0 : 0.0;
              write_result(self.body.last(), row);
            }
            return rows;
          },
          "centers"_a, "outward"_a, "radius"_a, "flat"_a, "max_updates"_a,
          "Return the equilibrium at each position, after at most `max_updates` model updates: rows as of simulate_path, and whether it "
          "converged.")
      .def(
          "contact_forces", [](const HyperelasticCore& self) { return contact_forces(self.body); },
          "Return the contact nodes of the last step and the forces along their inward normals, N.")
      .def(
          "displacement",
          [](const HyperelasticCore& self) {
            auto [out, data] = new_array<double>({self.points, 3});
            self.body.coupling().solver().displacement(data);
            return out;
          },
          "Return the displacements of all points at the last model update (p, 3), m.")
      .def(
          "energy", [](HyperelasticCore& self) { return self.body.energy(); },
          "Return the energy of the body and its layer at the last model update, kinetic energy included, J.")
      .def("reset", [](HyperelasticCore& self) {
        self.body.reset();
        self.initialized = false;
      });
}

}  // namespace

void bind_solid(nb::module_& m) {
  bind_solver(m);
  bind_hyperelastic(m);
  nb::class_<ModelCore>(m, "HyperelasticModel")
      .def(
          "__init__",
          [](ModelCore* self, const Points& points, const Cells& cells, const Numbers& shear, const Numbers& lame, const Flags& fixed,
             bool corotational, double instantaneous_ratio, double retardation_time) {
            check(instantaneous_ratio, retardation_time);
            const palpate::deformable::TetMesh mesh = mesh_of(points, cells, shear, lame, fixed);
            auto solid = palpate::deformable::make_hyperelastic_model(law_of(corotational), mesh, {instantaneous_ratio, retardation_time});
            new (self) ModelCore{points.shape(0), std::move(solid)};
          },
          "points"_a, "tetrahedra"_a, "shear"_a, "lame"_a, "fixed"_a, "corotational"_a, "instantaneous_ratio"_a = 1.0,
          "retardation_time"_a = 1.0)
      .def(
          "evaluate",
          [](ModelCore& self, const Points& displacement, double duration) {
            check(self, displacement);
            auto [forces, f] = new_array<double>({self.points, 3});
            return nb::make_tuple(self.model->evaluate(displacement.data(), duration, f), forces);
          },
          "displacement"_a, "duration"_a = palpate::deformable::fully_relaxed,
          "Return the energy, J, and the internal forces on the free points (p, 3), N, at the end of a step of a duration, s.")
      .def(
          "tangent",
          [](ModelCore& self, const Points& direction) {
            check(self, direction);
            auto [forces, f] = new_array<double>({self.points, 3});
            self.model->tangent(direction.data(), f);
            return forces;
          },
          "direction"_a,
          "Return the derivative of the internal forces along `direction`, N, at the last evaluated displacement, in single precision.")
      .def(
          "solve_equilibrium",
          [](ModelCore& self, const Points& load, double tolerance, int max_steps, double duration) {
            check(self, load);
            const nb::gil_scoped_release unlocked;
            return self.model->solve_equilibrium(load.data(), duration, tolerance, max_steps);
          },
          "load"_a, "tolerance"_a = 1e-8, "max_steps"_a = 60, "duration"_a = palpate::deformable::fully_relaxed,
          "Solve for the equilibrium under a load, N, at the end of a step of a duration, s. Return the number of Newton steps, or -1 if "
          "they do not converge.")
      .def("displacement",
           [](const ModelCore& self) {
             auto [out, data] = new_array<double>({self.points, 3});
             self.model->displacement(data);
             return out;
           })
      .def("reset", [](ModelCore& self) { self.model->reset(); });
}
