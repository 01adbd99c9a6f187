"""What a run shows in numbers, as a table: one row for each, with its unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from palpate.report.html import Page

__all__ = ["Number", "numbers_table"]

Number = tuple[str, str, str, float]  # what it is, its key, the unit shown, the factor to there from the key's


def numbers_table(page: Page, numbers: Sequence[Number], found: Mapping[str, Any], caption: str) -> None:
    """Write `numbers` of `found` as a table; None is a dash."""
    rows = [
        (name, None if found[key] is None else f"{found[key] * factor:.4g}", unit)
        for name, key, unit, factor in numbers
    ]
    page.table(["what", "found", "unit"], rows, caption)
