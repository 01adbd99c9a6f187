// A tick of a body takes no memory: this program's own allocation functions count every call.
#include <gtest/gtest.h>

#include <palpate/body/compliance.hpp>
#include <palpate/body/patch.hpp>

#include "allocations.hpp"

namespace {

TEST(BodyNoAllocation, InATickOfASlidingTip) {
  const int side = 21;
  const double width = 1e-3;
  std::vector<palpate::Vector3<>> points;
  for (int i = 0; i < side * side; ++i) points.emplace_back(width * (i % side - 10), width * (i / side - 10), 0.0);
  const std::size_t n = points.size();
  std::vector<float> full(9 * n * n, 0.0F);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t a = 0; a < 3; ++a)
        full[(3 * i + a) * 3 * n + 3 * j + a] = static_cast<float>(1e-5 / ((points[i] - points[j]).norm() + 0.3 * width));
  const palpate::BodyNodes nodes(points, std::vector<palpate::Vector3<>>(n, palpate::Vector3<>::UnitZ()),
                                 std::vector<double>(n, width * width));
  palpate::Compliance body(nodes, full.data());
  palpate::BodyContact<palpate::Compliance> contact(nodes, body);
  palpate::BodyTip tip;
  for (const auto kind : {palpate::BodyTip::Kind::sphere, palpate::BodyTip::Kind::flat}) {
    tip.kind = kind;
    tip.radius = 4e-3;
    long pressed = 0;
    int most = 0;
    const long before = allocations;
    for (int k = 0; k < 3000; ++k) {
      const double top = kind == palpate::BodyTip::Kind::sphere ? tip.radius : 0.0;
      tip.centre = {5e-3 * std::sin(0.01 * k), 4e-3 * std::cos(0.017 * k), top + 2e-3 * std::sin(0.05 * k)};
      const palpate::BodyAnswer& a = contact.step(tip);
      pressed += a.touching ? 1 : 0;
      most = std::max(most, a.nodes);
    }
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(pressed, 1000);
    EXPECT_LT(pressed, 2900);
    EXPECT_GT(most, 15);
  }
}

}  // namespace
