"""Conclusions of the thesis, sentence by sentence, with the checks that confirm or refute them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from palpate.report import Page
from palpate.report.html import number

from experiments.hosseini2004.checks import KINDS, Check, Kind, Tally
from experiments.hosseini2004.printed_numbers import table

__all__ = ["Sentence", "Verdict", "conclusions", "judged", "sentences"]

Verdict = Literal["confirmed", "refuted", "not testable", "undecided"]
NO_BREAK = "\N{NO-BREAK SPACE}"
SIGNS = {"confirmed": "✓", "refuted": "✗", "not testable": "·", "undecided": "?"}


@dataclass(frozen=True)
class Sentence:
    """A sentence of the thesis; fields as in conclusions.toml."""

    section: str
    says: str
    confirmed: tuple[str, ...] = ()
    refuted: tuple[str, ...] = ()
    not_testable: str = ""
    note: str = ""

    def verdict(self, checks: Mapping[str, Check]) -> Verdict:
        """Return the verdict that the checks support; "undecided" if one is missing or has another status."""
        if self.not_testable:
            return "not testable"
        named = self.confirmed or self.refuted
        if not all(id in checks for id in named):
            return "undecided"
        if self.confirmed:
            return "confirmed" if all(checks[id].status == "match" for id in named) else "undecided"
        shown = [
            checks[id].status == "erratum" or (checks[id].status == "differs" and checks[id].known) for id in named
        ]
        return "refuted" if all(shown) else "undecided"

    def evidence(self, checks: Mapping[str, Check]) -> str:
        """Return the computed values of its checks, with their ids."""
        if self.not_testable:
            return self.not_testable
        named = [checks[id] for id in (*self.confirmed, *self.refuted) if id in checks]
        parts = [f"{_shown(check)} (`{check.id}`)" for check in named]
        return "; ".join(parts) + (f". {self.note}" if self.note else "")


def _shown(check: Check) -> str:
    """Return the finding of a check: a sentence, a number beside the printed one, or a number with its quantity."""
    if check.sense == "statement":
        return _value(check)
    if check.kind == "recomputed":
        return f"{_value(check)}, printed {_value(check, 'printed')}"
    return f"{check.what}: {_value(check)}"


def sentences() -> list[Sentence]:
    """Return every sentence of conclusions.toml.

    Raises:
        ValueError: an entry has not exactly one of confirmed, refuted and not_testable.
    """
    found = []
    for entry in table("conclusions.toml")["sentence"]:
        if sum(key in entry for key in ("confirmed", "refuted", "not_testable")) != 1:
            raise ValueError(f"conclusions.toml: {entry['says']!r} needs one of confirmed, refuted, not_testable")
        found.append(
            Sentence(entry["section"], entry["says"], tuple(entry.get("confirmed", ())),
                     tuple(entry.get("refuted", ())), entry.get("not_testable", ""), entry.get("note", ""))
        )  # fmt: skip
    return found


def judged(checks: Sequence[Check]) -> list[tuple[Sentence, Verdict]]:
    """Return every sentence with its verdict."""
    by_id = {check.id: check for check in checks}
    return [(sentence, sentence.verdict(by_id)) for sentence in sentences()]


def conclusions(page: Page, checks: Sequence[Check], counts: Tally) -> None:
    """Write the opening section: counts by kind, and the conclusions of the thesis sentence by sentence."""
    by_id = {check.id: check for check in checks}
    verdicts = judged(checks)
    tally = Counter(verdict for _, verdict in verdicts)
    page.section("The conclusions of the thesis", "conclusions")
    page.verdict(
        f"{tally['confirmed']} sentences confirmed, {tally['refuted']} refuted, {tally['not testable']} not testable"
        + (f", {tally['undecided']} undecided" if tally["undecided"] else "")
        + ".",
        "bad" if tally["undecided"] else "note",
    )
    page.paragraph(
        "Sections 2.7 to 6, sentence by sentence, shortened. A sentence whose parts end differently has a row for "
        "each. The verdict follows from the checks named in the last column, which run with this report."
    )
    page.table(
        ["section", "the thesis says", "verdict", "evidence"],
        [(s.section, s.says, f"{SIGNS[v]} {v}".replace(" ", NO_BREAK), s.evidence(by_id)) for s, v in verdicts],
    )
    page.section("What was checked", "counts")
    page.paragraph(counts.sentence)
    page.paragraph("Only the first row of the table counts as printed numbers. The other kinds say less:")
    page.table(
        ["kind of check", "match", "errata", "differ", "not computed"],
        [(KINDS[kind], *_cells(kind, counts)) for kind in KINDS],
    )
    differing = [
        check for check in checks if check.kind == "recomputed" and check.status in ("differs", "not computed")
    ]
    page.paragraph("Printed numbers that are not reproduced:")
    page.table(
        ["where", "quantity", "printed", "computed", "reason"],
        [
            (c.where.partition(",")[0].replace(" ", NO_BREAK), c.what, _value(c, "printed"), _value(c), c.note)
            for c in differing
        ],
    )


def _cells(kind: Kind, counts: Tally) -> list[int]:
    found = counts.kinds[kind]
    return [found[status] for status in ("match", "erratum", "differs", "not computed")]


def _value(check: Check, name: str = "computed") -> str:
    value = getattr(check, name)
    if isinstance(value, str):
        return value
    text = number(value, 4 if name == "computed" else 8)
    return f"{text} {check.unit}".strip() if name == "computed" and check.sense != "statement" else text
