"""`palpate resolve`: scenario as plain data, for the C++ core."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.console import ScenarioFile, print_paths, progress
from palpate.cli.settings import Settings, load_scenario
from palpate.files import default_name


def resolve(
    scenario: ScenarioFile,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder to write; the default is results/ and the scenario's name, with loop/."
        ),
    ] = None,
    settings: Settings = None,
) -> None:
    """Resolve a scenario to plain data that the C++ core runs without Python.

    Writes a folder with loop.json and binary blobs. docs/how-to/run-in-cpp.md shows how to run it.

    Example: palpate resolve scenarios/slider-wall-stable.toml -o loop/
    """
    with progress("resolving the scenario"):
        from palpate.simulation.loop_config import resolve as write

        folder = write(
            load_scenario(scenario, settings),
            out if out is not None else Path("results") / default_name(scenario) / "loop",
        )
    print_paths(sorted(folder.iterdir()))
