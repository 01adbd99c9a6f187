#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Shape of a rigid tip, given by its signed distance. No direction is needed for a sphere.
struct TipGeometry {
  enum class Shape {
    capsule,   ///< points within `radius` of the segment from the center to center + length axis; a sphere has length 0
    cylinder,  ///< rod from the center of its flat end along the axis, without other end, see in_cylinder()
  };
  static constexpr double flare_slope = 1.3;  ///< fitted to presses of flat ends to 0.6 of their radius

  Shape shape = Shape::capsule;
  double radius = 5e-3;                 ///< m
  double length = 0.0;                  ///< of a capsule's segment, m
  double flare = 0.0;                   ///< of a cylinder, m; positive, at most `radius`
  Vector3<> axis = Vector3<>::UnitZ();  ///< unit, out of the body

  [[nodiscard]] static TipGeometry sphere(double radius) noexcept { return {.radius = radius}; }
  [[nodiscard]] static TipGeometry capsule(double radius, double length, const Vector3<>& axis) noexcept {
    return {.radius = radius, .length = length, .axis = axis};
  }
  /// The radius of the cylinder grows with the height e over its end by flare_slope e / sqrt(1 + (e / flare)^2).
  [[nodiscard]] static TipGeometry cylinder(double radius, double flare, const Vector3<>& axis) noexcept {
    return {.shape = Shape::cylinder, .radius = radius, .flare = std::min(flare, radius), .axis = axis};
  }

  [[nodiscard]] bool is_sphere() const noexcept { return shape == Shape::capsule && length == 0.0; }

  /// Depth of a point in the tip and its derivatives.
  template <class Scalar>
  struct Depth {
    Scalar depth;                ///< negative signed distance, m; in a cylinder see in_cylinder()
    Vector3<Scalar> away;        ///< unit vector in which the depth falls fastest
    Vector3<Scalar> bend;        ///< derivative of away . normal by the point, 1/m, for the normal given to evaluate()
    Scalar slope = Scalar(1.0);  ///< fall of the depth along `away`; 1 where the depth is a distance
  };

