"""`palpate bench`: the closed loop's speed and accuracy beside MuJoCo and python-control, in one run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from palpate.cli.console import output, progress

__all__ = ["bench"]


def bench(
    out: Annotated[Path | None, typer.Option("--out", "-o", help="JSON file for the numbers.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A tenth of the repetitions.")] = False,
) -> None:
    """Time one second of the nonlinear arm's closed loop at 1 kHz, and its distance from a tight reference.

    Medians and the slow tail (p99.9 of a thousand runs or more, else the slowest), as multiples of real time on one
    core; the ratio is palpate's speed over each program's. Peers come with pip install 'palpate[bench]'.
    """
    with progress("starting") as tell:
        from palpate.bench import run

        result = run(out, quick=quick, progress=tell)
    table = Table(box=None, pad_edge=False)
    for heading in ("program", "× real time", "slow tail", "runs", "error [rad]", "ratio"):
        table.add_column(heading, justify="left" if heading == "program" else "right")
    for row in result["rows"]:
        table.add_row(
            row["program"],
            f"{row['times_real_time']:.4g}",
            f"{row['worst_times_real_time']:.4g}",
            str(row["runs"]),
            f"{row['error_rad']:.1e}",
            f"{row['ratio']:.4g}",
        )
    output.print(f"{result['work']}; {result['machine']['processor']}\n")
    output.print(table)
    for line in result["missing"]:
        output.print(line, style="yellow", markup=False)
