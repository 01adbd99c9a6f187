#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
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

  static constexpr int contact_columns = 4;  ///< of each object: force (3), touching

  Scene() = default;
  explicit Scene(std::vector<AnyObject> objects) : objects_(std::move(objects)), contacts_(objects_.size()) {}

  void add(AnyObject object) {
    objects_.push_back(std::move(object));
    contacts_.emplace_back();
  }
  [[nodiscard]] const std::vector<AnyObject>& objects() const noexcept { return objects_; }
  [[nodiscard]] AnyObject& object(std::size_t i) noexcept { return objects_[i]; }
  /// Contact with each object at the last step.
  [[nodiscard]] const std::vector<ContactResult>& contacts() const noexcept { return contacts_; }

  void start(const Vector3<>& tip) {
    for (AnyObject& object : objects_) object.start(tip);
  }

  const ContactResult& step(const TipState& tip) noexcept {
    result_ = {};
    Vector3<> force = Vector3<>::Zero();
    double largest = -1.0;
    bool touching = false;
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      const ContactResult& one = contacts_[i] = objects_[i].step(tip);
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
    std::fill(contacts_.begin(), contacts_.end(), ContactResult());
    result_ = {};
  }
  void update() {
    for (AnyObject& object : objects_) object.update();
  }

  /// The columns of each object, one object after the other: its contact, then its own.
  [[nodiscard]] int record_width() const noexcept {
    int width = 0;
    for (const AnyObject& object : objects_) width += contact_columns + object.record_width();
    return width;
  }
  void record(double* row) const noexcept {
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      Eigen::Map<Vector3<>>{row} = contacts_[i].force;
      row[3] = contacts_[i].touching ? 1.0 : 0.0;
      objects_[i].record(row + contact_columns);
      row += contact_columns + objects_[i].record_width();
    }
  }

 private:
  std::vector<AnyObject> objects_;
  std::vector<ContactResult> contacts_;  // of each object at the last step
  ContactResult result_;
};

}  // namespace palpate::object
