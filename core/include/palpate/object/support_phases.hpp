#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_contact.hpp"
#include "palpate/deformable/linear/condensed_surface.hpp"
#include "palpate/deformable/linear/creep_motion.hpp"
#include "palpate/deformable/linear/modal_motion.hpp"
#include "palpate/deformable/linear/support_field.hpp"
#include "palpate/deformable/linear/support_offset.hpp"
#include "palpate/deformable/linear/support_phase.hpp"
#include "palpate/deformable/linear/supported_compliance.hpp"
#include "palpate/deformable/linear/supported_modes.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/signed_distance_body.hpp"

namespace palpate::object {

/// Contact of a linear body along its normals between two changes of its supports; see SupportedBody.
class NormalContactPhase {
 public:
  /// What copies share.
  struct Data {
    std::shared_ptr<const deformable::SupportPhase> phase;
    deformable::SurfaceNodes nodes;
    deformable::SupportedCompliance model;  // at rest

    explicit Data(std::shared_ptr<const deformable::SupportPhase> of)
        : phase(std::move(of)), nodes(phase->contact_nodes()), model(nodes, phase) {}
    Data(const Data&) = delete;
    Data& operator=(const Data&) = delete;
    Data(Data&&) = delete;
    Data& operator=(Data&&) = delete;
    ~Data() = default;
  };

  /// The data of every phase of a body.
  class Maker {
   public:
    [[nodiscard]] std::shared_ptr<const Data> operator()(std::shared_ptr<const deformable::SupportPhase> phase) const {
      return std::make_shared<const Data>(std::move(phase));
    }
  };

  explicit NormalContactPhase(std::shared_ptr<const Data> data)
      : data_(std::move(data)), model_(data_->model), contact_(data_->nodes, model_) {}
  NormalContactPhase(const NormalContactPhase&) = delete;
  NormalContactPhase& operator=(const NormalContactPhase&) = delete;
  NormalContactPhase(NormalContactPhase&&) = delete;
  NormalContactPhase& operator=(NormalContactPhase&&) = delete;
  ~NormalContactPhase() = default;

  [[nodiscard]] deformable::SupportField& field() noexcept { return model_.field(); }
  [[nodiscard]] const deformable::SupportPhase& phase() const noexcept { return *data_->phase; }

  const deformable::ContactResult& step(const deformable::Tip& tip) noexcept { return contact_.step(tip); }
  [[nodiscard]] const deformable::ContactResult& last() const noexcept { return contact_.last(); }
  [[nodiscard]] int contact_count() const noexcept { return contact_.last().nodes; }
  [[nodiscard]] std::int32_t contact_node(int k) const noexcept { return contact_.contact_nodes()[k]; }
  [[nodiscard]] Vector3<> node_force(int k) const noexcept { return -contact_.forces()[k] * data_->nodes.normal(contact_node(k)); }
  /// Append the loads of the tip on the body.
  void append_loads(deformable::BodyLoads& loads) const noexcept {
    for (int k = 0; k < contact_count(); ++k)
      loads.nodes.push_back({.node = phase().touched()[static_cast<std::size_t>(contact_node(k))], .force = node_force(k)});
  }
  [[nodiscard]] Vector3<> outward(const deformable::Tip& tip) const noexcept { return contact_.outward(tip); }
  void reset() noexcept { contact_.reset(); }
  [[nodiscard]] bool has_memory() const noexcept { return false; }
  [[nodiscard]] int tool_tips() const noexcept { return 0; }
  void place_tool(const Vector3<>* /*centers*/) noexcept {}
  [[nodiscard]] Vector3<> tool_force(int /*tip*/) const noexcept { return Vector3<>::Zero(); }

  void take_over(const NormalContactPhase& before) noexcept {
    const std::vector<std::int32_t>& touched = phase().touched();
    contact_.take_over(before.contact_, [&](std::int32_t node) { return before.phase().local(touched[static_cast<std::size_t>(node)]); });
  }

 private:
  std::shared_ptr<const Data> data_;
  deformable::SupportedCompliance model_;
  deformable::TipContact<deformable::SupportedCompliance> contact_;
};

/// Contact by signed distance between two changes of the supports of a body that is static, a standard linear solid, or elastic with
/// inertia; see SupportedBody.
class SignedDistancePhase final : public SignedDistanceBody {
 public:
  struct Data {
    std::shared_ptr<const SignedDistanceBody::Data> body;
    std::shared_ptr<const deformable::SupportPhase> phase;
  };

  /// The data of every phase of a body, from its whole contact surface. Of the options' modes it takes the damping: frequencies and shapes
  /// are those of the phase. A standard linear solid has none.
  class Maker {
   public:
    Maker(deformable::ContactSurface surface, SignedDistanceOptions options) : surface_(std::move(surface)), options_(std::move(options)) {
      if (!(options_.flare > 0.0)) options_.flare = deformable::PatchPoints::mean_spacing(surface_);  // of the whole surface
    }

