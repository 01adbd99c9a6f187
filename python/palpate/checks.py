"""Checks of arguments for the linear models and the stability functions."""

from __future__ import annotations

import math

from palpate.errors import StabilityError


def positive(value: float, name: str, unit: str) -> float:
    """Return ``value`` as a float, or raise StabilityError unless it is finite and above zero."""
    number = finite(value, name, unit)
    if number <= 0.0:
        raise StabilityError(f"{name} must be positive in {unit}, not {number:g}")
    return number


def not_negative(value: float, name: str, unit: str) -> float:
    """Return ``value`` as a float, or raise StabilityError unless it is finite and not below zero."""
    number = finite(value, name, unit)
    if number < 0.0:
        raise StabilityError(f"{name} must not be negative in {unit}; it is {number:g}")
    return number


def fraction(value: float, name: str) -> float:
    """Return ``value`` as a float, or raise StabilityError unless 0 <= value < 1."""
    number = finite(value, name, "(a pure number)")
    if not 0.0 <= number < 1.0:
        raise StabilityError(f"{name} must be at least 0 and below 1, not {number:g}")
    return number


def finite(value: float, name: str, unit: str) -> float:
    """Return ``value`` as a float, or raise StabilityError if it is no finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise StabilityError(f"{name} must be a number in {unit}, not {value!r}") from None
    if not math.isfinite(number):
        raise StabilityError(f"{name} must be finite in {unit}, not {number}")
    return number
