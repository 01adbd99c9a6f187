"""Numbers that a person gives to a body: in SI, or text with a unit."""

from __future__ import annotations

from math import inf

from palpate.bodies.errors import BodyError
from palpate.units import in_si

__all__ = ["length", "number", "positive"]


def number(value: float | str, unit: str, field: str) -> float:
    """Return `value` in the SI unit `unit`; BodyError, naming `field`, if it is text that cannot be read."""
    return in_si(value, unit, field, error=BodyError)


def length(value: float | str, field: str) -> float:
    """Return `value` in m; raises as `number`."""
    return number(value, "m", field)


def positive(value: float | str, unit: str, field: str) -> float:
    """Return `value` as `number` does; BodyError, too, if it is not positive and finite."""
    found = number(value, unit, field)
    if not 0 < found < inf:
        raise BodyError(f"{field} is positive and finite, not {found:g}")
    return found
