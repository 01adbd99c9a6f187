#pragma once

#include "palpate/math/vector.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// The same force on the tip everywhere. It depends on no motion, so it closes no loop.
class ConstantField {
 public:
  using Scalar = double;

  /// @param force  on the tip, N
  explicit ConstantField(const Vector3<>& force) {
    result_.force = -force;
    result_.touching = true;
  }

  const ContactResult& step(const TipState& /*tip*/) noexcept { return result_; }

 private:
  ContactResult result_;
};

}  // namespace palpate::object
