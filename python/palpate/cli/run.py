"""`palpate run`: a scenario to a trace, its numbers and its report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from palpate.cli.console import COLORS, output, progress
from palpate.cli.settings import Settings, load_scenario
from palpate.files import default_name, write_folder, write_json

__all__ = ["run"]


def run(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write to; if not given, results/ and in it the scenario's name."),
    ] = None,
    settings: Settings = None,
) -> None:
    """Run a scenario: writes trace.h5, summary.json and report.html, and prints the verdict.

    The trace opens in Python, MATLAB or Julia; every channel has its unit. If the loop diverges, the trace is kept up
    to there. The exit code is 1 unless the loop settled.

    Example: palpate run scenarios/press-stiff-cube-lqg.toml --set object.stiffness="2 N/mm"
    """
    with progress("reading the scenario") as tell:
        from palpate.metrics import summarize
        from palpate.report import run_page
        from palpate.simulation.simulator import simulate

        loaded = load_scenario(scenario, settings)
        for alone in loaded.each_object.values():
            if alone.object.kind == "body":
                from palpate.simulation.bodies import scenario_body

                scenario_body(alone, lambda text, share: tell(f"making the body: {text}", 0.2 * share))
        tell("running", 0.2)
        trace = simulate(loaded)
        tell("drawing", 0.6)
        summary = summarize(trace)
        page = run_page(trace, summary)
        tell("writing", 0.9)
        folder = out if out is not None else Path("results") / default_name(scenario)
        paths = write_folder(
            folder,
            {
                "trace.h5": trace.save,
                "summary.json": lambda path: write_json(path, summary, indent=2),
                "report.html": page.save,
            },
        )
    color = COLORS[trace.verdict.state.tone]
    output.print(f"[bold]{escape(loaded.title)}[/]: [bold {color}]{escape(summary['verdict'])}[/]", soft_wrap=True)
    if trace.verdict.linear is not None and trace.verdict.linear not in summary["verdict"]:
        output.print(f"  {escape(trace.verdict.linear)}", soft_wrap=True)
    for warning in summary["warnings"]:
        output.print(f"  [yellow]{escape(warning)}[/]", soft_wrap=True)
    for axis, row in summary["axes"].items() if trace.verdict.settled else ():
        expected = row["expected_deflection_m"]
        wanted = "" if expected is None else f" of {expected * 1e3:.4g} mm wanted"
        overshoot = row["overshoot_percent"]
        beyond = (
            f"peak {row['peak_deflection_m'] * 1e3:.4g} mm" if overshoot is None else f"overshoot {overshoot:.1f} %"
        )
        output.print(f"  {axis}: {row['steady_deflection_m'] * 1e3:.4g} mm{wanted}, {beyond}", soft_wrap=True)
    if len(summary["axes"]) > 1 and summary["peak_reference_force_N"]:
        output.print(f"  the reference is {summary['peak_reference_force_N']:.4g} N over all axes", soft_wrap=True)
    for path in paths:
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)
    if not trace.verdict.settled:
        raise typer.Exit(1)
