"""Reproduction of the thesis: results.json, report.html and the headline figure."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.files import write_folder
from palpate.report import Page

from experiments.hosseini2004.certificates import certificates
from experiments.hosseini2004.chapter2 import chapter2
from experiments.hosseini2004.chapter3 import chapter3
from experiments.hosseini2004.chapter4 import chapter4
from experiments.hosseini2004.chapter5 import chapter5
from experiments.hosseini2004.checks import KINDS, Check, Tally, tally
from experiments.hosseini2004.conclusions import Sentence, Verdict, conclusions, judged
from experiments.hosseini2004.contents import contents
from experiments.hosseini2004.errata import errata
from experiments.hosseini2004.headline import headline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Reproduction", "run"]

Progress = Callable[[str, float], None]
TITLE = "The thesis, reproduced"
LEAD = (
    "Hosseini-Zadeh's *Stability of Haptic Rendering for Deformable Objects* (2004), chapters 2 to 5, computed by "
    "palpate: first as printed, then with palpate's own controllers."
)
CHAPTERS = (  # with the fraction of the time of each
    (chapter2, "chapter 2", 0.06),
    (chapter3, "chapter 3", 0.27),
    (chapter4, "chapter 4", 0.2),
    (chapter5, "chapter 5", 0.2),
    (certificates, "certificates", 0.2),
)


@dataclass(frozen=True)
class Reproduction:
    """Result of a run: the checks, their counts, and the verdict of every conclusion of the thesis."""

    checks: list[Check]
    counts: Tally
    conclusions: list[tuple[Sentence, Verdict]]

    def to_list(self) -> list[dict[str, Any]]:
        """Return the content of results.json: one dictionary per check."""
        return [_plain(check.to_dict()) for check in self.checks]

    @property
    def expected(self) -> bool:
        """Whether every difference has a registered reason, and every conclusion is decided or not testable."""
        return not self.counts.unexplained and all(verdict != "undecided" for _, verdict in self.conclusions)


def run(out: Path, progress: Progress | None = None) -> Reproduction:
    """Compute chapters 2 to 5, write the results to `out`, and return them.

    Writes results.json (the checks), report.html (self-contained), headline.svg and headline.png atomically. Each check
    has id, kind (key of `KINDS`), what, printed, computed, unit, tolerance, status, where and sense. The status is
    "match", "erratum", "differs" or "not computed"; the sense "equal", "at most" (one-sided) or "statement". Where they
    apply, a check also has known (of a difference), right and cause (of an erratum), and note.

    Args:
        out: folder; created if missing.
        progress: called with a description and the fraction done.

    Raises:
        OutputError: the folder cannot be written.
    """
    report: Progress = progress or (lambda _text, _fraction: None)
    body = Page(TITLE)
    report("at a glance", 0.0)
    picture = headline(body)
    checks: list[Check] = []
    done = 0.05
    for chapter, name, fraction in CHAPTERS:
        report(name, done)
        checks += chapter(body, _part(report, name, done, fraction))
        done += fraction
    counts = tally(checks)
    page = Page(TITLE, f"{LEAD} {counts.sentence}", footer="All numbers on this page come from the run that wrote it.")
    conclusions(page, checks, counts)
    errata(page, checks)
    contents(page)
    page.extend(body)
    _all(page, checks)
    result = Reproduction(checks, counts, judged(checks))
    report("writing", 0.99)
    _write(Path(out), page, picture, result.to_list())
    report("done", 1.0)
    return result


def _part(report: Progress, name: str, start: float, size: float) -> Progress:
    """Return the progress callback of a part that begins at `start` and takes the fraction `size`."""
    return lambda text, fraction: report(f"{name}: {text}", start + size * fraction)


def _all(page: Page, checks: Iterable[Check]) -> None:
    page.section("Every check", "checks")
    page.paragraph(
        "A number matches if it lies within half a unit of the last printed digit, or within the tolerance stated. "
        "“≤” marks one-sided checks. Only the first kind compares with a printed number."
    )
    for kind, name in KINDS.items():
        rows = []
        for check in checks:
            if check.kind != kind:
                continue
            limit = "" if check.tolerance is None else f"{check.tolerance:.2g}"
            sign = {"at most": "≤ ", "equal": "± ", "statement": ""}[check.sense]
            rows.append((f"{check.what} (`{check.id}`)", _text(check, "printed"), _text(check, "computed"), check.unit,
                         sign + limit if limit else "", check.status))  # fmt: skip
        page.subsection(f"Kind: {name}")
        wanted = "printed" if kind in ("recomputed", "sentence", "carried", "bound") else "expected"
        page.table(["quantity", wanted, "computed", "unit", "tolerance", "status"], rows)


def _text(check: Check, name: str) -> str:
    value = getattr(check, name)
    if isinstance(value, str):
        return value
    digits = 6 if name == "computed" else 10
    return f"{value:.{digits}g}".replace("-", "−")


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry for JSON, with text in place of numbers that are not finite."""
    return {
        key: "not finite" if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in entry.items()
    }


def _write(out: Path, page: Page, picture: Figure, results: list[dict[str, Any]]) -> None:
    text = json.dumps(results, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_folder(
        out,
        {
            "headline.svg": lambda part: picture.savefig(part, format="svg", facecolor="white"),
            "headline.png": lambda part: picture.savefig(part, format="png", dpi=150, facecolor="white"),
            "report.html": page.save,
            "results.json": lambda part: part.write_text(text, encoding="utf-8"),
        },
    )
