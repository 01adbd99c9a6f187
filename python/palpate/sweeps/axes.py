"""Axes of a sweep: a key of the scenario and its values, `"object.stiffness" = "100 N/m..5 N/mm:100"`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.errors import PalpateError
from palpate.scenario.reader import lay_settings
from palpate.units import UNITS, parse_quantity, write

__all__ = [
    "COLUMNS",
    "LARGEST",
    "LONGEST",
    "Axis",
    "SweepError",
    "axes_of",
    "check_count",
    "key_of",
    "limits_of",
    "with_value",
]


# Keys with a separate value in every lane of the batch: column of the core, SI unit.
COLUMNS: dict[str, tuple[str, str]] = {
    "object.stiffness": ("stiffness", "N/m"),
    "object.damping": ("damping", "N*s/m"),
    "operator.mass": ("arm_mass", "kg"),
    "operator.damping": ("arm_damping", "N*s/m"),
    "operator.stiffness": ("arm_stiffness", "N/m"),
    "operator.tissue_stiffness": ("tissue_stiffness", "N/m"),
    "operator.tissue_damping": ("tissue_damping", "N*s/m"),
    "device.delay": ("delay", ""),
    "servo.jitter": ("jitter", "s"),
    "run.seed": ("seed", ""),
}
_RANGE = re.compile(r"\s*(.+?)\s*(?<!\.)\.\.(?!\.)\s*([^:]+?)\s*:\s*(\d+)\s*(log)?\s*")
_PATH = re.compile(r"[a-z]+(\.[A-Za-z][A-Za-z0-9_]*)+")
LARGEST = 100_000_000  # cells
LONGEST = 100_000  # values of a key: each chunk of cells and the file hold all of them as text


class SweepError(PalpateError):
    """A sweep cannot be run or resumed: an unknown key, a missing scheduler, or the file of another sweep."""


@dataclass(frozen=True)
class Axis:
    """One key of the scenario and its values.

    Attributes:
        path: tables and key, and x, y or z for one spatial axis: "object.body.radius", "operator.force.z".
        unit: SI unit of `values`; "" for plain numbers and for words.
        values: floats in SI, or words and flags.
    """

    path: str
    unit: str
    values: tuple[Any, ...]

    def __len__(self) -> int:
        return len(self.values)

    @property
    def key(self) -> str:
        """The path without its spatial axis."""
        return key_of(self.path)

    @property
    def component(self) -> int | None:
        """0, 1 or 2 for one spatial axis; None for all."""
        return None if self.key == self.path else "xyz".index(self.path[-1])

    def text(self, index: int) -> Any:
        """Return value `index` in the form of a scenario file."""
        return _written(self.values[index], self.unit)


def key_of(path: str) -> str:
    """Return a path without its spatial axis, if it has one."""
    return path[:-2] if path.count(".") > 1 and path.endswith((".x", ".y", ".z")) else path


def axes_of(over: Mapping[str, Any]) -> tuple[Axis, ...]:
    """Return the axes of a mapping from paths to values.

    Values are a range as text, `"FROM..TO:COUNT"` or `"FROM..TO:COUNT log"` (both ends included, with units), or a list
    of values as in a scenario file. Keys in COLUMNS also take plain numbers in SI.

    Raises:
        SweepError: a path or a value cannot be read.
    """
    if not isinstance(over, Mapping) or not over:
        raise SweepError('nothing to vary: give for example over={"object.stiffness": "100 N/m..5 N/mm:50"}')
    entries = list(over.items())
    check_count([_count(path, values) for path, values in entries])  # before the ranges are expanded
    axes = tuple(_axis(path, values) for path, values in entries)
    if len({axis.path for axis in axes}) < len(axes):
        raise SweepError("a key is varied twice")
    return axes


def check_count(sizes: Sequence[int]) -> None:
    """Raise SweepError if the cells are too many: the product of `sizes`, of the axes and of the draws."""
    if (count := math.prod(sizes)) > LARGEST:
        raise SweepError(
            f"{count:,} cells ({' × '.join(f'{size:,}' for size in sizes)}); the most is {LARGEST:,}: use fewer values "
            "or draws"
        )


def _count(path: str, values: Any) -> int:
    """Return the number of values of a key without expanding them. Raise SweepError if they are too many."""
    if isinstance(values, str):
        match = _RANGE.fullmatch(values)
        count = int(match[3]) if match else values.count(",") + 1
    else:
        count = (
            int(np.size(values)) if isinstance(values, np.ndarray) or not hasattr(values, "__len__") else len(values)
        )
    if count > LONGEST:
        raise SweepError(
            f"{path}: {count:,} values; a key takes at most {LONGEST:,}: use fewer, or draw them at random (random)"
        )
    return count


def limits_of(path: str, text: Any) -> tuple[float, float]:
    """Return the ends of the range "FROM..TO" in the SI unit of `path`, a key of COLUMNS.

    Raises:
        SweepError: the path has no column, or the text is no range.
    """
    unit = _unit(path)
    parts = str(text).split("..")
    if len(parts) != 2 or ":" in text or parts[1].startswith("."):
        raise SweepError(f'{path}: "{text}" is no range to draw from; write its two ends, as in "0.05 kg..0.3 kg"')
    try:
        low, high = parse_quantity(parts[0], unit), parse_quantity(parts[1], unit)
    except ValueError as problem:
        raise SweepError(f"{path}: {problem}") from None
    if not low <= high:
        raise SweepError(f"{path}: a range goes from the smaller to the larger, not from {parts[0]} to {parts[1]}")
    return low, high


def stored_axis(path: Any, unit: Any, values: Any) -> Axis:
    """Return the axis of a file. Raise ValueError unless it could be an axis of a sweep."""
    if not isinstance(path, str) or not _PATH.fullmatch(path):
        raise ValueError(f"{path!r} is no key of a scenario")
    numbers = [value for value in values if isinstance(value, (int, float)) and not isinstance(value, bool)]
    words = [value for value in values if isinstance(value, (str, bool))]
    if unit not in ("", *UNITS) or len(numbers) + len(words) < len(values) or not values:
        raise ValueError(f"{path} has values that cannot be varied")
    if COLUMNS.get(key_of(path), ("", unit))[1] != unit or (words and unit):
        raise ValueError(f"{path} has values of another kind")
    return Axis(path, unit, tuple(values))


def stored_limits(path: Any, low: Any, high: Any) -> tuple[float, float]:
    """Return the limits of a file. Raise ValueError unless they could be those of a random key of a sweep."""
    unit = _unit(path)
    return limits_of(path, f"{write(low, unit)}..{write(high, unit)}")


def with_value(tables: Mapping[str, Any], axis: Axis, index: int) -> dict[str, Any]:
    """Return the tables of a scenario with value `index` of `axis`."""
    value = axis.text(index)
    if axis.component is not None:
        before: Any = tables
        for part in axis.key.split("."):
            before = before.get(part) if isinstance(before, Mapping) else None
        if before is None:
            raise SweepError(
                f"{axis.path}: the scenario has no {axis.key} whose axis could be varied; write one into it first"
            )
        three = list(before) if isinstance(before, (list, tuple)) else [before] * 3
        three[axis.component] = value
        value = three
    return lay_settings(tables, {axis.key: value})


def _unit(path: str) -> str:
    key = key_of(path)
    if not _PATH.fullmatch(path) or key not in COLUMNS:
        raise SweepError(f"{path} cannot be drawn at random; those that can are {', '.join(COLUMNS)}")
    return COLUMNS[key][1]


def _axis(path: str, values: Any) -> Axis:
    if not _PATH.fullmatch(path):
        raise SweepError(
            f'"{path}" is no key of a scenario; write table.key, as in object.stiffness, and .x, .y or .z for one axis'
        )
    unit = COLUMNS.get(key_of(path), (None, None))[1]
    try:
        if isinstance(values, str) and (match := _RANGE.fullmatch(values)):
            low, unit = _quantity(match[1], unit)
            high, _ = _quantity(match[2], unit)
            return Axis(path, unit, _spread(low, high, int(match[3]), match[4] is not None))
        if isinstance(values, str) and ".." in values:
            raise ValueError(
                f'"{values}" is no range; write both ends with their units and how many values, "100 N/m..5 N/mm:50", '
                'and " log" after it for equal ratios'
            )
        listed = values.split(",") if isinstance(values, str) else _listed(path, values)
        read = [_value(value, unit) for value in listed]
    except ValueError as problem:
        raise SweepError(f"{path}: {problem}") from None
    if not read:
        raise SweepError(f"{path}: no values")
    units = {one for _, one in read}
    if len(units) > 1:
        raise SweepError(f"{path}: values of different kinds: {', '.join(sorted(units)) or 'words'}")
    return Axis(path, units.pop(), tuple(value for value, _ in read))


def _listed(path: str, values: Any) -> list[Any]:
    """Return the values of a list. Raise ValueError if one consists of several."""
    listed = list(np.atleast_1d(np.asarray(values, dtype=object)))
    for value in listed:
        if isinstance(value, (list, tuple, np.ndarray)):
            raise ValueError(
                f"{list(value)} has several values; an axis varies one number or word. "
                f'Vary one of three numbers by its axis, as in "{path}.x"'
            )
    return listed


def _spread(low: float, high: float, count: int, logarithmic: bool) -> tuple[float, ...]:
    if count < 1:
        raise ValueError("a range needs a count of at least 1")
    if not logarithmic:
        return tuple(float(x) for x in np.linspace(low, high, count))
    if low <= 0 or high <= 0:
        raise ValueError("a logarithmic range needs ends above zero")
    return tuple(float(x) for x in np.geomspace(low, high, count))


def _value(value: Any, unit: str | None) -> tuple[Any, str]:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, str):
        try:
            return _quantity(value, unit)
        except ValueError:
            if unit is not None or re.match(r"\s*[+-]?[\d.]", value):
                raise
            word = value.strip()
            return {"true": True, "false": False}.get(word, word), ""
    if isinstance(value, bool):
        return value, ""
    if not isinstance(value, (int, float)) or not np.isfinite(value):
        raise ValueError(f"{value!r} is not a finite number")
    return (float(value) if unit else value), unit or ""


def _quantity(text: str, unit: str | None) -> tuple[float, str]:
    """Return the number of a text in SI, and its SI unit; any unit where ``unit`` is None.

    Raises:
        ValueError: the text has another dimension, or no dimension that is known.
    """
    if unit is not None:
        return parse_quantity(text, unit), unit
    for known in ("rad", "", *UNITS):  # an angle can also be read as a plain number
        try:
            return parse_quantity(text, known), known
        except ValueError:
            continue
    raise ValueError(f'"{text}" cannot be read as a number with a unit; write it as "100 N/m"')


def _written(value: Any, unit: str) -> Any:
    if unit:
        return write(float(value), unit)
    return int(value) if isinstance(value, float) and value.is_integer() else value
