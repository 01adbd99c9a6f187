"""Figures, tables and diagrams of the thesis: where the report reproduces each, or why it does not."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any, Final, Literal

from palpate.report import Page

from experiments.hosseini2004.printed_numbers import table

__all__ = ["Item", "contents", "items"]

State = Literal["reproduced", "own choices", "not reproduced"]
STATES: Final[dict[State, str]] = {
    "reproduced": "the same quantities from the printed data",
    "own choices": "with controllers, forces or inputs that the thesis does not print",
    "not reproduced": "",
}


@dataclass(frozen=True)
class Item:
    """A figure, table or diagram.

    Attributes:
        name: "figure 2.11".
        shows: in a few words.
        state: key of STATES.
        where: title of the subsection of the report; "" if not reproduced.
        why: reason, or what differs.
    """

    name: str
    shows: str
    state: State
    where: str
    why: str


def items() -> list[Item]:
    """Return every figure, table and diagram of contents.toml, in its order."""
    return [Item(e["name"], e["shows"], e["state"], e.get("where", ""), e.get("why", "")) for e in _entries()]


def _entries() -> list[dict[str, Any]]:
    return list(table("contents.toml")["item"])


def contents(page: Page) -> None:
    """Write the list."""
    listed = items()
    counts = Counter(item.state for item in listed)
    page.section("Figures, tables and diagrams", "figures")
    page.paragraph(
        "The text of the thesis is available as a scan without pictures. Curves can therefore not be compared point by "
        "point; captions and text say what a figure shows. Of "
        f"{len(listed)} entries {counts['reproduced']} are reproduced, {counts['own choices']} are repeated with "
        f"controllers, forces or inputs that the thesis does not print, and {counts['not reproduced']} are not."
    )
    page.table(
        ["in the thesis", "shows", "state", "section of this report", "remark"],
        [(item.name, item.shows, item.state, item.where or None, item.why) for item in listed],
    )
