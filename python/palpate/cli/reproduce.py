"""`palpate reproduce`: the thesis computed anew and held against its printed numbers."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.console import output, progress

__all__ = ["reproduce"]


def reproduce(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for results.json and report.html.")] = Path(
        "results"
    ),
) -> None:
    """Compute every table, matrix and figure of the thesis (chapters 2 to 5) beside what it prints.

    Takes about a minute. A number matches, shows an erratum of the print, or differs; the exit code is 1 if one does.

    Example: palpate reproduce --out results
    """
    with progress("starting") as tell:
        from palpate.thesis.reproduce import run

        results = run(out, tell)
    counts = Counter(result["status"] for result in results)
    for result in results:
        if result["status"] == "differs":
            output.print(
                f"[bold red]differs[/] {result['id']}: {result['what']}: printed {result['printed']}, "
                f"computed {result['computed']} {result['unit']}"
            )
    colour = "red" if counts["differs"] else "green"
    output.print(
        f"{len(results)} checks: [bold]{counts['match']}[/] match, [bold]{counts['erratum']}[/] are errata of the "
        f"print, [bold {colour}]{counts['differs']} differ[/]"
    )
    output.print(f"  {out / 'report.html'}\n  {out / 'results.json'}", style="dim")
    if counts["differs"]:
        raise typer.Exit(1)
