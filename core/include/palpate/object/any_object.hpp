#pragma once

#include <concepts>
#include <memory>
#include <type_traits>
#include <utility>

#include "palpate/math/polymorphic_value.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"
#include "palpate/object/spring_wall.hpp"

namespace palpate::object {

namespace detail {
struct ObjectInterface : math::Cloneable<ObjectInterface> {
  virtual const ContactResult& step(const TipState& tip) noexcept = 0;
  virtual void start(const Vector3<>& tip) = 0;
  virtual void reset() noexcept = 0;
  virtual void update() = 0;
  [[nodiscard]] virtual int record_width() const noexcept = 0;
  virtual void record(double* row) const noexcept = 0;
};

template <class Object>
struct ObjectModel final : math::CloneableModel<ObjectInterface, ObjectModel, Object> {
  using math::CloneableModel<ObjectInterface, detail::ObjectModel, Object>::CloneableModel;
  const ContactResult& step(const TipState& tip) noexcept override { return this->value.step(tip); }
  void start(const Vector3<>& tip) override { object::start(this->value, tip); }
  void reset() noexcept override { object::reset(this->value); }
  void update() override { object::update(this->value); }
  [[nodiscard]] int record_width() const noexcept override { return object::record_width(this->value); }
  void record(double* row) const noexcept override { object::record(this->value, row); }
};
}  // namespace detail

/// Any contact object, chosen at run time. A copy is an independent object. A SpringWall is stored inline; every other object costs one
/// virtual call per step.
class AnyObject : public math::PolymorphicValue<SpringWall, detail::ObjectInterface, detail::ObjectModel> {
 public:
  using Scalar = double;

  AnyObject() = default;
  AnyObject(const SpringWall& wall) : PolymorphicValue(wall) {}  // NOLINT(google-explicit-constructor)
  template <ContactObject Object>
    requires(!std::same_as<std::remove_cvref_t<Object>, AnyObject> && !std::same_as<std::remove_cvref_t<Object>, SpringWall> &&
             std::copy_constructible<Object>)
  AnyObject(Object object)  // NOLINT(google-explicit-constructor): an object is one of any kind
      : PolymorphicValue(std::make_unique<detail::ObjectModel<Object>>(std::move(object))) {}

  [[gnu::always_inline]] const ContactResult& step(const TipState& tip) noexcept {
    if (other_) return other_->step(tip);
    return inline_.step(tip);
  }
  void start(const Vector3<>& tip) {
    if (other_) other_->start(tip);
  }
  void reset() noexcept {
    if (other_) return other_->reset();
    inline_.reset();
  }
  void update() {
    if (other_) other_->update();
  }
  [[nodiscard]] int record_width() const noexcept { return other_ ? other_->record_width() : 0; }
  void record(double* row) const noexcept {
    if (other_) other_->record(row);
  }
};

}  // namespace palpate::object
