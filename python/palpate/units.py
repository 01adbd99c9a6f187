"""Text with a unit to a number in SI: `"3.5 N/mm"` becomes `3500.0` where a stiffness in N/m is asked for.

People write dimensional values as text with the unit beside the number. A bare number, a wrong dimension, a
non-finite number or an unknown unit is refused with a sentence that says what to write instead. The text is
data: it is matched against a pattern and looked up in pint's table of units, nothing in it is evaluated.

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
from tokenize import TokenError
from typing import TYPE_CHECKING, Any, Final, NamedTuple, SupportsFloat

from palpate.errors import PalpateError, ScenarioError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pint import UnitRegistry

__all__ = ["array_to_si", "parse", "parse_any", "parse_vector", "quantity", "to_si", "vector", "write"]

_NUMBER: Final = re.compile(
    r"\s*([+-]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][+-]?\d{1,3})?)(?![\d.])\s*(.*?)\s*"
)
_NOT_FINITE: Final = re.compile(r"\s*[+-]?(nan|inf|infinity)\b.*", re.IGNORECASE)
_UNIT: Final = re.compile(r"(?:1\s*/\s*)?[A-Za-zµμ°%Ω][A-Za-zµμ°%Ω_0-9 */^().²³⁻¹-]*")
_LONG_INTEGER: Final = re.compile(r"\d{3}")

# What a unit measures, and an example of how to write it. The first entry of a dimension names it.
_KINDS: Final[dict[str, tuple[str, str]]] = {
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


def quantity(value: object, unit: str, field: str, *, error: type[PalpateError] = ScenarioError) -> float:
    """Return `value` as a finite number in `unit`, an SI unit such as "N/m", "rad" or "" (a plain number).

    `value` is text with a unit ("3.5 N/mm"); only where `unit` is "" may it be a number. `field` is where it
    stands ("object.stiffness"), for the message. Raises `error` when it is bare, not finite, cannot be read,
    or has another dimension.
    """
    try:
        return parse(value, unit)
    except ValueError as problem:
        raise error(f"{field}: {problem}") from None


def to_si(value: SupportsFloat | str, unit: str, field: str, *, error: type[PalpateError] = ScenarioError) -> float:
    """Return `value` in the SI unit `unit`: a number as it is, text as `quantity` reads it, which says what raises."""
    if isinstance(value, SupportsFloat) and not isinstance(value, bool):
        with suppress(TypeError):  # an array of several
            return float(value)
    return quantity(value, unit, field, error=error)


def array_to_si(value: Any, unit: str, field: str, *, error: type[PalpateError] = ScenarioError) -> NDArray[np.float64]:
    """Return numbers in the SI unit `unit` as an array: an array or list of numbers as it is, texts as `quantity`.

    Text may stand alone or within a list, beside numbers. Raises `error` where an entry is no number and no quantity.
    """
    import numpy as np

    def read(entry: Any) -> Any:
        if isinstance(entry, str):
            return quantity(entry, unit, field, error=error)
        return [read(one) for one in entry] if isinstance(entry, (list, tuple)) else entry

    try:
        return np.asarray(read(value), dtype=float)
    except (TypeError, ValueError) as problem:
        if isinstance(problem, PalpateError):
            raise
        raise error(f"{field}: {_shown(value)} is not made of numbers; {_remedy(unit)}") from None


def vector(
    value: object, unit: str, field: str, size: int = 3, *, error: type[PalpateError] = ScenarioError
) -> tuple[float, ...]:
    """Return `size` numbers in `unit`: from a list of `size` values, or one value for every axis.

    Raises `error` as `quantity` does, and when the list has another length.
    """
    try:
        return parse_vector(value, unit, size)
    except ValueError as problem:
        raise error(f"{field}: {problem}") from None


def write(value: float, unit: str) -> str:
    """Return text that `quantity` reads back exactly: 3500.0 in N/m becomes "3500.0 N/m"."""
    return f"{float(value)!r} {unit}".rstrip()


def parse(value: object, unit: str) -> float:
    """As `quantity`, with a ValueError whose sentence does not name a field."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise ValueError(f"{_shown(value)} is not a quantity; {_remedy(unit)}")
    if not isinstance(value, str):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number; {_remedy(unit)}")
        if unit not in _PLAIN:
            hint = f'"{value} {_example_unit(unit)}"'
            raise ValueError(f"{value} has no unit, and {_article(_kind(unit))} is needed; write it as {hint}")
        return float(value)
    if _NOT_FINITE.fullmatch(value):
        raise ValueError(f"{_shown(value)} is not a finite number; {_remedy(unit)}")
    match = _NUMBER.fullmatch(value)
    if match is None:
        raise ValueError(f"{_shown(value)} cannot be read as a {_form(unit)}; {_remedy(unit)}")
    number, written = match[1], match[2]
    if not written and unit not in _PLAIN:
        hint = f'"{number} {_example_unit(unit)}"'
        raise ValueError(f"{_shown(value)} has no unit, and {_article(_kind(unit))} is needed; write it as {hint}")
    factor = Fraction(1) if written == unit or not written else _factor(written, unit, value)
    try:
        result = float(Fraction(number) * factor)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise ValueError(f"{_shown(value)} is too large for a number; {_remedy(unit)}")
    return math.copysign(result, -1.0) if number.startswith("-") else result  # a fraction has no -0


