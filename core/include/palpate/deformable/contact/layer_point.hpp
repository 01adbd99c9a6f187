#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "palpate/deformable/contact/layer_modulus.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/math/select.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Elastic layer (Winkler foundation) between a tip and one point of a surface. Its pressure stiffness is E* / (beta b), with the radius b
/// of a circle of the area of the patch of the nearest vertex.
template <class Scalar>
struct LayerPoint {
  Scalar stiffness;  ///< E* times the area of the point, over b, N/m
  Scalar radius;     ///< b, m
  Scalar inverse;    ///< 1 / (scale b), 1/m
  /// 0 where the cone of a sphere presses the point too (Tip::continued), no_cone elsewhere.
  Scalar cone = Scalar(0.0);
};
constexpr double no_cone = 1e30;  ///< above all heights, m

/// Constants of the layer, fitted to presses of cylinders and blocks of tetrahedra. The layer also replaces the curvature of a sphere that
/// flat facets miss; small facets miss less.
struct LayerConstants {
  static constexpr double flat_beta = 0.21;
  static constexpr double sphere_beta = 6.5;  ///< of spheres of the radius R: beta over (b / R)^2, within the following limits
  static constexpr double least_beta = 0.1;
  static constexpr double most_beta = 2.0;
  static constexpr double scale = 0.06;  ///< depth at which the secant stiffness has doubled, over b
  static constexpr double flare = 0.25;  ///< of a flat end, see TipGeometry, over b
};

/// Layer of the part of a triangle that belongs to one corner.
struct LayerCorner {
  LayerModulus stiffness{};  ///< E* times the area of the part, over b, N/m; zero: no tip presses it
  double radius = 0.0;       ///< b, m

  [[nodiscard]] bool exists() const noexcept { return stiffness.round > 0.0; }
  /// The layer of a point with a `share` of the part, under a tip of a kind.
  [[nodiscard]] LayerPoint<double> point(Tip::Kind kind, double share) const noexcept {
    return {share * (kind == Tip::Kind::flat ? stiffness.flat : stiffness.round), radius, 1.0 / (LayerConstants::scale * radius)};
  }
};

/// Points of a triangle that tips press: three for each corner, which share its part of the area.
struct CornerPoint {
  double own = 0.0, next = 0.0, last = 0.0;  ///< barycentric coordinates: of the corner, the next one and the one after
  double share = 0.0;                        ///< of the corner's stiffness
};
inline constexpr std::array<CornerPoint, 3> corner_points{
    {{1.0, 0.0, 0.0, 0.2}, {11.0 / 18.0, 5.0 / 18.0, 2.0 / 18.0, 0.4}, {11.0 / 18.0, 2.0 / 18.0, 5.0 / 18.0, 0.4}}};

/// Contact of a tip with one point of a layer.
template <class Scalar>
struct PointContact {
  Scalar stiffness;       ///< N/m; 0: no contact
  Scalar energy;          ///< J
  Scalar depth;           ///< in the tip, m
  Scalar push;            ///< part of the force along `away`, N
  Vector3<Scalar> away;   ///< direction in which the depth falls
  Vector3<Scalar> force;  ///< on the point, N: the negative gradient of `energy` by its position
};

