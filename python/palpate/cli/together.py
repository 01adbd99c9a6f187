"""`palpate together`: several devices on one deformable body, and their joint stability."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from palpate.cli.console import COLORS, output, progress
from palpate.cli.settings import load_scenario
from palpate.files import default_name, write_folder

__all__ = ["together"]


def together(
    scenarios: Annotated[list[Path], typer.Argument(help="Scenario files (TOML), one for each device.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write to; if not given, results/ and there the files' names."),
    ] = None,
) -> None:
    """Run several devices on one deformable body, and test the stability of all loops together.

    Each scenario has the same body, in the frame of its own device. Writes a trace and a report for each device, and
    prints the joint verdict. The exit code is 1 unless the loops are stable together.

    Example: palpate together left.toml right.toml
    """
    with progress("reading the scenarios") as tell:
        from palpate.errors import StabilityError
        from palpate.metrics import summarize
        from palpate.report import run_page
        from palpate.simulation.joint_run import simulate_together
        from palpate.simulation.verdict import State
        from palpate.stability.joint import joint_stability

        loaded = [load_scenario(scenario, None) for scenario in scenarios]
        tell("running", 0.1)
        run = simulate_together(loaded)
        tell("testing the loops", 0.5)
        try:
            found = joint_stability(loaded, run)
            state, text = found.state, str(found)
        except StabilityError as problem:
            rows = [f"  device {number} in the run: {trace.verdict}" for number, trace in enumerate(run.traces, 1)]
            state, text = State.UNDECIDED, "\n".join([f"Undecided: {problem}", *rows])
        tell("drawing", 0.7)
        files = {}
        for number, trace in enumerate(run.traces, 1):
            files[f"device-{number}.h5"] = trace.save
            files[f"device-{number}.html"] = run_page(trace, summarize(trace)).save
        name = "-and-".join(default_name(scenario) for scenario in scenarios)
        paths = write_folder(out if out is not None else Path("results") / name, files)
    verdict, _, rest = text.partition("\n")
    output.print(f"[bold {COLORS[state.tone]}]{escape(verdict)}[/]", soft_wrap=True)
    output.print(rest, markup=False, soft_wrap=True)
    for path in paths:
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)
    if state is not State.STABLE:
        raise typer.Exit(1)
