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
_SAME_PLACE: Final = 1e-6  # m
_PLAIN: Final = "samples"  # counted, so a plain number


def tool_mistake(points: Sequence[Sequence[float]]) -> str:
    """Return what is wrong with the contact points of a tool (k, 3), m; "" if nothing is."""
    if len(points) > MAX_TIPS:
        return f"{len(points)} points; a tool has at most {MAX_TIPS}"
    for k, point in enumerate(points):
        for other in range(k):
            if math.dist(point, points[other]) < _SAME_PLACE:
                return f"points {other + 1} and {k + 1} are in the same place; remove one"
    return ""


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
