"""Checks of arguments for the linear models and the stability functions, and of a tool's contact points.

Each of a number takes it in SI, or text with a unit. A unit may carry an explanation in parentheses for the message.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from palpate.errors import StabilityError
from palpate.units import to_si

MAX_TIPS: Final = 8  # of a body's contact
SAME_PLACE: Final = 1e-6  # m, distance of tips
NEAREST: Final = 0.1  # of the radius: distance of a tool's tips, which press a layer each
_PLAIN: Final = "samples"  # counted, so a plain number


def tool_mistake(points: Sequence[Sequence[float]], radius: float = 0.0) -> str:
    """Return what is wrong with the contact points of a tool (k, 3), m, of tips with a radius, m; "" if nothing is."""
    if len(points) > MAX_TIPS:
        return f"{len(points)} points; a tool has at most {MAX_TIPS}"
    if same := close_pair(points):
        return f"points {same[0]} and {same[1]} are in the same place; remove one"
    if near := close_pair(points, NEAREST * radius):
        return (
            f"points {near[0]} and {near[1]} are nearer than a tenth of their radius, so the body would feel stiffer, "
            "as each presses a layer of its own; remove one"
        )
    return ""


def close_pair(points: Sequence[Sequence[float]], distance: float = SAME_PLACE) -> tuple[int, int] | None:
    """Return the numbers, from 1 on, of two points (k, 3), m, nearer than `distance`, m; None if there are none."""
    for k, point in enumerate(points):
        for other in range(k):
            if math.dist(point, points[other]) < distance:
                return other + 1, k + 1
    return None


def closest_tips(
    open_points: Sequence[Sequence[float]], closed_points: Sequence[Sequence[float]], least: float, radius: float
) -> tuple[int, int] | None:
    """Return the numbers, from 1 on, of two tips of a gripper that meet, or nearly; None if none do.

    Args:
        open_points: places of the tips at the opening 1 (k, 3), m.
        closed_points: the same at the opening 0; between them the tips move in proportion.
        least: smallest opening.
        radius: of the tips, m.
    """
    nearest = max(SAME_PLACE, NEAREST * radius)
    for k in range(len(open_points)):
        for other in range(k):
            wide = [a - b for a, b in zip(open_points[k], open_points[other], strict=True)]
            narrow = [a - b for a, b in zip(closed_points[k], closed_points[other], strict=True)]
            change = [a - b for a, b in zip(wide, narrow, strict=True)]
            square = sum(x * x for x in change)
            at = -sum(a * b for a, b in zip(narrow, change, strict=True)) / square if square > 0.0 else 1.0
            at = min(max(at, least), 1.0)  # opening at which they are closest
            if math.hypot(*(a + at * b for a, b in zip(narrow, change, strict=True))) < nearest:
                return other + 1, k + 1
    return None


def positive(value: float | str, name: str, unit: str) -> float:
    """Return ``value`` in SI, or raise StabilityError unless it is finite and above zero."""
    number = finite(value, name, unit)
    if number <= 0.0:
        raise StabilityError(f"{name} must be positive in {unit}, not {number:g}")
    return number


def not_negative(value: float | str, name: str, unit: str) -> float:
    """Return ``value`` in SI, or raise StabilityError unless it is finite and not below zero."""
    number = finite(value, name, unit)
    if number < 0.0:
        raise StabilityError(f"{name} must not be negative in {unit}; it is {number:g}")
    return number


def fraction(value: float | str, name: str) -> float:
    """Return ``value`` as a float, or raise StabilityError unless 0 <= value < 1."""
    number = finite(value, name, "")
    if not 0.0 <= number < 1.0:
        raise StabilityError(f"{name} must be at least 0 and below 1, not {number:g}")
    return number


def finite(value: float | str, name: str, unit: str) -> float:
    """Return ``value`` in SI, or raise StabilityError if it is neither a finite number nor text with a unit."""
    si = unit.partition(" (")[0]
    number = to_si(value, "" if si == _PLAIN else si, name, error=StabilityError)
    if not math.isfinite(number):
        raise StabilityError(f"{name} must be finite in {unit or 'one'}, not {number}")
    return number
