#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace palpate {

/// Numbers that an object and its copies have in common: written while the first is made, only read from then on.
template <class T>
class Shared {
 public:
  Shared() = default;
  explicit Shared(std::size_t count) : numbers_(std::make_shared<std::vector<T>>(count)) {}
  Shared(std::size_t count, const T& value) : numbers_(std::make_shared<std::vector<T>>(count, value)) {}

  [[nodiscard]] T* data() noexcept { return numbers_ ? numbers_->data() : nullptr; }
  [[nodiscard]] const T* data() const noexcept { return numbers_ ? numbers_->data() : nullptr; }
  [[nodiscard]] T& operator[](std::size_t i) noexcept { return (*numbers_)[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return (*numbers_)[i]; }

 private:
  std::shared_ptr<std::vector<T>> numbers_;
};

}  // namespace palpate
