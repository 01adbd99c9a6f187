#pragma once

#include <Eigen/Core>
#include <cmath>

#include "palpate/math/sincos.hpp"

namespace palpate {

/// A number with its exact derivatives along N directions: value + gradient . epsilon, epsilon^2 = 0
/// (forward-mode differentiation). Run through a templated formula it gives the formula's Jacobian to rounding.
template <int N>
struct Dual {
  double value = 0.0;
  Eigen::Matrix<double, N, 1> gradient = Eigen::Matrix<double, N, 1>::Zero();

  Dual() = default;
  Dual(double v) : value(v) {}  // NOLINT(google-explicit-constructor): constants mix with duals in formulas
  Dual(double v, const Eigen::Matrix<double, N, 1>& g) : value(v), gradient(g) {}

  /// The independent variable number `direction`: its derivative along that direction is one.
  static Dual variable(double v, int direction) {
    Dual d(v);
    d.gradient[direction] = 1.0;
    return d;
  }

  Dual operator-() const { return {-value, -gradient}; }
  Dual& operator+=(const Dual& o) {
    value += o.value;
    gradient += o.gradient;
    return *this;
  }
  Dual& operator-=(const Dual& o) {
    value -= o.value;
    gradient -= o.gradient;
    return *this;
  }
  Dual& operator*=(const Dual& o) {
    gradient = gradient * o.value + value * o.gradient;
    value *= o.value;
    return *this;
  }
  Dual& operator/=(const Dual& o) {
    value /= o.value;
    gradient = (gradient - value * o.gradient) / o.value;
    return *this;
  }

  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator*(Dual a, const Dual& b) { return a *= b; }
  friend Dual operator/(Dual a, const Dual& b) { return a /= b; }
  friend bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
};

template <int N>
SineCosine<Dual<N>> sincos(const Dual<N>& x) {
  const auto [s, c] = sincos(x.value);
  return {Dual<N>(s, c * x.gradient), Dual<N>(c, -s * x.gradient)};
}

template <int N>
Dual<N> sqrt(const Dual<N>& x) {
  const double root = std::sqrt(x.value);
  return {root, x.gradient / (2.0 * root)};
}

}  // namespace palpate

namespace Eigen {
template <int N>
struct NumTraits<palpate::Dual<N>> : NumTraits<double> {
  using Real = palpate::Dual<N>;
  using NonInteger = palpate::Dual<N>;
  using Nested = palpate::Dual<N>;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 1, ReadCost = 1, AddCost = N, MulCost = 2 * N };
};
}  // namespace Eigen
