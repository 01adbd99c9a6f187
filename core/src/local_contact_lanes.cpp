// Contact of the servo with local models of hyperelastic bodies, of one SIMD width, PALPATE_LANES. All widths give the same bits.
#include <cstdint>
#include <memory>

#include "hyperelastic_lanes.hpp"
#include "palpate/deformable/multirate/local_model_contact.hpp"

namespace palpate::deformable::detail {

namespace {

class ContactOf final : public AnyLocalContact::Interface {
 public:
  const MultiTipResult& solve(const LocalModel& model, const TipPair& tips, double compliance_scale) noexcept override {
    return contact_.solve(model, tips, compliance_scale);
  }
  void start_from(const LocalModel& model, const Interface& other) noexcept override {
    contact_.start_from(model, static_cast<const ContactOf&>(other).contact_);
  }
  [[nodiscard]] const MultiTipResult& last() const noexcept override { return contact_.last(); }
  [[nodiscard]] const std::int32_t* contact_nodes() const noexcept override { return contact_.contact_nodes(); }
  [[nodiscard]] const double* forces() const noexcept override { return contact_.forces(); }
  [[nodiscard]] const Vector3<>& node_force(int k) const noexcept override { return contact_.node_force(k); }
  [[nodiscard]] double layer_stiffness(int k) const noexcept override { return contact_.layer_stiffness(k); }

 private:
  LocalModelContact contact_;
};

}  // namespace

template <>
AnyLocalContact make_contact<PALPATE_LANES>() {
  return AnyLocalContact(std::make_unique<ContactOf>());
}

}  // namespace palpate::deformable::detail
