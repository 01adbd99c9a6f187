"""Reproduction of the thesis: results.json, report.html and the headline figure."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.files import write_folder
from palpate.report import Page

from experiments.hosseini2004.certificates import certificates
from experiments.hosseini2004.chapter2 import chapter2
from experiments.hosseini2004.chapter3 import chapter3
from experiments.hosseini2004.chapter4 import chapter4
from experiments.hosseini2004.chapter5 import chapter5
from experiments.hosseini2004.checks import Check
from experiments.hosseini2004.headline import headline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["run"]

Progress = Callable[[str, float], None]
TITLE = "The thesis, reproduced"
LEAD = (
    "Hosseini-Zadeh's *Stability of Haptic Rendering for Deformable Objects* (2004), chapters 2 to 5, "
    "computed by palpate and compared with every printed number."
)
CHAPTERS = (  # with the fraction of the time of each
    (chapter2, "chapter 2", 0.06),
    (chapter3, "chapter 3", 0.27),
    (chapter4, "chapter 4", 0.2),
    (chapter5, "chapter 5", 0.2),
    (certificates, "certificates", 0.2),
)


def run(out: Path, progress: Progress | None = None) -> list[dict[str, Any]]:
    """Compute chapters 2 to 5, write the results to `out`, and return the checks.

    Writes results.json (the returned list), report.html (self-contained), headline.svg and headline.png atomically.

    Args:
        out: folder; created if missing.
        progress: called with a description and the fraction done.

    Returns:
        One dictionary per check: id, what, printed, computed, unit, tolerance, status ("match", "erratum" or
        "differs"), where, sense ("equal", "at most": one-sided, or "statement"), and, where they apply,
        right (of an erratum) and note.

    Raises:
        OutputError: the folder cannot be written.
    """
    report: Progress = progress or (lambda _text, _fraction: None)
    page = Page(TITLE, LEAD, footer="All numbers on this page come from the run that wrote it.")
    report("at a glance", 0.0)
    picture = headline(page)
    checks: list[Check] = []
    done = 0.05
    for chapter, name, fraction in CHAPTERS:
        report(name, done)
        checks += chapter(page, _part(report, name, done, fraction))
        done += fraction
    counts: Counter[str] = Counter(check.status for check in checks)
    page.lead = f"{LEAD} {_verdict(counts)}"
    _errata(page, checks)
    _all(page, checks)
    results = [_plain(check.to_dict()) for check in checks]
    report("writing", 0.99)
    _write(Path(out), page, picture, results)
    report("done", 1.0)
    return results


def _part(report: Progress, name: str, start: float, size: float) -> Progress:
    """Return the progress callback of a part that begins at `start` and takes the fraction `size`."""
    return lambda text, fraction: report(f"{name}: {text}", start + size * fraction)


def _verdict(counts: Counter[str]) -> str:
    differs = counts["differs"]
    end = "none differs otherwise" if differs == 0 else f"**{differs} differ**"
    return (
        f"Of {sum(counts.values())} checks {counts['match']} match, {counts['erratum']} show an erratum of the print, "
        f"and {end}."
    )


def _errata(page: Page, checks: Iterable[Check]) -> None:
    page.section("Errata of the thesis", "errata")
    page.paragraph("Disagreements between print and mathematics. The evidence is computed in the chapters above.")
    rows = [
        (
            check.where,
            check.what,
            _text(check, "printed"),
            _text(check, "right") if check.right is not None else _text(check, "computed"),
            check.note,
        )
        for check in checks
        if check.status == "erratum"
    ]
    page.table(["where", "quantity", "printed", "correct", "evidence"], rows, "Errata.")


def _all(page: Page, checks: Iterable[Check]) -> None:
    page.section("Every check", "checks")
    page.paragraph(
        "A number matches if it lies within half a unit of the last printed digit, or within the tolerance stated. "
        "“≤” marks one-sided checks: no worse than printed."
    )
    rows = []
    for check in checks:
        limit = "" if check.tolerance is None else f"{check.tolerance:.2g}"
        sign = {"at most": "≤ ", "equal": "± ", "statement": ""}[check.sense]
        rows.append((check.id, check.what, _text(check, "printed"), _text(check, "computed"), check.unit,
                     sign + limit if limit else "", check.status))  # fmt: skip
    page.table(["id", "quantity", "printed", "computed", "unit", "tolerance", "status"], rows)


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
