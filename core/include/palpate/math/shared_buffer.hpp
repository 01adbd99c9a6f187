#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace palpate::math {

/// Array shared by an object and its copies. Written during construction of the first object,
/// read-only afterwards.
template <class T>
class SharedBuffer {
 public:
  SharedBuffer() = default;
  explicit SharedBuffer(std::size_t count) : values_(std::make_shared<std::vector<T>>(count)) {}
  SharedBuffer(std::size_t count, const T& value) : values_(std::make_shared<std::vector<T>>(count, value)) {}

  [[nodiscard]] T* data() noexcept { return values_ ? values_->data() : nullptr; }
  [[nodiscard]] const T* data() const noexcept { return values_ ? values_->data() : nullptr; }
  [[nodiscard]] T& operator[](std::size_t i) noexcept { return (*values_)[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return (*values_)[i]; }

 private:
  std::shared_ptr<std::vector<T>> values_;
};

}  // namespace palpate::math

namespace palpate {
using namespace math;  // shared vocabulary of all folders
}