def parse_any(text: str) -> tuple[float, str]:
    """Return a text's number in SI and its SI unit, of whatever it measures; ValueError when it cannot be read."""
    for unit in ("", *_KINDS):
        try:
            return parse(text, unit), unit
        except ValueError:
            continue
    raise ValueError(f'{_shown(text)} cannot be read as a number with a unit; write it as "100 N/m"')


def parse_vector(value: object, unit: str, size: int = 3) -> tuple[float, ...]:
    """As `vector`, with a ValueError whose sentence does not name a field."""
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        if len(value) != size:
            raise ValueError(f"{len(value)} values where {size} are needed, or one value for all axes")
        return tuple(parse(entry, unit) for entry in value)
    return (parse(value, unit),) * size


def _factor(written: str, unit: str, value: str) -> Fraction:
    """Size of one `written` unit in `unit`; ValueError when it is unknown or has another dimension."""
    found = _look_up(written)
    if found is None:
        raise ValueError(f'{_shown(value)}: the unit "{written[:40]}" is not known; {_remedy(unit)}')
    wanted = _NONE if unit in _PLAIN else _look_up(unit)
    if wanted is None:
        raise ValueError(f'the unit "{unit}" that is asked for is not known')
    # An angle or a rate of angle without its radian hides mistakes ("2 %", "20 Hz");
    # elsewhere (N*m/rad) the radian may be left out.
    angular = wanted.radians != 0 and wanted.dimension <= {("[time]", wanted.power_of_time)}
    if found.dimension != wanted.dimension or (angular and found.radians != wanted.radians):
        example = "" if unit in _PLAIN else f", for example {_example(unit)}"
        raise ValueError(f"{_shown(value)} is {_describe(written, found)}; {_article(_kind(unit))} is needed{example}")
    return found.size / wanted.size


class _Unit(NamedTuple):
    """What pint knows of a unit: its size in SI base units, its dimension, the power of the radian in it."""

    size: Fraction
    dimension: frozenset[tuple[str, Fraction]]
    radians: int

    @property
    def power_of_time(self) -> Fraction:
        return dict(self.dimension).get("[time]", Fraction(0))


_NONE: Final = _Unit(Fraction(1), frozenset(), 0)


@lru_cache(maxsize=1)
def _registry() -> UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)  # exact factors: "0.9 mm" is the double nearest to 0.0009


@lru_cache(maxsize=512)
def _look_up(unit: str) -> _Unit | None:
    """Return the unit as pint knows it, or None when it does not, or when it has an offset (degC)."""
    unit = unit.replace("·", "*").replace("µ", "μ").replace("Ω", "ohm")
    if len(unit) > 60 or not _UNIT.fullmatch(unit) or _LONG_INTEGER.search(unit):
        return None
    import pint

    registry = _registry()
    try:
        parsed = registry.parse_units(unit)
        if any(str(name).startswith(("degree_C", "degree_F", "degree_R", "delta_")) for name in parsed._units):
            return None
        factor, base = registry.get_root_units(parsed)
        dimension = frozenset((name, Fraction(str(power))) for name, power in parsed.dimensionality.items())
    except (pint.PintError, ValueError, TypeError, AttributeError, TokenError, ArithmeticError):
        return None
    powers = dict(base._units)
    grams = Fraction(str(powers.get("gram", 0)))  # pint's root unit of mass is the gram, SI's the kilogram
    if grams.denominator != 1:
        return None
    return _Unit(Fraction(str(factor)) / Fraction(1000) ** int(grams), dimension, int(str(powers.get("radian", 0))))


@lru_cache(maxsize=1)
def _names() -> dict[tuple[frozenset[tuple[str, Fraction]], bool], tuple[str, str]]:
    """(dimension, whether it turns) to (what it measures, SI unit); the first of _KINDS names a dimension."""
    names: dict[tuple[frozenset[tuple[str, Fraction]], bool], tuple[str, str]] = {}
    for unit, (kind, _) in _KINDS.items():
        found = _look_up(unit)
        if found is not None:
            names.setdefault((found.dimension, found.radians != 0), (kind, unit))
    return names


def _describe(written: str, found: _Unit) -> str:
    turns = found.radians != 0
    named = _names().get((found.dimension, turns)) or _names().get((found.dimension, not turns))
    if named is not None and (found.dimension or turns):
        return f"{_article(named[0])} [{named[1]}]"
    return "a plain number" if not found.dimension else f"in {written}"


def _kind(unit: str) -> str:
    if unit in _PLAIN:
        return "plain number"
    return _KINDS[unit][0] if unit in _KINDS else f"value in {unit}"


def _remedy(unit: str) -> str:
    """What to write instead; of plain numbers no example would be right everywhere: a count, a Poisson's ratio."""
    return "write a plain number" if unit in _PLAIN else f"write it as {_example(unit)}"


def _form(unit: str) -> str:
    return "plain number" if unit in _PLAIN else "number with a unit"


def _example(unit: str) -> str:
    return f'"{_KINDS[unit][1]}"' if unit in _KINDS else f'"1 {unit}"'


def _example_unit(unit: str) -> str:
    """Return the unit to write behind a bare number: in SI, as the number that a user of SI has in mind."""
    return "GB" if unit == "byte" else unit


def _article(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def _shown(value: object) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else text[:57] + '..."'
