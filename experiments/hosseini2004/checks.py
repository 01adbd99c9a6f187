"""Checks of the reproduction: computed numbers against printed ones, each with its kind."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from experiments.hosseini2004.printed_numbers import Printed, printed, with_zero

if TYPE_CHECKING:
    from palpate.report import Page

__all__ = [
    "KINDS",
    "Check",
    "Kind",
    "Tally",
    "at_most",
    "compare",
    "matrix_pair",
    "not_computed",
    "statement",
    "tally",
    "within",
]

Status = Literal["match", "erratum", "differs", "not computed"]
Kind = Literal["recomputed", "sentence", "bound", "carried", "identified", "own"]
KINDS: Final[dict[Kind, str]] = {
    "recomputed": "printed number recomputed",
    "sentence": "printed sentence or equation tested",
    "bound": "bound kept: palpate's own design is no worse than the print",
    "carried": "parameter carried over",
    "identified": "identified from own simulation, or fitted",
    "own": "palpate against palpate",
}


@dataclass(frozen=True)
class Check:
    """A computed number or finding beside a printed one.

    Attributes:
        id: unique; starts with the equation or table.
        what: one line.
        printed: as printed; a number, or words.
        computed: by palpate; a number, or words.
        unit: of both.
        tolerance: largest |computed - printed| of a match; with `sense` "at most" the computed value may be anything
            below printed + tolerance.
        status: match; erratum: the print is wrong, and the computed value equals the corrected one; differs: anything
            else; not computed: palpate has no way to compute it.
        kind: key of KINDS. Only "recomputed" counts as a printed number.
        note: reason of an erratum, of a difference or of a tolerance.
        sense: "equal", "at most" or "statement".
        right: the right value of an erratum.
        cause: of an erratum, key in errata.toml.
        known: whether the difference, or the missing computation, is expected and explained in `note`.
    """

    id: str
    what: str
    printed: float | str
    computed: float | str
    unit: str
    tolerance: float | None
    status: Status
    kind: Kind
    note: str = ""
    sense: str = "equal"
    where: str = ""
    right: float | str | None = field(default=None)
    cause: str = ""
    known: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of results.json."""
        entry: dict[str, Any] = {
            "id": self.id,
            "kind": self.kind,
            "what": self.what,
            "printed": self.printed,
            "computed": self.computed,
            "unit": self.unit,
            "tolerance": self.tolerance,
            "status": self.status,
            "where": self.where,
            "sense": self.sense,
        }
        if self.status in ("differs", "not computed"):
            entry["known"] = self.known
        for name in ("right", "cause", "note"):
            if getattr(self, name) not in (None, ""):
                entry[name] = getattr(self, name)
        return entry


@dataclass(frozen=True)
class Tally:
    """Counts of the checks; the first four are of printed numbers recomputed.

    Attributes:
        match, errata, differ, not_computed: printed numbers by status.
        causes: distinct causes of the errata, sentences and equations included.
        kinds: status counts of every kind.
        unexplained: ids of checks that differ without a registered reason.
    """

    match: int
    errata: int
    differ: int
    not_computed: int
    causes: int
    kinds: dict[Kind, Counter[Status]]
    unexplained: list[str]

    @property
    def sentence(self) -> str:
        """Headline: the printed numbers, and how many of them are not reproduced."""
        total = self.match + self.errata + self.differ + self.not_computed
        carried = self.kinds["carried"].total()
        return (
            f"Of {total} checks of printed numbers {self.match} agree to the printed digits, {self.errata} show errors "
            f"of the print, and {self.differ + self.not_computed} are not reproduced ({self.differ} differ, "
            f"{self.not_computed} cannot be computed). {carried} parameters are carried over, not tested."
        )


def tally(checks: Iterable[Check]) -> Tally:
    """Count checks by kind and status."""
    listed = list(checks)
    kinds: dict[Kind, Counter[Status]] = {kind: Counter() for kind in KINDS}
    for check in listed:
        kinds[check.kind][check.status] += 1
    numbers = kinds["recomputed"]
    return Tally(
        numbers["match"],
        numbers["erratum"],
        numbers["differs"],
        numbers["not computed"],
        len({check.cause for check in listed if check.cause}),
        kinds,
        [check.id for check in listed if check.status in ("differs", "not computed") and not check.known],
    )


