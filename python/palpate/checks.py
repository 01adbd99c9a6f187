"""Checks of arguments for the linear models and the stability functions.

Each takes a number in SI, or text with a unit. A unit may carry an explanation in parentheses for the message.
"""

from __future__ import annotations

import math
from typing import Final

from palpate.errors import StabilityError
from palpate.units import to_si

_PLAIN: Final = "samples"  # counted, so a plain number


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
