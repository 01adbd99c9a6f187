"""Printed numbers of the thesis, and the comparison of computed numbers with them."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from palpate.report import Page

__all__ = [
    "Check",
    "Erratum",
    "Printed",
    "at_most",
    "compare",
    "keys",
    "matrix_pair",
    "printed",
    "statement",
    "with_zero",
    "within",
]

Array = NDArray[np.float64]
Status = Literal["match", "erratum", "differs"]


@dataclass(frozen=True)
class Erratum:
    """A printed number that is wrong.

    Attributes:
        right: what it should read, digits as text; one number or one per entry.
        why: how it shows.
        at: (row, column) from 1; None for all of it.
    """

    right: Any
    why: str
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
        decimals: digits after the point that a bare integer stands for; None: as many as it shows.
        tolerance: in place of half a unit in the last digit; `because` says why.
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

    @property
    def values(self) -> Array:
        """Values (rows, columns)."""
        return np.array([[float(text) for text in row] for row in self.rows])

    def erratum(self, i: int, j: int) -> tuple[str, Erratum] | None:
        """Return the right digits of entry (i, j), counted from 0, and its erratum; None if it is right as printed."""
        for erratum in self.errata:
            if erratum.at is None:
                table = _rows(erratum.right)
                return table[i][j], erratum
            if erratum.at == (i + 1, j + 1):
                return str(erratum.right), erratum
        return None

    def resolution(self, text: str) -> float:
        """Half a unit in the last digit of `text`."""
        digits = -int(Decimal(text).as_tuple().exponent)
        if digits <= 0 and self.decimals is not None:
            digits = self.decimals
        return 0.5 * 10.0**-digits

    def entry_id(self, i: int, j: int) -> str:
        """Identity of one entry: the matrix's with [row,column] from 1."""
        if self.dimensions == 0:
            return self.id
        return f"{self.id}[{j + 1}]" if self.dimensions == 1 else f"{self.id}[{i + 1},{j + 1}]"


@dataclass(frozen=True)
class Check:
    """One computed number against one printed one.

    Attributes:
        id: unique; starts with the equation or table.
        what: one line.
        printed: as printed; a number, or words.
        computed: ours; a number, or words.
        unit: of both.
        tolerance: largest |computed - printed| of a match; with `sense` "at most" the computed value may be anything
            below printed + tolerance.
        status: match; erratum: the print is wrong, and ours agrees with what is right; differs: anything else.
        note: why, for an erratum or a tolerance of its own.
        sense: "equal" or "at most".
        right: the right value of an erratum.
    """

    id: str
    what: str
    printed: float | str
    computed: float | str
    unit: str
    tolerance: float | None
    status: Status
    note: str = ""
    sense: str = "equal"
    where: str = ""
    right: float | str | None = field(default=None)

    def to_dict(self) -> dict[str, Any]:
        """Return what results.json holds."""
        entry: dict[str, Any] = {
            "id": self.id,
            "what": self.what,
            "printed": self.printed,
            "computed": self.computed,
            "unit": self.unit,
            "tolerance": self.tolerance,
            "status": self.status,
            "where": self.where,
            "sense": self.sense,
        }
        if self.right is not None:
            entry["right"] = self.right
        if self.note:
            entry["note"] = self.note
        return entry


@cache
def _all() -> Mapping[str, Printed]:
    text = resources.files("experiments.hosseini2004").joinpath("printed.toml").read_text("utf-8")
    return {key: _read(key, entry) for key, entry in tomllib.loads(text).items()}


def printed(key: str) -> Printed:
    """Return a printed number of the thesis by its key in printed.toml."""
    return _all()[key]


def keys() -> list[str]:
    """Return every key of printed.toml, in the thesis's order."""
    return list(_all())


def compare(key: str, computed: ArrayLike, *, scale: float = 1.0, note: str = "") -> list[Check]:
    """Hold computed numbers against printed ones, one check per entry that is not printed as a plain zero.

    The zeros of a matrix become one check: the largest of them.

    Args:
        key: in printed.toml.
        computed: same shape as printed, in SI.
        scale: SI to the printed unit.
        note: added to each check.

    Raises:
        ValueError: the shapes differ.
    """
    p = printed(key)
    ours = np.asarray(computed, dtype=float) * scale
    ours = ours.reshape(1, -1) if ours.ndim < 2 else ours
    if ours.shape != p.values.shape:
        raise ValueError(f"{key} is printed with shape {p.values.shape}, computed with {ours.shape}")
    checks = []
    zeros: list[tuple[float, float]] = []
    for i, row in enumerate(p.rows):
        for j, text in enumerate(row):
            value = float(ours[i, j])
            if p.dimensions == 2 and float(text) == 0.0:
                zeros.append((abs(value), p.resolution(text)))
                continue
            checks.append(_one(p, i, j, value, note))
    if zeros:
        worst = max(value for value, _ in zeros)
        limit = min(limit for _, limit in zeros)
        what = f"{p.what}: largest of the {len(zeros)} entries printed 0"
        checks.append(within(f"{p.id}[zeros]", what, 0.0, worst, p.unit, limit, where=p.where, note=note))
    return checks


