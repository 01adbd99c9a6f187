"""Numbers as the thesis prints them: digits as text, errata, and numbers that palpate does not reproduce."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from palpate.arrays import Array

__all__ = ["Erratum", "Printed", "keys", "printed", "table", "with_zero"]

PACKAGE = "experiments.hosseini2004"


@dataclass(frozen=True)
class Erratum:
    """A printed number that is wrong.

    Attributes:
        right: correct value, digits as text; one number or one per entry.
        why: evidence.
        cause: key in errata.toml.
        at: (row, column) from 1; None for all entries.
    """

    right: Any
    why: str
    cause: str
    at: tuple[int, int] | None = None


@dataclass(frozen=True)
class Printed:
    """A printed number, list or matrix.

    Attributes:
        id: key in printed.toml, "eq3.41-A_ci".
        what: one line.
        where: equation or table, and page.
        unit: of every entry.
        rows: digits as text, by rows; one row for a list, one entry for a number.
        dimensions: 0, 1 or 2.
        decimals: digits after the point that a bare integer represents; None: as many as it shows.
        tolerance: replaces half a unit in the last digit; `because` gives the reason.
        errata: of the entries.
        differs: reasons why entries are not reproduced, by (row, column) from 1, or by None for all entries.
    """

    id: str
    what: str
    where: str
    unit: str
    rows: tuple[tuple[str, ...], ...]
    dimensions: int
    decimals: int | None = None
    tolerance: float | None = None
    because: str = ""
    errata: tuple[Erratum, ...] = ()
    differs: Mapping[tuple[int, int] | None, str] = field(default_factory=dict)

    @property
    def values(self) -> Array:
        """Values (rows, columns)."""
        return np.array([[float(text) for text in row] for row in self.rows])

    def erratum(self, i: int, j: int) -> tuple[str, Erratum] | None:
        """Return the right digits of entry (i, j), counted from 0, and its erratum; None if it is right as printed."""
        for erratum in self.errata:
            if erratum.at is None:
                right = _rows(erratum.right)
                return right[i][j], erratum
            if erratum.at == (i + 1, j + 1):
                return str(erratum.right), erratum
        return None

    def difference(self, i: int, j: int) -> str:
        """Return why entry (i, j), counted from 0, is not reproduced; "" if it should be."""
        return self.differs.get((i + 1, j + 1), self.differs.get(None, ""))

    def resolution(self, text: str) -> float:
        """Half a unit in the last digit of `text`."""
        digits = -int(Decimal(text).as_tuple().exponent)
        if digits <= 0 and self.decimals is not None:
            digits = self.decimals
        return 0.5 * 10.0**-digits

    def entry_id(self, i: int, j: int) -> str:
        """Identity of one entry: that of the matrix with [row,column] from 1."""
        if self.dimensions == 0:
            return self.id
        return f"{self.id}[{j + 1}]" if self.dimensions == 1 else f"{self.id}[{i + 1},{j + 1}]"


def table(name: str) -> dict[str, Any]:
    """Return a TOML file of this folder as a table."""
    return tomllib.loads(resources.files(PACKAGE).joinpath(name).read_text("utf-8"))


@cache
def _all() -> Mapping[str, Printed]:
    return {key: _read(key, entry) for key, entry in table("printed.toml").items()}


def printed(key: str) -> Printed:
    """Return a printed number of the thesis by its key in printed.toml."""
    return _all()[key]


def keys() -> list[str]:
    """Return every key of printed.toml, in the order of the thesis."""
    return list(_all())


def with_zero(text: str) -> str:
    """Return a number as printed, with a zero before a leading point."""
    return text.replace(".", "0.", 1) if text.startswith((".", "-.")) else text


def _rows(entry: Any) -> tuple[tuple[str, ...], ...]:
    if not isinstance(entry, list):
        return ((str(entry),),)
    if entry and isinstance(entry[0], list):
        return tuple(tuple(str(text) for text in row) for row in entry)
    return (tuple(str(text) for text in entry),)


def _read(key: str, entry: Mapping[str, Any]) -> Printed:
    value = entry["printed"]
    dimensions = 0 if not isinstance(value, list) else 2 if isinstance(value[0], list) else 1
    return Printed(
        key,
        entry["what"],
        entry["where"],
        entry["unit"],
        _rows(value),
        dimensions,
        entry.get("decimals"),
        entry.get("tolerance"),
        entry.get("because", ""),
        tuple(Erratum(e["right"], e["why"], e["cause"], _at(e)) for e in entry.get("errata", [])),
        {_at(e): e["why"] for e in entry.get("differs", [])},
    )


def _at(entry: Mapping[str, Any]) -> tuple[int, int] | None:
    return tuple(entry["at"]) if "at" in entry else None
