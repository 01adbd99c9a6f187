#pragma once

#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/object/any_object.hpp"
#include "palpate/object/contact_object.hpp"

namespace palpate::object {

/// Several objects touched by one tip: their forces add.
///
/// Deflection, normal, depth and stiffness are those of the object that is pressed hardest.
class Scene {
 public:
  using Scalar = double;

  Scene() = default;
  explicit Scene(std::vector<AnyObject> objects) : objects_(std::move(objects)) {}

  void add(AnyObject object) { objects_.push_back(std::move(object)); }
  [[nodiscard]] const std::vector<AnyObject>& objects() const noexcept { return objects_; }
  [[nodiscard]] std::vector<AnyObject>& objects() noexcept { return objects_; }

  void start(const Vector3<>& tip) {
    for (AnyObject& object : objects_) object.start(tip);
  }

  const ContactResult& step(const TipState& tip) noexcept {
    result_ = {};
    Vector3<> force = Vector3<>::Zero();
    double largest = -1.0;
    bool touching = false;
    for (AnyObject& object : objects_) {
      const ContactResult& one = object.step(tip);
      force += one.force;
      touching = touching || one.touching;
      const double load = one.touching ? one.force.squaredNorm() : -1.0;
      if (load > largest) {
        largest = load;
        result_ = one;
      }
    }
    result_.force = force;
    result_.touching = touching;
    return result_;
  }

  [[nodiscard]] const ContactResult& result() const noexcept { return result_; }

  void reset() noexcept {
    for (AnyObject& object : objects_) object.reset();
    result_ = {};
  }
  void update() {
    for (AnyObject& object : objects_) object.update();
  }

  /// The columns of each object, one object after the other.
  [[nodiscard]] int record_width() const noexcept {
    int width = 0;
    for (const AnyObject& object : objects_) width += object.record_width();
    return width;
  }
  void record(double* row) const noexcept {
    for (const AnyObject& object : objects_) {
      object.record(row);
      row += object.record_width();
    }
  }

 private:
  std::vector<AnyObject> objects_;
  ContactResult result_;
};

}  // namespace palpate::object
