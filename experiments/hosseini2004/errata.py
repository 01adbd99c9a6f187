"""Errata of the thesis by cause: errors and contradictions of the print, with the checks that show them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from palpate.report import Page

from experiments.hosseini2004.checks import Check
from experiments.hosseini2004.printed_numbers import table

__all__ = ["Cause", "causes", "errata"]


@dataclass(frozen=True)
class Cause:
    """A cause of errors of the print; fields as in errata.toml."""

    id: str
    where: str
    printed: str
    correct: str
    evidence: str
    kind: str
    checks: tuple[str, ...]

    def shown_by(self, checks: Iterable[Check]) -> list[Check]:
        """Return the checks that show it."""
        return [check for check in checks if check.cause == self.id or check.id in self.checks]


def causes() -> list[Cause]:
    """Return every cause of errata.toml, in its order."""
    return [
        Cause(id, e["where"], e["printed"], e["correct"], e["evidence"], e["kind"], tuple(e.get("checks", ())))
        for id, e in table("errata.toml").items()
    ]


def errata(page: Page, checks: Sequence[Check]) -> None:
    """Write the errata, one row per cause."""
    listed = causes()
    entries = sum(check.status == "erratum" for check in checks)
    page.section("Errata of the thesis", "errata")
    page.paragraph(
        f"{entries} checks show errors of the print. They have few causes: the tables list {len(listed)} errors and "
        "contradictions by cause. The last column counts the checks that show each; a dash means that the text alone "
        "shows it."
    )
    for kind, caption in (
        ("error", "Errors: the print is wrong, and the correct form is known."),
        ("contradiction", "Contradictions: two places of the print exclude each other."),
    ):
        rows = [
            (c.where, c.printed, c.correct, _evidence(c, checks), len(c.shown_by(checks)) or None)
            for c in listed
            if c.kind == kind
        ]
        second = "correct" if kind == "error" else "other place"
        page.paragraph(caption)
        page.table(["where", "printed", second, "evidence", "checks"], rows)


def _evidence(cause: Cause, checks: Sequence[Check]) -> str:
    """Return the evidence, with the computed note of the first sentence that shows it."""
    notes = [c.note for c in cause.shown_by(checks) if c.sense == "statement" and c.cause == cause.id and c.note]
    measured = notes[0][0].upper() + notes[0][1:] + "." if notes else ""
    return " ".join(part for part in (cause.evidence, measured) if part)
