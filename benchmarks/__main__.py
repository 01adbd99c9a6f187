"""`python -m benchmarks`: how fast the loop, the exact answers and the proxy are, in one run."""

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
        typer.Argument(help="What to time: loop, batch, stability, touch, solid, tick, body. Everything if not given."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="JSON file for the numbers.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A tenth of the repetitions.")] = False,
    large: Annotated[bool, typer.Option("--large", help="Also a mesh of a million triangles.")] = False,
) -> None:
    """Time palpate on this machine: the loop beside its peers, the exact answers, the proxy.

    **loop**: one second of the nonlinear arm at 1 kHz, and its distance from a tight reference; medians and the slow
    tail (p99.9 of a thousand runs or more, else the slowest) as multiples of real time on one core; the ratio is
    palpate's speed over each program's. Peers come with pip install 'palpate[bench]'. **batch**: the same loop, many
    side by side in vector lanes. **stability**: the exact boundary, and a map of spectral radii on all cores.
    **touch**: one step of the proxy. **tick**: the servo's whole tick on a body that yields.
    **body**: one tick of a pressed body, beside MuJoCo's flex on the same mesh.

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
            narrow = heading.replace(" [", "\n[")  # so that the names of the rows have room
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
