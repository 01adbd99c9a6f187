"""A section of the benchmark: what it times, and how its rows read."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

__all__ = ["TIMED", "Effort", "Progress", "Rows", "Section", "figures", "timed", "timed_cells"]

Progress = Callable[[str, float], None]
Row = dict[str, Any]
TIMED = ("what", "fastest", "median", "slowest", "runs", "asked")


@dataclass(frozen=True)
class Effort:
    """How much to time.

    Attributes:
        quick: a tenth of the repetitions.
        large: also the sizes that take minutes to prepare.
    """

    quick: bool = False
    large: bool = False

    def runs(self, usual: int) -> int:
        """Return how often to repeat what is usually repeated `usual` times."""
        return max(usual // 10, 1) if self.quick else usual


@dataclass(frozen=True)
class Rows:
    """What a section measured.

    Attributes:
        rows: numbers as JSON can hold them, each with its unit in the name.
        missing: what could not be measured, a sentence each.
    """

    rows: list[Row]
    missing: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Section:
    """One table of the benchmark.

    Attributes:
        work: what is timed, in one line.
        headings: of the table; the first column is text.
        cells: one row's texts, as many as headings.
        measure: does the work; told of progress with a text and the share done, 0 to 1.
    """

    work: str
    headings: tuple[str, ...]
    cells: Callable[[Row], tuple[str, ...]]
    measure: Callable[[Effort, Progress], Rows]


def figures(value: float, digits: int = 3) -> str:
    """Return a number rounded to so many figures, written out: 2,140 and not 2.14e+03."""
    return f"{float(f'{value:.{digits}g}'):,.10g}"


def timed(what: str, job: Callable[[], object], runs: int, asked: float | None = None) -> Row:
    """Return a row of TIMED: wall-clock seconds of `job` over `runs` repetitions, after one to warm up.

    Args:
        what: names the row.
        job: the work.
        runs: repetitions, at least 1.
        asked: s, what the fastest run is held against, for others on the machine only slow it; None: nothing is asked.
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
    """Return the texts of a row that `timed` made."""
    asked = row["asked_s"]
    met = "" if asked is None else f"{_text(asked)}{'' if row['fastest_s'] <= asked else ' (missed)'}"
    times = (_text(row[name]) for name in ("fastest_s", "median_s", "slowest_s"))
    return row["what"], *times, str(row["runs"]), met


def _text(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
