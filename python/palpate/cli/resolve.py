"""`palpate resolve`: a scenario as plain data, for the C++ core."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.console import output, progress


def resolve(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder to write; if not given, results/ and in it the scenario's name and loop/."
        ),
    ] = None,
) -> None:
    """Resolve a scenario to plain data that the C++ core runs without Python.

    Writes a folder with loop.json and binary blobs. docs/how-to/run-in-cpp.md shows how to run it.

    Example: palpate resolve scenarios/slider-wall-stable.toml -o loop/
    """
    with progress("resolving the scenario"):
        from palpate.simulation.loop_config import resolve as write

        folder = write(scenario, out if out is not None else Path("results") / scenario.stem / "loop")
    for path in sorted(folder.iterdir()):
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)
