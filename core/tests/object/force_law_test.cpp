#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <palpate/object/force_law.hpp>
#include <string>

namespace {

using palpate::math::Vector3;
using palpate::object::ForceLaw;
using palpate::object::ForceLawTable;

TEST(ForceLawTable, ForceIsTheDerivativeOfTheEnergyAndSlopeThatOfTheForce) {
  const ForceLawTable table({0.0, 1e-3, 3e-3}, {0.0, 0.5, 3.5});
  for (const double depth : {0.3e-3, 1.7e-3, 8e-3}) {
    const double h = 1e-7;
    const auto here = table.at(depth), before = table.at(depth - h), after = table.at(depth + h);
    EXPECT_NEAR((after.energy - before.energy) / (2 * h), here.force, 1e-6);
    EXPECT_NEAR((after.force - before.force) / (2 * h), here.slope, 1e-4);
  }
  EXPECT_EQ(table.at(1e-3).force, 0.5);
  EXPECT_NEAR(table.at(3e-3).energy, 0.25e-3 + 4e-3, 1e-18);
  EXPECT_EQ(table.at(-1e-3).force, 0.0);
  EXPECT_EQ(table.at(-1e-3).energy, 0.0);
  EXPECT_EQ(table.at(std::numeric_limits<double>::quiet_NaN()).force, 0.0);
}

TEST(ForceLawTable, NamesTheFirstFault) {
  EXPECT_EQ(ForceLawTable::fault({0.0, 1.0}, {0.0, 1.0}), nullptr);
  const std::string rise = ForceLawTable::fault({0.0, 1.0, 2.0}, {0.0, 1.0, 0.5});
  EXPECT_NE(rise.find("must rise"), std::string::npos);
  const std::string finite = ForceLawTable::fault({0.0, 1.0}, {0.0, std::numeric_limits<double>::infinity()});
  EXPECT_NE(finite.find("finite"), std::string::npos);
  EXPECT_NE(ForceLawTable::fault({0.0}, {0.0}), nullptr);
  EXPECT_NE(ForceLawTable::fault({0.1, 1.0}, {0.0, 1.0}), nullptr);
  EXPECT_NE(ForceLawTable::fault({0.0, 5e-324}, {0.0, 1.0}), nullptr);
}

TEST(ForceLaw, PushesAlongItsNormalOnly) {
  ForceLaw law(std::make_shared<const ForceLawTable>(std::vector{0.0, 1e-3, 3e-3}, std::vector{0.0, 0.5, 3.5}), {0.0, 0.0, 0.1},
               {0.0, 0.6, 0.8});
  EXPECT_FALSE(law.step({{0.0, 0.0, 0.2}, 1e3}).touching);
  const auto& c = law.step({Vector3<>(0.0, 0.0, 0.1) - 2e-3 * Vector3<>(0.0, 0.6, 0.8), 1e3});
  EXPECT_TRUE(c.touching);
  EXPECT_NEAR((c.force + 2.0 * Vector3<>(0.0, 0.6, 0.8)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(c.stiffness, 1000.0, 1e-9);
  double row[ForceLaw::columns];
  law.record(row);
  EXPECT_NEAR(row[0], 2e-3, 1e-15);
  EXPECT_NEAR(row[1], 1500.0, 1e-9);
}

}  // namespace