    [[nodiscard]] std::shared_ptr<const Data> operator()(std::shared_ptr<const deformable::SupportPhase> phase) const {
      deformable::ContactSurface surface = surface_;
      surface.modulus.clear();
      for (const std::int32_t node : phase->touched()) surface.modulus.push_back(surface_.modulus[static_cast<std::size_t>(node)]);
      for (std::int32_t& node : surface.node)
        if (node >= 0) node = phase->local(node);
      SignedDistanceOptions options = options_;
      options.modes.shapes = phase->modes().shapes().data();
      options.modes.frequencies = phase->modes().frequencies();
      auto body = std::make_shared<const SignedDistanceBody::Data>(phase->contact_nodes(), phase->compliance().data(), surface, options);
      return std::make_shared<const Data>(Data{std::move(body), std::move(phase)});
    }

   private:
    deformable::ContactSurface surface_;
    SignedDistanceOptions options_;
  };

  explicit SignedDistancePhase(std::shared_ptr<const Data> data)
      : SignedDistanceBody(data->body),
        phase_data_(std::move(data)),
        offset_(nodes(), phase_data_->phase, sideways(), phase_data_->body->patches.creep),
        creep_(phase().modes().size() > 0 ? nullptr : static_cast<deformable::CreepMotion*>(contact_of_tips().motion())),
        modal_(phase().modes().size() > 0 ? static_cast<deformable::ModalMotion*>(contact_of_tips().motion()) : nullptr),
        own_(phase().modes().size()),
        velocity_(own_),
        of_body_(own_) {
    contact_of_tips().set_offset(&offset_);
    if (creep_ != nullptr) creep_->set_supports(&offset_);
  }

  [[nodiscard]] deformable::SupportField& field() noexcept { return offset_.field(); }
  [[nodiscard]] const deformable::SupportPhase& phase() const noexcept { return *phase_data_->phase; }
  [[nodiscard]] int contact_count() const noexcept { return contact().contact_count(); }
  [[nodiscard]] std::int32_t contact_node(int k) const noexcept { return contact().contact_node(k); }

  /// Append the loads of the tips on the body, and set those of the modes.
  void append_loads(deformable::BodyLoads& loads) noexcept {
    const double series = 1.0 - phase_data_->body->patches.creep.delayed_ratio;
    for (int k = 0; k < contact_count(); ++k)
      loads.nodes.push_back({.node = body_node(contact_node(k)), .force = series * counted_force(k)});
    if (creep_ != nullptr)
      for (const std::int32_t node : creep_->delayed().nodes())
        loads.nodes.push_back({.node = body_node(node), .delayed = offset_.counted(node, creep_->delayed().at(node))});
    if (modal_ == nullptr) return;
    for (std::size_t k = 0; k < own_.size(); ++k) own_[k] = modal_->inertial_force(k);
    phase().modes().velocity_to_body(own_.data(), loads.modes.data());
  }

  void take_over(const SignedDistancePhase& before) noexcept {
    const std::vector<std::int32_t>& touched = before.phase().touched();
    offset_.start_over();
    take_tool(before);
    if (modal_ != nullptr) take_motion(before);
    contact_of_tips().take_over(before.contact(),
                                [&](std::int32_t node) { return phase().local(touched[static_cast<std::size_t>(node)]); });
    if (creep_ != nullptr)
      creep_->set_state_work(before.creep_->state_work() + before.offset_.field().delayed_work() - offset_.field().delayed_work());
  }

 private:
  [[nodiscard]] std::int32_t body_node(std::int32_t node) const noexcept { return phase().touched()[static_cast<std::size_t>(node)]; }
  [[nodiscard]] Vector3<> counted_force(int k) const noexcept { return offset_.counted(contact_node(k), node_force(k)); }

  /// Continue the motion of the modes: the body's coordinates and velocities stay.
  void take_motion(const SignedDistancePhase& before) noexcept {
    const deformable::SupportedModes &modes = phase().modes(), &old = before.phase().modes();
    old.to_body(before.modal_->values(), before.offset_.field().forces(), of_body_.data());
    modes.from_body(of_body_.data(), field().forces(), own_.data());
    old.velocity_to_body(before.modal_->velocities(), of_body_.data());
    modes.velocity_from_body(of_body_.data(), velocity_.data());
    modal_->set_state(own_.data(), velocity_.data(), own_.size());
  }

  std::shared_ptr<const Data> phase_data_;
  deformable::SupportOffset offset_;
  deformable::CreepMotion* creep_;                // memory of the contact's body, or null
  deformable::ModalMotion* modal_;                // the same of a body with inertia
  std::vector<double> own_, velocity_, of_body_;  // scratch of take_motion(): of the phase's and the body's modes
};

}  // namespace palpate::object
