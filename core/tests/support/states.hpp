#pragma once

#include <palpate/palpate.hpp>
#include <random>

inline const palpate::mechanism::Premium arm(palpate::plant::phantom_premium_1_5a());  ///< mechanism of the tests

/// Random states with a fixed seed, for laws that hold everywhere.
class States {
 public:
  palpate::math::Joints<3> draw(double size) {
    palpate::math::Joints<3> q;
    for (int i = 0; i < 3; ++i) q[i] = size * uniform_(engine_);
    return q;
  }

 private:
  std::mt19937_64 engine_{7};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
};
