"""Numbers that a person gives to a body: in SI, or text with a unit."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.errors import PoseError
from palpate.fem.errors import BodyError
from palpate.units import parse_quantity, to_si

__all__ = [
    "check_finite",
    "check_tip",
    "directions",
    "friction",
    "length",
    "lengths",
    "not_negative",
    "number",
    "point_of",
    "positive",
    "press_depth",
    "stiffening",
    "tick_period",
    "unit_of_length",
    "whole",
]

Array = NDArray[np.float64]


def number(value: float | str, unit: str, field: str) -> float:
    """Return `value` in the SI unit `unit`; BodyError, naming `field`, if it cannot be read or is not finite."""
    found = to_si(value, unit, field, error=BodyError)
    if not isfinite(found):
        raise BodyError(f"{field}: {found} is not a finite number")
    return found


def length(value: float | str, field: str) -> float:
    """Return `value` in m; raises as `number`."""
    return number(value, "m", field)


def positive(value: float | str, unit: str, field: str) -> float:
    """Return `value` as `number` does; BodyError, too, if it is not positive."""
    found = number(value, unit, field)
    if found <= 0.0:
        raise BodyError(f"{field}: {_said(value, unit)} must be positive")
    return found


def not_negative(value: float | str, unit: str, field: str) -> float:
    """Return `value` as `number` does; BodyError, too, if it is negative."""
    found = number(value, unit, field)
    if found < 0.0:
        raise BodyError(f"{field}: {_said(value, unit)} must not be negative")
    return found


def press_depth(depth: float | str) -> float:
    """Return how deep a tip is to go in, m; BodyError if that is outwards."""
    found = length(depth, "depth")
    if found < 0.0:
        raise BodyError(f"depth: {_said(depth, 'm')} leads out of the body; how deep a tip goes in is not negative")
    return found


def unit_of_length(unit: str) -> float:
    """Return how many m the unit is, such as "mm"; BodyError if it is none."""
    try:
        return parse_quantity(f"1 {unit}", "m")
    except ValueError:
        raise BodyError(f'unit: "{unit}" is no unit of length; write for example "mm"') from None


def tick_period(period: float | str) -> float:
    """Return the period of a servo's tick, s; BodyError if that is nothing a servo could have."""
    found = positive(period, "s", "period")
    if not 1e-7 <= found <= 100.0:
        raise BodyError(f"period: {found:g} s; a tick lasts from 0.1 us to 100 s")
    return found


def whole(value: float | str, field: str, low: int, high: int | None = None) -> int:
    """Return a whole number from `low` to `high`; BodyError, naming `field`, if it is none."""
    found = number(value, "", field)
    if not found.is_integer() or found < low or (high is not None and found > high):
        reach = f"{low} or more" if high is None else f"from {low} to {high}"
        raise BodyError(f"{field}: {_said(value, '')} must be a whole number, {reach}")
    return int(found)


def stiffening(instant: float | str) -> float:
    """Return how many times as stiff a standard linear solid is at once; BodyError if that is less than once."""
    found = number(instant, "", "instantaneous_ratio")
    if found < 1.0:
        raise BodyError(
            f"instantaneous_ratio: at once, tissue is at least as stiff as at last, so 1 or more, not {found:g}"
        )
    return found


def friction(static: float | str, dynamic: float | str | None) -> tuple[float, float]:
    """Return both coefficients of dry friction, the dynamic one as the static one if None.

    Raises BodyError if one is negative, or the dynamic one is above the static one.
    """
    most = not_negative(static, "", "static_friction")
    after = most if dynamic is None else not_negative(dynamic, "", "dynamic_friction")
    if after > most:
        raise BodyError(f"dynamic_friction: {after:g} must not exceed static_friction ({most:g})")
    return most, after


def lengths(values: ArrayLike, field: str) -> Array:
    """Return an array in m of numbers or of text such as "1 mm"; raises as `number`, or PoseError if it is ragged."""
    try:
        given = np.asarray(values)
        if given.dtype.kind in "fiu":
            return given.astype(float)
        given = np.asarray(values, dtype=object)  # so that numbers between text stay numbers
    except ValueError:
        raise PoseError(f"{field}: its rows must have the same length") from None
    return np.array([length(value, field) for value in given.ravel()], dtype=float).reshape(given.shape)


def point_of(place: ArrayLike) -> Array:
    """Return a point (3,), m, of numbers or text; PoseError if it is none."""
    found = lengths(place, "point")
    if found.shape != (3,) or not np.isfinite(found).all():
        raise PoseError(f'a point is three finite numbers in m, or text such as "5 mm", not {place!r}')
    return found


def check_finite(places: Array, field: str) -> None:
    """Raise PoseError, naming the first row of `places` (m, ..., 3), if a number in it is not finite."""
    bad = ~np.isfinite(places).all(axis=tuple(range(1, places.ndim)))
    if bad.any():
        row = int(np.argmax(bad))
        said = ", ".join(f"{number:g}" for number in places[row].ravel())
        raise PoseError(f"{field}: row {row} of {len(places)} has a number that is not finite: ({said})")


def directions(outward: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return unit vectors of `shape`, (..., 3), from one direction or as many; PoseError if one has no length."""
    try:
        found: Array = np.asarray(outward, dtype=float)
        axes: Array = np.array(np.broadcast_to(found, shape), order="C")
    except (TypeError, ValueError):
        told = f"shape {np.shape(outward)}" if isinstance(outward, np.ndarray) else repr(outward)
        raise PoseError(
            f"outward: a direction is three numbers, such as (0, 0, 1), or one for each place, {shape}; not {told}"
        ) from None
    size = np.linalg.norm(axes, axis=-1, keepdims=True)
    if not (np.isfinite(size) & (size > 0.0)).all():
        raise PoseError("outward: a direction is three finite numbers, not all of them zero")
    return np.asarray(axes / size)


def check_tip(tip: object) -> None:
    """Raise BodyError if a tip has no such shape."""
    if tip not in ("sphere", "flat"):
        raise BodyError(f'tip: a tip is "sphere" or "flat", not {tip!r}')


def _said(value: Any, unit: str) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g} {unit}".rstrip()
