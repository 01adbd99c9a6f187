"""`palpate certify`, `zwidth`, `workspace`: a verdict on a loop, all that it can render, and where in space."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from palpate.cli.console import COLORS, output, print_paths, progress
from palpate.cli.settings import Settings, load_scenario
from palpate.errors import ScenarioError
from palpate.files import default_name, write_folder, write_text

__all__ = ["certify", "workspace", "zwidth"]


def certify(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write to; if not given, results/ and in it the scenario's name."),
    ] = None,
    settings: Settings = None,
) -> None:
    """Judge a scenario's loop: the claim, what it holds for, its margins, or a counter-example that runs.

    Writes certificate.json and, where there is one, counter-example.toml for `palpate run`. The exit code is 1 unless
    the loop is stable.

    Example: palpate certify scenarios/press-stiff-cube-lqg.toml
    """
    with progress("judging the loop") as tell:
        from palpate.stability import certify as judge

        loaded = load_scenario(scenario, settings)
        tell("judging the loop", 0.1)
        certificate = judge(loaded)
        folder = out if out is not None else Path("results") / default_name(scenario)
        writers: dict[str, Callable[[Path], object]] = {"certificate.json": certificate.save}
        example = certificate.counter_example
        if example is not None:
            text = example.toml()
            writers["counter-example.toml"] = lambda path: write_text(path, text)
        paths = write_folder(folder, writers)
    state = certificate.verdict.state
    output.print(f"[bold]{escape(loaded.title)}[/]: [bold {COLORS[state.tone]}]{state.label}[/]")
    output.print(str(certificate), markup=False, soft_wrap=True)
    print_paths(paths)
    if not certificate.stable:
        raise typer.Exit(1)


def zwidth(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write to; if not given, results/ and in it the scenario's name."),
    ] = None,
    simulate: Annotated[bool, typer.Option(help="Find the boundary by running the loop as well.")] = True,
    settings: Settings = None,
) -> None:
    """Map the stable stiffness and damping of a scenario's loop: exact curve, simulated boundary, passive region.

    Writes zwidth.html and zwidth.json. The exit code is 1 unless the loop with the scenario's object is stable.

    Example: palpate zwidth scenarios/slider-wall-stable.toml
    """
    with progress("reading the scenario") as tell:
        from palpate.report import zwidth_page
        from palpate.stability import zwidth as map_of

        loaded = load_scenario(scenario, settings)
        found = map_of(loaded, simulated=simulate, progress=tell)
        tell("drawing", 0.95)
        page = zwidth_page(found)
        folder = out if out is not None else Path("results") / default_name(scenario)
        paths = write_folder(folder, {"zwidth.html": page.save, "zwidth.json": found.save})
    output.print(f"[bold]{escape(loaded.title)}[/]")
    output.print(
        f"  {found.verdict}", style=COLORS["good" if found.stable_here else "bad"], markup=False, soft_wrap=True
    )
    for fact in found.facts:
        style = "yellow" if fact in found.gap_remarks else None
        output.print(f"  {fact}", style=style, markup=False, soft_wrap=True)
    print_paths(paths)
    if not found.stable_here:
        raise typer.Exit(1)


def workspace(
    subject: Annotated[str, typer.Argument(help="Scenario file (TOML), or a device: its name or file.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder to write to; if not given, results/ and in it the name of the scenario or device.",
        ),
    ] = None,
    poses: Annotated[int, typer.Option(min=50, max=100_000, help="About how many poses to judge.")] = 2000,
    settings: Settings = None,
) -> None:
    """Map the stiffest stable wall over the reachable workspace of an arm, in every direction, and its minimum.

    A device by itself is held through fingertip tissue. Writes workspace.html and workspace.json. The exit code is 1
    unless every wall up to the minimum is stable at every pose.

    Example: palpate workspace scenarios/arm-through-tissue-on-a-wall.toml
    """
    with progress("reading") as tell:
        from palpate.report import workspace_page
        from palpate.stability import workspace as map_of

        if settings and not subject.endswith(".toml"):
            raise ScenarioError(f"--set changes a scenario, and {subject} is a device: give a scenario file")
        loaded = load_scenario(Path(subject), settings) if settings else subject
        found = map_of(loaded, poses=poses, progress=tell)
        tell("drawing", 0.96)
        page = workspace_page(found)
        folder = out if out is not None else Path("results") / default_name(subject)
        paths = write_folder(folder, {"workspace.html": page.save, "workspace.json": found.save})
    title = "" if found.loop.startswith(found.title) else f"[bold]{escape(found.title)}[/]: "
    output.print(f"{title}{escape(found.loop)}", soft_wrap=True)
    output.print(str(found), markup=False, soft_wrap=True)
    print_paths(paths)
    if not found.stable:
        raise typer.Exit(1)