def compare(
    key: str, computed: ArrayLike, *, kind: Kind = "recomputed", scale: float = 1.0, note: str = ""
) -> list[Check]:
    """Compare computed numbers with printed ones, one check per entry that is not printed as a plain zero.

    The zeros of a matrix become one check: the largest of them.

    Args:
        key: in printed.toml.
        computed: same shape as printed, in SI.
        kind: of the checks.
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
            checks.append(_one(p, i, j, value, kind, note))
    if zeros:
        worst = max(value for value, _ in zeros)
        limit = min(limit for _, limit in zeros)
        what = f"{p.what}: largest of the {len(zeros)} entries printed 0"
        checks.append(within(f"{p.id}[zeros]", what, 0.0, worst, p.unit, limit, kind=kind, where=p.where, note=note))
    return checks


def _one(p: Printed, i: int, j: int, value: float, kind: Kind, note: str) -> Check:
    text = p.rows[i][j]
    name = p.entry_id(i, j)
    what = p.what if p.dimensions == 0 else f"{p.what}, {name.removeprefix(p.id)}"
    tolerance = p.tolerance if p.tolerance is not None else p.resolution(text)
    agrees = _close(value, float(text), tolerance)
    wrong = p.erratum(i, j)
    if wrong is None:
        reason = "" if agrees else p.difference(i, j)
        notes = reason or "; ".join(part for part in (p.because, note) if part)
        status: Status = "match" if agrees else "differs"
        return Check(name, what, float(text), value, p.unit, tolerance, status, kind, notes, where=p.where,
                     known=bool(reason))  # fmt: skip
    right, erratum = wrong
    allowed = p.resolution(right)
    status = "erratum" if _close(value, float(right), allowed) and not agrees else "differs"
    return Check(name, what, float(text), value, p.unit, allowed, status, kind, erratum.why, where=p.where,
                 right=float(right), cause=erratum.cause)  # fmt: skip


def not_computed(key: str, kind: Kind = "recomputed") -> list[Check]:
    """Return a check per entry of a printed number that palpate cannot compute; printed.toml gives the reason."""
    p = printed(key)
    return [
        Check(p.entry_id(i, j), p.what, float(text), "–", p.unit, None, "not computed", kind, p.difference(i, j),
              where=p.where, known=bool(p.difference(i, j)))
        for i, row in enumerate(p.rows)
        for j, text in enumerate(row)
    ]  # fmt: skip


def within(
    id: str,
    what: str,
    expected: float,
    computed: float,
    unit: str,
    tolerance: float,
    *,
    kind: Kind,
    where: str = "",
    note: str = "",
) -> Check:
    """Return a check that matches if |computed - expected| <= tolerance."""
    status: Status = "match" if _close(computed, expected, tolerance) else "differs"
    return Check(id, what, expected, float(computed), unit, tolerance, status, kind, note, where=where)


def at_most(
    id: str,
    what: str,
    limit: float,
    computed: float,
    unit: str,
    *,
    kind: Kind,
    tolerance: float = 0.0,
    where: str = "",
    note: str = "",
    reason: str = "",
) -> Check:
    """Return a check that matches if computed <= limit + tolerance; `reason` explains a known excess."""
    kept = math.isfinite(computed) and computed <= limit + tolerance
    status: Status = "match" if kept else "differs"
    known = bool(reason) and not kept and math.isfinite(computed)
    return Check(id, what, limit, float(computed), unit, tolerance, status, kind, reason if known else note, "at most",
                 where, known=known)  # fmt: skip


def statement(
    id: str,
    what: str,
    said: str,
    found: str,
    *,
    holds: bool,
    kind: Kind = "sentence",
    cause: str = "",
    refuted: bool = False,
    where: str = "",
    note: str = "",
) -> Check:
    """Return a check of a sentence or an equation of the thesis.

    Args:
        holds: whether the computation shows `found`.
        kind: "own" if the sentence is palpate's.
        cause: `found` shows an error of the print; key in errata.toml.
        refuted: `found` contradicts the sentence without an error of the print; the check differs, for a known reason.
    """
    status: Status = "differs" if refuted or not holds else ("erratum" if cause else "match")
    return Check(id, what, said, found, "", None, status, kind, note, "statement", where, cause=cause,
                 known=bool(refuted and holds))  # fmt: skip


def _close(value: float, target: float, tolerance: float) -> bool:
    # The last printed digit is exact in decimal, not in binary: half a unit may be met by rounding alone.
    return math.isfinite(value) and abs(value - target) <= tolerance * (1 + 1e-9) + 1e-15


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
