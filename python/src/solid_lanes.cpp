/// Hyperelastic solvers. This file is compiled once for each SIMD width, as batch_lanes.cpp is.
#include <algorithm>
#include <palpate/deformable/hyperelastic/corotational.hpp>
#include <palpate/deformable/hyperelastic/neo_hookean.hpp>

#include "pressed.hpp"
#include "solid.hpp"

namespace palpate::solid {

namespace {

template <template <class> class Material>
class SolidOf final : public AnySolid {
 public:
  explicit SolidOf(const deformable::TetMesh& mesh)
      : solid_(mesh), free_(static_cast<std::size_t>(solid_.free_nodes())), at_(3 * solid_.nodes()), load_(solid_.unknowns()) {}

  double evaluate(const double* displacement, double* forces) override {
    gather(displacement, at_);
    solid_.set_displacement(at_.data());
    scatter(solid_.gradient(), free_, forces);
    return solid_.energy();
  }

  void tangent(const double* motion, double* forces) override {
    std::vector<double> free(solid_.unknowns());
    gather(motion, free);
    const std::vector<float> x(free.begin(), free.end());
    std::vector<float> y(x.size());
    float along = 0.0F;
    solid_.tangent().multiply(x.data(), y.data(), along);
    std::copy(y.begin(), y.end(), free.begin());
    scatter(free.data(), free_, forces);
  }

  int solve_equilibrium(const double* load, double tolerance, int max_steps) override {
    gather(load, load_);
    double size = 0.0;
    for (const double f : load_) size += f * f;
    for (int k = 0; k <= max_steps; ++k) {
      double left = 0.0;
      for (std::size_t i = 0; i < load_.size(); ++i) left += (load_[i] - solid_.gradient()[i]) * (load_[i] - solid_.gradient()[i]);
      if (left <= tolerance * tolerance * size) return k;
      if (k < max_steps) solid_.step(load_.data(), 1e-4F, 300);
    }
    return -1;
  }

  void displacement(double* to) const override { scatter(solid_.displacement(), solid_.nodes(), to); }
  void reset() override { solid_.reset(); }

 private:
  /// Copy from points to the first nodes, as many as `to` has.
  void gather(const double* from, std::vector<double>& to) const {
    for (std::size_t i = 0; 3 * i < to.size(); ++i)
      for (std::size_t a = 0; a < 3; ++a) to[3 * i + a] = from[3 * point(i) + a];
  }
  /// Copy from the first `nodes` nodes to their points.
  void scatter(const double* from, std::size_t nodes, double* to) const {
    for (std::size_t i = 0; i < nodes; ++i)
      for (std::size_t a = 0; a < 3; ++a) to[3 * point(i) + a] = from[3 * i + a];
  }
  [[nodiscard]] std::size_t point(std::size_t node) const { return static_cast<std::size_t>(solid_.point_of(static_cast<int>(node))); }

  deformable::HyperelasticModel<Material, PALPATE_LANES> solid_;
  std::size_t free_;
  std::vector<double> at_, load_;
};

template <template <class> class Material>
class PressedOf final : public AnyPressed {
 public:
  PressedOf(const PressedOf& other) : AnyPressed(), pressed_(other.pressed_) {}
  PressedOf& operator=(const PressedOf&) = delete;
  ~PressedOf() override = default;
  PressedOf(const deformable::TetMesh& mesh, const deformable::TetSurface& surface, const deformable::SolverOptions& options)
      : pressed_(mesh, surface, options) {}

  PressedStep step(const deformable::TipPair& tips, deformable::LocalModel& to) override {
    const auto report = pressed_.step(tips, to);
    return {report.relative_residual, report.newton.residual, report.newton.solver_steps, report.compliance.steps,
            report.compliance.max_error};
  }

  void displacement(double* to) const override { pressed_.displacement(to); }
  [[nodiscard]] double energy() override { return pressed_.model().energy(); }
  void reset() override { pressed_.reset(); }
  [[nodiscard]] std::unique_ptr<AnyPressed> clone_at_rest() const override {
    auto same = std::make_unique<PressedOf>(*this);
    same->reset();
    return same;
  }

 private:
  deformable::QuasiStaticSolver<Material, PALPATE_LANES> pressed_;
};

}  // namespace

template <>
std::unique_ptr<AnySolid> make<PALPATE_LANES>(bool corotational, const deformable::TetMesh& mesh) {
  if (corotational) return std::make_unique<SolidOf<deformable::Corotational>>(mesh);
  return std::make_unique<SolidOf<deformable::NeoHookean>>(mesh);
}

template <>
std::unique_ptr<AnyPressed> press<PALPATE_LANES>(bool corotational, const deformable::TetMesh& mesh, const deformable::TetSurface& surface,
                                                 const deformable::SolverOptions& options) {
  if (corotational) return std::make_unique<PressedOf<deformable::Corotational>>(mesh, surface, options);
  return std::make_unique<PressedOf<deformable::NeoHookean>>(mesh, surface, options);
}

}  // namespace palpate::solid
