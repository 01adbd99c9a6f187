// Hyperelastic models and solvers of one SIMD width, PALPATE_LANES.
#include "hyperelastic_lanes.hpp"

#include <algorithm>
#include <vector>

#include "palpate/deformable/hyperelastic/corotational.hpp"
#include "palpate/deformable/hyperelastic/hyperelastic_model.hpp"
#include "palpate/deformable/hyperelastic/neo_hookean.hpp"
#include "palpate/deformable/hyperelastic/quasi_static_solver.hpp"

namespace palpate::deformable::detail {

namespace {

template <template <class> class Material>
class ModelOf final : public AnyHyperelasticModel {
 public:
  ModelOf(const TetMesh& mesh, const Relaxation& relaxation)
      : model_(mesh, relaxation), free_(static_cast<std::size_t>(model_.free_nodes())), at_(3 * model_.nodes()), load_(model_.unknowns()) {}

  double evaluate(const double* displacement, double duration, double* forces) override {
    gather(displacement, at_);
    model_.begin_step(duration, at_.data());
    scatter(model_.gradient(), free_, forces);
    model_.end_step();
    return model_.energy();
  }

  void tangent(const double* motion, double* forces) override {
    std::vector<double> free(model_.unknowns());
    gather(motion, free);
    const std::vector<float> x(free.begin(), free.end());
    std::vector<float> y(x.size());
    float along = 0.0F;
    model_.tangent().multiply(x.data(), y.data(), along);
    std::copy(y.begin(), y.end(), free.begin());
    scatter(free.data(), free_, forces);
  }

  int solve_equilibrium(const double* load, double duration, double tolerance, int max_steps) override {
    gather(load, load_);
    model_.begin_step(duration);
    double size = 0.0;
    for (const double f : load_) size += f * f;
    for (int k = 0; k <= max_steps; ++k) {
      double left = 0.0;
      for (std::size_t i = 0; i < load_.size(); ++i) left += (load_[i] - model_.gradient()[i]) * (load_[i] - model_.gradient()[i]);
      if (left <= tolerance * tolerance * size) {
        model_.end_step();
        return k;
      }
      if (k < max_steps) model_.step(DeadLoad{load_.data(), load_.size()}, 1e-4F, 300);
    }
    return -1;
  }

  void displacement(double* to) const override { scatter(model_.displacement(), model_.nodes(), to); }
  void reset() override { model_.reset(); }

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
  [[nodiscard]] std::size_t point(std::size_t node) const { return static_cast<std::size_t>(model_.point_of(static_cast<int>(node))); }

  HyperelasticModel<Material, PALPATE_LANES> model_;
  std::size_t free_;
  std::vector<double> at_, load_;
};

template <template <class> class Material>
class SolverOf final : public AnyQuasiStaticSolver {
 public:
  SolverOf(const SolverOf& other) : AnyQuasiStaticSolver(), solver_(other.solver_) {}
  SolverOf& operator=(const SolverOf&) = delete;
  ~SolverOf() override = default;
  SolverOf(const TetMesh& mesh, const TetSurface& surface, const SolverOptions& options) : solver_(mesh, surface, options) {}

  ModelUpdateReport step(const TipPair& tips, LocalModel& to) override {
    const auto report = solver_.step(tips, to);
    return {report.relative_residual, report.newton.residual, report.newton.solver_steps, report.compliance.steps,
            report.compliance.max_error};
  }

  [[nodiscard]] AnyLocalContact make_contact() const override { return detail::make_contact<PALPATE_LANES>(); }
  void displacement(double* to) const override { solver_.displacement(to); }
  [[nodiscard]] Vector3<> normal_near(const Vector3<>& place) const override { return solver_.normal_near(place); }
  [[nodiscard]] double energy() override { return solver_.energy(); }
  void reset() override { solver_.reset(); }
  void set_clock(std::int64_t tick) override { solver_.set_clock(tick); }
  void set_static(bool is_static) override { solver_.set_static(is_static); }
  [[nodiscard]] std::unique_ptr<AnyQuasiStaticSolver> clone_at_rest() const override {
    auto same = std::make_unique<SolverOf>(*this);
    same->reset();
    return same;
  }

 private:
  QuasiStaticSolver<Material, PALPATE_LANES> solver_;
};

}  // namespace

template <>
std::unique_ptr<AnyHyperelasticModel> make_model<PALPATE_LANES>(HyperelasticLaw law, const TetMesh& mesh, const Relaxation& relaxation) {
  if (law == HyperelasticLaw::corotational) return std::make_unique<ModelOf<Corotational>>(mesh, relaxation);
  return std::make_unique<ModelOf<NeoHookean>>(mesh, relaxation);
}

template <>
std::unique_ptr<AnyQuasiStaticSolver> make_solver<PALPATE_LANES>(HyperelasticLaw law, const TetMesh& mesh, const TetSurface& surface,
                                                                 const SolverOptions& options) {
  if (law == HyperelasticLaw::corotational) return std::make_unique<SolverOf<Corotational>>(mesh, surface, options);
  return std::make_unique<SolverOf<NeoHookean>>(mesh, surface, options);
}

}  // namespace palpate::deformable::detail
