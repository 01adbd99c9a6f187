"""Validation of user input to bodies: numbers in SI, or text with a unit."""

from __future__ import annotations

import warnings
from math import isfinite
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.checks import tool_mistake
from palpate.errors import PoseError
from palpate.fem.errors import BodyError, BodyWarning
from palpate.units import parse_quantity, to_si

TipShape = Literal["sphere", "flat"]

_FAR: Final = 100.0  # extents of a body from which a path is taken for one in another unit


def number(value: float | str, unit: str, field: str) -> float:
    """Return `value` in the SI unit `unit`.

    Raises:
        BodyError: the value of `field` cannot be read or is not finite.
    """
    result = to_si(value, unit, field, error=BodyError)
    if not isfinite(result):
        raise BodyError(f"{field}: {result} is not a finite number")
    return result


def length(value: float | str, field: str) -> float:
    """Return `value` in m. Raise as `number`."""
    return number(value, "m", field)


def positive(value: float | str, unit: str, field: str) -> float:
    """Return `value` as `number` does. Raise BodyError also if it is not positive."""
    result = number(value, unit, field)
    if result <= 0.0:
        raise BodyError(f"{field}: {_format(value, unit)} must be positive")
    return result


def not_negative(value: float | str, unit: str, field: str) -> float:
    """Return `value` as `number` does. Raise BodyError also if it is negative."""
    result = number(value, unit, field)
    if result < 0.0:
        raise BodyError(f"{field}: {_format(value, unit)} must not be negative")
    return result


def indentation_depth(depth: float | str) -> float:
    """Return the depth of an indentation, m. Raise BodyError if it is negative."""
    result = length(depth, "depth")
    if result < 0.0:
        raise BodyError(f"depth: {_format(depth, 'm')} points out of the body; a depth is not negative")
    return result


def unit_of_length(unit: str) -> float:
    """Return a unit of length, such as "mm", in m. Raise BodyError for any other text."""
    try:
        return parse_quantity(f"1 {unit}", "m")
    except ValueError:
        raise BodyError(f'unit: "{unit}" is not a unit of length; write for example "mm"') from None


def warn_of_size(extent: float, *, stacklevel: int) -> None:
    """Warn if the extent of a body, m, is not within 1 mm and 2 m."""
    if 1e-3 <= extent <= 2.0:
        return
    size = f"{extent:.3g} m" if extent > 1.0 else f"{1e3 * extent:.3g} mm"
    unit = "mm" if extent > 2.0 else "m"
    warnings.warn(
        f'the body has an extent of {size}: are its coordinates in {unit}? Then give unit="{unit}" (--unit {unit})',
        BodyWarning,
        stacklevel=stacklevel,
    )


def tick_period(period: float | str) -> float:
    """Return the period of a servo tick, s. Raise BodyError if it is not within 0.1 us and 100 s."""
    result = positive(period, "s", "period")
    if not 1e-7 <= result <= 100.0:
        raise BodyError(f"period: {result:g} s; a tick lasts from 0.1 us to 100 s")
    return result


def whole(value: float | str, field: str, low: int, high: int | None = None) -> int:
    """Return a whole number from `low` to `high`. Raise BodyError, naming `field`, for any other value."""
    result = number(value, "", field)
    if not result.is_integer() or result < low or (high is not None and result > high):
        allowed = f"{low} or more" if high is None else f"from {low} to {high}"
        raise BodyError(f"{field}: {_format(value, '')} must be a whole number, {allowed}")
    return int(result)


def stiffness_ratio(ratio: float | str) -> float:
    """Return the instantaneous over the long-term stiffness. Raise BodyError if it is below 1."""
    result = number(ratio, "", "instantaneous_ratio")
    if result < 1.0:
        raise BodyError(
            f"instantaneous_ratio: the instantaneous stiffness over the long-term one is 1 or more, not {result:g}"
        )
    return result


def friction_coefficients(static: float | str, dynamic: float | str | None) -> tuple[float, float]:
    """Return the static and the dynamic coefficient of dry friction, which are equal if `dynamic` is None.

    Raises:
        BodyError: a coefficient is negative, or the dynamic one exceeds the static one.
    """
    mu_static = not_negative(static, "", "static_friction")
    mu_dynamic = mu_static if dynamic is None else not_negative(dynamic, "", "dynamic_friction")
    if mu_dynamic > mu_static:
        raise BodyError(f"dynamic_friction: {mu_dynamic:g} must not exceed static_friction ({mu_static:g})")
    return mu_static, mu_dynamic


