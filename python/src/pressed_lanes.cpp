/// Compiled once for each width of vector registers, as batch_lanes.cpp is and for the same reasons.
#include <palpate/body/corotational.hpp>
#include <palpate/body/neo_hookean.hpp>

#include "pressed.hpp"

namespace palpate::solid {

namespace {

template <template <class> class Material>
class PressedOf final : public AnyPressed {
 public:
  PressedOf(const PressedOf& other) : AnyPressed(), pressed_(other.pressed_) {}
  PressedOf& operator=(const PressedOf&) = delete;
  ~PressedOf() override = default;
  PressedOf(const SolidMesh& mesh, const SolidSurface& surface, const Effort& effort) : pressed_(mesh, surface, effort) {}

  PressedStep step(const BodyTips& tips, Snapshot& to) override {
    const auto report = pressed_.step(tips, to);
    return {report.newton.residual, report.newton.solver_steps, report.compliance_steps, report.compliance_left};
  }

  void displacement(double* to) const override {
    const auto& solid = pressed_.solid();
    for (std::size_t i = 0; i < solid.nodes(); ++i)
      for (std::size_t a = 0; a < 3; ++a)
        to[3 * static_cast<std::size_t>(solid.point_of(static_cast<std::int32_t>(i))) + a] = solid.displacement()[3 * i + a];
  }

  [[nodiscard]] double energy() override { return pressed_.solid().energy(); }
  void reset() override { pressed_.reset(); }
  [[nodiscard]] std::unique_ptr<AnyPressed> fresh() const override {
    auto same = std::make_unique<PressedOf>(*this);
    same->reset();
    return same;
  }

 private:
  PressedSolid<Material, PALPATE_LANES> pressed_;
};

}  // namespace

template <>
std::unique_ptr<AnyPressed> press<PALPATE_LANES>(bool corotational, const SolidMesh& mesh, const SolidSurface& surface,
                                                 const Effort& effort) {
  if (corotational) return std::make_unique<PressedOf<Corotational>>(mesh, surface, effort);
  return std::make_unique<PressedOf<NeoHookean>>(mesh, surface, effort);
}

}  // namespace palpate::solid