def _one(p: Printed, i: int, j: int, value: float, note: str) -> Check:
    text = p.rows[i][j]
    what = p.what if p.dimensions == 0 else f"{p.what}, {p.entry_id(i, j).removeprefix(p.id)}"
    tolerance = p.tolerance if p.tolerance is not None else p.resolution(text)
    agrees = _close(value, float(text), tolerance)
    wrong = p.erratum(i, j)
    if wrong is None:
        notes = "; ".join(part for part in (p.because, note) if part)
        status: Status = "match" if agrees else "differs"
        return Check(p.entry_id(i, j), what, float(text), value, p.unit, tolerance, status, notes, where=p.where)
    right, erratum = wrong
    allowed = p.resolution(right)
    status = "erratum" if _close(value, float(right), allowed) and not agrees else "differs"
    return Check(
        p.entry_id(i, j),
        what,
        float(text),
        value,
        p.unit,
        allowed,
        status,
        erratum.why,
        where=p.where,
        right=float(right),
    )


def within(
    id: str,
    what: str,
    expected: float,
    computed: float,
    unit: str,
    tolerance: float,
    *,
    where: str = "",
    note: str = "",
) -> Check:
    """Return a check that matches if |computed - expected| <= tolerance."""
    status: Status = "match" if _close(computed, expected, tolerance) else "differs"
    return Check(id, what, expected, float(computed), unit, tolerance, status, note, where=where)


def at_most(
    id: str,
    what: str,
    limit: float,
    computed: float,
    unit: str,
    *,
    tolerance: float = 0.0,
    where: str = "",
    note: str = "",
) -> Check:
    """Return a check that matches if computed <= limit + tolerance: no worse than printed."""
    status: Status = "match" if math.isfinite(computed) and computed <= limit + tolerance else "differs"
    return Check(id, what, limit, float(computed), unit, tolerance, status, note, "at most", where)


def statement(
    id: str,
    what: str,
    said: str,
    found: str,
    *,
    holds: bool,
    wrong: bool = False,
    where: str = "",
    note: str = "",
) -> Check:
    """Return a check of a sentence of the thesis.

    Args:
        holds: whether what we found is what we claim to find (the evidence was computed).
        wrong: whether that contradicts the sentence: an erratum.
    """
    status: Status = "differs" if not holds else ("erratum" if wrong else "match")
    return Check(id, what, said, found, "", None, status, note, "statement", where)


def _close(value: float, target: float, tolerance: float) -> bool:
    # The last printed digit is exact in decimal, not in binary: half a unit may be met by rounding alone.
    return math.isfinite(value) and abs(value - target) <= tolerance * (1 + 1e-9) + 1e-15


def _rows(entry: Any) -> tuple[tuple[str, ...], ...]:
    if not isinstance(entry, list):
        return ((str(entry),),)
    if entry and isinstance(entry[0], list):
        return tuple(tuple(str(text) for text in row) for row in entry)
    return (tuple(str(text) for text in entry),)


def _read(key: str, entry: Mapping[str, Any]) -> Printed:
    value = entry["printed"]
    dimensions = 0 if not isinstance(value, list) else 2 if isinstance(value[0], list) else 1
    errata: Sequence[Mapping[str, Any]] = entry.get("errata", [])
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
        tuple(Erratum(e["right"], e["why"], tuple(e["at"]) if "at" in e else None) for e in errata),
    )


def matrix_pair(page: Page, key: str, computed: ArrayLike) -> None:
    """Write a printed matrix beside the computed one on a page; entries beyond their tolerance are marked."""
    p = printed(key)
    ours = np.asarray(computed, dtype=float)
    ours = ours.reshape(1, -1) if ours.ndim < 2 else ours
    differs = [
        [
            not _close(float(ours[i, j]), float(text), p.tolerance if p.tolerance is not None else p.resolution(text))
            for j, text in enumerate(row)
        ]
        for i, row in enumerate(p.rows)
    ]
    why = " ".join(dict.fromkeys(erratum.why for erratum in p.errata))
    unit = f" [{p.unit}]" if p.unit else ""
    rows = [[with_zero(text) for text in row] for row in p.rows]
    page.matrices(f"{p.where}: {p.what}{unit}", rows, ours.tolist(), differs=differs, explanation=why)


def with_zero(text: str) -> str:
    """Return a number as printed, with a zero before a leading point."""
    return text.replace(".", "0.", 1) if text.startswith((".", "-.")) else text
