#pragma once

#include <concepts>
#include <memory>
#include <utility>

namespace palpate::math {

/// Base of an interface whose implementations are copied by value; see PolymorphicValue.
template <class Interface>
struct Cloneable {
  Cloneable() = default;
  Cloneable(const Cloneable&) = delete;
  Cloneable& operator=(const Cloneable&) = delete;
  Cloneable(Cloneable&&) = delete;
  Cloneable& operator=(Cloneable&&) = delete;
  virtual ~Cloneable() = default;
  [[nodiscard]] virtual std::unique_ptr<Interface> clone() const = 0;
  [[nodiscard]] virtual const void* tag() const noexcept = 0;  ///< address that identifies the type without run-time type information
};

/// Base of `Model<Value>`, which implements `Interface` with a value.
template <class Interface, template <class> class Model, class Value>
struct CloneableModel : Interface {
  static constexpr char unique = 0;
  Value value;
  explicit CloneableModel(Value v) : value(std::move(v)) {}
  [[nodiscard]] std::unique_ptr<Interface> clone() const override { return std::make_unique<Model<Value>>(value); }
  [[nodiscard]] const void* tag() const noexcept override { return &unique; }
};

/// A value of a type chosen at run time: an `Inline`, stored in place, or any type behind an `Interface`. A copy is independent.
template <class Inline, class Interface, template <class> class Model>
class PolymorphicValue {
 public:
  PolymorphicValue() = default;
  PolymorphicValue(const PolymorphicValue& o) : inline_(o.inline_), other_(o.other_ ? o.other_->clone() : nullptr) {}
  PolymorphicValue& operator=(const PolymorphicValue& o) { return *this = PolymorphicValue(o); }
  PolymorphicValue(PolymorphicValue&&) noexcept = default;
  PolymorphicValue& operator=(PolymorphicValue&&) noexcept = default;
  ~PolymorphicValue() = default;

  /// Return the value if it is a `Value`, else null.
  template <class Value>
  [[nodiscard]] Value* get_if() noexcept {
    if constexpr (std::same_as<Value, Inline>)
      return other_ ? nullptr : &inline_;
    else
      return other_ && other_->tag() == &Model<Value>::unique ? &static_cast<Model<Value>&>(*other_).value : nullptr;
  }
  template <class Value>
  [[nodiscard]] const Value* get_if() const noexcept {
    return const_cast<PolymorphicValue*>(this)->template get_if<Value>();
  }

 protected:
  explicit PolymorphicValue(Inline value) : inline_(std::move(value)) {}
  explicit PolymorphicValue(std::unique_ptr<Interface> other) : other_(std::move(other)) {}

  Inline inline_;
  std::unique_ptr<Interface> other_;  // null: the value is inline_
};

}  // namespace palpate::math
