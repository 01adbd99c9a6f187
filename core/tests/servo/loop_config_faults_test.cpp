// A servo on every kind of object with invalid, repeated and late samples between valid ones.
// PALPATE_ROUNDS=200 runs ten million ticks.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <palpate/mechanism/slider.hpp>
#include <palpate/servo/loop_config.hpp>
#include <random>
#include <string>

#include "support/loop_folder.hpp"
#include "support/rounds.hpp"

namespace {

using palpate::control::AnyController;
using palpate::control::StateSpace;
using palpate::math::Joints;
using palpate::math::Vector3;
using palpate::mechanism::Slider;
using palpate::object::AnyObject;

struct Sample {
  Joints<1> position;
  Vector3<> reference = Vector3<>::Zero();
  double elapsed = 1e-3;
  bool fault = false;
};

/// A moving slider whose samples are invalid in bursts of 1 to 20 ticks.
class Samples {
 public:
  Sample next() {
    Sample out{Joints<1>(0.01 * std::sin(0.05 * count_++))};
    if (left_ == 0 && one_in(30)) {
      left_ = 1 + static_cast<int>(engine_() % 20);
      kind_ = static_cast<int>(engine_() % 8);
    }
    if (left_ > 0) {
      --left_;
      spoil(out);
    } else if (one_in(10)) {
      constexpr double odd[] = {0.0, 5e-3, 1e-12, -1.0, std::numeric_limits<double>::quiet_NaN()};
      out.elapsed = odd[engine_() % 5];
    }
    return out;
  }

 private:
  bool one_in(unsigned n) { return engine_() % n == 0; }

  void spoil(Sample& out) const {
    constexpr double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    constexpr double values[] = {nan, inf, -inf, 1e300, 1e155, 0.5};  // the last one is a jump
    out.fault = true;
    if (kind_ < 6)
      out.position[0] = values[kind_];
    else
      out.reference[2] = kind_ == 6 ? nan : 1e300;
  }

  std::mt19937_64 engine_{7};
  int count_ = 0;
  int left_ = 0;
  int kind_ = 0;
};

class FaultInjection : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Objects, FaultInjection, testing::ValuesIn(loop_folder::object_kinds),
                         [](const auto& info) { return std::string(info.param); });

// Law: every invalid sample is counted and no other, the torque is finite and within the drive's limit at every tick, and ten valid ticks
// after a fault the servo applies the full force again.
TEST_P(FaultInjection, NoInvalidSampleReachesATorque) {
  constexpr double peak = 8.5;
  const auto loaded = palpate::servo::load_loop_config(loop_folder::MemorySource(loop_folder::valid(GetParam())));
  ASSERT_TRUE(loaded) << loaded.error;
  auto setup = *loaded.config->setup<Slider>();
  setup.faults = {.speed = 2.0, .fade = 10e-3};
  Eigen::MatrixXd integrate(1, 6);
  integrate << 1e-3, 0, 0, -1e-3, 0, 0;
  const AnyController integral = StateSpace(0.99 * Eigen::MatrixXd::Identity(1, 1), integrate, Eigen::MatrixXd::Identity(3, 1),
                                            Eigen::MatrixXd::Zero(3, 6), Eigen::MatrixXd::Zero(1, 3));
  for (const bool direct : {true, false}) {
    palpate::servo::Servo<Slider, AnyObject, AnyController> servo(setup, setup.object, direct ? setup.controller : integral);
    Samples samples;
    long faults = 0;
    int valid = 0;
    Vector3<> wanted = Vector3<>::Zero();
    for (int k = 0; k < 1500 * rounds(); ++k) {
      const Sample sample = samples.next();
      const auto& tick = servo.tick(sample.position, sample.reference, sample.elapsed);
      faults += sample.fault ? 1 : 0;
      valid = sample.fault ? 0 : valid + 1;
      ASSERT_EQ(tick.fault, sample.fault) << k;
      ASSERT_EQ(servo.faults(), faults) << k;
      ASSERT_TRUE(std::abs(tick.torque[0]) <= peak * (1.0 + 1e-12)) << k;
      if (direct && valid > 10 && wanted.norm() < peak) {
        ASSERT_EQ(tick.torque[0], wanted[0]) << k;  // the delay is one tick
      }
      wanted = sample.reference - tick.object_force;
      servo.update();
    }
    EXPECT_GT(faults, 40);
  }
}

}  // namespace
