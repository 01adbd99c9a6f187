"""`palpate design`: controller of a device from a specification, or the constraint that forbids it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from palpate.cli.console import OutFolder, output, print_paths, progress
from palpate.files import default_name, write_folder

if TYPE_CHECKING:
    from palpate.tuning import ControllerDesign


def design(
    device: Annotated[str, typer.Argument(help="Name in the catalog, or your own device file.")],
    stiffness: Annotated[str, typer.Option(help='Range of the object\'s stiffness, "50 N/m..10 N/mm".')],
    force: Annotated[str, typer.Option(help='Largest reference force in any direction, "2 N".')],
    settle: Annotated[str, typer.Option(help='Wanted settling time to 5 %, "25 ms".')],
    period: Annotated[
        str | None, typer.Option(help='Servo period, "0.5 ms"; the default is that of the device.')
    ] = None,
    delay: Annotated[int, typer.Option(help="Servo periods from a command to its application.")] = 0,
    pose: Annotated[str | None, typer.Option(help='Start, "0 deg, 120 deg, 190 deg".')] = None,
    tip: Annotated[str | None, typer.Option(help='Start by the tip, "0 mm, 10 mm, 50 mm".')] = None,
    against: Annotated[
        list[str] | None, typer.Option(help="Device that the controller does not know; repeatable.")
    ] = None,
    out: OutFolder = None,
) -> None:
    """Design a controller for a range of stiffness and a settling time, or name the constraint that forbids it.

    Writes design.json, and scenario.toml if the specification is met.

    Example: palpate design phantom-premium-1.5a --stiffness "1 N/mm..10 N/mm" --force "3 N" --settle "40 ms"
    """
    with progress("reading the device") as tell:
        from palpate.tuning import design as tune

        found = tune(
            device,
            stiffness,
            force,
            settle,
            period=period,
            delay=delay,
            pose=_list(pose),
            tip=_list(tip),
            against=tuple(against or ()),
            progress=tell,
        )
        folder = out if out is not None else Path("results") / f"{default_name(device)}-design"
        writers = {"design.json": found.save}
        if found.feasible:
            writers["scenario.toml"] = found.save_scenario
        paths = write_folder(folder, writers)
    output.print(f"[bold {'green' if found.feasible else 'yellow'}]{'met' if found.feasible else 'not met'}[/]")
    for line in summary(found):
        output.print(f"  {line}", markup=False, soft_wrap=True)
    print_paths(paths)
    if not found.feasible:
        raise typer.Exit(1)


def _list(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",")]


def summary(found: ControllerDesign) -> list[str]:
    """Return the result of a design in lines."""
    lines = [found.claim]
    if found.remedies:
        lines.append(f"do one of: {'; '.join(found.remedies)}")
    if (axis := found.axis) is not None:
        options, margins = axis.options, axis.margins
        lines += [
            f"bandwidth {options['bandwidth']:g} rad/s, reference model {options['reference']:g} rad/s, observer "
            f"{options['observer']:g} and disturbance {options['disturbance']:g} of the bandwidth",
            f"a larger bandwidth: {axis.reason}",
            f"disk margin {margins.disk:.3g}, phase margin {margins.phase:.3g} deg, crossover {margins.crossover:.4g} "
            f"rad/s, delay margin {1e3 * margins.delay:.3g} ms, {100 * axis.robustness.share:.3g} % of the optimal "
            "robustness",
        ]
    if found.bound == 0.0:
        lines.append("drive: the device has no known limit, so it sets no least time")
    elif math.isfinite(found.bound):
        lines.append(f"drive: at least {1e3 * found.bound:.3g} ms at the worst pose on the softest object")
    if 0.0 < found.within_reach < 1.0:
        share = f"{100 * found.within_reach:.3g} %"
        lines.append(f"ways within reach on the softest object: {share}; there is no claim beyond")
    for stiffness, time in found.settling.items():
        text = f"{1e3 * time:.3g} ms" if math.isfinite(time) else "does not settle"
        lines.append(f"slowest simulated press on {stiffness:.5g} N/m: {text}")
    if found.count:
        moved = f"the tip by up to {1e6 * found.count:.3g} µm, {100 * found.count_share:.3g} % of the deflection"
        lines.append(f"encoder: one count moves {moved} of the stiffest object; set device.encoder = true to see it")
    lines.append(f"certificate: {found.certificate_remark}")
    return lines
