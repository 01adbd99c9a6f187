"""`python -m experiments.hosseini2004`: reproduction of the thesis, compared with its printed numbers."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from palpate.cli.command import one_sentence
from palpate.cli.console import output, progress
from rich.markup import escape
from rich.table import Table

from experiments.hosseini2004.checks import KINDS

__all__ = ["app", "reproduce"]


def reproduce(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for results.json and report.html.")] = Path(
        "results"
    ),
) -> None:
    """Compute chapters 2 to 5 of the thesis, and compare them with the print.

    Takes about a minute. Opens with the conclusions of the thesis, sentence by sentence. Exit code 1: a number differs
    without a known reason, or a conclusion is no longer decided by its checks.

    Example: python -m experiments.hosseini2004 --out results
    """
    with progress("starting") as report:
        from experiments.hosseini2004.conclusions import SIGNS
        from experiments.hosseini2004.reproduce import run

        found = run(out, report)
    rows = Table("", "", "section", "sentence", box=None, title="Conclusions of the thesis", title_justify="left")
    for sentence, verdict in found.conclusions:
        rows.add_row(SIGNS[verdict], verdict, sentence.section, escape(sentence.says))
    output.print(rows)
    verdicts = Counter(verdict for _, verdict in found.conclusions)
    output.print("[bold]" + ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items()) + "[/]")
    output.print(found.counts.sentence)
    others = [
        f"{name}: {found.counts.kinds[kind].total()}"
        for kind, name in KINDS.items()
        if kind not in ("recomputed", "carried")
    ]
    output.print("Other checks, not counted as printed numbers. " + "; ".join(others) + ".")
    for id in found.counts.unexplained:
        output.print(f"[bold red]differs without a known reason[/] {escape(id)}")
    output.print(f"  {out / 'report.html'}\n  {out / 'results.json'}", style="dim")
    if not found.expected:
        raise typer.Exit(1)


app = typer.Typer(
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(one_sentence(reproduce))

if __name__ == "__main__":
    app(prog_name="python -m experiments.hosseini2004")
