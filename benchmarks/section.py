"""Section of the benchmark: its measurement and its table."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

__all__ = ["TIMED", "Effort", "Progress", "Rows", "Section", "figures", "timed", "timed_cells"]

Progress = Callable[[str, float], None]
Row = dict[str, Any]
TIMED = ("work", "fastest", "median", "slowest", "runs", "required")


@dataclass(frozen=True)
class Effort:
    """Amount of repetitions and sizes.

    Attributes:
        quick: whether to run a tenth of the repetitions.
        large: whether to include sizes whose preparation takes minutes.
    """

    quick: bool = False
    large: bool = False

    def runs(self, usual: int) -> int:
        """Return the number of repetitions in place of `usual`."""
        return max(usual // 10, 1) if self.quick else usual


@dataclass(frozen=True)
class Rows:
    """Results of a section.

    Attributes:
        rows: numbers for JSON, with units in their names.
        missing: a sentence for each program that could not be measured.
    """

    rows: list[Row]
    missing: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Section:
    """Section with one table.

    Attributes:
        work: description of the work, one line.
        headings: of the columns; the first one is text.
        cells: returns the texts of a row, one per heading.
        measure: runs the measurement; its second argument is called with a text and the fraction done, 0 to 1.
    """

    work: str
    headings: tuple[str, ...]
    cells: Callable[[Row], tuple[str, ...]]
    measure: Callable[[Effort, Progress], Rows]


def figures(value: float, digits: int = 3) -> str:
    """Return a number with `digits` significant digits and without exponent: 2,140, not 2.14e+03."""
    return f"{float(f'{value:.{digits}g}'):,.10g}"


def timed(what: str, job: Callable[[], object], runs: int, asked: float | None = None) -> Row:
    """Return a row of TIMED: wall-clock time of a job, s, over `runs` repetitions after a first one.

    Args:
        what: name of the row.
        job: function to time.
        runs: number of repetitions, at least 1.
        asked: required time of the fastest run, s, which other processes affect least; None for none.
    """
    job()
    seconds = np.empty(runs)
    for i in range(runs):
        begin = time.perf_counter()
        job()
        seconds[i] = time.perf_counter() - begin
    return {
        "what": what,
        "fastest_s": float(seconds.min()),
        "median_s": float(np.median(seconds)),
        "slowest_s": float(seconds.max()),
        "runs": runs,
        "asked_s": asked,
    }


def timed_cells(row: Row) -> tuple[str, ...]:
    """Return the texts of a row of `timed`."""
    asked = row["asked_s"]
    met = "" if asked is None else f"{_text(asked)}{'' if row['fastest_s'] <= asked else ' (missed)'}"
    times = (_text(row[name]) for name in ("fastest_s", "median_s", "slowest_s"))
    return row["what"], *times, str(row["runs"]), met


def _text(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