  /// Evaluate the depth at `y`, the position relative to the center [m]; `normal` is the surface normal there.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Depth<Scalar> evaluate(const Vector3<Scalar>& y, const Vector3<Scalar>& normal) const noexcept {
    return shape == Shape::capsule ? in_capsule<Scalar>(y, normal) : in_cylinder<Scalar>(y, normal);
  }

  /// Largest distance of a point in the tip from its axis, m.
  [[nodiscard]] double reach() const noexcept { return radius + flare_slope * flare; }

  /// Signed distance of a point from the tip, m; beside a cylinder 0.6 to 1 times as large. `y` is relative to the center.
  [[nodiscard]] double distance(const Vector3<>& y) const noexcept {
    const double along = y.dot(axis);
    if (shape == Shape::capsule) return (y - std::clamp(along, 0.0, length) * axis).norm() - radius;
    const double height = std::max(along, 0.0), widening = flare_slope * flare * height / std::hypot(flare, height);
    const double side = cosine * ((y - along * axis).norm() - radius - widening);
    return std::hypot(std::max(side, 0.0), std::max(-along, 0.0)) + std::min(std::max(side, -along), 0.0);
  }

  /// Whether distance(y) is less than `most` [m], which is at least -radius.
  [[nodiscard]] bool within(const Vector3<>& y, double most) const noexcept {
    if (shape != Shape::capsule) return distance(y) < most;
    return (y - std::clamp(y.dot(axis), 0.0, length) * axis).squaredNorm() < (radius + most) * (radius + most);
  }

  /// Depth in a cylinder as of evaluate(), whose radius and flare may differ by lane.
  ///
  /// With the height e of a point over the end and its distance f from the flank, the depth is the harmonic sum e f / (e + f). The true
  /// distance has a kink at the edge, over which the points of a deeply pressed end jump. The second derivatives of the squared harmonic
  /// sum, in contrast, do not depend on how far the layer is compressed: points pass the edge gradually. The harmonic sum weakens the
  /// layer near the edge; the flare of the flank, which begins with the slope `flare_slope`, makes up for it.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] static Depth<Scalar> in_cylinder(const Vector3<Scalar>& y, const Vector3<Scalar>& normal,
                                                                     const Vector3<>& axis, Scalar radius, Scalar flare) noexcept {
    using std::sqrt;
    const Scalar zero(0.0), one(1.0);
    const Vector3<Scalar> a{Scalar(axis[0]), Scalar(axis[1]), Scalar(axis[2])};
    const Scalar along = (y[0] * a[0] + y[1] * a[1]) + y[2] * a[2];
    const Vector3<Scalar> aside = y - along * a;
    const Scalar off_axis = sqrt((aside[0] * aside[0] + aside[1] * aside[1]) + aside[2] * aside[2] + Scalar(1e-30));
    const Vector3<Scalar> radial = aside * (one / off_axis);
    const Scalar e = max_of(along, zero), square = one / (flare * flare + e * e), inverse = sqrt(square);
    const Scalar widening = (Scalar(flare_slope) * flare) * e * inverse,
                 slope = Scalar(flare_slope) * (flare * flare * flare) * square * inverse;
    const Scalar side = (radius - off_axis) + widening;
    const Scalar u = Scalar(cosine) * min_of(side, zero), v = min_of(along, zero), outside = sqrt(u * u + v * v);
    const Scalar f = max_of(side, zero), over = one / max_of(e + f, Scalar(1e-6) * radius), p = f * over, q = e * over;
    const Scalar by_flank = q * q, by_end = p * p + slope * by_flank;  // derivatives of the depth by distance from the flank, by height
    const Scalar length_square = one / max_of(by_flank * by_flank + by_end * by_end, Scalar(1e-3)), scale = sqrt(length_square);
    const Scalar across = by_flank * scale, endward = by_end * scale;  // components of `away`
    const Scalar radial_part = (normal[0] * radial[0] + normal[1] * radial[1]) + normal[2] * radial[2];
    const Scalar axial_part = (normal[0] * a[0] + normal[1] * a[1]) + normal[2] * a[2];
    const Scalar turning = (endward * radial_part + across * axial_part) * length_square, common = Scalar(2.0) * p * q * over;
    const Scalar by_height = common * (p - slope * q) + Scalar(3.0) * slope * e * square * by_flank * by_flank;
    const Vector3<Scalar> bend = turning * ((common * q) * radial + by_height * a) +
                                 (across / max_of(off_axis, Scalar(1e-3) * radius)) * (normal - radial_part * radial - axial_part * a);
    return {select(outside > zero, zero - outside, e * p), across * radial - endward * a, bend, one / scale};
  }

 private:
  static constexpr double cosine = 0.6;  // of the angle of the flare, rounded down

  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Depth<Scalar> in_capsule(Vector3<Scalar> y, const Vector3<Scalar>& normal) const noexcept {
    using std::sqrt;
    Vector3<Scalar> cross = normal;  // the part of the normal across the segment, beside which a point lies
    if (length > 0.0) {
      const Vector3<Scalar> a{Scalar(axis[0]), Scalar(axis[1]), Scalar(axis[2])};
      const Scalar along = (y[0] * a[0] + y[1] * a[1]) + y[2] * a[2];
      const auto beside = (along > Scalar(0.0)) & (along < Scalar(length));
      y -= min_of(max_of(along, Scalar(0.0)), Scalar(length)) * a;
      const Scalar part = select(beside, (normal[0] * a[0] + normal[1] * a[1]) + normal[2] * a[2], Scalar(0.0));
      cross -= part * a;
    }
    const Scalar square = (y[0] * y[0] + y[1] * y[1]) + y[2] * y[2], distance = sqrt(square + Scalar(1e-30));
    const Scalar inverse = Scalar(1.0) / distance;
    const Vector3<Scalar> away = y * inverse;
    const Scalar facing = (away[0] * normal[0] + away[1] * normal[1]) + away[2] * normal[2];
    return {Scalar(radius) - distance, away, (cross - facing * away) * min_of(inverse, Scalar(1e3 / radius))};
  }

  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Depth<Scalar> in_cylinder(const Vector3<Scalar>& y, const Vector3<Scalar>& normal) const noexcept {
    return in_cylinder<Scalar>(y, normal, axis, Scalar(radius), Scalar(flare));
  }
};

}  // namespace palpate::deformable
