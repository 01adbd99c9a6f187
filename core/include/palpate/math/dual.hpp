#pragma once

#include <Eigen/Core>
#include <cmath>
#include <type_traits>

#include "palpate/math/sincos.hpp"

namespace palpate::math {

/// Dual number of forward-mode automatic differentiation: value + gradient . epsilon,
/// epsilon^2 = 0.
///
/// A templated formula evaluated on `Dual` yields its value and its Jacobian, exact to rounding.
/// `N` is the number of independent variables.
template <int N, class Value = double>
struct Dual {
  using Gradient = Eigen::Matrix<Value, N, 1>;
  Value value = 0.0;
  Gradient gradient = Gradient::Constant(0.0);

  Dual() = default;
  template <class Number>
    requires std::is_convertible_v<Number, Value>
  Dual(const Number& v) : value(v) {}  // NOLINT(google-explicit-constructor): constants mix with duals in formulas
  Dual(const Value& v, const Gradient& g) : value(v), gradient(g) {}

  /// Return independent variable number `direction`, with derivative 1 along that direction.
  static Dual variable(const Value& v, int direction) {
    Dual d(v);
    d.gradient[direction] = 1.0;
    return d;
  }

  /// Return the number with the given value and derivatives. Loops over the derivatives compile faster than Eigen's expressions.
  template <class Derivative>
  static Dual with_gradient(const Value& v, const Derivative& derivative) {
    Dual out(v);
    for (int i = 0; i < N; ++i) out.gradient[i] = derivative(i);
    return out;
  }

  Dual operator-() const {
    return with_gradient(-value, [&](int i) { return -gradient[i]; });
  }
  Dual& operator+=(const Dual& o) {
    value += o.value;
    for (int i = 0; i < N; ++i) gradient[i] += o.gradient[i];
    return *this;
  }
  Dual& operator-=(const Dual& o) {
    value -= o.value;
    for (int i = 0; i < N; ++i) gradient[i] -= o.gradient[i];
    return *this;
  }
  Dual& operator*=(const Dual& o) {
    for (int i = 0; i < N; ++i) gradient[i] = gradient[i] * o.value + o.gradient[i] * value;
    value *= o.value;
    return *this;
  }
  Dual& operator/=(const Dual& o) {
    value /= o.value;
    for (int i = 0; i < N; ++i) gradient[i] = (gradient[i] - o.gradient[i] * value) / o.value;
    return *this;
  }

  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator*(Dual a, const Dual& b) { return a *= b; }
  friend Dual operator/(Dual a, const Dual& b) { return a /= b; }
  friend auto operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend auto operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
};

/// Return sine and cosine with their derivatives, given sine and cosine of the value.
template <int N, class Value>
[[gnu::always_inline]] inline SineCosine<Dual<N, Value>> sincos(const SineCosine<Value>& at, const Eigen::Matrix<Value, N, 1>& gradient) {
  using Out = Dual<N, Value>;
  return {Out::with_gradient(at.sine, [&](int i) { return gradient[i] * at.cosine; }),
          Out::with_gradient(at.cosine, [&](int i) { return gradient[i] * -at.sine; })};
}

template <int N, class Value>
SineCosine<Dual<N, Value>> sincos(const Dual<N, Value>& x) {
  return sincos<N, Value>(sincos(x.value), x.gradient);
}

template <int N, class Value>
Dual<N, Value> sin(const Dual<N, Value>& x) {
  return sincos(x).sine;
}

template <int N, class Value>
Dual<N, Value> cos(const Dual<N, Value>& x) {
  return sincos(x).cosine;
}

template <int N, class Value>
Dual<N, Value> atan2(const Dual<N, Value>& y, const Dual<N, Value>& x) {
  using std::atan2;
  return {atan2(y.value, x.value), (y.gradient * x.value - x.gradient * y.value) / (x.value * x.value + y.value * y.value)};
}

template <int N, class Value>
Dual<N, Value> sqrt(const Dual<N, Value>& x) {
  using std::sqrt;
  const Value root = sqrt(x.value);
  return {root, x.gradient / (2.0 * root)};
}

}  // namespace palpate::math

namespace Eigen {
template <int N, class Value>
struct NumTraits<palpate::math::Dual<N, Value>> : NumTraits<double> {
  using Real = palpate::math::Dual<N, Value>;
  using NonInteger = palpate::math::Dual<N, Value>;
  using Nested = palpate::math::Dual<N, Value>;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 1, ReadCost = 1, AddCost = N, MulCost = 2 * N };
};
}  // namespace Eigen
