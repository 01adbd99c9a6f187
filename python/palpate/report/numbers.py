"""Tables of the numbers of a run, with one row per number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from palpate.report.html import Page, number

Number = tuple[str, str, str, float]  # name, key, unit shown, factor from the unit of the key to the unit shown


_SMALLEST: Final = 1e-4  # number written out, in the unit shown


def numbers_table(page: Page, numbers: Sequence[Number], found: Mapping[str, Any], caption: str) -> None:
    """Add a table of the values of `found` under the keys of `numbers`, formatted by `in_column`; None is a dash."""
    rows = [
        (name, None if found[key] is None else in_column(found[key] * factor), unit)
        for name, key, unit, factor in numbers
    ]
    page.table(["quantity", "value", "unit"], rows, caption)


def in_column(value: float) -> str:
    """Return a number with four digits and without powers of ten, for comparison within a column.

    Numbers below 0.0001 are written as "under 0.0001" or "over −0.0001".
    """
    if 0.0 < abs(value) < _SMALLEST:
        return f"under {number(_SMALLEST)}" if value > 0.0 else f"over {number(-_SMALLEST)}"
    return number(value)