namespace detail {

template <class Scalar>
[[nodiscard, gnu::always_inline]] inline Scalar dot(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline Vector3<Scalar> spread(const Vector3<>& a) noexcept {
  return {Scalar(a[0]), Scalar(a[1]), Scalar(a[2])};
}

constexpr double cone_cosine = 0.2;

}  // namespace detail

/// Whether a point may have a positive depth_in_sphere(): a quick test.
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline auto may_be_in_sphere(const Tip& tip, const Vector3<Scalar>& y) noexcept {
  const Scalar square = detail::dot(y, y), height = detail::dot(y, detail::spread<Scalar>(tip.outward));
  if (!tip.continued) return square < Scalar(tip.radius * tip.radius);
  const Scalar below = select(height < Scalar(0.0), height * height, Scalar(0.0));
  const Scalar least = select(below < Scalar(detail::cone_cosine * detail::cone_cosine) * square, Scalar(0.0), square);
  return least < Scalar(tip.radius * tip.radius);
}

/// Depth of a point in a sphere that its tangent cone at 78 degrees continues along `outward`: points above the center are pressed outward
/// and in, never through the sphere. The cone widens without end and would contain walls beside the tip and a surface that is higher: it
/// presses only what is connected to the points in the sphere (SurfaceContact::update_cones). `y` is relative to the center, `cone` as
/// in LayerPoint.
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline TipGeometry::Depth<Scalar> depth_in_sphere(const Tip& tip, const Vector3<Scalar>& y,
                                                                                    const Vector3<Scalar>& normal,
                                                                                    const Scalar& cone = Scalar(0.0)) noexcept {
  using detail::dot, std::sqrt;
  constexpr double cosine = detail::cone_cosine, sine = 0.9797958971132712;
  const Vector3<Scalar> axis = detail::spread<Scalar>(tip.outward);
  const Scalar least(1e-3 * tip.radius), height = dot(y, axis), distance = max_of(sqrt(dot(y, y)), least);
  const Scalar inverse = Scalar(1.0) / distance;
  const Vector3<Scalar> away = y * inverse;
  TipGeometry::Depth<Scalar> round{Scalar(tip.radius) - distance, away, (normal - dot(away, normal) * away) * inverse};
  if (!tip.continued) return round;
  const auto in_cone = height > cone - Scalar(cosine) * distance;
  if (!any(in_cone)) return round;
  const Vector3<Scalar> aside = y - height * axis;
  const Scalar off_axis = max_of(sqrt(dot(aside, aside)), least), over = Scalar(1.0) / off_axis;
  const Vector3<Scalar> radial = aside * over;
  const Vector3<Scalar> across = normal - dot(normal, radial) * radial - dot(normal, axis) * axis;
  const TipGeometry::Depth<Scalar> above{Scalar(tip.radius) - Scalar(sine) * off_axis + Scalar(cosine) * height,
                                         Scalar(sine) * radial - Scalar(cosine) * axis, (Scalar(sine) * over) * across};
  return {select(in_cone, above.depth, round.depth), select_each(in_cone, above.away, round.away),
          select_each(in_cone, above.bend, round.bend)};
}

/// beta of the layer under a tip.
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline Scalar layer_beta(const Tip& tip, const Scalar& radius) noexcept {
  if (tip.kind == Tip::Kind::flat) return Scalar(LayerConstants::flat_beta);
  const Scalar ratio = radius * Scalar(1.0 / tip.radius);
  return min_of(max_of(Scalar(LayerConstants::sphere_beta) * ratio * ratio, Scalar(LayerConstants::least_beta)),
                Scalar(LayerConstants::most_beta));
}

/// Depth of a point in a tip; `y` is relative to the center and `radius` is b, m.
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline TipGeometry::Depth<Scalar> depth_in_tip(const Tip& tip, const Vector3<Scalar>& y,
                                                                                 const Vector3<Scalar>& normal, const Scalar& radius,
                                                                                 const Scalar& cone = Scalar(0.0)) noexcept {
  if (tip.kind == Tip::Kind::sphere) return depth_in_sphere<Scalar>(tip, y, normal, cone);
  const Scalar flare = min_of(Scalar(LayerConstants::flare) * radius, Scalar(tip.radius));
  return TipGeometry::in_cylinder<Scalar>(y, normal, tip.outward, Scalar(tip.radius), flare);
}

/// Press a point at `y`, relative to the tip's center [m], of a surface with the outward unit normal `normal`. The energy is
/// 1/2 k w depth^2 (1 + (depth / scale)^2 / 2), with the depth in the tip. w falls from 1 to 0 where the surface looks away from the tip by
/// 90 to 120 degrees.
template <class Scalar>
[[nodiscard, gnu::always_inline]] inline PointContact<Scalar> press_point(const Tip& tip, const Vector3<Scalar>& y,
                                                                          const Vector3<Scalar>& normal,
                                                                          const LayerPoint<Scalar>& layer) noexcept {
  const Scalar zero(0.0), one(1.0);
  const auto in = depth_in_tip<Scalar>(tip, y, normal, layer.radius, layer.cone);
  const Scalar x = min_of(max_of(one - Scalar(2.0) * detail::dot(in.away, normal), zero), one), weight = x * x * (Scalar(3.0) - (x + x));
  const Scalar depth = max_of(in.depth, zero), k = layer.stiffness / layer_beta<Scalar>(tip, layer.radius);
  const Scalar over = depth * layer.inverse, part = over * over;
  const Scalar energy = (Scalar(0.5) * k) * (depth * depth) * (one + Scalar(0.5) * part), pressed = k * weight;
  const Scalar push = pressed * depth * (one + part) * in.slope, turned = (Scalar(12.0) * x * (one - x)) * energy;
  PointContact<Scalar> out;
  out.stiffness = select(in.depth > zero, pressed * (one + Scalar(3.0) * part) * (in.slope * in.slope), zero);
  out.energy = weight * energy;
  out.depth = depth;
  out.push = push;
  out.away = in.away;
  for (int a = 0; a < 3; ++a) out.force[a] = push * in.away[a] + turned * in.bend[a];
  return out;
}

}  // namespace palpate::deformable
