"""What a run shows in numbers, as a table: one row for each, with its unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from palpate.report.html import Page, number

__all__ = ["Number", "in_column", "numbers_table"]

Number = tuple[str, str, str, float]  # what it is, its key, the unit shown, the factor to there from the key's


_LEAST: Final = 1e-4  # that is written out: less, of the unit that a table shows, is as good as nothing


def numbers_table(page: Page, numbers: Sequence[Number], found: Mapping[str, Any], caption: str) -> None:
    """Write `numbers` of `found` as a table, as `in_column` does; None is a dash."""
    rows = [
        (name, None if found[key] is None else in_column(found[key] * factor), unit)
        for name, key, unit, factor in numbers
    ]
    page.table(["what", "found", "unit"], rows, caption)


def in_column(value: float) -> str:
    """Return a number to be compared with others above and below: four digits, no powers of ten where it is small.

    What is less than 0.0001 is said to be: "under 0.0001", below zero "over −0.0001".
    """
    if 0.0 < abs(value) < _LEAST:
        return f"under {number(_LEAST)}" if value > 0.0 else f"over {number(-_LEAST)}"
    return number(value)
