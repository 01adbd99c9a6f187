"""Conversion of text with a unit to a number in SI: `"3.5 N/mm"` becomes `3500.0` in N/m.

Dimensional values are text with the unit beside the number. A number without a unit, a wrong dimension, a non-finite
number or an unknown unit is refused with a message that shows the right form. The text is data: it is matched against
a pattern and looked up in the unit table of pint, and never evaluated.

pint takes half a second to import, so it is imported when the first unit is looked up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple, SupportsFloat, overload

from palpate.errors import ScenarioError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pint import UnitRegistry

__all__ = ["UNITS", "array_to_si", "bounded_to_si", "parse_quantity", "to_si", "write"]

_NUMBER: Final = re.compile(
    r"([+-]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][+-]?\d{1,3})?)(?![\d.])\s*+(.*)"  # in linear time
)
_NOT_FINITE: Final = re.compile(r"\s*[+-]?(nan|inf|infinity)\b.*", re.IGNORECASE)
_UNIT: Final = re.compile(r"(?:1\s*/\s*)?[A-Za-zµμ°%Ω][A-Za-zµμ°%Ω_0-9 */^().²³⁻¹-]*")
_LONG_INTEGER: Final = re.compile(r"\d{3}")

# SI unit to (physical quantity, example of a value). The first entry of a dimension names the quantity.
UNITS: Final[dict[str, tuple[str, str]]] = {
    "N/m": ("stiffness", "3.5 N/mm"),
    "N*s/m": ("damping", "4.5 N*s/m"),
    "N": ("force", "8.5 N"),
    "m": ("length", "10 mm"),
    "s": ("time", "0.5 ms"),
    "rad": ("angle", "30 deg"),
    "rad/s": ("angular velocity", "2 rad/s"),
    "kg": ("mass", "0.15 kg"),
    "N*m": ("torque", "0.01 N*m"),
    "Hz": ("frequency", "2 Hz"),
    "m/s": ("speed", "0.1 m/s"),
    "m/s^2": ("acceleration", "9.81 m/s^2"),
    "kg*m^2": ("moment of inertia", "7.11e-4 kg*m^2"),
    "N*m*s/rad": ("rotary damping", "0.05 N*m*s/rad"),
    "N*m/rad": ("rotary stiffness", "1 N*m/rad"),
    "N*m/A": ("motor constant", "0.0234 N*m/A"),
    "A": ("current", "1 A"),
    "V": ("voltage", "24 V"),
    "ohm": ("resistance", "2.18 ohm"),
    "H": ("inductance", "0.238 mH"),
    "Pa": ("pressure", "5 kPa"),
    "W": ("power", "1 W"),
    "J/K": ("heat capacity", "10 J/K"),
    "K": ("temperature", "293 K"),
    "byte": ("amount of memory", "8 GB"),
}
_PLAIN: Final = ("", "1")


def to_si(value: SupportsFloat | str, unit: str, field: str, *, error: type[ValueError] = ScenarioError) -> float:
    """Return `value` in the SI unit `unit`: a number unchanged, text as `parse_quantity` reads it.

    Raises:
        error: as `parse_quantity`; the message begins with `field`.
    """
    if isinstance(value, SupportsFloat) and not isinstance(value, bool):
        with suppress(TypeError):  # an array with several elements
            return float(value)
    return parse_quantity(value, unit, field, error=error)


def bounded_to_si(
    value: SupportsFloat | str, unit: str, field: str, *, zero: bool = False, error: type[ValueError] = ScenarioError
) -> float:
    """Return `value` as `to_si` does. Raise `error` also unless it is finite and positive, or zero if `zero`."""
    result = to_si(value, unit, field, error=error)
    if not math.isfinite(result) or result < 0.0 or (result == 0.0 and not zero):
        needed = "finite and not negative" if zero else "positive and finite"
        raise error(f"{field} must be {needed}, not {f'{result} {unit}'.rstrip()}")
    return result


def array_to_si(value: Any, unit: str, field: str, *, error: type[ValueError] = ScenarioError) -> NDArray[np.float64]:
    """Return numbers in the SI unit `unit` as an array: numbers unchanged, texts as `parse_quantity` reads them.

    Text may stand alone or within a list, beside numbers. Raises `error` where an entry is no number and no quantity.
    """
    import numpy as np

    def read(entry: Any) -> Any:
        if isinstance(entry, str):
            return parse_quantity(entry, unit, field, error=error)
        return [read(one) for one in entry] if isinstance(entry, (list, tuple)) else entry

    try:
        return np.asarray(read(value), dtype=float)
    except (TypeError, ValueError) as problem:
        if isinstance(problem, error):
            raise
        raise error(f"{field}: {_shown(value)} is not made of numbers; {_remedy(unit)}") from None


@overload
def parse_quantity(value: object, unit: str, field: str = "", *, error: type[ValueError] = ValueError) -> float: ...


@overload
def parse_quantity(
    value: object, unit: str, field: str = "", *, size: int, error: type[ValueError] = ValueError
) -> tuple[float, ...]: ...


def parse_quantity(
    value: object, unit: str, field: str = "", *, size: int | None = None, error: type[ValueError] = ValueError
) -> float | tuple[float, ...]:
    """Return `value` as a finite number in `unit`, or as `size` of them.

    Args:
        value: text with a unit ("3.5 N/mm"), or a number where `unit` is "". With `size` also a list of `size` such
            values; one value then stands for all of them.
        unit: SI unit such as "N/m" or "rad"; "" for a plain number.
        field: place of the value ("object.stiffness"), with which the message begins.
        size: length of the vector; None for a single number.
        error: exception to raise.

    Raises:
        error: the value has no unit, is not finite, cannot be read or has another dimension, or the list has another
            length than `size`.
    """
    try:
        if size is None:
            return _parse(value, unit)
        if not isinstance(value, Sequence) or isinstance(value, (str, bytes)):
            return (_parse(value, unit),) * size
        if len(value) != size:
            raise ValueError(f"{len(value)} values where {size} are needed, or one value for all axes")
        return tuple(_parse(entry, unit) for entry in value)
    except ValueError as problem:
        raise error(f"{field}: {problem}" if field else str(problem)) from None


def write(value: float, unit: str) -> str:
    """Return text that `parse_quantity` reads back exactly: 3500.0 in N/m becomes "3500.0 N/m"."""
    return f"{float(value)!r} {unit}".rstrip()


def _parse(value: object, unit: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError(f"{_shown(value)} is not a quantity; {_remedy(unit)}")
    if not isinstance(value, str):
        try:
            finite = math.isfinite(value)
        except OverflowError:
            raise ValueError(f"the integer is too large for a number; {_remedy(unit)}") from None
        if not finite:
            raise ValueError(f"{value} is not a finite number; {_remedy(unit)}")
        if unit not in _PLAIN:
            raise ValueError(_without_unit(str(value), str(value), unit))
        return float(value)
    if _NOT_FINITE.fullmatch(value):
        raise ValueError(f"{_shown(value)} is not a finite number; {_remedy(unit)}")
    match = _NUMBER.fullmatch(value.strip())
    if match is None:
        form = "plain number" if unit in _PLAIN else "number with a unit"
        raise ValueError(f"{_shown(value)} cannot be read as a {form}; {_remedy(unit)}")
    number, written = match[1], match[2]
    if not written and unit not in _PLAIN:
        raise ValueError(_without_unit(_shown(value), number, unit))
    factor = Fraction(1) if written == unit or not written else _factor(written, unit, value)
    try:
        result = float(Fraction(number) * factor)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise ValueError(f"{_shown(value)} is too large for a number; {_remedy(unit)}")
    return math.copysign(result, -1.0) if number.startswith("-") else result  # a fraction has no -0


def _factor(written: str, unit: str, value: str) -> Fraction:
    """Return the size of one `written` unit in `unit`; ValueError if it is unknown or has another dimension."""
    found = _look_up(written)
    if found is None:
        raise ValueError(f'{_shown(value)}: the unit "{written[:40]}" is not known; {_remedy(unit)}')
    target = _DIMENSIONLESS if unit in _PLAIN else _look_up(unit)
    if target is None:
        raise ValueError(f'the requested unit "{unit}" is not known')
    # An angle or an angular rate must state its radian, because "2 %" and "20 Hz" are likely mistakes.
    # Elsewhere (N*m/rad) the radian may be omitted.
    angular = target.radians != 0 and dict(target.dimension).keys() <= {"[time]"}
    if found.dimension != target.dimension or (angular and found.radians != target.radians):
        example = "" if unit in _PLAIN else f", for example {_example(unit)}"
        raise ValueError(
            f"{_shown(value)} is {_describe(written, found)}; {_article(_measure(unit))} is needed{example}"
        )
    return found.size / target.size


class _Unit(NamedTuple):
    """Size of a unit in the root units of pint, its dimension, and its power of the radian."""

    size: Fraction
    dimension: frozenset[tuple[str, Fraction]]
    radians: Fraction


_DIMENSIONLESS: Final = _Unit(Fraction(1), frozenset(), Fraction(0))


@lru_cache(maxsize=1)
def _registry() -> UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)  # exact factors: "0.9 mm" is the double nearest to 0.0009


@lru_cache(maxsize=512)
def _look_up(unit: str) -> _Unit | None:
    """Return the unit from the table of pint; None if it is unknown or has an offset (degC)."""
    unit = unit.replace("·", "*")
    if len(unit) > 60 or not _UNIT.fullmatch(unit) or _LONG_INTEGER.search(unit):
        return None
    registry = _registry()
    try:
        parsed = registry.parse_units(unit)
        if any(str(name).startswith(("degree_C", "degree_F", "degree_R", "delta_")) for name in parsed._units):
            return None
        factor, base = registry.get_root_units(parsed)
        dimension = frozenset((name, Fraction(str(power))) for name, power in parsed.dimensionality.items())
    except Exception:  # pint raises any exception on text that is no unit, KeyError and AssertionError among them
        return None
    return _Unit(Fraction(str(factor)), dimension, Fraction(str(dict(base._units).get("radian", 0))))


@lru_cache(maxsize=1)
def _names() -> dict[tuple[frozenset[tuple[str, Fraction]], bool], tuple[str, str]]:
    """Return the map from (dimension, has a radian) to (physical quantity, SI unit)."""
    names: dict[tuple[frozenset[tuple[str, Fraction]], bool], tuple[str, str]] = {}
    for unit, (measure, _) in UNITS.items():
        found = _look_up(unit)
        if found is not None:
            names.setdefault((found.dimension, found.radians != 0), (measure, unit))
    return names


def _describe(written: str, found: _Unit) -> str:
    angular = found.radians != 0
    named = _names().get((found.dimension, angular)) or _names().get((found.dimension, not angular))
    if named is not None and (found.dimension or angular):
        return f"{_article(named[0])} [{named[1]}]"
    return "a plain number" if not found.dimension else f"in {written}"


def _measure(unit: str) -> str:
    if unit in _PLAIN:
        return "plain number"
    return UNITS[unit][0] if unit in UNITS else f"value in {unit}"


def _remedy(unit: str) -> str:
    """Return the remedy of a message; a plain number has no example, because none is valid everywhere."""
    return "write a plain number" if unit in _PLAIN else f"write for example {_example(unit)}"


def _without_unit(shown: str, number: str, unit: str) -> str:
    usual = UNITS[unit][1].split(" ")[1] if unit in UNITS else unit  # which a user of a bare number may have in mind
    choices = [usual] if unit == "byte" else dict.fromkeys((unit, usual))
    hint = " or ".join(f'"{number} {choice}"' for choice in choices)
    return f"{shown} has no unit, and {_article(_measure(unit))} is needed; write it as {hint}"


def _example(unit: str) -> str:
    return f'"{UNITS[unit][1]}"' if unit in UNITS else f'"1 {unit}"'


def _article(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def _shown(value: object) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + '..."'
