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
    cylinder,  ///< rod from the center along the axis, without end; its edge is rounded with the radius `rim`
  };
  Shape shape = Shape::capsule;
  double radius = 5e-3;                 ///< m
  double length = 0.0;                  ///< of a capsule's segment, m
  double rim = 0.0;                     ///< of a cylinder, m; positive, at most `radius`
  Vector3<> axis = Vector3<>::UnitZ();  ///< unit, out of the body

  [[nodiscard]] static TipGeometry sphere(double radius) noexcept { return {.radius = radius}; }
  [[nodiscard]] static TipGeometry capsule(double radius, double length, const Vector3<>& axis) noexcept {
    return {.radius = radius, .length = length, .axis = axis};
  }
  [[nodiscard]] static TipGeometry cylinder(double radius, double rim, const Vector3<>& axis) noexcept {
    return {.shape = Shape::cylinder, .radius = radius, .rim = std::min(rim, radius), .axis = axis};
  }

  [[nodiscard]] bool is_sphere() const noexcept { return shape == Shape::capsule && length == 0.0; }

  /// Depth of a point in the tip and its derivatives.
  template <class Scalar>
  struct Depth {
    Scalar depth;          ///< negative signed distance, m
    Vector3<Scalar> away;  ///< unit vector in which the signed distance grows
    Vector3<Scalar> bend;  ///< derivative of away . normal by the point, 1/m, for the normal given to evaluate()
  };

  /// Evaluate the depth at `y`, the position relative to the center [m]; `normal` is the surface normal there.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] Depth<Scalar> evaluate(const Vector3<Scalar>& y, const Vector3<Scalar>& normal) const noexcept {
    return shape == Shape::capsule ? in_capsule<Scalar>(y, normal) : in_cylinder<Scalar>(y, normal);
  }

  /// Signed distance of a point from the tip, m; `y` is relative to the center.
  [[nodiscard]] double distance(const Vector3<>& y) const noexcept {
    const double along = y.dot(axis);
    if (shape == Shape::capsule) return (y - std::clamp(along, 0.0, length) * axis).norm() - radius;
    const double side = (y - along * axis).norm() - (radius - rim), end = rim - along;
    return std::hypot(std::max(side, 0.0), std::max(end, 0.0)) + std::min(std::max(side, end), 0.0) - rim;
  }

  /// Whether distance(y) is less than `most` [m], which is at least -radius.
  [[nodiscard]] bool within(const Vector3<>& y, double most) const noexcept {
    if (shape != Shape::capsule) return distance(y) < most;
    return (y - std::clamp(y.dot(axis), 0.0, length) * axis).squaredNorm() < (radius + most) * (radius + most);
  }

  /// Depth in a cylinder as of evaluate(), whose radius and rim may differ by lane.
  template <class Scalar>
  [[nodiscard, gnu::always_inline]] static Depth<Scalar> in_cylinder(const Vector3<Scalar>& y, const Vector3<Scalar>& normal,
                                                                     const Vector3<>& axis, Scalar radius, Scalar rim) noexcept {
    using std::sqrt;
    const Scalar zero(0.0), one(1.0);
    const Vector3<Scalar> a{Scalar(axis[0]), Scalar(axis[1]), Scalar(axis[2])};
    const Scalar along = (y[0] * a[0] + y[1] * a[1]) + y[2] * a[2];
    const Vector3<Scalar> aside = y - along * a;
    const Scalar off_axis = sqrt((aside[0] * aside[0] + aside[1] * aside[1]) + aside[2] * aside[2] + Scalar(1e-30));
    const Vector3<Scalar> radial = aside * (one / off_axis);
    const Scalar side = off_axis - (radius - rim), end = rim - along;
    const Scalar u = max_of(side, zero), v = max_of(end, zero), rounded = sqrt(u * u + v * v);
    const auto outside = rounded > zero;
    const auto flank = side > end;
    const Scalar scale = one / max_of(rounded, Scalar(1e-12) * radius);
    const Scalar across = select(outside, u * scale, select(flank, one, zero));  // components of `away`
    const Scalar endward = select(outside, v * scale, select(flank, zero, one));
    const Vector3<Scalar> away = across * radial - endward * a;
    const Vector3<Scalar> around = endward * radial + across * a;  // along the profile of the rim
    const Scalar radial_part = (normal[0] * radial[0] + normal[1] * radial[1]) + normal[2] * radial[2];
    const Scalar axial_part = (normal[0] * a[0] + normal[1] * a[1]) + normal[2] * a[2];
    const auto on_rim = (side > zero) & (end > zero);
    const Scalar turning = select(on_rim, (endward * radial_part + across * axial_part) / max_of(rounded, Scalar(1e-3) * rim), zero);
    const Vector3<Scalar> bend =
        turning * around + (across / max_of(off_axis, Scalar(1e-3) * radius)) * (normal - radial_part * radial - axial_part * a);
    return {rim - rounded - min_of(max_of(side, end), zero), away, bend};
  }

 private:
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
    return in_cylinder<Scalar>(y, normal, axis, Scalar(radius), Scalar(rim));
  }
};

}  // namespace palpate::deformable
