#pragma once

#include <concepts>
#include <memory>
#include <type_traits>
#include <utility>

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"
#include "palpate/object/spring_wall.hpp"

namespace palpate::object {

/// Any contact object, chosen at run time. A copy is an independent object. A SpringWall is stored inline; every other object costs one
/// virtual call per step.
class AnyObject {
 public:
  using Scalar = double;

  AnyObject() = default;
  AnyObject(const SpringWall& wall) : wall_(wall) {}  // NOLINT(google-explicit-constructor)
  template <ContactObject Object>
    requires(!std::same_as<std::remove_cvref_t<Object>, AnyObject> && !std::same_as<std::remove_cvref_t<Object>, SpringWall> &&
             std::copy_constructible<Object>)
  AnyObject(Object object)  // NOLINT(google-explicit-constructor): an object is one of any kind
      : other_(std::make_unique<Model<Object>>(std::move(object))) {}

  AnyObject(const AnyObject& o) : wall_(o.wall_), other_(o.other_ ? o.other_->clone() : nullptr) {}
  AnyObject& operator=(const AnyObject& o) { return *this = AnyObject(o); }
  AnyObject(AnyObject&&) noexcept = default;
  AnyObject& operator=(AnyObject&&) noexcept = default;
  ~AnyObject() = default;

  [[gnu::always_inline]] const ContactResult& step(const TipState& tip) noexcept {
    if (other_) return other_->step(tip);
    return wall_.step(tip);
  }
  void start(const Vector3<>& tip) {
    if (other_) other_->start(tip);
  }
  void reset() noexcept {
    if (other_) return other_->reset();
    wall_.reset();
  }
  void update() {
    if (other_) other_->update();
  }
  [[nodiscard]] int record_width() const noexcept { return other_ ? other_->record_width() : 0; }
  void record(double* row) const noexcept {
    if (other_) other_->record(row);
  }

  /// Return the object if it is an `Object`, else null.
  template <class Object>
  [[nodiscard]] Object* get_if() noexcept {
    if constexpr (std::same_as<Object, SpringWall>)
      return other_ ? nullptr : &wall_;
    else
      return other_ && other_->tag() == &Model<Object>::unique ? &static_cast<Model<Object>&>(*other_).object : nullptr;
  }
  template <class Object>
  [[nodiscard]] const Object* get_if() const noexcept {
    return const_cast<AnyObject*>(this)->get_if<Object>();
  }

 private:
  struct Interface {
    Interface() = default;
    Interface(const Interface&) = delete;
    Interface& operator=(const Interface&) = delete;
    Interface(Interface&&) = delete;
    Interface& operator=(Interface&&) = delete;
    virtual ~Interface() = default;
    [[nodiscard]] virtual std::unique_ptr<Interface> clone() const = 0;
    [[nodiscard]] virtual const void* tag() const noexcept = 0;
    virtual const ContactResult& step(const TipState& tip) noexcept = 0;
    virtual void start(const Vector3<>& tip) = 0;
    virtual void reset() noexcept = 0;
    virtual void update() = 0;
    [[nodiscard]] virtual int record_width() const noexcept = 0;
    virtual void record(double* row) const noexcept = 0;
  };

  template <class Object>
  struct Model final : Interface {
    static constexpr char unique = 0;  // its address names the type without run-time type information
    Object object;
    explicit Model(Object o) : object(std::move(o)) {}
    [[nodiscard]] std::unique_ptr<Interface> clone() const override { return std::make_unique<Model>(object); }
    [[nodiscard]] const void* tag() const noexcept override { return &unique; }
    const ContactResult& step(const TipState& tip) noexcept override { return object.step(tip); }
    void start(const Vector3<>& tip) override { object::start(object, tip); }
    void reset() noexcept override { object::reset(object); }
    void update() override { object::update(object); }
    [[nodiscard]] int record_width() const noexcept override { return object::record_width(object); }
    void record(double* row) const noexcept override { object::record(object, row); }
  };

  SpringWall wall_;
  std::unique_ptr<Interface> other_;
};

}  // namespace palpate::object
