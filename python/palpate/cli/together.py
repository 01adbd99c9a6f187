"""`palpate together`: several devices on one deformable body, and their joint stability."""

from __future__ import annotations

from collections.abc import Callable
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

    Each scenario has the same body, in the frame of its own device. Writes a trace and a page for each device,
    and report.html with the joint verdict and the body, and prints the joint verdict. The exit code is 1 unless the
    loops are stable together.

    Example: palpate together left.toml right.toml
    """
    with progress("reading the scenarios") as tell:
        from palpate.errors import StabilityError
        from palpate.report import device_page, together_page
        from palpate.simulation.joint_run import simulate_together
        from palpate.simulation.shared_body import SharedBody
        from palpate.simulation.verdict import State
        from palpate.stability.joint import JointStability, joint_stability, run_alone

        loaded = [load_scenario(scenario, None) for scenario in scenarios]
        tell("running", 0.1)
        run = simulate_together(loaded)
        tell("testing the loops", 0.5)
        found: JointStability | None = None
        try:
            found = joint_stability(loaded, run)
            state, text = found.state, str(found)
        except StabilityError as problem:
            state, text = run_alone(run, str(problem))
        tell("drawing", 0.7)
        names = [
            one.title if "title" in one.model_fields_set else default_name(scenario)
            for one, scenario in zip(loaded, scenarios, strict=True)
        ]
        pages = [f"device-{number}.html" for number in range(1, len(loaded) + 1)]
        files: dict[str, Callable[[Path], object]] = {}
        for index, trace in enumerate(run.traces):
            files[f"device-{index + 1}.h5"] = trace.save
            files[pages[index]] = device_page(run, index, names, (state, text), "report.html").save
        files["report.html"] = together_page(run, SharedBody(loaded), names, (state, text), found, pages).save
        name = "-and-".join(default_name(scenario) for scenario in scenarios)
        paths = write_folder(out if out is not None else Path("results") / name, files)
    verdict, _, rest = text.partition("\n")
    output.print(f"[bold {COLORS[state.tone]}]{escape(verdict)}[/]", soft_wrap=True)
    output.print(rest, markup=False, soft_wrap=True)
    for path in paths:
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)
    if state is not State.STABLE:
        raise typer.Exit(1)
