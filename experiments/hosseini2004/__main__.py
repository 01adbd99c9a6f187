"""`python -m experiments.hosseini2004`: reproduction of the thesis, compared with its printed numbers."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from palpate.cli.command import one_sentence
from palpate.cli.console import output, progress

__all__ = ["app", "reproduce"]


def reproduce(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for results.json and report.html.")] = Path(
        "results"
    ),
) -> None:
    """Compute every table, matrix and figure of chapters 2 to 5 of the thesis, and compare them with the print.

    Takes about a minute. A number matches, shows an erratum of the print, or differs. The exit code is 1 if one
    differs.

    Example: python -m experiments.hosseini2004 --out results
    """
    with progress("starting") as report:
        from experiments.hosseini2004.reproduce import run

        results = run(out, report)
    counts = Counter(result["status"] for result in results)
    for result in results:
        if result["status"] == "differs":
            output.print(
                f"[bold red]differs[/] {result['id']}: {result['what']}: printed {result['printed']}, "
                f"computed {result['computed']} {result['unit']}"
            )
    color = "red" if counts["differs"] else "green"
    output.print(
        f"{len(results)} checks: [bold]{counts['match']}[/] match, [bold]{counts['erratum']}[/] are errata of the "
        f"print, [bold {color}]{counts['differs']} differ[/]"
    )
    output.print(f"  {out / 'report.html'}\n  {out / 'results.json'}", style="dim")
    if counts["differs"]:
        raise typer.Exit(1)


app = typer.Typer(
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(one_sentence(reproduce))

if __name__ == "__main__":
    app(prog_name="python -m experiments.hosseini2004")
