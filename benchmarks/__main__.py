"""`python -m benchmarks`: speed of the loop, the stability functions and contact."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from palpate.cli.command import one_sentence
from palpate.cli.console import output, progress
from rich.markup import escape
from rich.table import Table

__all__ = ["app", "bench"]


def bench(
    sections: Annotated[
        list[str] | None,
        typer.Argument(help="Sections: loop, batch, stability, touch, solid, tick, body, guards. Default: all."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="JSON file to write.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A tenth of the repetitions.")] = False,
    large: Annotated[bool, typer.Option("--large", help="Also a mesh of a million triangles.")] = False,
) -> None:
    """Time palpate and its peers on this machine. Peers are installed by pip install 'palpate[bench]'.

    **loop**: one second of the nonlinear device at 1 kHz on one core, and its error. Speeds are multiples of real time:
    the median, and p99.9 of the run times (the slowest of fewer than a thousand runs). The ratio is palpate's speed
    over that of the program. **batch**: the same loop in vector lanes. **stability**: exact boundary, and a map of
    spectral radii on all cores. **touch**: one step of the proxy. **solid**: model updates under large displacements.
    **tick**: a whole servo tick on a deformable body. **body**: one tick of a body, and a step of MuJoCo's flex on
    the same mesh.

    Example: python -m benchmarks stability --quick
    """
    with progress("starting") as tell:
        from benchmarks import SECTIONS, run

        result = run(sections or (), out, quick=quick, large=large, progress=tell)
    output.print(f"{result['machine']['processor']}, {result['machine']['cores']} cores", markup=False)
    for name, found in result["sections"].items():
        section = SECTIONS[name]
        table = Table(box=None, pad_edge=False)
        for number, heading in enumerate(section.headings):
            narrow = heading.replace(" [", "\n[")  # leaves room for the names of the rows
            table.add_column(escape(narrow), justify="left" if number == 0 else "right")
        for row in found["rows"]:
            table.add_row(*section.cells(row))
        output.print(f"\n[bold]{name}[/]: {found['work']}\n", soft_wrap=True)
        output.print(table)
        for line in found["missing"]:
            output.print(line, style="yellow", markup=False)


app = typer.Typer(
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(one_sentence(bench))

if __name__ == "__main__":
    app(prog_name="python -m benchmarks")