def lengths(values: ArrayLike, field: str) -> Array:
    """Return an array in m from numbers or text such as "1 mm".

    Raises:
        BodyError: as `number`.
        PoseError: the rows have different lengths.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind in "fiu":
            return array.astype(float)
        array = np.asarray(values, dtype=object)  # numbers among text remain numbers
    except ValueError:
        raise PoseError(f"{field}: its rows must have the same length") from None
    return np.array([length(value, field) for value in array.ravel()], dtype=float).reshape(array.shape)


def contact_points(values: ArrayLike) -> tuple[tuple[float, ...], ...]:
    """Return the contact points of a tool, m, from numbers or text (k, 3).

    Raises:
        PoseError: they have another shape or a number that is not finite.
        BodyError: there are too many, or two are in the same place.
    """
    points = lengths(values, "contact_points")
    if points.size == 0:
        return ()
    if points.shape == (3,):
        raise PoseError("contact_points: a list of points is needed: write one point as [[x, y, z]]")
    if points.ndim != 2 or points.shape[1] != 3:
        raise PoseError(f"contact_points: a tool has points (k, 3) in m; these have shape {points.shape}")
    check_finite(points, "contact_points")
    offsets = tuple((float(x), float(y), float(z)) for x, y, z in points)
    if mistake := tool_mistake(offsets):
        raise BodyError(f"contact_points: {mistake}")
    return offsets


def point_of(value: ArrayLike) -> Array:
    """Return a point (3,), m, from numbers or text. Raise PoseError for any other value."""
    point = lengths(value, "point")
    if point.shape != (3,) or not np.isfinite(point).all():
        raise PoseError(f'a point is three finite numbers in m, or text such as "5 mm", not {value!r}')
    return point


def row_of(values: Array) -> str:
    """Return numbers as text with four digits, separated by commas."""
    return ", ".join(f"{value:.4g}" for value in values)


def bounds_of(points: Array) -> str:
    """Return the corners of the box around points (p, 3), m, as text in mm."""
    return f"from ({row_of(points.min(axis=0) * 1e3)}) to ({row_of(points.max(axis=0) * 1e3)}) mm"


def check_finite(points: Array, field: str) -> None:
    """Raise PoseError, naming the first row of `points` (m, ..., 3) with a number that is not finite."""
    bad = ~np.isfinite(points).all(axis=tuple(range(1, points.ndim)))
    if bad.any():
        row = int(np.argmax(bad))
        numbers = ", ".join(f"{number:g}" for number in points[row].ravel())
        raise PoseError(f"{field}: row {row} of {len(points)} has a number that is not finite: ({numbers})")


def check_near(path: Array, points: Array) -> None:
    """Raise BodyError if a path (..., 3), m, never comes near a body with `points` (p, 3), m."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    apart = np.linalg.norm(path - np.clip(path, low, high), axis=-1).min(initial=np.inf)
    if path.size and apart > _FAR * extent:
        raise BodyError(f"path: it stays {apart:.3g} m from the body, whose extent is {extent:.3g} m: lengths are in m")


def directions(outward: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return unit vectors of `shape`, (..., 3), from one direction or from an array of that shape.

    Raises:
        PoseError: the shape is wrong, or a direction is zero or not finite.
    """
    try:
        axes: Array = np.array(np.broadcast_to(np.asarray(outward, dtype=float), shape), order="C")
    except (TypeError, ValueError):
        value = f"shape {np.shape(outward)}" if isinstance(outward, np.ndarray) else repr(outward)
        raise PoseError(
            f"outward: a direction is three numbers, such as (0, 0, 1), or one per sample, {shape}; not {value}"
        ) from None
    size = np.linalg.norm(axes, axis=-1, keepdims=True)
    if not (np.isfinite(size) & (size > 0.0)).all():
        raise PoseError("outward: a direction is three finite numbers, not all of them zero")
    return np.asarray(axes / size)


def check_tip(tip: object) -> None:
    """Raise BodyError unless `tip` is a tip shape."""
    if tip not in ("sphere", "flat"):
        raise BodyError(f'tip: a tip is "sphere" or "flat", not {tip!r}')


def _format(value: Any, unit: str) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g} {unit}".rstrip()
