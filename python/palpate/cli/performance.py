"""`palpate performance`: what a hand feels of a scenario's loop."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.console import output, progress
from palpate.files import write_folder


def performance(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write to; if not given, results/ and in it the scenario's name."),
    ] = None,
) -> None:
    """Measure a loop's performance: impedance, stiffness, rate hardness, force bandwidth, and ripple.

    Writes performance.html and performance.json.

    Example: palpate performance scenarios/arm-through-tissue-on-a-wall.toml
    """
    with progress("reading the scenario") as tell:
        from palpate.metrics import measure_performance
        from palpate.report import performance_page
        from palpate.scenario import Scenario

        loaded = Scenario.from_file(scenario)
        found = measure_performance(loaded, progress=tell)
        tell("drawing", 0.9)
        page = performance_page(found)
        folder = out if out is not None else Path("results") / scenario.stem
        paths = write_folder(folder, {"performance.html": page.save, "performance.json": found.save})
    output.print(f"[bold]{loaded.title}[/]")
    for one in found.along:
        where = ", ".join(f"{part:.3g}" for part in one.direction)
        output.print(
            f"  along ({where}): "
            + (
                "gives way to no force at rest (an integrator); "
                if math.isinf(one.static_stiffness)
                else f"{one.static_stiffness:.4g} N/m felt at rest, "
            )
            + (
                f"as wished to within 23 % up to {one.transparency_bandwidth:.3g} Hz; "
                if one.transparency_bandwidth
                else "nowhere as wished to within 23 %; "
            )
            + ("" if math.isnan(one.rate_hardness) else f"rate-hardness {one.rate_hardness:.4g} N/m; ")
            + f"force bandwidth {one.bandwidth:.3g} Hz",
            markup=False,
            soft_wrap=True,
        )
    output.print(f"  {found.remark}", markup=False, soft_wrap=True)
    for path in paths:
        output.print(f"  {path}", style="dim")
