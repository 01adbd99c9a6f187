#pragma once

#include <cstddef>
#include <palpate/body/touched.hpp>
#include <palpate/math/latest.hpp>

/// Where the last slow step of a loop's body left its points. Neither the step nor whoever draws waits for the other.
class SolidFrames {
 public:
  explicit SolidFrames(std::size_t points) : points_(points) {
    for (palpate::MovedPoints& moved : box_.places()) moved.displacement.assign(3 * points, 0.0);
  }

  [[nodiscard]] palpate::Latest<palpate::MovedPoints>* box() noexcept { return &box_; }
  [[nodiscard]] std::size_t points() const noexcept { return points_; }

  /// For one thread at a time.
  const palpate::MovedPoints& latest() noexcept {
    box_.fetch();
    return box_.value();
  }

 private:
  std::size_t points_;
  palpate::Latest<palpate::MovedPoints> box_;
};
